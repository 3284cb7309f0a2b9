from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.hand_made import skeleton

import viewer
from viewer.errors import RigError
from viewer.rigs import kinematics
from viewer.rigs.figure import Figure
from viewer.rigs.hierarchy import cycle_members
from viewer.rigs.inspection.single_vertices import vertex_facts
from viewer.rigs.kinematics import posed_skeleton, skinning_matrices, world_matrices
from viewer.rigs.memo import NumberKey
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion import instances
from viewer.rigs.motion.instances import posed_worlds
from viewer.rigs.pose import pose_key, pose_of
from viewer.rigs.scalars._inputs import Asked
from viewer.rigs.scalars.weights import weight
from viewer.rigs.skeleton import (
    Skeleton,
    ball_skeleton,
    clamp_dofs,
    dof_label,
    find_dof,
    joint_label,
    joint_labels,
    shown_joint_of,
    shown_joints,
    shown_parents,
)
from viewer.rigs.skin import idle_joints, skin_from_lists
from viewer.rigs.skinning import Skinning

LEG = skeleton(
    [-1, 0, 1, 0],
    [(0, "ty", 0.0), (0, "x", 0.0), (1, "x", 0.0), (1, "z", 0.5, 0.5, 0.5), (2, "y", 0.0)],
    names=["root", "knee", "", "knee"],
)


def build(**changes) -> Skeleton:
    parts = {
        "names": ("a", "b"),
        "parents": [-1, 0],
        "rest_translations": np.zeros((2, 3)),
        "rest_rotations": [[0, 0, 0, 1]] * 2,
        "rest_scales": np.ones((2, 3)),
        "dof_joints": [0, 1],
        "dof_kinds": [3, 4],
        "rest_dofs": [0.0, 0.0],
        "dof_limits": [[-1, 1], [-np.inf, np.inf]],
    }
    return Skeleton(**{**parts, **changes})


def test_skeleton_counts_joints_and_dofs():
    assert (LEG.n_joints, LEG.n_dofs) == (4, 5)


def test_skeleton_arrays_cannot_be_changed():
    for name in ("parents", "rest_translations", "dof_limits", "rest_dofs", "dof_kinds"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(LEG, name)[0] = 0


def test_locked_dofs_have_equal_limits():
    assert LEG.locked.tolist() == [False, False, False, True, False]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parents": [-1]}, "parents: expected shape 2, found 1"),
        ({"parents": [-1, 1]}, "joint b: expected a parent before it, found 1"),
        ({"parents": [1, -1]}, "joint a: expected a parent before it, found 1"),
        ({"parents": [0, 0]}, "joint a: expected a parent before it, found 0"),
        ({"parents": [-1, -2]}, "joint b: expected a parent before it, found -2"),
        ({"rest_dofs": [0.0]}, "rest_dofs: expected shape 2, found 1"),
        ({"rest_dofs": [0.0, np.nan]}, "rest_dofs: expected finite numbers, found nan at index 1"),
        ({"dof_limits": [[0, 1]]}, "dof_limits: expected shape 2 x 2 without NaN"),
        (
            {"dof_limits": [[np.nan, 1], [0, 1]]},
            "dof_limits: expected shape 2 x 2 without NaN",
        ),
        (
            {"dof_limits": [[-1, 1], [2, 1]]},
            "dof_limits of b.y: expected a minimum not above the maximum, found 2 and 1",
        ),
        ({"dof_joints": [0, 2]}, "dof_joints: expected 0 to 1, found 2"),
        ({"dof_joints": [-1, 0]}, "dof_joints: expected 0 to 1, found -1"),
        ({"dof_kinds": [0, 6]}, "dof_kinds: expected 0 to 5, found 6"),
        (
            {"rest_rotations": [[0, 0, 0, 1], [0, 0, 0, 0]]},
            "rest_rotations of joint b: expected a quaternion, found 0 0 0 0",
        ),
        ({"boxes": np.zeros((2, 3))}, "boxes: expected shape 2 x 2 x 3, found 2 x 3"),
    ],
)
def test_skeleton_refuses_inconsistent_parts(changes, message):
    with pytest.raises(RigError) as caught:
        build(**changes)
    assert str(caught.value) == message


