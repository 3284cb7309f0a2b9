"""Masked, blended and single-sided materials in shadows, occlusion, picking and outlines."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, square
from rendering.front_view import PIXELS, alone, drawn, front_view, grid_figure
from rendering.plain_pictures import N, front, lights, plain

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.target import Target, picture_rows
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes import instance_pass
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rig.figure import Figure
from viewer.rig.material import Material, Texture
from viewer.rig.pose import rest_pose
from viewer.rig.scene import Actor, Scene, scene_box

GROUND = np.array([[-2.0, -1.5, -2.0], [2.0, 1.5, 2.0]])  # at height -1.5


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


@pytest.fixture(params=[1, 100], ids=["instanced", "single"])
def fewest(request, monkeypatch):
    monkeypatch.setattr(instance_pass, "FEWEST", request.param)


def painted(mode="opaque", left=255, right=255, **changes) -> Figure:
    """Return the white grid from -1.5 to 1.5 with these alphas left and right of x = 0."""
    image = np.full((1, 2, 4), 255, np.uint8)
    image[0, :, 3] = left, right
    material = Material("", Texture("", image, is_smooth=False), alpha_mode=mode, **changes)
    figure = grid_figure()
    mesh = figure.require_mesh()
    uvs = mesh.positions[:, :2] / 3.0 + 0.5
    number = np.zeros(mesh.n_triangles, np.int32)
    return replace(
        figure,
        mesh=replace(mesh, uvs=uvs, materials=(material,), triangle_materials=number),
    )


def right_half() -> Figure:
    """Return only the grid's triangles at x > 0, like a mask of the left half."""
    figure = painted("mask")
    mesh = figure.require_mesh()
    kept = mesh.positions[mesh.triangles, 0].mean(axis=1) > 0.0
    number = np.zeros(kept.sum(), np.int32)
    changes = {"triangles": mesh.triangles[kept], "triangle_materials": number}
    return replace(figure, mesh=replace(mesh, **changes, triangle_parts=None))


def behind() -> Figure:
    """Return a wall behind the grid on which shadows fall."""
    return Figure("wall", square(-0.4, half=1.9))


def lit(**changes) -> DisplayOptions:
    light = lights(0.4, 0.6, azimuth=40.0, inclination=20.0)
    return plain(**{"lights": light, "passes": 3, **changes})


@pytest.mark.parametrize("quality", ["normal", "final"])
def test_masked_areas_affect_shadows_and_occlusion_like_missing_triangles(
    offscreen, quality, fewest
):
    """A mask of the left half draws the same picture as a mesh without the left half."""
    camera = front(inclination=35.0, azimuth=20.0)
    masked, cut, whole = (
        offscreen.render(
            Scene([Actor(figure, rest_pose(figure.skeleton)), Actor(behind())]),
            (N, N),
            camera,
            lit(quality=quality),
            GROUND,
        ).astype(int)
        for figure in (painted("mask", left=100), right_half(), painted("mask"))
    )
    assert np.abs(masked - cut).max() <= 6
    assert (np.abs(whole - cut).max(axis=2) > 20).mean() > 0.05


def shadow_on_wall(offscreen, figure, **changes) -> np.ndarray:
    """Return the darkness of the shadow by the left light right of the grid, at x > 1.5."""
    light = lights(0.0, 1.0, azimuth=-60.0, follow_camera=False)
    wall = Figure("wall", square(-0.4, half=2.5))
    scene = Scene([Actor(figure, rest_pose(figure.skeleton)), Actor(wall)])
    options = plain(lights=light, quality="normal", **changes)
    pixels = offscreen.render(scene, (N, N), front(), options, GROUND)
    # The shadow extends 0.4 tan 60 = 0.69 beyond the grid, to 2.19. A unit is 25 pixels.
    return 1.0 - (pixels[40:60, 92:98, 0].mean() / pixels[5:8, 92:98, 0].mean()) ** 2.2


@pytest.mark.parametrize("alpha", [64, 128, 192])
def test_blended_surfaces_cast_shadows_in_proportion_to_their_alpha(offscreen, alpha):
    solid = shadow_on_wall(offscreen, painted("opaque"))
    thin = shadow_on_wall(offscreen, painted("blend", alpha, alpha))
    assert solid > 0.5
    assert thin / solid == pytest.approx(alpha / 255, abs=0.08)


def test_blended_surfaces_cause_no_ambient_occlusion(offscreen):
    options = lit(quality="final", shadows=False, lights=lights(0.5))
    glass = painted("blend", 0, 0)
    wall = behind()
    both, one = (
        offscreen.render(scene_of(*meshes), (N, N), front(azimuth=20.0), options, GROUND)
        for meshes in ((glass.mesh, wall.mesh), (wall.mesh,))
    )
    assert np.abs(both.astype(int) - one).max() <= 3


