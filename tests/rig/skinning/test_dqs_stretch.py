"""Two-phase dual quaternion skinning of joints that scale, shear or reflect."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import matrix, mesh, skeleton, turn_x, turn_y, turn_z

from viewer.rig.figure import Figure
from viewer.rig.pose import rest_pose
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import deform, dqs, lbs

POINTS = np.random.default_rng(0).normal(size=(20, 3))
NORMALS = np.random.default_rng(1).normal(size=(20, 3))
PLACES = np.array([[0.0, 0, 0], [1, 2, 0], [-1, 1, 3]])
BIND = np.array([matrix(None, place) for place in PLACES])


def scaled(factors, turn=None, move=(0.0, 0.0, 0.0)):
    """Return the matrix that scales along the axes, then rotates, then translates."""
    turn = np.eye(3) if turn is None else turn
    return matrix(turn @ np.diag(np.broadcast_to(factors, 3)), move)


def moved_by(palette, pairs, method=dqs):
    skin = skin_from_lists([pairs] * len(POINTS), np.linalg.inv(BIND))
    return method.deform(POINTS, NORMALS, skin, np.array(palette))


AFFINE = [
    pytest.param(scaled(3.0, turn_x(1.0), (1, 2, 3)), id="uniform"),
    pytest.param(scaled((2.0, 0.5, 1.0), turn_y(2.5), (0, 1, 0)), id="along axes"),
    pytest.param(scaled((-1.0, 1.0, 1.0), turn_z(0.4), (1, 0, 0)), id="mirrored"),
    pytest.param(scaled((-1.0, -2.0, -0.5)), id="point-mirrored"),
    pytest.param(scaled((1.0, 0.0, 2.0), turn_x(0.7)), id="flattened"),
    pytest.param(matrix([[1, 0.7, 0], [0, 1, 0.2], [0, 0, 1]], (2, 0, 0)), id="sheared"),
]


@pytest.mark.parametrize("motion", AFFINE)
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_one_influence_is_the_affine_map(motion, joint):
    palette = [np.eye(4)] * 3
    palette[joint] = motion
    moved, turned = moved_by(palette, [(joint, 1.0)])
    assert_allclose(moved, POINTS @ motion[:3, :3].T + motion[:3, 3], atol=1e-13)
    # Exact normals are those of |det(M)| M^-T, by cofactors, which stay finite for flattening
    # matrices.
    a, b, c = motion[:3, :3].T
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    exact = (-1.0 if np.linalg.det(motion) < 0.0 else 1.0) * NORMALS @ cofactors.T
    assert_allclose(turned, exact / np.linalg.norm(exact, axis=1, keepdims=True), atol=1e-13)


@pytest.mark.parametrize("factor", [0.2, 2.0, -1.5])
def test_figure_scaled_as_a_whole_equals_linear_blending(factor):
    """All joints have the same map, so any weights must result in this map at any position."""
    motion = scaled(factor, turn_x(0.9) @ turn_z(2.0), (5, -1, 2))
    moved, _ = moved_by([motion] * 3, [(0, 0.2), (1, 0.5), (2, 0.3)])
    assert_allclose(moved, POINTS @ motion[:3, :3].T + motion[:3, 3], atol=1e-13)
    linear, _ = moved_by([motion] * 3, [(0, 0.2), (1, 0.5), (2, 0.3)], lbs)
    assert_allclose(moved, linear, atol=1e-13)


@pytest.mark.parametrize("factors", [(2.0, 2.0, 2.0), (3.0, 0.5, 1.0), (-1.0, 1.0, 1.0)])
def test_scaled_root_scales_the_whole_figure(factors):
    offsets = [PLACES[0], PLACES[1] - PLACES[0], PLACES[2] - PLACES[1]]
    dofs = [(joint, axis, 0.0) for joint in range(3) for axis in "xyz"]
    bones = skeleton([-1, 0, 1], dofs, offsets=offsets)
    rng = np.random.default_rng(2)
    influences = [[(j, float(rng.uniform(0.1, 1))) for j in range(3)] for _ in POINTS]
    weights = [[(j, w / sum(v for _, v in pairs)) for j, w in pairs] for pairs in influences]
    figure = Figure(
        "three", mesh(POINTS, NORMALS), bones, skin_from_lists(weights, np.linalg.inv(BIND))
    )
    pose = rest_pose(bones)
    pose.scales[0] = factors
    assert_allclose(deform(figure, pose, "dqs")[0], POINTS * factors, atol=1e-13)


def test_two_scales_blend_linearly_without_rotation():
    # Each joint stretches about its position: 0.5 (2 x) + 0.5 (4 (x - c) + c).
    palette = [scaled(2.0), matrix(4.0 * np.eye(3), -3.0 * PLACES[1]), np.eye(4)]
    moved, _ = moved_by(palette, [(0, 0.5), (1, 0.5)])
    assert_allclose(moved, POINTS + 2.0 * POINTS - 1.5 * PLACES[1], atol=1e-13)


def test_scale_and_twist_keep_the_scaled_radius():
    """A tube bound at x = 0 to two joints of scale 2, one of them rotated by 170 degrees."""
    angle = np.radians(170)
    palette = [scaled(2.0), scaled(2.0, turn_x(angle)), np.eye(4)]
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]], np.tile(np.eye(4), (3, 1, 1)))
    points = np.array([[0.0, 0.6, 0.8]])
    moved, _ = dqs.deform(points, points, skin, np.array(palette))
    assert_allclose(moved[0], 2.0 * turn_x(angle / 2) @ points[0], atol=1e-14)


def test_stretch_of_a_rotated_joint_is_blended_before_the_rotation():
    """Kavan 2008, 4.2: (sum w S) in the bind pose, then the blended rigid motion."""
    stretches = [np.diag([2.0, 1.0, 1.0]), np.diag([1.0, 1.0, 3.0])]
    turns = [turn_y(0.4), turn_y(1.2)]
    palette = [matrix(t @ s) for t, s in zip(turns, stretches, strict=True)] + [np.eye(4)]
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]] * 20, np.tile(np.eye(4), (3, 1, 1)))
    moved, _ = dqs.deform(POINTS, NORMALS, skin, np.array(palette))
    expected = POINTS @ (turn_y(0.8) @ np.diag([1.5, 1.0, 2.0])).T
    assert_allclose(moved, expected, atol=1e-13)


def test_bind_matrix_with_scale_and_shear_is_part_of_the_map():
    """Only the product M matters: a sheared binding that the pose cancels has no effect."""
    rng = np.random.default_rng(3)
    bind = np.tile(np.eye(4), (3, 1, 1))
    bind[:, :3] += 0.3 * rng.normal(size=(3, 3, 4))
    skin = skin_from_lists([[(0, 0.3), (1, 0.3), (2, 0.4)]] * 20, np.linalg.inv(bind))
    moved, _ = dqs.deform(POINTS, NORMALS, skin, bind @ np.linalg.inv(bind))
    assert_allclose(moved, POINTS, atol=1e-13)


def test_long_chain_with_rounding_errors_is_rigid():
    rotation = np.linalg.matrix_power(turn_x(0.3) @ turn_y(0.2), 1000)
    _, stretches = dqs.split_palette(matrix(rotation)[None], np.zeros((1, 3)))
    assert stretches[0].tolist() == np.eye(3, 4).tolist()