def test_skeleton_requires_a_joint():
    with pytest.raises(RigError) as caught:
        skeleton([], names=[])
    assert str(caught.value) == "a skeleton needs at least one joint"


def test_skeleton_may_have_several_roots():
    assert skeleton([-1, -1, 0]).parents.tolist() == [-1, -1, 0]


def test_clamp_dofs_moves_values_to_the_nearest_limit():
    limited = build(dof_limits=[[-1.0, 0.5], [2.0, 3.0]])
    values = np.array([[-9.0, 0.0], [0.25, 2.5], [9.0, 9.0]])
    assert clamp_dofs(limited, values).tolist() == [[-1.0, 2.0], [0.25, 2.5], [0.5, 3.0]]


def test_clamp_dofs_does_not_change_unlimited_values():
    assert clamp_dofs(
        build(dof_limits=[[-np.inf, np.inf]] * 2), np.array([1e30, -1e30])
    ).tolist() == [
        1e30,
        -1e30,
    ]


def test_joint_labels_distinguish_repeated_and_unnamed_joints():
    assert joint_labels(LEG) == ("root", "knee#1", "#2", "knee#3")
    assert tuple(joint_label(LEG, joint) for joint in range(4)) == joint_labels(LEG)


def test_dof_labels_join_joint_and_kind():
    labels = [dof_label(LEG, dof) for dof in range(5)]
    assert labels == ["root.ty", "root.x", "knee#1.x", "knee#1.z", "#2.y"]


def test_find_dof_finds_every_label():
    assert [find_dof(LEG, dof_label(LEG, dof)) for dof in range(5)] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("label", "dof"), [("ROOT.X", 1), ("root.TY", 0), ("#1.z", 3), ("KNEE#1.x", 2), ("#0.x", 1)]
)
def test_find_dof_accepts_any_case_and_a_bare_index(label, dof):
    assert find_dof(LEG, label) == dof


def test_find_dof_prefers_the_exact_case():
    both = skeleton([-1, 0], [(0, "x", 0.0), (1, "x", 0.0)], names=["Arm", "arm"])
    assert (find_dof(both, "arm.x"), find_dof(both, "Arm.x")) == (1, 0)


def test_find_dof_accepts_names_with_dots_and_spaces():
    dotted = skeleton([-1], [(0, "x", 0.0)], names=["left arm.001"])
    assert find_dof(dotted, "left arm.001.x") == 0


@pytest.mark.parametrize(
    ("label", "message"),
    [
        ("root", '"root": expected JOINT.KIND with KIND one of tx, ty, tz, x, y, z'),
        ("root.w", '"root.w": expected JOINT.KIND with KIND one of tx, ty, tz, x, y, z'),
        ("", '"": expected JOINT.KIND with KIND one of tx, ty, tz, x, y, z'),
        ("root.z", "joint root has no DOF z; it has ty, x"),
        ("knee.x", '"knee" is the name of 2 joints: use one of knee#1, knee#3'),
        ("knee#9.x", 'no joint is called "knee#9"; did you mean knee#1 or knee#3?'),
        ("toe.x", 'no joint is called "toe"; there are 4: root, knee#1, #2, knee#3'),
        ("root#1.x", 'no joint is called "root#1"; did you mean root?'),
    ],
)
def test_find_dof_reports_errors(label, message):
    with pytest.raises(RigError) as caught:
        find_dof(LEG, label)
    assert str(caught.value) == message


def test_find_dof_lists_only_the_first_joints():
    with pytest.raises(RigError) as caught:
        find_dof(skeleton([-1] * 21), "toe.x")
    assert str(caught.value) == 'no joint is called "toe"; there are 21: j0, j1, j2, j3, j4, j5, …'


def test_find_dof_refuses_an_index_of_5000_digits():
    with pytest.raises(RigError, match=r'^no joint is called "knee#9999'):
        find_dof(LEG, f"knee#{'9' * 5000}.x")


ARRAYS = ("dofs", "translations", "rotations", "scales", "shape_weights")
ORDER = 1e-14  # rounding, because matrices of many poses are multiplied in a different order


