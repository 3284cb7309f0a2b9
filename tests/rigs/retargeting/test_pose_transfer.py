"""Transfer of poses between figures with unequal DOF orders, rest rotations, up axes and joints."""

import json
from dataclasses import replace

import numpy as np
import pytest
from builders import axis_turn
from faults import told
from numpy.testing import assert_allclose
from rigs.retargeting.two_people import BODY, figure_of

from viewer.errors import RigError
from viewer.formats.pose import named_rotations
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.humanoid import HUMAN_BONES, Humanoid
from viewer.rigs.pose import joint_rotations, pose_key, rest_pose
from viewer.rigs.posing.pose_record import apply_record, record_of
from viewer.rigs.retargeting.pose_transfer import (
    dof_layout,
    joints_by_name,
    relative_rotations,
    rotate_joints,
)
from viewer.rigs.skeleton import Skeleton

HALF = np.sqrt(0.5)


def figure(names, orders, name="one", up="y", rest=None, limits=None, parents=None) -> Figure:
    """Return a chain of joints, each of which rotates about its axes, the first axis first."""
    dofs = [(joint, "xyz".index(axis)) for joint, word in enumerate(orders) for axis in word]
    count = len(names)
    bounds = np.tile([-np.inf, np.inf], (len(dofs), 1)) if limits is None else np.array(limits)
    skeleton = Skeleton(
        names=tuple(names),
        parents=np.arange(count) - 1 if parents is None else np.array(parents),
        rest_translations=np.tile([0.0, 1.0, 0.0], (count, 1)),
        rest_rotations=np.tile([0.0, 0, 0, 1], (count, 1)) if rest is None else np.array(rest),
        rest_scales=np.ones((count, 3)),
        dof_joints=np.array([joint for joint, _ in dofs], int),
        dof_kinds=np.array([3 + axis for _, axis in dofs], int),
        rest_dofs=np.clip(np.zeros(len(dofs)), *bounds.T),
        dof_limits=bounds,
    )
    return Figure(name=name, skeleton=skeleton, up=up)


def transfer_pose(one, pose, other, start):
    return rotate_joints(relative_rotations(one, pose), other, start)


def shares_dofs(one, other):
    return dof_layout(one) == dof_layout(other)


def posed(fig, *dofs):
    pose = rest_pose(fig.skeleton)
    pose.dofs[:] = dofs
    return pose


def test_different_order_of_dofs_gets_the_same_rotation():
    one, other = figure("ab", ["xyz", "xyz"]), figure("ab", ["zxy", "yzx"], "other")
    angles = 0.3, -0.5, 0.8, 1.0, 0.2, -0.7
    pose, notes = transfer_pose(one, posed(one, *angles), other, rest_pose(other.skeleton))
    z, x, y = pose.dofs[:3]
    first = axis_turn(2, 0.8) @ axis_turn(1, -0.5) @ axis_turn(0, 0.3)
    assert_allclose(axis_turn(1, y) @ axis_turn(0, x) @ axis_turn(2, z), first, atol=1e-12)
    y, z, x = pose.dofs[3:]
    second = axis_turn(2, -0.7) @ axis_turn(1, 0.2) @ axis_turn(0, 1.0)
    assert_allclose(axis_turn(0, x) @ axis_turn(2, z) @ axis_turn(1, y), second, atol=1e-12)
    assert told(notes) == [("F007.joints-taken-over", {"n": 2, "all": 2, "figure": "one"})]


def test_rotations_and_not_equally_named_dofs_are_transferred():
    # The rotation is transferred, so the values of DOFs with equal names differ.
    one, other = figure("a", ["xyz"]), figure("a", ["zyx"], "other")
    pose, _ = transfer_pose(one, posed(one, 0.5, 0.6, 0.7), other, rest_pose(other.skeleton))
    z, y, x = pose.dofs
    assert np.abs([x - 0.5, y - 0.6, z - 0.7]).max() > 0.1


def test_missing_joints_are_listed_and_others_unchanged():
    one = figure(["a", "b", "tail", "tip"], ["xyz"] * 4, "cat")
    other = figure(["a", "b", "hat"], ["xyz"] * 3, "man")
    start = posed(other, *np.zeros(6), 0.1, 0.2, 0.3)
    pose, notes = transfer_pose(one, posed(one, *[0.2] * 12), other, start)
    assert told(notes) == [
        ("F007.joints-taken-over", {"n": 2, "all": 4, "figure": "cat"}),
        ("F007.joints-lacking", {"figure": "man", "names": ["tail", "tip"]}),
    ]
    assert_allclose(pose.dofs, [0.2] * 6 + [0.1, 0.2, 0.3], atol=1e-12)
    assert_allclose(start.dofs[:6], 0)


