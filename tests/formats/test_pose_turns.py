"""Turns of joints in pose files: they come back to the bit, and broken ones are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from faults import lines
from numpy.testing import assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.formats import pose
from viewer.formats._source import Source
from viewer.rig.posing.pose_record import PoseRecord
from viewer.rig.retargeting.pose_transfer import JointTurns

NAMES = ("root", "", "left knee", "knee", "knee")
ROWS = np.array([[0.5, 0.5, 0.5, 0.5], [0, 0, 0, 1], [0.6, 0, 0, 0.8], [0, 1, 0, 0], [0, 0, -1, 0]])
BENEATH = ROWS[::-1] / 3  # of any length: they come back as they are
SHIFTS = np.arange(15.0).reshape(5, 3) / 7
GOOD = {"dofs": {"a.x": 1.0}, "joint_names": ["a"], "joint_turns": [[0, 0, 0, 1]]}


def turns(shifts=SHIFTS, rotations=None) -> JointTurns:
    return JointTurns("some cat", NAMES, ROWS, shifts, "z", "0123abcd", rotations)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@pytest.mark.parametrize("shifts", [SHIFTS, np.zeros((5, 3))])
def test_turns_come_back(tmp_path: Path, suffix, shifts):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, turns=turns(shifts)), path)
    source = Source(path, path.read_bytes())
    found = pose.read(source).turns
    assert source.warnings == []
    assert (found.figure, found.names, found.up, found.layout) == (
        "some cat", NAMES, "z", "0123abcd",
    )  # fmt: skip
    assert_array_equal(found.turns, ROWS)
    assert_array_equal(found.shifts, shifts)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_rotations_beneath_the_dofs_come_back(tmp_path: Path, suffix):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, turns=turns(rotations=BENEATH)), path)
    source = Source(path, path.read_bytes())
    assert_array_equal(pose.read(source).turns.rotations, BENEATH)
    assert source.warnings == []


def test_what_is_at_rest_is_not_written():
    named = json.loads(pose.pose_text(PoseRecord(dofs={"a.x": 1.0}, turns=turns(0 * SHIFTS))))
    assert "joint_turns" in named
    assert "joint_rotations" not in named and "joint_shifts" not in named


def test_edited_dof_of_a_saved_pose_is_what_a_figure_gets():
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
    assert lines(notes) == ["1 DOF of the pose was beyond its limits and clamped"]
    assert found.dofs.tolist() == [-0.5, 1.0]
    assert found.rotations.tolist() == [[0, 0, 0, 1], [0, 0.6, 0, 0.8]]


def read(**values):
    return pose.read(Source("a.json", json.dumps(GOOD | values).encode()))


def test_a_file_needs_no_more_than_names_and_turns():
    found = read(joint_turns=[[0, 0, 0, 2]]).turns
    assert found.turns.tolist() == [[0, 0, 0, 1]] and found.shifts.tolist() == [[0, 0, 0]]
    assert found.rotations is None
    assert (found.figure, found.up, found.layout) == ("", "y", "")


def test_without_turns_the_other_words_mean_nothing():
    source = Source("a.json", b'{"dofs": {"a.x": 1}, "joint_names": 3, "up": "y"}')
    assert pose.read(source).turns is None
    assert source.warnings == ["a.json:1: keys that mean nothing in a pose: joint_names, up"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"joint_names": None}, "joint_names: expected names, found nothing"),
        ({"joint_names": [1]}, "joint_names: expected names, found 1"),
        ({"joint_names": "a"}, "joint_names: expected a list of names, found 0 dimensions"),
        ({"joint_names": ["a", "b"]}, "joint_turns: expected 2 x 4 numbers, found 1 x 4"),
        ({"joint_turns": [[0, 0, 1]]}, "joint_turns: expected 1 x 4 numbers, found 1 x 3"),
        ({"joint_turns": 1}, "joint_turns: expected 1 x 4 numbers, found one number"),
        ({"joint_turns": "a"}, "joint_turns: expected numbers, found 'a'"),
        ({"joint_turns": [[0, 0], [1]]},
         "joint_turns: expected numbers, found lists of different lengths or depths"),
        ({"joint_turns": [[0, 0, 0, 0]]},
         "joint_turns: a: expected a quaternion, found four zeros"),
        ({"joint_turns": [[0, 0, 0, 1e300]]},
         "joint_turns: expected finite numbers, found 1e+300"),
        ({"joint_shifts": [[0, 0]]}, "joint_shifts: expected 1 x 3 numbers, found 1 x 2"),
        ({"joint_rotations": [[0, 0, 1]]},
         "joint_rotations: expected 1 x 4 numbers, found 1 x 3"),
        ({"joint_rotations": [[0, 0, 0, 0]]},
         "joint_rotations: a: expected a quaternion, found four zeros"),
        ({"up": "x"}, 'up: expected "y" or "z", found "x"'),
        ({"up": 3}, "up: expected a word, found 3"),
        ({"dof_layout": [1]}, "dof_layout: expected a word, found a list of 1"),
    ],
)  # fmt: skip
def test_broken_turns_are_refused(values, message):
    with pytest.raises(FormatError) as caught:
        read(**values)
    assert str(caught.value) == f"a.json:1: {message}"