@pytest.fixture
def actor():
    actor = viewer.load().actors[0]
    actor.pose.shape_weights = np.zeros(2)
    actor.pose.dofs[:] = np.linspace(-0.2, 0.2, len(actor.pose.dofs))
    return actor


@pytest.fixture
def runs(monkeypatch):
    """A counter of the runs of forward kinematics."""
    counted, run = [], kinematics.joint_worlds

    def count(*args):
        counted.append(1)
        return run(*args)

    for module in (kinematics, instances):
        monkeypatch.setattr(module, "joint_worlds", count)
    return counted


def test_matrices_match_the_pose(actor):
    figure, pose = actor.figure, actor.pose
    posed, world = posed_skeleton(figure.skeleton, pose), world_matrices(figure.skeleton, pose)
    assert_array_equal(posed.world, world)
    assert_array_equal(
        posed.palette(figure.skin), skinning_matrices(world, figure.skin.inverse_bind)
    )


def test_kinematics_run_once_until_a_value_changes(actor, runs):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first = posed_skeleton(skeleton, pose)
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 1
    pose.figure_translation[0] += 1.0  # placement is applied after skinning
    pose.figure_scale = 2.0
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 1


@pytest.mark.parametrize("name", ARRAYS)
def test_every_joint_value_invalidates_the_cache(actor, name):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first, key = posed_skeleton(skeleton, pose), pose.skinning_key
    getattr(pose, name)[-1] += 0.25
    assert pose.skinning_key is not key and pose.skinning_key != key
    other = posed_skeleton(skeleton, pose)
    assert other is not first
    assert_array_equal(other.world, world_matrices(skeleton, pose))
    getattr(pose, name)[-1] -= 0.25
    assert_array_equal(posed_skeleton(skeleton, pose).world, first.world)


def test_different_skeleton_or_skin_has_separate_matrices(actor):
    figure, pose = actor.figure, actor.pose
    longer = replace(figure.skeleton, rest_translations=2.0 * figure.skeleton.rest_translations)
    first = posed_skeleton(figure.skeleton, pose)
    assert_array_equal(posed_skeleton(longer, pose).world, world_matrices(longer, pose))
    other = replace(figure.skin, inverse_bind=2.0 * figure.skin.inverse_bind)
    assert_array_equal(first.palette(other), 2.0 * first.palette(figure.skin))


def test_matrices_are_read_only(actor):
    posed = posed_skeleton(actor.figure.skeleton, actor.pose)
    for matrices in (posed.world, posed.palette(actor.figure.skin)):
        with pytest.raises(ValueError, match="read-only"):
            matrices[0] = 0.0


def test_copied_poses_have_separate_matrices(actor, runs):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first, copy = posed_skeleton(skeleton, pose), pose.copy()
    copy.dofs[0] += 0.5
    assert posed_skeleton(skeleton, copy) is not first
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 2


def test_poses_computed_together_cache_their_matrices(actor, runs):
    skeleton, poses = actor.figure.skeleton, [actor.pose.copy() for _ in range(3)]
    for row, pose in enumerate(poses):
        pose.dofs[:] *= row
    wanted = [world_matrices(skeleton, pose) for pose in poses]
    runs.clear()
    assert_allclose(posed_worlds(skeleton, poses), wanted, atol=ORDER)
    assert len(runs) == 1
    kept = [posed_skeleton(skeleton, pose) for pose in poses]
    assert_allclose([posed.world for posed in kept], wanted, atol=ORDER)
    assert len(runs) == 1
    poses[1].dofs[0] += 0.5
    wanted[1] = world_matrices(skeleton, poses[1])
    runs.clear()
    assert_allclose(posed_worlds(skeleton, poses), wanted, atol=ORDER)
    assert len(runs) == 1 and posed_skeleton(skeleton, poses[0]) is kept[0]


def test_pose_keys_record_and_restore_every_value(actor):
    pose, key = actor.pose, pose_key(actor.pose)
    again = pose_of(key)
    assert pose_key(again) == key
    for name in (*ARRAYS, "figure_translation"):
        assert_array_equal(getattr(again, name), getattr(pose, name))
        getattr(again, name)[-1] += 0.25
        assert pose_key(again) != key and pose_key(pose) == key
        again = pose_of(key)
    again.figure_scale = 2.0
    assert pose_key(again) != key


