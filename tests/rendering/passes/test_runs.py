"""Masked, blended and single-sided materials in shadows, occlusion, picking and outlines."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, skeleton, sphere, square
from rendering.front_view import (
    PIXELS,
    WHITE,
    alone,
    dark,
    drawn,
    front_view,
    grid_figure,
    pixel,
)
from rendering.plain_pictures import N, draw, front, lights, plain

from viewer.rendering import lineup
from viewer.rendering.camera import Camera
from viewer.rendering.gpu import mesh_buffers
from viewer.rendering.gpu.target import Target, picture_rows
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skin import skin_from_lists

GROUND = np.array([[-2.0, -1.5, -2.0], [2.0, 1.5, 2.0]])  # at height -1.5


@pytest.fixture(params=[1, 100], ids=["instanced", "single"])
def fewest(request, monkeypatch):
    monkeypatch.setattr(lineup, "FEWEST", request.param)


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
    monkeypatch.setattr(lineup, "FEWEST", 2)
    figure = painted(double_sided=False)
    actors = [Actor(figure, rest_pose(figure.skeleton)) for _ in range(4)]
    for number, actor in enumerate(actors):
        actor.placement = np.diag([0.3 * (-1.0) ** number, 0.3, 0.3, 1.0])
        actor.placement[0, 3] = number - 1.5
    shown = drawn(front_view(offscreen, Scene(actors)))
    assert shown[PIXELS // 2, [10, 30, 50, 70]].all()


def layers(figure_of) -> Mesh:
    """Return squares at z = 0 to 3 as one mesh, listed in the order 2, 0, 3, 1."""
    squares = [figure_of(float(z)) for z in (2, 0, 3, 1)]
    return Mesh(
        np.concatenate([one.positions for one in squares]),
        np.concatenate([one.normals for one in squares]),
        np.concatenate([one.triangles + 4 * row for row, one in enumerate(squares)]),
        colors=np.repeat([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5], [1, 1, 1, 0.5]], 4, 0),
        materials=(Material("", None, WHITE, alpha_mode="blend", unlit=True, is_physical=True),),
        triangle_materials=np.zeros(8, np.int32),
    )


@pytest.mark.parametrize("is_turned", [False, True])
def test_blended_triangles_of_a_mesh_are_drawn_from_far_to_near(offscreen, is_turned):
    """Each layer covers half of those behind it; the order is by depth, then as listed above."""
    actor = Actor(Figure("layers", layers(square)))
    if is_turned:
        actor.placement = np.diag([-1.0, 1.0, -1.0, 1.0])
    wanted = np.zeros(3)
    by_depth = [(0, 255, 0), (255, 255, 255), (255, 0, 0), (0, 0, 255)]
    for color in reversed(by_depth) if is_turned else by_depth:
        wanted = 0.5 * wanted + 0.5 * np.array(color)
    wanted /= 1.0 - 0.5**4  # opacity of all layers together
    for _ in range(2):
        shown = front_view(offscreen, Scene([actor]), lights=dark())
        assert np.allclose(pixel(shown, 0.3, 0.2)[:3], wanted, atol=2)


def test_blended_materials_are_drawn_from_far_to_near(offscreen):
    """Four materials with one run each are in the order of the test above."""
    mesh = layers(square)
    one = mesh.materials[0]
    colors = [(*mesh.colors[4 * row, :3].tolist(), 0.5) for row in range(4)]
    split = replace(
        mesh,
        colors=None,
        materials=tuple(replace(one, base_color=color) for color in colors),
        triangle_materials=np.repeat([0, 1, 2, 3], 2),
    )
    pictures = [
        front_view(offscreen, alone(Figure("s", shape)), lights=dark()) for shape in (mesh, split)
    ]
    assert np.abs(pictures[0].astype(int) - pictures[1]).max() <= 2


LIT = plain(lights=lights(ambient=0.3, key=1.0, azimuth=30.0, inclination=40.0))


def closed(rings=24) -> Mesh:
    """Return a sphere of radius 1 with one vertex per position at the seam and the poles."""
    mesh = sphere(rings)
    return replace(mesh, positions=np.round(mesh.positions, 9))


def opened(to=(0.0, 0.0, 1.0)) -> Mesh:
    """Return the sphere without the eight triangles within 7.5 degrees of a direction."""
    mesh = closed()
    middles = mesh.positions[mesh.triangles].mean(axis=1)
    cosines = middles @ np.array(to) / np.linalg.norm(middles, axis=1)
    kept = mesh.triangles[cosines < np.cos(np.radians(7.5))]
    return replace(mesh, triangles=kept, triangle_materials=None, triangle_parts=None)


def regions(offscreen, scene: Scene, camera: Camera):
    """Return the regions in which back faces are drawn; None for the whole image."""
    with offscreen.context:
        mesh = offscreen.renderer.buffers.posed_mesh(scene.actors[0])
    view, projection = camera.view_matrix(), camera.projection_matrix(1.0, np.array([[-1], [1]]))
    return mesh.back_faces.regions(view, projection @ np.eye(4), (0, 0, 100, 100))


def drawn_both_ways(offscreen, monkeypatch, scene: Scene, camera: Camera):
    """Return the picture, the regions with back faces, and the picture with all back faces."""
    picture = draw(offscreen, scene, LIT, camera)
    where = regions(offscreen, scene, camera)
    monkeypatch.setattr(mesh_buffers, "shell_of", lambda *_: None)
    again = Scene([Actor(replace(scene.actors[0].figure))])
    whole = draw(offscreen, again, LIT, camera)
    assert regions(offscreen, again, camera) is None
    return picture, where, whole


def test_closed_surface_looks_the_same_without_back_faces(offscreen, monkeypatch):
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(closed()), front())
    assert where == ()
    np.testing.assert_array_equal(picture, whole)


def test_opening_shows_the_inside(offscreen, monkeypatch):
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(opened()), front())
    np.testing.assert_array_equal(picture, whole)
    # The border is 25 sin(7.5 degrees) = 3.3 pixels from the middle at 50, with a margin of two.
    assert where == ((44, 44, 12, 12),)


def test_opening_outside_the_image_draws_no_back_faces(offscreen):
    scene, camera = scene_of(opened((1.0, 0.0, 0.0))), front(target=np.array([-3.0, 0.0, 0.0]))
    draw(offscreen, scene, LIT, camera)
    assert regions(offscreen, scene, camera) == ()


def test_camera_inside_sees_the_back_faces(offscreen, monkeypatch):
    camera = front(orthographic=False, distance=0.1)
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(closed()), camera)
    assert where is None
    assert (picture[..., 3] == 255).all()
    np.testing.assert_array_equal(picture, whole)


@pytest.mark.parametrize("scale, is_hidden", [(0.5, True), (-0.5, True), (0.0, False)])
def test_back_faces_are_hidden_unless_a_joint_flattens_them(offscreen, scale, is_hidden):
    mesh = closed(8)
    skin = skin_from_lists([[(0, 1.0)] for _ in mesh.positions], np.eye(4)[None])
    scene = Scene([Actor(Figure("ball", mesh, skeleton([-1], [[0.0, 0.0, 0.0]]), skin))])
    pose = scene.actors[0].pose
    pose.scales[:] = 1.0, scale, 1.0
    draw(offscreen, scene, LIT)
    assert (regions(offscreen, scene, front()) == ()) is is_hidden


def test_negative_weights_have_no_bound_so_all_back_faces_are_drawn(offscreen):
    mesh = closed(8)
    binding = skin_from_lists([[(0, 1.5), (0, -0.5)] for _ in mesh.positions], np.eye(4)[None])
    scene = Scene([Actor(Figure("ball", mesh, skeleton([-1], [[0.0, 0.0, 0.0]]), binding))])
    draw(offscreen, scene, LIT)
    assert regions(offscreen, scene, front()) is None
