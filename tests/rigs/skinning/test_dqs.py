"""Invariants of dual quaternion skinning, and closed forms of its results."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, skeleton, turn_x, turn_y, turn_z

from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform, dqs, lbs, mix

ROUNDING = 1e-14
RIGID = [matrix(turn_x(0.8), (1, 2, 3)), matrix(turn_z(-2.0), (-4, 0, 1)), np.eye(4)]


def bound(pairs, n_joints=3, bind=None):
    """Return a skin with one vertex per list; joints are bound at the origin by default."""
    bind = np.tile(np.eye(4), (n_joints, 1, 1)) if bind is None else np.asarray(bind)
    return skin_from_lists(pairs, np.linalg.inv(bind))


def move(point, pairs, palette, method=dqs, normal=(0.6, 0.0, 0.8), bind=None, **changes):
    skin = bound([pairs], len(palette), bind)
    points, normals = np.array([point], dtype=float), np.array([normal], dtype=float)
    moved, turned = method.deform(points, normals, skin, np.array(palette), **changes)
    return moved[0], turned[0]


def random_rigid(rng, count):
    return [
        matrix(turn_x(a) @ turn_y(b) @ turn_z(c), rng.normal(size=3))
        for a, b, c in rng.uniform(-3, 3, (count, 3))
    ]


def random_arm(seed, n_vertices=80, n_joints=7):
    rng = np.random.default_rng(seed)
    dofs = [(joint, axis, 0.0) for joint in range(n_joints) for axis in "xyz"]
    parents = [-1, *(int(rng.integers(0, j)) for j in range(1, n_joints))]
    bones = skeleton(parents, dofs, offsets=rng.normal(size=(n_joints, 3)))
    joints = bones.rest_translations.copy()
    for joint, parent in enumerate(parents):
        joints[joint] += joints[parent] if parent >= 0 else 0.0
    influences = [
        [(int(rng.integers(n_joints)), float(rng.uniform(0.05, 1))) for _ in range(4)]
        for _ in range(n_vertices)
    ]
    bind = np.array([matrix(None, place) for place in joints])
    shape = Mesh(rng.normal(size=(n_vertices, 3)), rng.normal(size=(n_vertices, 3)), [[0, 1, 2]])
    return Figure("arm", shape, bones, bound(influences, bind=bind))


def test_bind_pose_returns_the_mesh():
    figure = random_arm(0)
    positions, normals = deform(figure, method="dqs")
    assert_allclose(positions, figure.mesh.positions, atol=ROUNDING)
    lengths = np.linalg.norm(figure.mesh.normals, axis=1, keepdims=True)
    assert_allclose(normals, figure.mesh.normals / lengths, atol=ROUNDING)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_one_influence_is_a_rigid_motion(joint):
    moved, turned = move((1, 2, 3), [(joint, 1.0)], RIGID)
    assert_allclose(moved, (RIGID[joint] @ [1, 2, 3, 1])[:3], atol=ROUNDING)
    assert_allclose(turned, RIGID[joint][:3, :3] @ [0.6, 0, 0.8], atol=ROUNDING)


def test_all_weight_on_one_joint_equals_linear_blending():
    figure = random_arm(1)
    single = [[(vertex % 7, 1.0)] for vertex in range(80)]
    figure = replace(figure, skin=skin_from_lists(single, figure.skin.inverse_bind))
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = np.random.default_rng(2).uniform(-3, 3, 21)
    for found, expected in zip(deform(figure, pose, "dqs"), deform(figure, pose), strict=True):
        assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize("degrees", [30, 90, 150, 179])
def test_twist_keeps_the_radius_where_linear_blending_collapses(degrees):
    angle = np.radians(degrees)
    palette = [np.eye(4), matrix(turn_x(angle))]
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    for a in around:
        point, pairs = (0.3, np.cos(a), np.sin(a)), [(0, 0.5), (1, 0.5)]
        # Halfway between two rotations about x is the rotation by half the angle.
        half = turn_x(angle / 2) @ point
        moved, turned = move(point, pairs, palette, normal=(0, np.cos(a), np.sin(a)))
        assert_allclose(moved, half, atol=ROUNDING)
        assert_allclose(turned, half - [0.3, 0, 0], atol=ROUNDING)
        # The mean of two matrices shortens the radius to cos(angle / 2).
        linear, _ = move(point, pairs, palette, lbs)
        assert np.hypot(*linear[1:]) == pytest.approx(np.cos(angle / 2))


def test_twist_of_180_degrees_keeps_the_radius():
    palette = [np.eye(4), matrix(np.diag([1.0, -1.0, -1.0]))]
    for point in ((0.3, 1.0, 0.0), (0.0, 0.6, 0.8)):
        moved, _ = move(point, [(0, 0.5), (1, 0.5)], palette)
        assert np.hypot(*moved[1:]) == pytest.approx(1.0)
        assert moved[0] == pytest.approx(point[0])
        assert_allclose(move(point, [(0, 0.5), (1, 0.5)], palette, lbs)[0], [point[0], 0, 0])


def middle_screw(first, second):
    """Return the motion halfway along the screw from one rigid motion to another.

    The formula uses no quaternions: the relative motion is a rotation by ``angle`` about an axis
    through a point and a translation along that axis. Half of the motion is half the rotation and
    half the translation.
    """
    relative = second @ np.linalg.inv(first)
    turn, shift = relative[:3, :3], relative[:3, 3]
    angle = np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    axis /= np.linalg.norm(axis)
    slide = axis @ shift
    center = np.linalg.lstsq(np.eye(3) - turn, shift - slide * axis, rcond=None)[0]
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    half = np.eye(3) + np.sin(angle / 2) * cross + (1 - np.cos(angle / 2)) * cross @ cross
    return matrix(half, center - half @ center + 0.5 * slide * axis) @ first


@pytest.mark.parametrize("seed", range(12))
def test_equal_weights_meet_halfway_along_the_screw(seed):
    rng = np.random.default_rng(seed)
    first, second = random_rigid(rng, 2)
    point = rng.normal(size=3)
    moved, turned = move(point, [(0, 0.5), (1, 0.5)], [first, second])
    middle = middle_screw(first, second)
    assert_allclose(moved, (middle @ [*point, 1])[:3], atol=1e-13)
    assert_allclose(turned, middle[:3, :3] @ [0.6, 0, 0.8], atol=1e-13)


def test_result_does_not_depend_on_the_origin():
    """Blending follows the screw motion, so moving all joints moves the result equally."""
    rng = np.random.default_rng(3)
    palette, shift = random_rigid(rng, 3), matrix(turn_y(1.0), (10, -20, 5))
    pairs, point = [(0, 0.2), (1, 0.5), (2, 0.3)], rng.normal(size=3)
    moved, _ = move(point, pairs, palette)
    elsewhere = [shift @ motion @ np.linalg.inv(shift) for motion in palette]
    again, _ = move((shift @ [*point, 1])[:3], pairs, elsewhere)
    assert_allclose(again, (shift @ [*moved, 1])[:3], atol=1e-12)


@pytest.mark.parametrize("angle", [2.0, 3.0, 3.5, 5.0, 6.2])
def test_rotations_take_the_shorter_arc(angle):
    """Joints at angle and angle + 0.4: the mean is angle + 0.2, regardless of the sign of w."""
    palette = [matrix(turn_y(angle)), matrix(turn_y(angle + 0.4))]
    for pairs in ([(0, 0.5), (1, 0.5)], [(1, 0.5), (0, 0.5)]):
        moved, _ = move((1, 2, 3), pairs, palette)
        assert_allclose(moved, turn_y(angle + 0.2) @ [1, 2, 3], atol=ROUNDING)


def test_chain_rotated_by_more_than_180_degrees_blends_across_its_last_joint():
    # Ten joints of 50 degrees each: 450 and 500 degrees meet at 475.
    bones = skeleton([-1, *range(9)], [(joint, "z", np.radians(50)) for joint in range(10)])
    skin = bound([[(8, 0.5), (9, 0.5)]], 10)
    figure = Figure("chain", mesh([[1.0, 0, 0]]), bones, skin)
    expected = turn_z(np.radians(475)) @ [1, 0, 0]
    assert_allclose(deform(figure, method="dqs")[0][0], expected, atol=ROUNDING)


def test_hemisphere_is_that_of_the_strongest_influence():
    # The joints are at 0, 100 and 200 degrees about z; 100 has the largest weight, and both other
    # rotations differ from it by less than 180.
    angles = np.radians([0.0, 100.0, 200.0])
    palette = [matrix(turn_z(angle)) for angle in angles]
    weights = [0.25, 0.5, 0.25]
    half = np.array([np.sin(angles / 2), np.cos(angles / 2)]) @ weights
    expected = turn_z(2.0 * np.arctan2(*half)) @ [1, 0, 0]
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        moved, _ = move((1, 0, 0), [(j, weights[j]) for j in order], palette)
        assert_allclose(moved, expected, atol=ROUNDING)
    assert_allclose(expected, turn_z(angles[1]) @ [1, 0, 0], atol=ROUNDING)


def test_order_of_influences_does_not_matter():
    rng = np.random.default_rng(4)
    palette = random_rigid(rng, 6)
    weights = rng.dirichlet(np.ones(6))
    pairs = [(joint, float(weights[joint])) for joint in range(6)]
    expected, _ = move((1, 2, 3), pairs, palette)
    for _ in range(10):
        mixed = [pairs[index] for index in rng.permutation(6)]
        assert_allclose(move((1, 2, 3), mixed, palette)[0], expected, atol=ROUNDING)


def test_weights_are_relative_to_their_sum():
    expected, _ = move((1, 2, 3), [(0, 0.75), (1, 0.25)], RIGID)
    for factor in (0.1, 0.998, 4.0, -2.0):
        pairs = [(0, 0.75 * factor), (1, 0.25 * factor)]
        assert_allclose(move((1, 2, 3), pairs, RIGID)[0], expected, atol=1e-13)


def test_weights_of_a_joint_listed_twice_are_added():
    once, _ = move((1, 2, 3), [(0, 0.75), (1, 0.25)], RIGID)
    twice, _ = move((1, 2, 3), [(0, 0.375), (1, 0.25), (0, 0.375)], RIGID)
    assert_allclose(twice, once, atol=ROUNDING)


@pytest.mark.parametrize("pairs", [[], [(0, 0.0)], [(0, 1.0), (1, -1.0)], [(0, 0.5), (0, -0.5)]])
def test_vertex_without_influence_or_with_cancelling_weights_does_not_move(pairs):
    moved, turned = move((1, 2, 3), pairs, RIGID)
    assert moved.tolist() == [1, 2, 3]
    assert_allclose(turned, [0.6, 0, 0.8], atol=ROUNDING)


@pytest.mark.parametrize("chunk", [1, 7, 100])
def test_chunk_size_does_not_change_results(monkeypatch, chunk):
    rng = np.random.default_rng(5)
    influences = [
        [(int(rng.integers(5)), float(rng.uniform(0.1, 1))) for _ in range(rng.integers(0, 4))]
        for _ in range(50)
    ]
    positions, normals = rng.normal(size=(2, 50, 3))
    skin, palette = bound(influences, 5), np.array(random_rigid(rng, 5))
    expected = dqs.deform(positions, normals, skin, palette)
    monkeypatch.setattr(dqs, "_CHUNK", chunk)
    found = dqs.deform(positions, normals, skin, palette)
    assert np.array_equal(found[0], expected[0])
    assert np.array_equal(found[1], expected[1])


def test_mesh_without_vertices_stays_empty():
    none = np.zeros((0, 3))
    assert dqs.deform(none, none, bound([], 2), np.array(RIGID[:2]))[0].shape == (0, 3)


@pytest.mark.parametrize("blend_factor", [0.0, 0.25, 0.5, 1.0])
def test_mix_interpolates_linearly_between_both_methods(blend_factor):
    figure = random_arm(6)
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = np.random.default_rng(7).uniform(-2, 2, 21)
    linear, dual = deform(figure, pose), deform(figure, pose, "dqs")
    positions, normals = deform(figure, pose, Skinning("mix", blend_factor=blend_factor))
    assert_allclose(positions, linear[0] + blend_factor * (dual[0] - linear[0]), atol=ROUNDING)
    between = linear[1] + blend_factor * (dual[1] - linear[1])
    between /= np.linalg.norm(between, axis=1, keepdims=True)
    assert_allclose(normals, between, atol=1e-13)


def test_mix_uses_half_of_each_method_by_default():
    palette = [np.eye(4), matrix(turn_x(np.pi / 2))]
    moved, _ = move((0, 1, 0), [(0, 0.5), (1, 0.5)], palette, mix)
    # LBS returns (0, 1/2, 1/2), DQS a point on the circle at 45 degrees.
    assert_allclose(moved, [0, *[(0.5 + np.sqrt(0.5)) / 2] * 2], atol=ROUNDING)


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
