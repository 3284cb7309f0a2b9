"""Recognition of the joint names of many programs."""

import time

import numpy as np
import pytest
from rig.retargeting.joint_tables import TABLES

from viewer.rig.bodies.smpl_family import FAMILY
from viewer.rig.retargeting.joint_names import canonical_names


def tree(text: str) -> tuple[list[str], list[str], np.ndarray]:
    """Return names, their expected meanings ("-" for none) and parents of an indented list."""
    names, meanings, parents, above = [], [], [], []
    for line in text.strip("\n").split("\n"):
        depth = len(line) - len(line.lstrip())
        above = above[:depth]
        parents.append(above[-1] if above else -1)
        above.append(len(names))
        name, _, meaning = line.strip().partition(" = ")
        names.append(name)
        meanings.append("" if meaning == "-" else meaning)
    return names, meanings, np.array(parents, dtype=np.int32)


@pytest.mark.parametrize("table", TABLES)
def test_program_names_map_to_family_joints(table: str) -> None:
    names, meanings, parents = tree(TABLES[table])
    found = canonical_names(names, parents)
    assert dict(zip(names, found, strict=True)) == dict(zip(names, meanings, strict=True))


@pytest.mark.parametrize("count", [24, 52, 55, 16])
def test_family_names_map_to_themselves(count: int) -> None:
    member = FAMILY[count]
    assert canonical_names(member.names, np.array(member.parents)) == member.names


@pytest.mark.parametrize(
    "name",
    ["left_hip", "LeftHip", "L_Hip", "l_hip", "hip.L", "Hip_L", "hip_left", "LEFT_HIP", "lHip",
     "hip-l", "LeftThigh", "thigh.left", "L Thigh", "lthigh", "leftupleg", "ns:sub:LHip"],
)  # fmt: skip
def test_sides_are_recognised_at_either_end_of_a_name(name: str) -> None:
    assert canonical_names(["pelvis", name], np.array([-1, 0]))[1] == "left_hip"


def test_no_canonical_name_occurs_twice() -> None:
    names = ["Hips", "LeftShin", "LeftKnee", "Head", "Head"]
    found = canonical_names(names, np.array([-1, 0, 1, 0, 3]))
    assert found == ("pelvis", "left_knee", "", "head", "")


@pytest.mark.parametrize("word", ["leg", "index", "foot", "shoulder"])
def test_numbers_of_thousands_of_digits_are_no_error(word: str) -> None:
    names = ["hips", f"{word}_l", f"{word}{'1' * 5000}_l"]
    meanings = canonical_names(names, np.array([-1, 0, 1], dtype=np.int32))
    assert meanings[2] == ""


def test_unknown_names_have_no_canonical_name() -> None:
    names = ["", "bone1", "bone2", "left", "tail_01", "wing_02_r", "123", "é"]
    assert canonical_names(names, np.arange(8) - 1) == ("",) * 8


def test_huge_skeletons_are_not_bodies() -> None:
    start = time.process_time()
    assert set(canonical_names(["LeftArm"] * 50000, np.arange(50000) - 1)) == {""}
    deep = canonical_names(["spine", "LeftArm", "RightArm"] * 600, np.arange(1800) - 1)
    assert "spine1" in deep
    assert time.process_time() - start < 2.0
