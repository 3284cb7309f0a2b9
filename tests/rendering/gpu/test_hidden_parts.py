"""Hidden parts of a mesh, which are not drawn, picked or framed, for each actor separately."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.front_view import alone, drawn, front_view, grid_figure

from viewer.rendering.camera import Camera
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rig.scene import Actor, Scene, scene_box


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


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