def test_extra_joint_in_between_is_compensated():
    # In the target, "b" is the child of an extra joint rotated by 0.3, which b compensates.
    one = figure(["a", "b"], ["xyz", "xyz"])
    other = figure(["a", "extra", "b"], ["xyz"] * 3, "other")
    start = posed(other, 0, 0, 0, 0, 0, 0.3, 0, 0, 0)
    pose, _ = transfer_pose(one, posed(one, 0, 0, 0.2, 0, 0, 0.5), other, start)
    assert_allclose(pose.dofs[[2, 5, 8]], [0.2, 0.3, 0.2], atol=1e-12)


def test_rest_rotations_may_differ():
    # The target's joint has a rest rotation of 90 degrees about x, so a rotation about the world's
    # y is one about the joint's -z: Rx(-90) y = -z.
    one = figure("a", ["xyz"])
    other = figure("a", ["xyz"], "other", rest=[[HALF, 0, 0, HALF]])
    pose, _ = transfer_pose(one, posed(one, 0, 0.4, 0), other, rest_pose(other.skeleton))
    # W = Ry(0.4) Rx(90) = Rx(90) R'  =>  R' = Rx(-90) Ry(0.4) Rx(90) = Rz(-0.4).
    assert_allclose(pose.dofs, [0, 0, -0.4], atol=1e-12)


def test_up_axes_may_differ():
    # The rotation is about the up axis, which is y in one figure and z in the other.
    one, other = figure("a", ["xyz"]), figure("a", ["xyz"], "other", up="z")
    pose, _ = transfer_pose(one, posed(one, 0, 0.4, 0), other, rest_pose(other.skeleton))
    assert_allclose(pose.dofs, [0, 0, 0.4], atol=1e-12)
    back, _ = transfer_pose(other, posed(other, 0, 0, 0.4), one, rest_pose(one.skeleton))
    assert_allclose(back.dofs, [0, 0.4, 0], atol=1e-12)


def test_limits_and_missing_axes_are_applied_and_reported():
    one = figure("ab", ["xyz", "xyz"])
    other = figure("ab", ["xyz", "x"], "stiff", limits=[[-0.1, 0.1]] * 3 + [[0, 1]])
    pose, notes = transfer_pose(one, posed(one, 0.5, 0, 0, 0.4, 0, 0.2), other,
                                rest_pose(other.skeleton))  # fmt: skip
    assert_allclose(pose.dofs[:3], [0.1, 0, 0], atol=1e-9)
    # Rz(0.2) Rx(0.4) on an axis x: tan t = (1 + cos 0.2) sin 0.4 / ((1 + cos 0.2) cos 0.4).
    assert_allclose(pose.dofs[3], 0.4, atol=1e-9)
    assert told(notes)[1:] == [("F007.joints-limited", {"names": ["a", "b"]})]


def test_placement_scale_and_shape_are_unchanged():
    one, other = figure("a", ["xyz"]), figure("a", ["zyx"], "other")
    source = posed(one, 0.1, 0.2, 0.3)
    source.figure_translation[:] = 1, 2, 3
    source.figure_scale = 5.0
    start = rest_pose(other.skeleton)
    start.figure_scale = 0.5
    pose, _ = transfer_pose(one, source, other, start)
    assert pose.figure_scale == 0.5 and not pose.figure_translation.any()


def test_pose_without_common_joints_is_refused():
    one, other = figure("ab", ["xyz", "x"], "cat"), figure("cd", ["x", "x"], "man")
    with pytest.raises(RigError) as caught:
        transfer_pose(one, rest_pose(one.skeleton), other, rest_pose(other.skeleton))
    assert caught.value.diagnostic.key == "F004.no-common-joint"
    assert caught.value.diagnostic.values == {"pose": "cat", "figure": "man"}


def test_repeated_and_empty_names_are_not_matched():
    one = figure(["a", "leg", "leg", ""], ["x"] * 4)
    other = figure(["leg", "a", ""], ["x"] * 3)
    assert joints_by_name(one.skeleton.names, other.skeleton.names).tolist() == [-1, 0, -1]


