import numpy as np
import pytest
from rig.hand_made import skeleton

from viewer.errors import RigError
from viewer.rig.skeleton import (
    Skeleton,
    clamp_dofs,
    dof_label,
    find_dof,
    joint_label,
    joint_labels,
)

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
