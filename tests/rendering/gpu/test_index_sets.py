"""Triangle order for the vertex cache: consecutive neighbours, all triangles, unchanged runs."""

import ctypes
import ctypes.util
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, checker, sphere
from rendering.front_view import alone, drawn, front_view, grid_figure
from rendering.plain_pictures import draw, front, plain

from viewer.cli import run
from viewer.errors import RenderError
from viewer.rendering.camera import Camera
from viewer.rendering.gpu import upload
from viewer.rendering.gpu.index_sets import curve_order, curve_places, index_set
from viewer.rendering.gpu.surfaces import PLAIN
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene, scene_box

_KINDS = ("Buffer", "Texture", "VertexArray", "Framebuffer", "Renderbuffer", "Query")
_PROGRAMS = ("Program", "Shader")
_LARGEST = 1024  # names are assigned from 1, the smallest free one first


def gl_objects() -> Counter[str]:
    """Return the number of objects of each kind in the current context."""
    library = ctypes.CDLL(ctypes.util.find_library("GL") or "libGL.so.1")
    found: Counter[str] = Counter()
    for kind in (*_KINDS, *_PROGRAMS):
        is_one = getattr(library, f"glIs{kind}")
        is_one.restype = ctypes.c_ubyte
        found[kind] = sum(bool(is_one(name)) for name in range(1, _LARGEST))
    return found


def shaded(triangles, kept=32) -> int:
    """Return the number of vertices that are shaded with a small cache."""
    recent: list[int] = []
    count = 0
    for vertex in np.ravel(triangles).tolist():
        if vertex not in recent:
            count += 1
            recent = [vertex, *recent[: kept - 1]]
    return count


def drawn_order(ctx, triangles, materials, positions):
    parts = np.full(len(triangles), -1)
    order = None if positions is None else curve_order(triangles, materials, parts, positions)
    made = index_set(ctx, triangles, materials, [PLAIN, PLAIN], order)
    indices = np.frombuffer(made.indices.read(), dtype="u4").reshape(-1, 3)
    made.indices.release()
    return made, indices


def test_shuffled_triangles_are_sorted_spatially(ctx):
    ball = sphere(24)
    shuffled = np.random.default_rng(0).permutation(ball.triangles)
    made, indices = drawn_order(ctx, shuffled, np.full(len(shuffled), -1), ball.positions)
    assert np.array_equal(indices, shuffled[made.order])
    assert sorted(made.order) == list(range(len(shuffled)))
    assert made.spans == ((0, 3 * len(shuffled)),)
    # The optimum is one vertex for two triangles, the worst case three for each.
    assert shaded(shuffled) > 2.9 * len(shuffled)
    assert shaded(indices) < 0.9 * len(shuffled)


def test_material_runs_keep_their_order(ctx):
    ball = sphere(8)
    materials = np.zeros(len(ball.triangles), dtype=np.int32)
    materials[20:50] = 1
    materials[100:] = -1
    made, indices = drawn_order(ctx, ball.triangles, materials, ball.positions)
    assert [(run.first, run.count) for run in made.runs] == [
        (0, 60),
        (60, 90),
        (150, 150),
        (300, 3 * len(materials) - 300),
    ]
    assert np.array_equal(materials[made.order], materials)
    assert np.array_equal(indices, ball.triangles[made.order])


def test_order_is_unchanged_without_positions(ctx):
    ball = sphere(6)
    made, indices = drawn_order(ctx, ball.triangles, np.zeros(len(ball.triangles)), None)
    assert np.array_equal(indices, ball.triangles)
    assert np.array_equal(made.order, np.arange(len(ball.triangles)))


@pytest.mark.parametrize("count", [0, 1])
def test_small_numbers_of_triangles_are_sorted(ctx, count):
    points = np.zeros((3, 3))
    triangles = np.array([[0, 1, 2]], dtype=np.int32)[:count]
    order = curve_order(triangles, np.zeros(count), np.zeros(count), points)
    made = index_set(ctx, triangles, np.zeros(count), [PLAIN], order)
    assert made.spans == ((0, 3 * count),) and len(made.order) == count
    made.indices.release()


def test_curve_interleaves_the_bits_of_cells():
    cells = np.array([[0, 0, 0], [1023, 1023, 1023], [5, 3, 6], [512, 0, 1]], dtype=float)
    wanted = []
    for cell in cells.astype(int):
        place = 0
        for bit in range(10):
            for axis in range(3):
                place |= (int(cell[axis]) >> bit & 1) << (3 * bit + axis)
        wanted.append(place)
    assert curve_places(cells).tolist() == wanted
    # The result does not depend on size and position of the cloud.
    assert curve_places(cells / 1024 + 64.0).tolist() == wanted


def rows():
    """Return a grid of 4 rows of 8 triangles: feet, two of belly, and a head without a part."""
    figure = grid_figure(4)
    parts = np.repeat([0, 1, 1, -1], 8)
    return replace(figure, mesh=replace(figure.mesh, parts=("feet", "belly"), triangle_parts=parts))


def picked(offscreen, scene: Scene, y: float) -> int | None:
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    size = 64, 64
    place = size[0] * (0.5 + 0.1 / 4), size[1] * (0.5 - y / 4)
    with offscreen.context:
        found = offscreen.renderer.pick(
            scene, camera, DisplayOptions(), size, *place, scene_box(scene)
        )
    return None if found is None else found.triangle