def click(offscreen, scene, x, y=0.3, **options):
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    size, shown = (PIXELS, PIXELS), DisplayOptions(**options)
    at = PIXELS * (0.5 + x / 4), PIXELS * (0.5 - y / 4)
    with offscreen.context:
        return offscreen.renderer.pick(scene, camera, shown, size, *at, scene_box(scene))


def test_picking_passes_through_masked_and_invisible_areas(offscreen, fewest):
    """A square is far behind the grid; triangle 12 of the grid is at x = 0.2, y = 0.3."""
    far = Actor(Figure("far", square(-1.0, half=1.9)))
    for mode, left, hit in (("mask", 100, 1), ("blend", 5, 1), ("blend", 60, 0), ("opaque", 0, 0)):
        figure = painted(mode, left)
        scene = Scene([Actor(figure, rest_pose(figure.skeleton)), far])
        assert click(offscreen, scene, -0.6).actor == hit
        found = click(offscreen, scene, 0.6)
        # Cells of 0.75 have two triangles each, row by row from the lower left corner.
        assert (found.actor, found.triangle // 2) == (0, 4 * 2 + 2)


def test_picked_triangles_of_several_materials_are_those_of_the_mesh(offscreen, fewest):
    figure = painted("mask")
    mesh = figure.require_mesh()
    numbers = (np.arange(32) // 8).astype(np.int32)
    mesh = replace(mesh, materials=mesh.materials * 4, triangle_materials=numbers)
    figure = replace(figure, mesh=mesh)
    scene = Scene([Actor(figure, rest_pose(figure.skeleton))])
    for row in range(4):
        assert click(offscreen, scene, 0.4, 0.75 * row - 1.2).triangle // 2 == 4 * row + 2


def outline(offscreen, scene) -> np.ndarray:
    front_view(offscreen, scene)
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    with offscreen.context as context:
        target, box = Target(context, (PIXELS, PIXELS), 1), scene_box(scene)
        shown = DisplayOptions(samples=1)
        offscreen.renderer.draw_outlines([Outlined(0)], scene, camera, shown, target, box)
        rows = picture_rows(target.framebuffer.read(components=4), target.size).copy()
        target.release()
    return rows


def test_outlines_follow_masks(offscreen):
    masked, cut = (
        outline(offscreen, alone(figure)) for figure in (painted("mask", 100), right_half())
    )
    assert np.array_equal(masked, cut) and masked[..., 3].any()


def mirrored(pose=None, placement=(1.0, 1.0, 1.0), scale=1.0, joints=(1.0, 1.0, 1.0)) -> Scene:
    """Return the single-sided grid that faces +z, reflected in one of three ways."""
    figure = painted(double_sided=False)
    actor = Actor(figure, rest_pose(figure.skeleton), placement=np.diag([*placement, 1.0]))
    actor.pose.figure_scale = scale
    actor.pose.scales[:] = joints
    return Scene([actor])


@pytest.mark.parametrize(
    ("reflection", "is_seen"),
    [
        ({}, True),
        ({"placement": (-1.0, 1.0, 1.0)}, True),
        ({"placement": (1.0, 1.0, -1.0)}, False),
        ({"placement": (-1.0, 1.0, -1.0)}, False),
        ({"scale": -1.0}, False),
        ({"placement": (1.0, 1.0, -1.0), "scale": -1.0}, True),
        ({"joints": (-1.0, 1.0, 1.0)}, True),
        ({"joints": (1.0, 1.0, -1.0)}, False),
        ({"joints": (-1.0, 1.0, 1.0), "placement": (-1.0, 1.0, 1.0)}, True),
    ],
)
def test_single_sides_remain_outside_under_reflections(offscreen, reflection, is_seen, fewest):
    """A reflection keeps the side that the transformed normal points to."""
    scene = mirrored(**reflection)
    assert drawn(front_view(offscreen, scene)).any() == is_seen
    assert (click(offscreen, scene, 0.6) is not None) == is_seen
    culled = painted()
    scene.actors[0].figure = culled
    assert drawn(front_view(offscreen, scene, cull=True)).any() == is_seen
    assert (click(offscreen, scene, 0.6, cull=True) is not None) == is_seen


def test_mirrored_and_plain_actors_of_one_figure_are_drawn_together(offscreen, monkeypatch):
    monkeypatch.setattr(instance_pass, "FEWEST", 2)
    figure = painted(double_sided=False)
    actors = [Actor(figure, rest_pose(figure.skeleton)) for _ in range(4)]
    for number, actor in enumerate(actors):
        actor.placement = np.diag([0.3 * (-1.0) ** number, 0.3, 0.3, 1.0])
        actor.placement[0, 3] = number - 1.5
    shown = drawn(front_view(offscreen, Scene(actors)))
    assert shown[PIXELS // 2, [10, 30, 50, 70]].all()