def test_keys_distinguish_array_layouts_and_sizes():
    square = np.arange(9.0).reshape(3, 3)
    key = NumberKey(square[:, ::2], np.zeros(0))
    assert key.updated(square[:, ::2], np.zeros(0)) is key
    assert key.updated(square[:, ::2].copy(), np.zeros(0)) is key
    for others in (square[:, 1::2], np.zeros(0)), (square[:, ::2],), (square[:, ::2], np.zeros(1)):
        assert key.updated(*others) == NumberKey(*others) != key
    assert key == NumberKey(square[:, ::2], np.zeros(0)) and key != NumberKey(square)
    assert hash(key) == hash(NumberKey(square[:, ::2], np.zeros(0))) and key != 1


def test_old_keys_keep_their_contents_after_an_update():
    first, second = np.arange(3.0), np.arange(2.0)
    key = NumberKey(first, second)
    second[1] = -0.0
    changed = key.updated(first, second)
    assert_array_equal(key.array(1), [0.0, 1.0])
    assert_array_equal(np.signbit(changed.array(1)), [False, True])
    second[1] = 1.0
    assert changed.updated(first, second) == key


def walks_back(parents: list[int], joint: int) -> bool:
    """Return whether the chain of parents of a joint returns to the joint."""
    at = joint
    for _ in parents:
        at = parents[at] if 0 <= at < len(parents) else -1
        if at == joint:
            return True
    return False


@pytest.mark.parametrize("seed", range(20))
def test_cycle_members_are_their_own_ancestors(seed):
    rng = np.random.default_rng(seed)
    parents = rng.integers(-1, 30, 30)
    expected = [walks_back(parents.tolist(), joint) for joint in range(30)]
    assert cycle_members(parents).tolist() == expected


def test_invalid_index_counts_as_no_parent():
    parents = np.array([-1.0, 0.5, np.nan, 99.0, -7.0, 5.0])
    assert cycle_members(parents).tolist() == [False] * 5 + [True]


def test_long_cycle_is_found():
    parents = np.roll(np.arange(1000), 1)
    assert cycle_members(parents).all()
    parents[0] = -1
    assert not cycle_members(parents).any()


@pytest.fixture
def figure():
    """A hip with an auxiliary child, which is the parent of the knee and moves a vertex."""
    parents = np.array([-1, 0, 1, 1], dtype=np.int32)
    joints = np.array([[0.0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]])
    skeleton = ball_skeleton(("hip", "", "knee", ""), parents, joints)
    skeleton = replace(skeleton, auxiliary=np.array([False, True, False, True]))
    skin = skin_from_lists([[(0, 0.25), (3, 0.5), (1, 0.25)]], np.tile(np.eye(4), (4, 1, 1)))
    mesh = Mesh(np.zeros((1, 3)), np.ones((1, 3)), np.zeros((0, 3), dtype=np.int32))
    return Figure("leg", mesh, skeleton, skin)


def test_lists_omit_auxiliary_joints(figure):
    skeleton = figure.skeleton
    assert shown_joints(skeleton).tolist() == [0, 2]
    assert shown_joint_of(skeleton).tolist() == [0, 0, 2, 0]
    assert shown_parents(skeleton).tolist() == [-1, 0, 0, 0]


def test_labels_of_auxiliary_joints_are_those_of_their_ancestors(figure):
    assert joint_labels(figure.skeleton) == ("hip", "hip", "knee", "hip")
    assert joint_label(figure.skeleton, 3) == "hip"


def test_influences_of_auxiliary_joints_are_those_of_their_ancestors(figure):
    facts = vertex_facts(figure, None, Skinning(), 0)
    assert facts.names == ("hip",)
    assert facts.weights.tolist() == [1.0]
    assert weight(Asked(figure, None, Skinning(), joint=0)).tolist() == [1.0]
    assert idle_joints(figure.skin, figure.skeleton).tolist() == [2]
