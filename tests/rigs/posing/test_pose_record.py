"""Pose records: DOFs by name, pose vectors of models, parts of smplx, shape and placement."""

import numpy as np
import pytest
from builders import family_figure
from faults import told
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose
from rigs.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.pose import Pose, joint_rotations, pose_key, rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record, record_of
from viewer.rigs.posing.pose_vector import own_numbers


def vectors(figure: Figure, pose: Pose) -> np.ndarray:
    """Return every joint's rotation vector."""
    return own_numbers(figure.pose_layout, joint_rotations(figure.skeleton, pose))


def applied(figure: Figure, **words) -> tuple[np.ndarray, list[str]]:
    """Apply a record to the rest pose; return the rotation vectors of the joints and the notes."""
    pose = figure_pose(figure)
    notes = apply_record(PoseRecord(**words), figure, pose)
    return vectors(figure, pose), notes


def refusal(figure: Figure, **words) -> str:
    """Check that a record is refused without changing the pose; return the refusal."""
    pose = figure_pose(figure)
    pose.dofs[:] = 0.125
    before = pose_key(pose)
    with pytest.raises(RigError) as caught:
        apply_record(PoseRecord(translation=np.ones(3), **words), figure, pose)
    assert pose_key(pose) == before
    return str(caught.value)


def hinges() -> Figure:
    dofs = [(0, "tx", 0.5), (0, "x", 0.0, -1.0, 1.0), (1, "z", 0.0, -1.0, 1.0)]
    return Figure("hinges", skeleton=skeleton([-1, 0], dofs, names=["hip", "knee"]))


def test_dofs_are_set_by_name_and_others_unchanged():
    figure = hinges()
    pose = rest_pose(figure.skeleton)
    assert apply_record(PoseRecord(dofs={"knee.z": 0.75, "hip.x": -0.5}), figure, pose) == []
    assert pose.dofs.tolist() == [0.5, -0.5, 0.75]


def test_dofs_beyond_their_limits_are_clamped_and_counted():
    figure = hinges()
    pose = rest_pose(figure.skeleton)
    notes = apply_record(PoseRecord(dofs={"knee.z": 3.0, "hip.x": -2.0}), figure, pose)
    assert pose.dofs.tolist() == [0.5, -1.0, 1.0]
    assert told(notes) == [("F007.pose-clamped", {"n": 2})]


def test_unknown_dof_is_refused_and_the_pose_unchanged():
    message = refusal(hinges(), dofs={"knee.z": 0.5, "elbow.x": 1.0})
    assert message.startswith("expected a DOF of ") and message.endswith(
        'found "elbow.x": no joint is called "elbow"; there are 2: hip, knee'
    )


def test_malformed_dof_is_reported_once():
    message = refusal(hinges(), dofs={"knee.q": 0.5})
    assert message.count("knee.q") == 1 and ": expected JOINT.KIND with KIND" in message


def test_dofs_take_precedence_over_the_vector():
    figure = hinges()
    pose = rest_pose(figure.skeleton)
    apply_record(PoseRecord(dofs={"knee.z": 0.25}, vector=np.ones(3)), figure, pose)
    assert pose.dofs.tolist() == [0.5, 0.0, 0.25]


def test_figure_without_skeleton_is_refused():
    figure = Figure("bust", mesh([[0, 0, 0]]))
    with pytest.raises(RigError) as caught:
        apply_record(PoseRecord(), figure, rest_pose(skeleton([-1])))
    assert caught.value.diagnostic.key == "F004.pose"
    assert caught.value.diagnostic.values == {"figure": "bust"}


@pytest.mark.parametrize("kind", ["smpl", "smplh", "smplx", "mano", "flame"])
def test_raw_pose_vector_rotates_every_joint(family, kind):
    figure = family(kind)
    wanted = np.random.default_rng(0).uniform(-1, 1, (figure.skeleton.n_joints, 3))
    found, notes = applied(figure, vector=wanted.ravel())
    assert_allclose(found, wanted, atol=1e-13)
    assert notes == []


