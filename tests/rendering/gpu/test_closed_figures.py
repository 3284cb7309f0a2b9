"""Release of the buffers of closed figures and failed uploads."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, checker, sphere
from rendering.gpu.gl_objects import gl_objects
from rendering.plain_pictures import draw, front, plain

from viewer.errors import RenderError
from viewer.rendering.gpu import upload
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning

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


def test_closed_figures_leave_no_objects_behind(offscreen) -> None:
    found = []
    for _ in range(4):
        # Draw one at a time, and nine as instances; every pose is new, and every option creates
        # buffers.
        for count in (1, 9):
            opened = scene(count)
            for frame, options in enumerate(OPTIONS):
                opened.actors[0].require_pose().dofs[4] = 0.1 * frame
                draw(offscreen, opened, options)
        draw(offscreen, Scene([]), plain())
        with offscreen.context:
            found.append(gl_objects())
    # The first round compiles programs and creates the buffers that all figures share.
    assert found[1] == found[2] == found[3]
    assert found[1].total() > 20


@pytest.mark.parametrize("count", [1, 9])
def test_refused_scene_leaves_no_objects_and_keeps_the_old_scene(
    offscreen, monkeypatch, count
) -> None:
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
            monkeypatch.setattr("viewer.rendering.gpu.posed_mesh.checked", upload.checked)
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


def test_shape_without_enough_memory_can_be_tried_again(offscreen, monkeypatch) -> None:
    """Allocation of the second of two buffers fails, so the first is freed."""
    figure = arm(2)
    mesh = figure.require_mesh()
    opened = Scene([Actor(figure)])
    draw(offscreen, opened)
    with offscreen.context:
        buffers = offscreen.renderer.buffers.mesh(figure)
        rest = offscreen.renderer.buffers.posed_mesh(opened.actors[0])._rest
        before, calls = gl_objects(), []

        def second_fails(context, doing) -> None:
            calls.append(doing)
            if len(calls) == 2:
                raise RenderError(f"{doing}: not enough graphics memory")

        monkeypatch.setattr(upload, "check_errors", second_fails)
        moved = replace(figure, mesh=replace(mesh, positions=mesh.positions + 0.1))
        shape = replace(opened.actors[0].require_pose(), shape_weights=np.ones(1))
        with pytest.raises(RenderError, match=r"^a shaped mesh of 0\.\d MB: not enough"):
            rest.update(moved, shape, Skinning())
        assert gl_objects() == before
        rest.update(moved, shape, Skinning())
        found = np.frombuffer(rest.positions.read(), "f4").reshape(-1, 3)
        expected = (mesh.positions + 0.1 - buffers.center)[buffers.sources]
        np.testing.assert_allclose(found, expected, atol=1e-6)
