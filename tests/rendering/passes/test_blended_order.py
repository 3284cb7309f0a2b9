"""Pixels of blended triangles within one mesh, which are sorted by depth."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import square
from rendering.front_view import (
    WHITE,
    alone,
    dark,
    front_view,
    pixel,
)

from viewer.rendering.offscreen import Offscreen
from viewer.rig.figure import Figure
from viewer.rig.material import Material
from viewer.rig.mesh import Mesh
from viewer.rig.scene import Actor, Scene


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


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