# ``shared``: first joint after the 22 body joints in the vector, in the figure, and their number.
@pytest.mark.parametrize(
    ("kind", "count", "shared", "left_out"),
    [
        ("smplx", 72, None, 2),
        ("smplx", 156, (22, 25, 30), 0),
        ("smplh", 165, (25, 22, 30), 3),
        ("smpl", 165, None, 33),
        ("smplh", 66, None, 0),
        ("smpl", 66, None, 0),
    ],
)
def test_vector_of_another_family_member_is_matched_by_joint_names(
    family, kind, count, shared, left_out
):
    figure = family(kind)
    wanted = np.random.default_rng(1).uniform(-1, 1, (count // 3, 3))
    expected = np.zeros((figure.skeleton.n_joints, 3))
    expected[:22] = wanted[:22]
    if shared:
        source, target, joints = shared
        expected[target : target + joints] = wanted[source : source + joints]
    found, notes = applied(figure, vector=wanted.ravel())
    assert_allclose(found, expected, atol=1e-13)
    said = [("F007.pose-joints-left-out", {"n": left_out, "figure": figure.name})]
    assert told(notes) == (said if left_out else [])


def test_joints_missing_in_the_vector_are_set_to_rest(family):
    figure = family("smplx")
    pose = figure_pose(figure)
    pose.dofs[:] = 0.1
    apply_record(PoseRecord(vector=np.zeros(72)), figure, pose)
    assert not pose.dofs.any()


def test_mano_accepts_a_left_or_right_hand(family):
    wanted = np.random.default_rng(7).uniform(-0.5, 0.5, 45)
    found, notes = applied(family("mano"), parts={"left_hand_pose": wanted})
    assert_allclose(found[1:].ravel(), wanted, atol=1e-13)
    assert notes == []


@pytest.mark.parametrize("scale", [0.0, -2.0, 1e-300, 1e300])
def test_invalid_scale_is_ignored(family, scale):
    figure = family("smpl")
    pose = figure_pose(figure)
    pose.figure_scale = 1.5
    notes = apply_record(PoseRecord(scale=scale), figure, pose)
    assert pose.figure_scale == 1.5
    ((key, values),) = told(notes)
    assert (key, values["scale"]) == ("F007.scale-kept", 1.5)
    assert values["fault"].values["found"] == scale


def test_extreme_placement_is_ignored_and_extreme_shape_refused(family):
    figure = family("smpl")
    pose = figure_pose(figure)
    notes = apply_record(PoseRecord(translation=np.array([1e300, 0, 0])), figure, pose)
    fault = "translation: expected at most 1e+09, found 1e+300"
    assert told(notes) == [("F007.translation-kept", {"fault": fault})]
    assert not pose.figure_translation.any()
    message = refusal(figure, shape=np.array([1e300]))
    assert message == "shape coefficients: expected at most 1e+06, found 1e+300"


def test_hands_at_rest_of_another_family_member_cause_no_note(family):
    wanted = np.zeros(72)
    wanted[:66] = 0.1
    assert applied(family("smplx"), vector=wanted)[1] == []


@pytest.mark.parametrize(
    ("kind", "count", "own"),
    [("smpl", 71, 72), ("smpl", 63, 72), ("mano", 72, 48), ("flame", 165, 15)],
)
def test_vector_of_unknown_length_is_refused(family, kind, count, own):
    figure = family(kind)
    message = refusal(figure, vector=np.ones(count))
    assert message == f"expected {own} pose values for {figure.name}, found {count}"


def test_body_pose_starts_after_the_root(family):
    wanted = np.random.default_rng(2).uniform(-1, 1, (21, 3))
    found, notes = applied(family("smplx"), parts={"body_pose": wanted.ravel()})
    assert_allclose(found[1:22], wanted, atol=1e-13)
    assert not found[0].any()
    assert not found[22:].any()
    assert notes == []
    # The pose vector of SMPL itself also includes the two hands.
    wanted = np.random.default_rng(3).uniform(-1, 1, (23, 3))
    assert_allclose(applied(family("smpl"), parts={"body_pose": wanted})[0][1:], wanted, atol=1e-13)


def test_body_pose_of_another_length_is_refused(family):
    message = "body_pose: expected 3 numbers per joint for at most 23 joints, found "
    for kind, count in (("smpl", 72), ("smpl", 64), ("smpl", 2), ("smplx", 72), ("smplx", 65)):
        found = refusal(family(kind), parts={"body_pose": np.ones(count)})
        assert found == f"{message}{count} numbers"


@pytest.mark.parametrize(
    ("part", "kind", "joint"),
    [
        ("global_orient", "smplx", 0),
        ("global_orient", "mano", 0),
        ("global_orient", "flame", 0),
        ("jaw_pose", "smplx", 22),
        ("leye_pose", "smplx", 23),
        ("reye_pose", "smplx", 24),
        ("neck_pose", "flame", 1),
        ("jaw_pose", "flame", 2),
    ],
)
def test_single_joints_are_set_by_smplx_names(family, part, kind, joint):
    found, notes = applied(family(kind), parts={part: np.array([0.1, -0.2, 0.3])})
    assert_allclose(found[joint], [0.1, -0.2, 0.3], atol=1e-14)
    assert not np.delete(found, joint, axis=0).any()
    assert notes == []


def test_missing_part_is_reported_unless_at_rest(family):
    figure = family("smpl")
    assert applied(figure, parts={"jaw_pose": np.zeros(3)})[1] == []
    found, notes = applied(figure, parts={"jaw_pose": np.ones(3)})
    assert told(notes) == [("F007.part-left-out", {"part": "jaw_pose", "figure": figure.name})]
    assert not found.any()


def test_single_joint_requires_three_numbers(family):
    message = refusal(family("smplx"), parts={"jaw_pose": np.ones(6)})
    assert message == "jaw_pose: expected 3 numbers, found 6"


HANDS = [("smplx", "left", 25), ("smplx", "right", 40), ("smplh", "left", 22), ("mano", "", 1)]


def hand_arrays(kind, side):
    arrays = model(kind)
    return arrays[f"hands_components{side[:1]}"], arrays[f"hands_mean{side[:1]}"]


@pytest.mark.parametrize(("kind", "side", "first"), HANDS)
@pytest.mark.parametrize("flat", [None, True, False])
def test_few_numbers_are_hand_coefficients(family, kind, side, first, flat):
    components, mean = hand_arrays(kind, side)
    part = f"{side}_hand_pose" if side else "hand_pose"
    weights = np.array([0.5, -0.25, 0.125])
    expected = 0.5 * components[0] - 0.25 * components[1] + 0.125 * components[2]
    if not flat:  # not stated, or False
        expected = expected + mean
    found, _ = applied(family(kind), parts={part: weights}, flat_hands=flat)
    assert_allclose(found[first : first + 15].ravel(), expected, atol=1e-13)
    assert not np.delete(found, range(first, first + 15), axis=0).any()


@pytest.mark.parametrize(("kind", "side", "first"), HANDS)
@pytest.mark.parametrize("flat", [None, True, False])
def test_forty_five_numbers_are_rotation_vectors_by_default(family, kind, side, first, flat):
    _, mean = hand_arrays(kind, side)
    part = f"{side}_hand_pose" if side else "hand_pose"
    wanted = np.random.default_rng(4).uniform(-0.5, 0.5, 45)
    expected = wanted + mean if flat is False else wanted
    found, _ = applied(family(kind), parts={part: wanted}, flat_hands=flat)
    assert_allclose(found[first : first + 15].ravel(), expected, atol=1e-13)


def test_forty_five_numbers_are_coefficients_if_the_file_states_so(family):
    components, mean = hand_arrays("smplx", "left")
    weights = np.zeros(45)
    weights[44] = 0.5
    words = {"parts": {"left_hand_pose": weights}, "hand_coefficients": True}
    found, _ = applied(family("smplx"), **words)
    assert_allclose(found[25:40].ravel(), 0.5 * components[44] + mean, atol=1e-13)


def test_hand_of_another_length_is_refused(family):
    figure = family("smplx")
    message = refusal(figure, parts={"left_hand_pose": np.ones(46)})
    assert message == "expected at most 45 hand coefficients, found 46"
    words = {"parts": {"left_hand_pose": np.ones(12)}, "hand_coefficients": False}
    assert refusal(figure, **words) == "left_hand_pose: expected 45 numbers, found 12"


def test_fingers_without_components_accept_only_rotation_vectors(tmp_path):
    none = {f"hands_{what}{side}": None for what in ("components", "mean") for side in "lr"}
    figure = family_figure("smplh", tmp_path, **none)
    wanted = np.random.default_rng(5).uniform(-0.5, 0.5, 45)
    found, notes = applied(figure, parts={"right_hand_pose": wanted})
    assert_allclose(found[37:].ravel(), wanted, atol=1e-13)
    assert notes == []
    found, notes = applied(figure, parts={"right_hand_pose": np.ones(6)})
    values = {"part": "right_hand_pose", "figure": figure.name}
    assert told(notes) == [("F007.hand-part-left-out", values)]
    assert not found.any()


def test_shape_and_expression_are_set_separately(family):
    figure = family("smplx")
    pose = figure_pose(figure)
    pose.shape_weights[:] = 9.0
    apply_record(PoseRecord(shape=np.array([1.0, 2.0])), figure, pose)
    assert pose.shape_weights.tolist() == [1, 2, *[0] * 8, *[9] * 10]
    apply_record(PoseRecord(expression=np.array([3.0])), figure, pose)
    assert pose.shape_weights.tolist() == [1, 2, *[0] * 8, 3, *[0] * 9]


def test_coefficients_beyond_those_of_the_figure_must_be_zero(family):
    figure = family("smpl")
    pose = figure_pose(figure)
    apply_record(PoseRecord(shape=np.array([1.0] * 10 + [0.0] * 290)), figure, pose)
    assert pose.shape_weights.tolist() == [1.0] * 10
    message = refusal(figure, shape=np.ones(16))
    assert message == f"{figure.name} has 10 shape coefficients, found 16"
    message = refusal(figure, expression=np.ones(1))
    assert message == f"{figure.name} has 0 expression coefficients, found 1"


def test_coefficients_beyond_those_of_the_figure_can_be_left_out(family):
    figure = family("smpl")
    pose = figure_pose(figure)
    record = PoseRecord(shape=np.array([0.5] * 14 + [-3.0, 0.0]), expression=np.array([2.0]))
    shape = {"group": "shape", "first": 11, "last": 16, "most": 10, "largest": 3.0}
    face = {"group": "expression", "first": 1, "last": 1, "most": 0, "largest": 2.0}
    assert told(apply_record(record, figure, pose, drop_excess=True)) == [
        ("F007.coefficients-left-out", {**shape, "figure": figure.name}),
        ("F007.coefficient-left-out", {**face, "figure": figure.name}),
    ]
    assert pose.shape_weights.tolist() == [0.5] * 10


def test_shapes_for_a_figure_without_shapes_are_refused():
    rig = Figure("bones", skeleton=skeleton((-1,)))
    with pytest.raises(RigError) as caught:
        apply_record(PoseRecord(shape=np.ones(3)), rig, figure_pose(rig), drop_excess=True)
    assert str(caught.value) == "bones has 0 shape coefficients, found 3"


def test_placement_is_applied_and_missing_values_are_unchanged(family):
    figure = family("smpl")
    pose = figure_pose(figure)
    pose.dofs[:] = 0.1
    apply_record(PoseRecord(translation=np.array([1, 2, 3]), scale=2), figure, pose)
    assert pose.figure_translation.tolist() == [1, 2, 3]
    assert pose.figure_scale == 2.0
    apply_record(PoseRecord(), figure, pose)
    assert pose.figure_translation.tolist() == [1, 2, 3]
    assert pose.dofs.tolist() == [0.1] * 72


def test_pose_shares_no_array_with_its_record(family):
    figure = family("smpl")
    pose, moved = figure_pose(figure), np.zeros(3)
    apply_record(PoseRecord(translation=moved), figure, pose)
    pose.figure_translation[0] = 5.0
    assert moved[0] == 0.0


@pytest.mark.parametrize("kind", ["smpl", "smplx", "mano"])
def test_pose_record_round_trips(family, kind):
    figure = family(kind)
    rng = np.random.default_rng(6)
    pose = figure_pose(figure)
    pose.dofs[:] = rng.uniform(-1, 1, len(pose.dofs))
    pose.shape_weights[:] = rng.normal(size=len(pose.shape_weights))
    pose.figure_scale, pose.figure_translation[:] = 1.5, rng.normal(size=3)
    again = figure_pose(figure)
    assert apply_record(record_of(figure, pose), figure, again) == []
    assert pose_key(again) == pose_key(pose)


def test_record_contains_labels_and_raw_pose_values(family):
    figure = family("smplx")
    pose = figure_pose(figure)
    pose.dofs[3 * 4] = 0.5  # left knee about x
    pose.shape_weights[[0, 10]] = 1.0, 2.0
    record = record_of(figure, pose)
    assert record.dofs["left_knee.x"] == 0.5
    assert len(record.dofs) == 165
    assert_allclose(record.vector[12:15], [0.5, 0, 0], atol=1e-15)
    assert record.shape.tolist() == [1.0, *[0.0] * 9]
    assert record.expression.tolist() == [2.0, *[0.0] * 9]


def test_record_of_a_figure_without_shapes_has_no_shapes():
    figure = hinges()
    record = record_of(figure, rest_pose(figure.skeleton))
    assert record.shape is None and record.expression is None
    assert record.vector.tolist() == [0.5, 0.0, 0.0]