def test_values_are_copied_only_for_equal_dofs_rest_pose_and_up_axis():
    one = figure("ab", ["xyz", "xyz"])
    assert shares_dofs(one, one) and shares_dofs(one, figure("ab", ["xyz", "xyz"], "other"))
    assert shares_dofs(one, shaped(one, 3)) and shares_dofs(shaped(one, 10), shaped(one, 8))
    assert not shares_dofs(one, figure("ab", ["xyz", "zyx"]))
    assert not shares_dofs(one, figure("ac", ["xyz", "xyz"]))
    assert not shares_dofs(one, figure("ab", ["xyz", "xyz"], up="z"))
    assert not shares_dofs(one, figure("ab", ["xyz", "xyz"], parents=[-1, -1]))
    assert not shares_dofs(one, figure("ab", ["xyz"] * 2, rest=[[0, 0, 0, 1], [HALF, 0, 0, HALF]]))


def test_long_lists_are_truncated():
    one = figure(["a", *(f"j{k}" for k in range(20))], ["xyz"] * 21)
    other = figure("a", ["zyx"], "man")
    _, notes = transfer_pose(one, rest_pose(one.skeleton), other, rest_pose(other.skeleton))
    names = [f"j{k}" for k in range(20)]
    assert told(notes)[1] == ("F007.joints-lacking", {"figure": "man", "names": names})


def test_rotations_are_relative_to_the_axes_of_the_figure():
    # The second joint rotates about x, its parent about z; the product is Rz(0.5) Rx(0.3).
    one = figure("ab", ["z", "x"])
    turns = relative_rotations(one, posed(one, 0.5, 0.3))
    assert_allclose(turns.relative[0], [0, 0, np.sin(0.25), np.cos(0.25)], atol=1e-12)
    c, s, cx, sx = np.cos(0.25), np.sin(0.25), np.cos(0.15), np.sin(0.15)
    assert_allclose(turns.relative[1], [c * sx, s * sx, s * cx, c * cx], atol=1e-12)
    assert (turns.figure, turns.names, turns.up) == ("one", ("a", "b"), "y")


def test_record_of_the_same_dofs_restores_rotations_below_the_dofs():
    # A motion has also rotated the hinge "b" about y, and moved it.
    one = figure("ab", ["xyz", "x"], rest=[[0, 0, 0, 1], [HALF, 0, 0, HALF]])
    pose = posed(one, 0.1, 0.2, 0.3, 0.4)
    pose.rotations[1] = 0.0, np.sin(0.35), 0.0, np.cos(0.35)
    pose.translations[1] = 0.5, 0.25, -1.0
    found = posed(one, 0, 0, 0, -1.0)
    found.rotations[0] = 0.0, 1.0, 0.0, 0.0
    assert apply_record(record_of(one, pose), one, found) == []
    assert found.rotations.tolist() == pose.rotations.tolist()
    assert found.dofs.tolist() == pose.dofs.tolist()
    assert found.translations.tolist() == pose.translations.tolist()


def test_record_for_different_dofs_rotates_joints_and_keeps_placement_and_scale():
    one, other = figure("ab", ["xyz", "xyz"], "cat"), figure("ab", ["zxy", "yzx"], "man")
    pose = posed(one, 0.3, -0.5, 0.8, 1.0, 0.2, -0.7)
    pose.figure_translation[:] = 1, 0, 0
    pose.figure_scale = 2.0
    found = rest_pose(other.skeleton)
    assert told(apply_record(record_of(one, pose), other, found)) == [
        ("F007.joints-taken-over", {"n": 2, "all": 2, "figure": "cat"}),
        ("F007.left-as-they-were", {"names": ["figure translation", "figure scale"]}),
    ]
    wanted = joint_rotations(one.skeleton, pose)
    assert_allclose(joint_rotations(other.skeleton, found), wanted, atol=1e-12)
    assert found.figure_scale == 1.0 and not found.figure_translation.any()


def test_refused_record_does_not_change_the_pose():
    one, other = figure("a", ["xyz"], "cat"), figure("b", ["x"], "man")
    found = rest_pose(other.skeleton)
    before = pose_key(found)
    with pytest.raises(RigError) as caught:
        apply_record(record_of(one, rest_pose(one.skeleton)), other, found)
    assert caught.value.diagnostic.key == "F004.no-common-joint"
    assert caught.value.diagnostic.values == {"pose": "cat", "figure": "man"}
    assert pose_key(found) == before


def test_handwritten_partial_record_keeps_rotations_below_the_dofs():
    one = figure("ab", ["xyz", "x"])
    found = rest_pose(one.skeleton)
    found.rotations[1] = 0.0, 1.0, 0.0, 0.0
    part = replace(record_of(one, posed(one, 0, 0, 0, 0.4)), dofs={"b.x": 0.25})
    assert apply_record(part, one, found) == []
    assert found.dofs.tolist() == [0, 0, 0, 0.25] and found.rotations[1].tolist() == [0, 1, 0, 0]