# The grid is from -1.5 to 1.5; each row is 0.75 high.
@pytest.mark.parametrize(
    ("hidden", "shown"),
    [({0}, [0, 1, 1, 1]), ({1}, [1, 0, 0, 1]), ({0, 1}, [0, 0, 0, 1]), ({7}, [1, 1, 1, 1])],
)
def test_hidden_parts_are_not_drawn(offscreen, hidden, shown):
    actor = Actor(rows(), hidden_parts=frozenset(hidden))
    for options in ({}, {"wireframe": True, "normals": True}, {"shading": "normals"}):
        picture = drawn(front_view(offscreen, alone(actor.figure), **options))
        scene = Scene([actor])
        found = drawn(front_view(offscreen, scene, **options))
        height = len(picture)
        middles = [round(height * (0.5 + (1.125 - 0.75 * row) / 4)) for row in range(4)]
        assert picture[middles, height // 2 + 2].all()
        assert found[middles, height // 2 + 2].tolist() == [bool(row) for row in shown]


def test_hidden_parts_are_not_picked_and_other_triangles_keep_their_numbers(offscreen):
    scene = Scene([Actor(rows(), hidden_parts=frozenset({1}))])
    assert picked(offscreen, scene, -1.2) in range(8)
    assert picked(offscreen, scene, 0.3) is None
    assert picked(offscreen, scene, 1.2) in range(24, 32)


def test_camera_is_fitted_without_hidden_parts():
    actor = Actor(rows(), hidden_parts=frozenset({0, 1}))
    assert scene_box(Scene([actor]))[:, 1] == pytest.approx([0.75, 1.5])


def test_actors_of_one_figure_may_hide_different_parts(offscreen):
    figure = rows()
    aside = np.eye(4)
    aside[2, 3] = -0.5
    front = Actor(figure, hidden_parts=frozenset({0}))
    behind = Actor(figure, hidden_parts=frozenset({1}), placement=aside)
    assert drawn(front_view(offscreen, Scene([front, behind]))).sum() == pytest.approx(
        drawn(front_view(offscreen, alone(figure))).sum(), rel=0.02
    )


OPTIONS = (
    plain(show="both"),
    plain(shading="scalar", scalar="weight:#0"),
    plain(wireframe=True, normals=True, samples=4),
    plain(quality="final", passes=2, background="gradient"),
)


def scene(count: int) -> Scene:
    """Return textured arms, drawn singly or as instances, and a ball."""
    figure = arm(3, sides=6, rings=9, material=checker(2))
    return Scene([*(Actor(figure) for _ in range(count)), Actor(Figure("ball", sphere(6)))])


def test_closed_figures_leave_no_objects_behind(offscreen):
    found = []
    for _ in range(4):
        # Draw one at a time, and nine as instances; every pose is new, and every option creates
        # buffers.
        for count in (1, 9):
            opened = scene(count)
            for frame, options in enumerate(OPTIONS):
                opened.actors[0].pose.dofs[4] = 0.1 * frame
                draw(offscreen, opened, options)
        draw(offscreen, Scene([]), plain())
        with offscreen.context:
            found.append(gl_objects())
    # The first round compiles programs and creates the buffers that all figures share.
    assert found[1] == found[2] == found[3]
    assert found[1].total() > 20


@pytest.mark.parametrize("count", [1, 9])
def test_refused_scene_leaves_no_objects_and_keeps_the_old_scene(offscreen, monkeypatch, count):
    old = Scene([Actor(arm(2))])
    picture = draw(offscreen, old, camera=front())
    check = upload.check_errors
    refused, is_done = 0, False
    while not is_done:
        made = 0

        def fail_once(context, doing, at=refused) -> None:
            nonlocal made
            made += 1
            if made > at:
                raise RenderError(f"{doing}: not enough graphics memory")
            check(context, doing)

        with offscreen.context:
            before = gl_objects()
            monkeypatch.setattr(upload, "check_errors", fail_once)
            monkeypatch.setattr("viewer.rendering.gpu.posed_vertices.checked", upload.checked)
            try:
                offscreen.renderer.prepare(scene(count))
                is_done = True
            except RenderError:
                assert gl_objects() == before
            monkeypatch.undo()
        refused += 1
    # The uploads of mesh, skin, palette, texture and skeleton have each failed once.
    assert refused > 12
    np.testing.assert_array_equal(draw(offscreen, old, camera=front()), picture)


def test_shape_without_enough_memory_can_be_tried_again(offscreen, monkeypatch):
    """Allocation of the second of two buffers fails, so the first is freed."""
    figure = arm(2)
    mesh = figure.require_mesh()
    opened = Scene([Actor(figure)])
    draw(offscreen, opened)
    with offscreen.context:
        buffers = offscreen.renderer.buffers.mesh(figure)
        rest = offscreen.renderer.buffers.posed_mesh(opened.actors[0])._vertices._rest
        before, calls = gl_objects(), []

        def second_fails(context, doing) -> None:
            calls.append(doing)
            if len(calls) == 2:
                raise RenderError(f"{doing}: not enough graphics memory")

        monkeypatch.setattr(upload, "check_errors", second_fails)
        moved = replace(figure, mesh=replace(mesh, positions=mesh.positions + 0.1))
        with pytest.raises(RenderError, match=r"^a shaped mesh of \d\.\d+ kB: not enough"):
            rest.reshape(moved)
        assert gl_objects() == before
        rest.reshape(moved)
        found = np.frombuffer(rest.positions.read(), "f4").reshape(-1, 3)
        expected = (mesh.positions + 0.1 - buffers.center)[buffers.sources]
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_hundred_thousand_coincident_boxes_are_drawn(tmp_path, capsys):
    deep = tmp_path / "deep.skel"
    deep.write_text("balljoint a { " * 100_000 + "} " * 100_000)
    out = tmp_path / "deep.png"
    # In final quality, a slow machine would print the time that the image takes.
    options = ["--size", "320x240", "--quality", "normal"]
    assert run(["render", str(deep), "-o", str(out), *options]) == 0
    assert capsys.readouterr().err == "" and out.stat().st_size > 1000
