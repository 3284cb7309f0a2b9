"""Poses as vectors, rotations of joints, text and parameters."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from builders import axis_turn, quaternion_matrix
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from linting.sound import make_skeleton
from numpy.testing import assert_allclose
from rigs.hand_made import skeleton, turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.formats import Source, read
from viewer.rigs.figure import Figure
from viewer.rigs.motion.body_motion import parameter_pose
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import joint_rotations, rest_pose, rotation_rows, set_joint_rotations
from viewer.rigs.posing.dof_text import beyond_text, dof_value_text
from viewer.rigs.posing.joint_rotation import nearest_dofs, rotates_freely, rotation_dofs
from viewer.rigs.posing.pose_vector import PoseLayout, own_numbers, read_vector, write_vector
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skinning import deform

BALLS = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 1]), np.eye(4, 3))
SMPL = PoseLayout(12, 3 * np.arange(4), np.zeros(4, bool))
# The layout of PIG: translation, root angles about z, y, x, rotation vectors of the other joints,
# scale.
PIG = PoseLayout(16, 3 + 3 * np.arange(4), np.arange(4) == 0, translation=0, scale=15)


def about(vector):
    """Return the rotation about an axis by the series of the matrix exponential."""
    x, y, z = np.asarray(vector) / 64.0
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    term, total = np.eye(3), np.eye(3)
    for power in range(1, 15):
        term = term @ cross / power
        total = total + term
    return np.linalg.matrix_power(total, 64)


def posed(layout, vector, bones=BALLS):
    pose = rest_pose(bones)
    read_vector(layout, bones, pose, np.asarray(vector, dtype=float))
    return pose


def test_smpl_numbers_are_rotation_vectors():
    vector = np.random.default_rng(0).uniform(-1.5, 1.5, 12)
    found = joint_rotations(BALLS, posed(SMPL, vector))
    assert_allclose(found, [about(row) for row in vector.reshape(4, 3)], atol=1e-13)


def test_pig_root_is_rotated_about_x_then_y_then_z():
    vector = np.arange(16) / 10.0
    pose = posed(PIG, vector)
    found = joint_rotations(BALLS, pose)
    # The first value rotates about z: R = Rz(0.3) Ry(0.4) Rx(0.5).
    assert_allclose(found[0], turn_z(0.3) @ turn_y(0.4) @ turn_x(0.5), atol=1e-15)
    for joint in (1, 2, 3):
        assert_allclose(found[joint], about(vector[3 + 3 * joint : 6 + 3 * joint]), atol=1e-13)
    assert pose.figure_translation.tolist() == [0.0, 0.1, 0.2]
    assert pose.figure_scale == 1.5


@pytest.mark.parametrize("layout", [SMPL, PIG], ids=["smpl", "pig"])
def test_pose_values_round_trip(layout):
    rng = np.random.default_rng(1)
    for _ in range(20):
        vector = rng.uniform(-1.5, 1.5, layout.n_numbers)
        found = write_vector(layout, BALLS, posed(layout, vector))
        assert_allclose(found, vector, atol=1e-12)


def test_long_vectors_round_trip_as_the_same_rotation():
    vector = np.zeros(12)
    vector[3:6] = 0.0, 5.0, 0.0
    assert_allclose(write_vector(SMPL, BALLS, posed(SMPL, vector))[4], 5.0 - 2.0 * np.pi)


def test_pig_root_at_a_right_angle_about_y_keeps_its_rotation():
    vector = np.zeros(16)
    vector[3:6] = 0.7, np.pi / 2, -0.4
    z, y, x = write_vector(PIG, BALLS, posed(PIG, vector))[3:6]
    wanted = turn_z(0.7) @ turn_y(np.pi / 2) @ turn_x(-0.4)
    assert_allclose(turn_z(z) @ turn_y(y) @ turn_x(x), wanted, atol=1e-13)


def test_raw_pose_values_are_those_of_each_joint():
    root = turn_z(0.3) @ turn_y(0.4) @ turn_x(0.5)
    rotations = np.array([root, about([0.1, 0.2, 0.3]), np.eye(3), np.eye(3)])
    expected = [[0.3, 0.4, 0.5], [0.1, 0.2, 0.3], [0, 0, 0], [0, 0, 0]]
    assert_allclose(own_numbers(PIG, rotations), expected, atol=1e-14)


def test_values_may_be_in_a_different_order_than_the_joints():
    layout = PoseLayout(13, [9, 0, 6, 3], np.zeros(4, bool), scale=12)
    vector = np.zeros(13)
    vector[0], vector[12] = 0.5, 2.0
    pose = posed(layout, vector)
    assert pose.dofs.reshape(4, 3)[1].tolist() == [0.5, 0, 0]
    assert pose.figure_scale == 2.0
    assert_allclose(write_vector(layout, BALLS, pose), vector, atol=1e-15)


def test_model_without_layout_uses_its_dofs():
    bones = skeleton([-1, 0], [(0, "tx", 0.0), (1, "z", 0.0, -1.0, 1.0)])
    pose = posed(None, [3.0, 2.0], bones)
    assert pose.dofs.tolist() == [3.0, 1.0]  # the second DOF is clamped to its limits
    written = write_vector(None, bones, pose)
    assert written.tolist() == [3.0, 1.0]
    written[0] = 9.0  # changing the returned copy does not change the pose
    assert pose.dofs[0] == 3.0


@pytest.mark.parametrize(("layout", "count"), [(SMPL, 12), (PIG, 16), (None, 12)])
@pytest.mark.parametrize("extra", [-1, 1, 3])
def test_wrong_number_of_values_is_refused(layout, count, extra):
    pose = rest_pose(BALLS)
    with pytest.raises(RigError) as caught:
        read_vector(layout, BALLS, pose, np.ones(count + extra))
    assert str(caught.value) == f"expected {count} pose numbers, found {count + extra}"
    assert not pose.dofs.any()


def test_reading_a_vector_does_not_change_shape_weights():
    pose = rest_pose(BALLS)
    pose.shape_weights = np.array([1.0, 2.0])
    read_vector(SMPL, BALLS, pose, np.ones(12))
    assert pose.shape_weights.tolist() == [1.0, 2.0]


def test_rotation_rows_are_only_those_of_ball_joints():
    dofs = [(0, "x", 0.0), (0, "y", 0.0), (0, "z", 0.0)]
    dofs += [(1, "z", 0.0), (1, "y", 0.0), (1, "x", 0.0)]  # in another order
    dofs += [(2, "x", 0.0), (2, "z", 0.0)]
    dofs += [(3, "tx", 0.0), (3, "x", 0.0), (3, "y", 0.0), (3, "z", 0.0)]
    dofs += [(4, "x", 0.0), (4, "y", 0.0), (4, "z", 0.0), (4, "x", 0.0)]
    bones = skeleton([-1, 0, 1, 2, 3, 4], dofs)
    found = rotation_rows(bones).tolist()
    assert found == [[0, 1, 2], [-1] * 3, [-1] * 3, [9, 10, 11], [-1] * 3, [-1] * 3]


@pytest.mark.parametrize(
    "axes", ["xyz", "zyx", "xz", "y", "", "xyx"], ids=lambda axes: axes or "none"
)
@pytest.mark.parametrize("turned_rest", [False, True])
def test_any_joint_accepts_any_rotation(axes, turned_rest):
    bones = skeleton([-1, 0], [(1, axis, 0.3) for axis in axes])
    if turned_rest:
        bones = replace(bones, rest_rotations=[[0, 0, 0, 1], [0.5, 0.5, 0.5, 0.5]])
    wanted = about([0.4, -0.9, 2.0])
    pose = rest_pose(bones)
    set_joint_rotations(bones, pose, np.array([1]), wanted[None])
    found = joint_rotations(bones, pose)
    assert_allclose(found, [np.eye(3), wanted], atol=1e-14)


def test_limits_apply_to_ball_joints_unless_disabled():
    bones = skeleton([-1], [(0, "x", 0.0, -0.1, 0.1), (0, "y", 0.0), (0, "z", 0.0)])
    pose = rest_pose(bones)
    joint = np.array([0])
    set_joint_rotations(bones, pose, joint, turn_x(0.5)[None])
    assert_allclose(pose.dofs, [0.1, 0, 0], atol=1e-15)
    set_joint_rotations(bones, pose, joint, turn_x(0.5)[None], "dofs")
    assert_allclose(pose.dofs, [0.5, 0, 0], atol=1e-15)


def test_motion_beyond_limits_is_posed_as_it_is_exported():
    dofs = [(joint, axis, 0.0, -0.2, 0.3) for joint in range(2) for axis in "xyz"]
    bones = replace(skeleton([-1, 0], dofs), rest_rotations=[[0, 0, 0, 1], [0.5, 0.5, 0.5, 0.5]])
    # About z by 0.25, and about (1, 2, 2) / 3 by 2 radians.
    sine, cosine = np.sin(1.0) / 3.0, np.cos(1.0)
    turned = [[0, 0, np.sin(0.125), np.cos(0.125)], [sine, 2 * sine, 2 * sine, cosine]]
    clip = SampledClip("c", Timing(1.0, [0, 1]), np.array([turned[::-1], turned]))
    actor = Actor(Figure("f", skeleton=bones), clip=clip)
    pose_actors([actor], 1.0)
    wanted = [turn_z(0.25), about(np.array([1.0, 2.0, 2.0]) * 2.0 / 3.0)]
    assert_allclose(joint_rotations(bones, actor.pose), wanted, atol=1e-14)
    assert (actor.pose.dofs >= -0.2).all() and (actor.pose.dofs <= 0.3).all()
    # Within the limits, the DOFs have all of the rotation.
    assert_allclose(actor.pose.dofs[:3], [0, 0, 0.25], atol=1e-15)
    assert actor.pose.rotations[0].tolist() == [0, 0, 0, 1]
    assert actor.pose.dofs[5] in (-0.2, 0.3)


def test_rotation_beyond_a_hinge_is_stored_in_its_quaternion():
    bones = skeleton([-1], [(0, "x", 0.5, 0.25, 2.0)])
    pose = rest_pose(bones)
    set_joint_rotations(bones, pose, np.array([0]), turn_x(0.75)[None])
    assert pose.dofs.tolist() == [0.25]
    assert_allclose(pose.rotations, [[np.sin(0.25), 0, 0, np.cos(0.25)]], atol=1e-15)


def test_only_the_selected_joints_rotate():
    pose = rest_pose(BALLS)
    pose.dofs[:] = 0.25
    set_joint_rotations(BALLS, pose, np.array([2]), np.eye(3)[None])
    assert pose.dofs.tolist() == [0.25] * 6 + [0.0] * 3 + [0.25] * 3


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (([0.5], [False]), "starts: expected whole numbers that fit int32"),
        (([0, 3], [False]), "is_euler: expected shape 2, found 1"),
    ],
)
def test_layout_refuses_parts_that_do_not_fit(parts, message):
    with pytest.raises(RigError) as caught:
        PoseLayout(6, *parts)
    assert str(caught.value) == message


FREE = (-np.inf, np.inf)


def single(axes: str, *limits: tuple[float, float], quaternion=(0, 0, 0, 1)) -> Skeleton:
    """Return one joint that rotates about some axes, the first letter applied first."""
    bounds = np.array([*limits, *([FREE] * (len(axes) - len(limits)))], float).reshape(-1, 2)
    return Skeleton(
        names=("joint",),
        parents=np.array([-1]),
        rest_translations=np.zeros((1, 3)),
        rest_rotations=np.array([quaternion], float),
        rest_scales=np.ones((1, 3)),
        dof_joints=np.zeros(len(axes), int),
        dof_kinds=np.array([3 + "xyz".index(axis) for axis in axes], int),
        rest_dofs=np.clip(np.zeros(len(axes)), *bounds.T),
        dof_limits=bounds,
    )


@pytest.mark.parametrize("order", ["".join(order) for order in itertools.permutations("xyz")])
def test_rotation_about_three_axes_in_any_order_is_exact(order):
    skeleton = single(order, quaternion=(0.1, -0.3, 0.2, 0.9))
    pose = rest_pose(skeleton)
    for seed in range(20):
        random = np.random.default_rng(seed)
        q = random.standard_normal(4)
        q /= np.linalg.norm(q)
        wanted = quaternion_matrix(q)
        found = nearest_dofs(skeleton, pose, 0, wanted)
        pose.dofs[:] = found.dofs
        assert_allclose(joint_rotations(skeleton, pose)[0], wanted, atol=1e-12)
        assert found.error < 1e-7 and len(found.limited) == 0


def test_axes_are_applied_in_the_order_of_the_rows():
    # Rows z, x, y: z is applied first, so R = Ry Rx Rz.
    angles = np.array([0.3, -0.4, 1.1])
    wanted = axis_turn(1, 1.1) @ axis_turn(0, -0.4) @ axis_turn(2, 0.3)
    skeleton = single("zxy")
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
    assert_allclose(found.dofs, angles, atol=1e-12)


def test_solution_nearer_the_current_values_is_chosen():
    skeleton = single("xyz")
    pose = rest_pose(skeleton)
    # With y beyond a right angle, the rotation equals that of (x + pi, pi - y, z + pi).
    pose.dofs[:] = 0.1, 2.0, 0.2
    wanted = axis_turn(2, 0.25) @ axis_turn(1, 2.1) @ axis_turn(0, 0.05)
    assert_allclose(nearest_dofs(skeleton, pose, 0, wanted).dofs, [0.05, 2.1, 0.25], atol=1e-9)
    # Multiples of 360 degrees are preserved too.
    pose.dofs[:] = 0.1 + 4 * np.pi, 2.0, 0.2
    found = nearest_dofs(skeleton, pose, 0, wanted).dofs
    assert_allclose(found, [0.05 + 4 * np.pi, 2.1, 0.25], atol=1e-9)


def test_limits_select_the_allowed_solution():
    # Only y between 1.6 and 2.5 is allowed; the principal solution has y below pi / 2.
    skeleton = single("xyz", FREE, (1.6, 2.5), FREE)
    wanted = axis_turn(2, 0.4) @ axis_turn(1, 2.2) @ axis_turn(0, -0.3)
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
    assert_allclose(found.dofs, [-0.3, 2.2, 0.4], atol=1e-9)


def test_solution_360_degrees_away_within_the_limits_is_found():
    skeleton = single("x", (2 * np.pi + 0.1, 2 * np.pi + 1.0))
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, axis_turn(0, 0.5))
    assert_allclose(found.dofs, [2 * np.pi + 0.5], atol=1e-12)


def test_rotation_beyond_a_limit_is_replaced_by_the_nearest_and_its_dof_named():
    skeleton = single("xyz", (-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5))
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, axis_turn(1, 0.8))
    assert_allclose(found.dofs, [0, 0.5, 0], atol=1e-9)
    assert found.limited.tolist() == [1]
    assert found.error == pytest.approx(0.3)


def test_no_rotation_within_the_limits_is_nearer():
    limits = ((-0.6, 0.4), (-0.3, 0.7), (-0.5, 0.2))
    skeleton = single("xyz", *limits)
    grids = [np.linspace(low, high, 15) for low, high in limits]
    for seed in range(6):
        a, b, c = np.random.default_rng(seed).uniform(-1.2, 1.2, 3)
        wanted = axis_turn(2, c) @ axis_turn(1, b) @ axis_turn(0, a)
        found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
        best = max(
            np.trace(wanted.T @ axis_turn(2, z) @ axis_turn(1, y) @ axis_turn(0, x))
            for x, y, z in itertools.product(*grids)
        )
        x, y, z = found.dofs
        ours = np.trace(wanted.T @ axis_turn(2, z) @ axis_turn(1, y) @ axis_turn(0, x))
        assert ours >= best - 1e-9
        assert (found.dofs >= skeleton.dof_limits[:, 0]).all()
        assert (found.dofs <= skeleton.dof_limits[:, 1]).all()


def test_single_axis_takes_the_twist_about_it():
    skeleton = single("y")
    # For Ry(0.7) Rx(0.2), a single axis y is rotated by 0.7, because the trace is symmetric in x.
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, axis_turn(1, 0.7) @ axis_turn(0, 0.2))
    t = np.linspace(-np.pi, np.pi, 100_001)
    wanted = axis_turn(1, 0.7) @ axis_turn(0, 0.2)
    traces = (
        wanted[1, 1]
        + (wanted[0, 0] + wanted[2, 2]) * np.cos(t)
        + (wanted[0, 2] - wanted[2, 0]) * np.sin(t)
    )
    assert found.dofs[0] == pytest.approx(t[traces.argmax()], abs=1e-4)
    assert found.error > 0.1 and len(found.limited) == 0


def test_joint_without_rotations_is_unchanged():
    skeleton = single("")
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, axis_turn(2, 0.5))
    assert found.dofs.shape == (0,) and found.error == pytest.approx(0.5)


def test_start_is_not_modified():
    skeleton = single("xyz")
    pose = rest_pose(skeleton)
    nearest_dofs(skeleton, pose, 0, axis_turn(2, 0.5))
    assert not pose.dofs.any()


def test_locked_dofs_are_ignored():
    assert rotates_freely(single("zyx"), 0)
    assert not rotates_freely(single("xyz", (0.2, 0.2)), 0)
    assert not rotates_freely(single("xyx"), 0)
    assert not rotates_freely(single("xy"), 0)
    assert rotation_dofs(single("xyz", (0.2, 0.2)), 0, free=True).tolist() == [1, 2]
    assert rotation_dofs(single("xyz", (0.2, 0.2)), 0).tolist() == [0, 1, 2]


def head(low: float, high: float) -> Skeleton:
    return make_skeleton(("head",), [-1], [[0, 0, 0]], (low, high))


def test_angles_are_in_degrees_and_lengths_in_file_units():
    skeleton = head(-1.0, 1.0)
    assert dof_value_text(skeleton, 4, math.pi / 6) == "30.0°"
    assert dof_value_text(skeleton, 4, -0.0) == "0.0°"
    assert dof_value_text(skeleton, 1, 0.25) == "0.25"


def test_value_and_limits_are_shown_together():
    # 0.3 and 0.5 radians are 17.188734 and 28.647890 degrees.
    text = str(beyond_text(head(0.3, 0.5), 4, 0.0, " in frame 7"))
    assert text == "head.y is 0.0° in frame 7; its limits are 17.2° and 28.6°"


def test_value_just_beyond_a_limit_is_distinguishable():
    # 1e-5 radians are 0.00057 degrees.
    text = str(beyond_text(head(0.3, 0.5), 4, 0.50001))
    assert text == "head.y is 28.6485°; its limits are 17.1887° and 28.6479°"


@pytest.mark.parametrize(
    ("low", "high", "value", "text"),
    [
        (-np.inf, math.pi, 2.0 * math.pi, "head.y is 360.0°; its maximum is 180.0°"),
        (0.0, np.inf, -math.pi, "head.y is -180.0°; its minimum is 0.0°"),
    ],
)
def test_single_limit_is_named(low, high, value, text):
    assert str(beyond_text(head(low, high), 4, value)) == text


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return read(Source.open(write(tmp_path_factory.mktemp("mhr"))))


def test_pose_has_the_vertices_of_the_published_equations(figure):
    generator = np.random.default_rng(11)
    identity, expression = generator.normal(size=N_IDENTITY), generator.normal(size=N_EXPRESSIONS)
    parameters = generator.normal(size=len(NAMES))
    pose = parameter_pose(figure, parameters, identity, expression)
    wanted = forward(identity, parameters, expression)[0]
    assert_allclose(deform(figure, pose)[0], wanted, atol=1e-10)


def test_wrong_counts_and_figures_without_parameters_are_refused(figure):
    parameters = np.zeros(len(NAMES))
    with pytest.raises(RigError, match="46"):
        parameter_pose(figure, parameters, np.ones(46), np.zeros(1))
    with pytest.raises(RigError, match="8"):
        parameter_pose(figure, parameters[1:], np.zeros(45), np.zeros(1))
    with pytest.raises(RigError, match="no model parameters"):
        parameter_pose(Figure("arm", skeleton=skeleton([-1], [])), parameters, [], [])