def test_edited_dofs_override_the_stored_rotations():
    one = figure("ab", ["xyz", "x"], rest=[[0, 0, 0, 1], [HALF, 0, 0, HALF]])
    record = record_of(one, posed(one, 0.1, 0.2, 0.3, 0.4))
    edited = replace(record, dofs={**record.dofs, "a.y": -0.5, "b.x": 0.25})
    found = posed(one, 1.0, 1.0, 1.0, 1.0)
    found.rotations[0] = 0.0, 1.0, 0.0, 0.0
    found.translations[1] = 1.0, 2.0, 3.0
    assert apply_record(edited, one, found) == []
    assert found.dofs.tolist() == [0.1, -0.5, 0.3, 0.25]
    assert found.rotations.tolist() == [[0, 0, 0, 1], [HALF, 0, 0, HALF]]
    assert not found.translations.any()
    # Relative to the parent the rotation is Rx(90) Rx(0.25), so the edit has its full effect.
    turned = axis_turn(0, np.pi / 2 + 0.25)
    assert_allclose(joint_rotations(one.skeleton, found)[1], turned, atol=1e-12)


def test_edited_dofs_keep_rotations_below_the_dofs():
    one = figure("ab", ["xyz", "x"])
    pose = posed(one, 0, 0, 0, 0.4)
    pose.rotations[1] = 0.0, np.sin(0.35), 0.0, np.cos(0.35)
    pose.translations[1] = 0.5, 0.25, -1.0
    record = record_of(one, pose)
    found = rest_pose(one.skeleton)
    assert apply_record(replace(record, dofs={**record.dofs, "b.x": -0.5}), one, found) == []
    wanted = axis_turn(1, 0.7) @ axis_turn(0, -0.5)
    assert_allclose(joint_rotations(one.skeleton, found)[1], wanted, atol=1e-12)
    assert found.translations.tolist() == [[0, 0, 0], [0.5, 0.25, -1.0]]


def test_edited_dof_beyond_its_limit_leaves_no_rotation_below_the_dofs():
    one = figure("a", ["xyz"], limits=[[-0.5, 0.5]] * 3)
    record = record_of(one, posed(one, 0.1, 0.2, 0.3))
    found = rest_pose(one.skeleton)
    notes = apply_record(replace(record, dofs={**record.dofs, "a.x": 2.0}), one, found)
    assert told(notes) == [("F007.pose-clamped", {"n": 1})]
    assert found.dofs.tolist() == [0.5, 0.2, 0.3]
    assert found.rotations.tolist() == [[0, 0, 0, 1]]


def test_partial_record_restores_rotations_below_its_dofs():
    one = figure("ab", ["xyz", "x"])
    pose = posed(one, 0, 0, 0, 0.4)
    pose.rotations[1] = 0.0, 1.0, 0.0, 0.0
    pose.translations[0] = 0.0, 2.0, 0.0
    found = posed(one, 0.1, 0, 0, 0)
    assert apply_record(replace(record_of(one, pose), dofs={"b.x": 0.25}), one, found) == []
    assert found.dofs.tolist() == [0.1, 0, 0, 0.25]
    assert found.rotations.tolist() == [[0, 0, 0, 1], [0, 1, 0, 0]]
    assert found.translations.tolist() == [[0, 2, 0], [0, 0, 0]]


def test_lists_of_another_length_than_the_skeleton_are_matched_by_name():
    # A joint was removed from the file's lists, but the digest of the DOFs was kept.
    one = figure("ab", ["xyz", "x"], "cat")
    record = record_of(one, posed(one, 0.1, 0, 0, 0.4))
    named = record.joint_rotations
    turns = replace(named, names=("a",), relative=named.relative[:1], shifts=named.shifts[:1],
                    rotations=np.array([[0, 0, 0, 1.0]]))  # fmt: skip
    found = posed(one, 0, 0, 0, 0.3)
    notes = apply_record(replace(record, joint_rotations=turns), one, found)
    assert told(notes) == [("F007.joints-taken-over", {"n": 1, "all": 1, "figure": "cat"})]
    assert_allclose(found.dofs, [0.1, 0, 0, 0.3], atol=1e-12)


def shaped(fig: Figure, shapes: int, expressions: int = 0) -> Figure:
    """Return a figure with blend shapes of both groups."""
    count = shapes + expressions
    groups = ("shape",) * shapes + ("expression",) * expressions
    names = tuple(f"s{row}" for row in range(count))
    return replace(fig, blend_shapes=BlendShapes(names, np.zeros((count, 0, 3)), groups))


