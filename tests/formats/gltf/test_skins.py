"""Skins: joints and inverse bind matrices."""

import numpy as np
import pytest
from formats.gltf.files import File, read, refused, skinned, warned

MOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]


def bound(matrices: list[list[float]]) -> File:
    file = skinned()
    file.root["skins"][0]["inverseBindMatrices"] = file.accessor(matrices)
    return file


def test_joints_and_matrices_are_read() -> None:
    [skin] = read(bound([MOVED, MOVED])).skins
    assert skin.joints.tolist() == [1, 2]
    assert skin.inverse_bind[1, :3, 3].tolist() == [1, 2, 3]


def test_missing_matrices_are_the_identity() -> None:
    [skin] = read(skinned()).skins
    assert skin.inverse_bind.tolist() == [np.eye(4).tolist()] * 2


def test_surplus_matrices_are_ignored_with_a_warning() -> None:
    file = bound([MOVED] * 3)
    assert read(file).skins[0].inverse_bind.shape == (2, 4, 4)
    assert warned(file) == [("G004.bind-count", "/skins/0/inverseBindMatrices")]


@pytest.mark.parametrize(
    ("matrices", "key"),
    [
        ([MOVED], "F002.gltf-bind-count"),
        ([MOVED, [*MOVED[:15], 2.0]], "F002.gltf-bind-row"),
        ([MOVED, [*MOVED[:3], 1.0, *MOVED[4:]]], "F002.gltf-bind-row"),
        ([[np.nan, *MOVED[1:]], MOVED], "F003.gltf-bind"),
    ],
)
def test_invalid_matrices_are_refused(matrices: list[list[float]], key: str) -> None:
    assert refused(bound(matrices)) == (key, "/skins/0/inverseBindMatrices")


@pytest.mark.parametrize(
    ("skin", "key", "pointer"),
    [
        ({"joints": [1, 3]}, "F002.gltf-index", "/joints/1"),
        ({"joints": [1, "2"]}, "F002.gltf-type", "/joints/1"),
        ({}, "F002.gltf-missing", ""),
        ({"joints": [1, 2], "inverseBindMatrices": 3}, "F002.gltf-index", "/inverseBindMatrices"),
        ({"joints": [1, 2], "inverseBindMatrices": 0}, "F002.gltf-kind", "/inverseBindMatrices"),
    ],
)
def test_invalid_skins_are_refused(skin: dict[str, object], key: str, pointer: str) -> None:
    file = skinned()
    file.root["skins"] = [skin]
    assert refused(file) == (key, f"/skins/0{pointer}")


def test_skin_without_joints_is_ignored() -> None:
    file = skinned()
    file.root["skins"][0]["joints"] = []
    file.root["skins"].append({"joints": [2]})
    file.root["nodes"][2]["skin"] = 1
    content = read(file)
    assert [skin.joints.tolist() for skin in content.skins] == [[2]]
    assert content.tree.skins.tolist() == [-1, -1, 0]
    assert warned(file) == [("G004.no-joints", "/skins/0/joints")]


def test_skeleton_that_is_not_a_node_is_ignored() -> None:
    file = skinned()
    file.root["skins"][0]["skeleton"] = 3
    assert warned(file) == [("G004.skeleton", "/skins/0/skeleton")]
    file.root["skins"][0]["skeleton"] = 1
    assert warned(file) == []
