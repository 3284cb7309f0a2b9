"""Shadows on ground and figures, contact shadows, ambient occlusion, and averaged passes."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import (
    arm,
    bent,
    picture,
    random_figure,
    random_pose,
    scene_of,
    skeleton,
    sphere,
    square,
)
from rendering.golden_motion import SHOTS
from rendering.plain_pictures import N, front, lights, plain

from viewer.rendering import lineup
from viewer.rendering.casters import spheres_of
from viewer.rendering.gpu.target import Target
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes import shadow_passes
from viewer.rendering.sampling import limit_passes, time_note
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import deform

WHITE = picture([[(255, 255, 255)]])
GROUND = np.array([[-1.0, 0.0, -1.0], [1.0, 1.5, 1.0]])  # at height 0


def draw(offscreen, scene, options, camera, box=GROUND, size=(N, N)):
    return offscreen.render(scene, size, camera, options, box)


def plate(height: float, half: float = 0.25) -> Mesh:
    """Return a horizontal square above the origin."""
    upright = square(half=half, material=WHITE)
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # y is mapped to -z, and z to y
    positions = upright.positions @ turn.T + [0.0, height, 0.0]
    return replace(upright, positions=positions, normals=upright.normals @ turn.T)


def from_above() -> object:
    """Return a camera that sees -2 to 2 of x and z, with x to the right and 25 pixels per unit."""
    return front(inclination=90.0)


def with_shadows(**changes) -> DisplayOptions:
    return plain(**{"quality": "normal", **changes})


def test_shadow_of_a_plate_is_cast_by_light_at_45_degrees(offscreen):
    """With light from +x, a plate from -0.25 to 0.25 at height 1 darkens x from -1.25 to -0.75."""
    light = lights(0.2, 1.0, azimuth=90.0, inclination=45.0, follow_camera=False)
    pixels = draw(offscreen, scene_of(plate(1.0)), with_shadows(lights=light), from_above())
    alpha = pixels[..., 3].astype(float)
    shadow = alpha[:, :40]  # the plate starts at column 43
    dark = shadow > 0.5 * shadow.max()
    rows, columns = np.nonzero(dark)
    assert 60 < shadow.max() < 200
    np.testing.assert_allclose((columns.min(), columns.max()), (18.75, 30.25), atol=1.0)
    np.testing.assert_allclose((rows.min(), rows.max()), (43.75, 55.25), atol=1.0)
    assert alpha[:, 65:].max() == 0 and pixels[:, :40][dark][:, :3].max() == 0


@pytest.mark.parametrize("quality", ["normal", "final"])
def test_ground_is_dark_only_in_the_part_of_the_map_with_casters(offscreen, monkeypatch, quality):
    """A long plate fills a strip of the square map. The whole map, drawn too, looks the same."""
    strip = plate(1.0)
    strip = replace(strip, positions=strip.positions * [1.0, 1.0, 8.0])
    light = lights(0.2, 1.0, azimuth=60.0, inclination=50.0, follow_camera=False)
    how = scene_of(strip), with_shadows(lights=light, quality=quality), from_above()
    part = draw(offscreen, *how)
    original, areas = shadow_passes.light_view, []

    def with_whole_map(*args):
        view, extent, low, high = original(*args)
        areas.append(np.prod(high - low))
        return view, extent, np.zeros(2), np.ones(2)

    monkeypatch.setattr(shadow_passes, "light_view", with_whole_map)
    offscreen.render(Scene([]), (8, 8), from_above(), how[1], GROUND)  # forgets the shadow map
    whole = draw(offscreen, *how)
    assert 0.0 < max(areas) < 0.4
    assert np.abs(part.astype(int) - whole).max() <= 1 and (whole[..., 3] > 30).any()


@pytest.mark.parametrize("bones", ["octahedra", "sticks", "axes", "boxes"])
@pytest.mark.parametrize("count", [1, lineup.FEWEST])
def test_no_bone_reaches_beyond_the_part_of_the_map_with_casters(
    offscreen, monkeypatch, bones, count
):
    """Ends at the tips of a hand reach farthest from joints; folded, its joints are close."""
    shadows = []

    def drawn(self, *args):
        shadow = original(self, *args)
        texels = np.frombuffer(shadow.texture.read(), np.float32).reshape(self.side, self.side)
        cast = np.argwhere(texels < 1.0)[:, ::-1]
        low, high = cast.min(axis=0) / self.side, (cast.max(axis=0) + 1) / self.side
        shadows.append((shadow.low - low, high - shadow.high, 1.0 / self.side))
        return shadow

    original = shadow_passes.ShadowPass.draw
    monkeypatch.setattr(shadow_passes.ShadowPass, "draw", drawn)
    figure = replace(arm(3), skeleton=replace(arm(3).skeleton, boxes=None))
    options = DisplayOptions(show="skeleton", bones=bones, quality="normal")
    for angle in (0.0, 1.5, 3.1):
        actors = [bent(figure, (1, "z", angle), (2, "x", angle)) for _ in range(count)]
        offscreen.render(Scene(actors), (N, N), front(), options, GROUND)
    assert len(shadows) == 3
    for below, above, texel in shadows:
        assert max(below.max(), above.max()) <= texel  # pixels are drawn whole


def test_shadow_falls_on_another_figure(offscreen):
    """Light from above reaches the larger, lower plate only around the smaller one."""
    light = lights(0.2, 0.6, inclination=90.0, follow_camera=False)
    scene = scene_of(plate(1.0), plate(0.4, half=1.0))
    options = with_shadows(lights=light)
    camera = front(inclination=60.0, target=np.array([0.0, 0.7, 0.0]))
    lit = draw(offscreen, scene, replace(options, quality="draft"), camera)
    shaded = draw(offscreen, scene, options, camera)
    changed = np.abs(lit[..., :3].astype(int) - shaded[..., :3]).max(axis=2) > 40
    solid = (lit[..., 3] == 255) & (shaded[..., 3] == 255)
    # The shadow has a sixteenth of the large plate's area. From this angle, the upper plate does
    # not cover it: its offset is 0.6 / tan 60 = 0.35 units, its half width 0.25.
    share = (changed & solid).sum() / solid.sum()
    assert 0.02 < share < 0.09


def test_surfaces_do_not_shadow_themselves(offscreen):
    """A ball under grazing light differs from one without shadows only at its terminator."""
    light = lights(0.2, 0.8, azimuth=60.0, inclination=20.0)
    camera, box = front(), np.array([[-1.0, -1, -1], [1, 1, 1]])
    options = with_shadows(lights=light)
    first, second = (
        draw(offscreen, scene_of(sphere(48)), replace(options, shadows=value), camera, box)
        for value in (False, True)
    )
    inside = first[..., 3] == 255
    difference = np.abs(first[..., :3].astype(int) - second[..., :3]).max(axis=2)[inside]
    assert (difference > 6).mean() < 0.01


def test_contact_shadow_is_darkest_below_the_figure_and_needs_no_light(offscreen):
    options = with_shadows(lights=lights(0.2, 0.0))
    alpha = {
        height: draw(offscreen, scene_of(plate(height)), options, from_above())[50, :, 3]
        for height in (0.005, 1.0)
    }
    outside = alpha[0.005][57:].astype(int)  # starting at 0.28
    assert outside[0] > 8 and outside[-1] == 0 and (np.diff(outside) <= 0).all()
    assert (alpha[1.0][57:] == 0).all()


def test_ground_is_drawn_only_below_the_camera(offscreen):
    light = lights(0.2, 1.0, azimuth=90.0, inclination=45.0, follow_camera=False)
    camera = front(inclination=-60.0)
    with_ground = draw(offscreen, scene_of(plate(1.0)), with_shadows(lights=light), camera)
    assert set(np.unique(with_ground[..., 3])) == {0, 255}


def test_occlusion_darkens_a_corner_but_not_an_open_plane(offscreen):
    options = plain(quality="final", shadows=False, passes=4, lights=lights(0.5))
    wall, floor = square(half=1.0, material=WHITE), plate(-1.0, half=1.0)
    floor = replace(floor, positions=floor.positions + np.array([0.0, 0.0, 1.0]))
    camera, box = front(inclination=35.0), np.array([[-1.0, -1, 0], [1, 1, 2]])
    camera.target = np.array([0.0, 0.0, 0.5])
    merged = scene_of(wall, floor)
    alone, corner = (draw(offscreen, scene, options, camera, box) for scene in
                     (scene_of(wall), merged))  # fmt: skip
    plane = alone[..., 0][alone[..., 3] == 255]
    assert plane.min() >= plane.max() - 3
    column = corner[:, 50, 0].astype(int)
    assert column.min() < 0.85 * column.max()


def test_averaged_alpha_is_that_of_supersampling(offscreen):
    """Sixteen passes of one sample match 64 samples to 1/16 of coverage, on average exactly."""
    scene, camera = scene_of(sphere(32)), front()
    fine = draw(offscreen, scene, plain(), camera, size=(8 * N, 8 * N))[..., 3].astype(float)
    wanted = fine.reshape(N, 8, N, 8).mean(axis=(1, 3))
    edge = (wanted > 0) & (wanted < 255)
    once, often = (
        draw(offscreen, scene, plain(shadows=False, **change), camera)
        for change in ({}, {"quality": "final", "passes": 16})
    )
    errors = [(pixels[..., 3] - wanted)[edge] for pixels in (once, often)]
    assert np.abs(errors[1]).mean() < 255 / 16 < 40.0 < np.abs(errors[0]).mean()
    assert abs(errors[1].mean()) < 3.0
    # Straight colours of edges are those of the surface.
    inner = often[50, 50, :3].astype(int)
    partial = (often[..., 3] > 40) & (often[..., 3] < 255)
    assert np.abs(often[partial][:, :3] - inner).max() <= 8


def test_separate_passes_have_the_average_of_all_passes(offscreen):
    scene, camera, options = scene_of(sphere(24)), front(), plain(quality="final", passes=3)
    wanted = draw(offscreen, scene, options, camera)
    with offscreen.context:
        target = Target(offscreen.context, (N, N), 1)
        for index in range(3):
            offscreen.renderer.draw(
                scene, camera, options, target, GROUND, passes=range(index, index + 1)
            )
        target.resolve()
        np.testing.assert_array_equal(target.read(), wanted)
        target.release()


def test_instances_cast_the_same_shadows(offscreen, monkeypatch):
    shot = SHOTS["instances"]()
    options = replace(shot.options, quality="normal", samples=1)
    box = scene_box(shot.scene)
    together = offscreen.render(shot.scene, (N, N), shot.camera, options, box)
    monkeypatch.setattr(lineup, "FEWEST", 100)
    alone = offscreen.render(shot.scene, (N, N), shot.camera, options, box)
    assert (np.abs(together.astype(int) - alone).max(axis=2) > 8).mean() < 0.005


@pytest.mark.parametrize("seed", range(3))
def test_spheres_of_joints_contain_all_vertices(seed):
    rng = np.random.default_rng(seed)
    figure = random_figure(rng, 9)
    actor = Actor(figure)
    actor.pose = random_pose(figure.skeleton, rng)
    actor.placement[:3] = np.array([[0.0, -2, 0, 5], [2, 0, 0, 1], [0, 0, 2, -3]])
    spheres = spheres_of(actor, DisplayOptions())
    points = deform(figure, actor.pose)[0] @ actor.placement[:3, :3].T + actor.placement[:3, 3]
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reach = (spheres[:, :3] @ directions.T + spheres[:, 3:]).max(axis=0)
    assert (reach >= (points @ directions.T).max(axis=0)).all()


def test_software_draws_fewer_passes_of_large_pictures(offscreen):
    """8.3 megapixels are 0.85 units of work per pass; 2 of 8 passes would be too few."""
    scene = Scene([])
    found = {}
    for size in ((640, 480), (2400, 1800), (3840, 2160), (8000, 8000)):
        options = DisplayOptions(quality="final")
        notes = limit_passes(options, scene, size, offscreen.context)
        found[size] = options.quality, options.passes, len(notes)
    if "llvmpipe" not in offscreen.context.info["GL_RENDERER"]:
        pytest.skip("drawn by hardware")
    assert found == {
        (640, 480): ("final", 8, 0),
        (2400, 1800): ("final", 4, 1),
        (3840, 2160): ("normal", 8, 1),
        (8000, 8000): ("normal", 8, 1),
    }


def test_time_of_a_pass_is_measured_once_and_reported_if_all_passes_are_slow(offscreen):
    scene, camera, times = scene_of(sphere(8)), front(), []
    for options in (plain(), plain(quality="final", passes=4)):
        once = offscreen.render(scene, (N, N), camera, options, GROUND)
        timed = offscreen.render(
            scene, (N, N), camera, options, GROUND, lambda *time: times.append(time)
        )
        assert np.array_equal(once, timed)
    ((seconds, count),) = times
    assert seconds > 0.0 and count == 4
    assert time_note(0.6, 8) == []
    (note,) = time_note(1.25, 8)
    assert "about 10 s" in note and "8 passes of 1.2 s" in note


def on_ground(n_joints) -> Scene:
    """Return an upright square from y = 0 to 1, bound to a single joint or to none."""
    mesh = square(half=0.5, material=WHITE)
    mesh = replace(mesh, positions=mesh.positions + np.array([0.0, 0.5, 0.0]))
    if not n_joints:
        return Scene([Actor(Figure("square", mesh))])
    skin = skin_from_lists([[(0, 1.0)]] * 4, [np.eye(4)])
    figure = Figure("square", mesh, skeleton([-1], np.zeros((1, 3))), skin)
    return Scene([Actor(figure, rest_pose(figure.skeleton))])


@pytest.mark.parametrize("quality", ["normal", "final"])
def test_figures_of_a_single_joint_have_the_same_shadows(offscreen, quality):
    """Coincident joints have no extent, but the mesh has."""
    light = lights(0.3, 1.0, azimuth=60.0, inclination=45.0, follow_camera=False)
    options, camera = with_shadows(quality=quality, lights=light), front(inclination=40.0)
    areas = [
        (draw(offscreen, on_ground(count), options, camera)[..., 3] % 255 > 20).sum()
        for count in (0, 1)
    ]
    # The shadow map is fitted to spheres around the joints, so its texels differ.
    assert areas[0] > 50 and areas[1] == pytest.approx(areas[0], rel=0.25)