def body_pose(fig: Figure):
    """Return a pose of a body with four shapes and two expressions, and a placement."""
    pose = posed(fig, 0.1, 0.2, 0.3, 0.4)
    pose.figure_translation[:] = 0, 1, 2
    pose.figure_scale = 1.2
    pose.shape_weights = np.array([2.0, -1.0, 0.5, 0.25, 3.0, -4.0])
    return pose


@pytest.mark.parametrize("cut", [False, True])
def test_pose_for_fewer_shapes_transfers_placement_scale_and_common_shapes(cut):
    bones = figure("ab", ["xyz", "x"])
    one, other = shaped(bones, 4, 2), replace(shaped(bones, 2, 1), name="kin")
    found = rest_pose(bones.skeleton)
    shape = {"first": 3, "last": 4, "most": 2, "largest": 0.5}
    face = {"first": 2, "last": 2, "most": 1, "largest": 4.0}
    assert told(apply_record(record_of(one, body_pose(one)), other, found, cut)) == [
        ("F007.coefficients-left-out", {"group": "shape", "figure": "kin", **shape}),
        ("F007.coefficient-left-out", {"group": "expression", "figure": "kin", **face}),
    ]
    assert found.dofs.tolist() == [0.1, 0.2, 0.3, 0.4]
    assert found.shape_weights.tolist() == [2, -1, 3]
    assert found.figure_translation.tolist() == [0, 1, 2] and found.figure_scale == 1.2


def test_pose_for_more_shapes_transfers_placement_scale_and_common_shapes():
    bones = figure("ab", ["xyz", "x"])
    one, other = shaped(bones, 4, 2), shaped(bones, 5, 3)
    found = rest_pose(bones.skeleton)
    found.shape_weights = np.ones(8)
    assert apply_record(record_of(one, body_pose(one)), other, found) == []
    assert found.shape_weights.tolist() == [2, -1, 0.5, 0.25, 0, 3, -4, 0]
    assert found.figure_translation.tolist() == [0, 1, 2] and found.figure_scale == 1.2


def test_pose_for_a_figure_without_shapes_reports_dropped_shapes():
    bones = figure("ab", ["xyz", "x"], "bones")
    one = shaped(bones, 4, 2)
    found = rest_pose(bones.skeleton)
    shape = {"first": 1, "last": 4, "most": 0, "largest": 2.0}
    face = {"first": 1, "last": 2, "most": 0, "largest": 4.0}
    assert told(apply_record(record_of(one, body_pose(one)), bones, found)) == [
        ("F007.coefficients-left-out", {"group": "shape", "figure": "bones", **shape}),
        ("F007.coefficients-left-out", {"group": "expression", "figure": "bones", **face}),
    ]
    assert found.dofs.tolist() == [0.1, 0.2, 0.3, 0.4] and found.shape_weights.size == 0
    assert found.figure_translation.tolist() == [0, 1, 2] and found.figure_scale == 1.2


def test_humanoids_exchange_poses_by_their_bones():
    half = np.diag([-1.0, 1.0, -1.0])  # VRM 0.x faces -z
    one, other = figure_of(BODY, "body"), figure_of(BODY, "hero", half)
    bones = {bone: list(BODY).index(name) for bone, name in HUMAN_BONES.items() if name in BODY}
    bones |= {"spine": 3, "chest": 6, "upperChest": 9}
    names = tuple(f"n{joint}" for joint in range(len(BODY)))
    stated = replace(other.require_skeleton(), names=names, humanoid=Humanoid(bones))
    other = replace(other, skeleton=stated)
    pose = rest_pose(one.require_skeleton())
    pose.dofs[:] = np.random.default_rng(5).uniform(-0.4, 0.4, len(pose.dofs))
    moved, notes = transfer_pose(one, pose, other, rest_pose(stated))
    assert notes[0].values["n"] == len(BODY)
    expected = half @ joint_rotations(one.require_skeleton(), pose) @ half
    assert_allclose(joint_rotations(stated, moved), expected, atol=1e-12)
    # The pose is transferred back through a file.
    text = json.loads(json.dumps(named_rotations(relative_rotations(other, moved))))
    assert text["left"] == [[-1.0, 0.0, 0.0]] and "left_hip" in text["joint_meanings"]
    back, _ = transfer_pose(other, moved, one, rest_pose(one.require_skeleton()))
    assert_allclose(back.dofs, pose.dofs, atol=1e-9)
