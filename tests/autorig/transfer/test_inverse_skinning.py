"""Inversion of linear blend skinning, and reports of singular vertices."""

import numpy as np
import pytest
from autorig.rigged_shapes import arm, turn
from numpy.testing import assert_allclose

from viewer.autorig.transfer.inverse_skinning import invert_skinning, repair_tears
from viewer.rig.skin import skin_from_lists

EXACT = 1e-12


def palette(angle):
    """Return the palette of a base at rest and a tip rotated about z through (0, 1, 0)."""
    matrices = np.tile(np.eye(4), (2, 1, 1))
    rotation = turn([0, 0, 1], angle)
    matrices[1, :3, :3] = rotation
    matrices[1, :3, 3] = [0, 1, 0] - rotation @ [0, 1, 0]
    return matrices


def skinned(positions, skin, matrices):
    """Skin vertex by vertex, directly by the formula."""
    moved = []
    for vertex, point in enumerate(positions):
        span = slice(skin.starts[vertex], skin.starts[vertex + 1])
        blended = sum(
            w * matrices[j] for j, w in zip(skin.joints[span], skin.weights[span], strict=True)
        )
        moved.append((blended @ [*point, 1.0])[:3])
    return np.array(moved)


def test_skinned_mesh_is_inverted_exactly():
    figure = arm()
    matrices = palette(1.2)
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert_allclose(found.positions, figure.mesh.positions, atol=EXACT)
    assert not found.guarded.any()


@pytest.mark.parametrize(("degrees", "guarded"), [(156.0, False), (158.0, True), (180.0, True)])
def test_equal_weights_are_singular_beyond_157_degrees(degrees, guarded):
    # The smallest singular value of (I + R) / 2 is cos(angle / 2), here 0.208 and 0.191.
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]], np.tile(np.eye(4), (2, 1, 1)))
    found = invert_skinning(np.array([[0.3, 0.2, 0.1]]), skin, palette(np.radians(degrees)))
    assert found.guarded.tolist() == [guarded]
    assert np.abs(found.positions).max() < 10.0


def test_singular_vertex_is_inverted_with_the_nearest_rotation():
    # The mean of the identity and 160 degrees about z is cos(80 deg) times a rotation by 80
    # degrees.
    angle = np.radians(160.0)
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]], np.tile(np.eye(4), (2, 1, 1)))
    matrices = palette(angle)
    point = np.array([0.4, 1.5, -0.2])
    found = invert_skinning(point[None], skin, matrices)
    shift = 0.5 * matrices[1, :3, 3]
    assert_allclose(found.positions[0], turn([0, 0, 1], -angle / 2) @ (point - shift), atol=EXACT)


def test_vertex_without_influence_does_not_move():
    skin = skin_from_lists([[], [(1, 1.0)]], np.tile(np.eye(4), (2, 1, 1)))
    found = invert_skinning(np.ones((2, 3)), skin, palette(0.5))
    assert_allclose(found.positions[0], [1.0, 1.0, 1.0])
    assert not found.guarded.any()


def test_repair_moves_only_the_neighbourhood_and_improves_the_pose():
    figure = arm()
    matrices = palette(np.radians(170.0))
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert found.guarded.any() and not found.guarded.all()
    mended = repair_tears(found, posed, figure.mesh.triangles)
    assert (mended[found.guarded] != found.positions[found.guarded]).any()
    # No vertex moves three rings away from the fold, at least 0.45 from y = 1.
    away = np.abs(figure.mesh.positions[:, 1] - 1.0) > 0.45
    assert (mended[away] == found.positions[away]).all()
    before, after = (
        np.linalg.norm(skinned(rest, figure.skin, matrices) - posed, axis=1).max()
        for rest in (found.positions, mended)
    )
    assert after < 0.5 * before


def test_no_vertex_is_repaired_without_singular_vertices():
    figure = arm()
    matrices = palette(0.3)
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert repair_tears(found, posed, figure.mesh.triangles) is found.positions
