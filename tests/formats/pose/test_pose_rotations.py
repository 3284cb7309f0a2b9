"""Joint rotations in pose files: bit-exact round trips, and refusal of invalid rotations."""

import json
from pathlib import Path

import numpy as np
import pytest
from faults import fault_of, told, warnings_of
from numpy.testing import assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.formats import pose
from viewer.formats._source import Source
from viewer.rig.posing.pose_record import PoseRecord
from viewer.rig.retargeting.pose_transfer import JointRotations

NAMES = ("root", "", "left knee", "knee", "knee")
ROWS = np.array([[0.5, 0.5, 0.5, 0.5], [0, 0, 0, 1], [0.6, 0, 0, 0.8], [0, 1, 0, 0], [0, 0, -1, 0]])
BENEATH = ROWS[::-1] / 3  # of any length, because they are not normalised
SHIFTS = np.arange(15.0).reshape(5, 3) / 7
GOOD = {"dofs": {"a.x": 1.0}, "joint_names": ["a"], "joint_turns": [[0, 0, 0, 1]]}


def turns(shifts=SHIFTS, rotations=None) -> JointRotations:
    return JointRotations("some cat", NAMES, ROWS, shifts, "z", "0123abcd", rotations)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@pytest.mark.parametrize("shifts", [SHIFTS, np.zeros((5, 3))])
def test_rotations_round_trip(tmp_path: Path, suffix, shifts):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, joint_rotations=turns(shifts)), path)
    source = Source(path, path.read_bytes())
    found = pose.read(source).joint_rotations
    assert source.warnings == []
    assert (found.figure, found.names, found.up, found.layout) == (
        "some cat", NAMES, "z", "0123abcd",
    )  # fmt: skip
    assert_array_equal(found.relative, ROWS)
    assert_array_equal(found.shifts, shifts)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_rotations_below_the_dofs_round_trip(tmp_path: Path, suffix):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, joint_rotations=turns(rotations=BENEATH)), path)
    source = Source(path, path.read_bytes())
    assert_array_equal(pose.read(source).joint_rotations.rotations, BENEATH)
    assert source.warnings == []


def test_rest_values_are_not_written():
    named = json.loads(
        pose.pose_text(PoseRecord(dofs={"a.x": 1.0}, joint_rotations=turns(0 * SHIFTS)))
    )
    assert "joint_turns" in named
    assert "joint_rotations" not in named and "joint_shifts" not in named


def test_edited_dof_of_a_saved_pose_takes_precedence():
    skeleton = viewer.Skeleton(
        names=("hip", "knee"),
        parents=np.array([-1, 0]),
        rest_translations=np.zeros((2, 3)),
        rest_rotations=np.tile([0.0, 0, 0, 1], (2, 1)),
        rest_scales=np.ones((2, 3)),
        dof_joints=np.array([0, 1]),
        dof_kinds=np.array([3, 3]),
        rest_dofs=np.zeros(2),
        dof_limits=np.array([[-1.0, 1.0]] * 2),
    )
    figure = viewer.Figure("legs", skeleton=skeleton)
    posed = viewer.rest_pose(skeleton)
    posed.dofs[:] = 0.25, 0.5
    posed.rotations[1] = 0.0, 0.6, 0.0, 0.8
    values = json.loads(pose.pose_text(viewer.record_of(figure, posed)))
    values["dofs"] |= {"hip.x": -0.5, "knee.x": 7.0}
    record = pose.read(Source("a.json", json.dumps(values).encode()))
    found = viewer.rest_pose(skeleton)
    notes = viewer.apply_record(record, figure, found)
    assert told(notes) == [("F007.pose-clamped", {"n": 1})]
    assert found.dofs.tolist() == [-0.5, 1.0]
    assert found.rotations.tolist() == [[0, 0, 0, 1], [0, 0.6, 0, 0.8]]


def read(**values):
    return pose.read(Source("a.json", json.dumps(GOOD | values).encode()))


def test_file_may_have_only_names_and_rotations():
    found = read(joint_turns=[[0, 0, 0, 2]]).joint_rotations
    assert found.relative.tolist() == [[0, 0, 0, 1]] and found.shifts.tolist() == [[0, 0, 0]]
    assert found.rotations is None
    assert (found.figure, found.up, found.layout) == ("", "y", "")


def test_keys_of_rotations_are_ignored_without_rotations():
    source = Source("a.json", b'{"dofs": {"a.x": 1}, "joint_names": 3, "up": "y"}')
    assert pose.read(source).joint_rotations is None
    assert warnings_of(source.diagnostics) == [
        ("F007.pose-keys", 1, {"keys": ["joint_names", "up"]})
    ]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"joint_names": None}, ("F002.pose-array", 1, {"item": "joint_names",
         "expected": "names", "found": "None"})),
        ({"joint_names": [1]}, ("F002.pose-array", 1, {"item": "joint_names",
         "expected": "names", "found": "1"})),
        ({"joint_names": "a"}, ("F002.pose-list", 1, {"item": "joint_names", "found": 0})),
        ({"joint_names": ["a", "b"]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "2 x 4 numbers", "found": "1 x 4"})),
        ({"joint_turns": [[0, 0, 1]]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "1 x 4 numbers", "found": "1 x 3"})),
        ({"joint_turns": 1}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "1 x 4 numbers", "found": "a single number"})),
        ({"joint_turns": "a"}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "numbers", "found": "'a'"})),
        ({"joint_turns": [[0, 0], [1]]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "numbers", "found": "ragged lists"})),
        ({"joint_turns": [[0, 0, 0, 0]]}, ("F002.pose-quaternion", 1, {"item": "joint_turns",
         "joint": "a"})),
        ({"joint_turns": [[0, 0, 0, 1e300]]}, ("F003.pose-number", 1, {"item": "joint_turns",
         "found": 1e300})),
        ({"joint_shifts": [[0, 0]]}, ("F002.pose-array", 1, {"item": "joint_shifts",
         "expected": "1 x 3 numbers", "found": "1 x 2"})),
        ({"joint_rotations": [[0, 0, 1]]}, ("F002.pose-array", 1, {"item": "joint_rotations",
         "expected": "1 x 4 numbers", "found": "1 x 3"})),
        ({"joint_rotations": [[0, 0, 0, 0]]}, ("F002.pose-quaternion", 1,
         {"item": "joint_rotations", "joint": "a"})),
        ({"up": "x"}, ("F002.pose-up", 1, {"found": "x"})),
        ({"up": 3}, ("F002.pose-word", 1, {"item": "up", "found": "3"})),
        ({"dof_layout": [1]}, ("F002.pose-word", 1, {"item": "dof_layout",
         "found": "a list of length 1"})),
    ],
)  # fmt: skip
def test_invalid_rotations_are_refused(values, message):
    with pytest.raises(FormatError) as caught:
        read(**values)
    assert str(caught.value).startswith("a.json:1: ")
    assert fault_of(caught.value.diagnostic) == message
