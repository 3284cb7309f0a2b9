"""Findings of lint in glTF files: every code of the reader, at its JSON pointer."""

from pathlib import Path

import pytest
from formats.gltf.files import skinned
from formats.gltf.planted import PLANTED

from viewer.lint import lint_files


@pytest.mark.parametrize("code", PLANTED)
def test_a_planted_error_is_found(tmp_path: Path, code: str) -> None:
    made, pointer = PLANTED[code]
    path = tmp_path / "a.gltf"
    path.write_bytes(made().json())
    found = [finding for finding in lint_files([path])[1] if finding.code == code]
    assert [(one.severity, one.file, one.diagnostic.pointer) for one in found] == [
        ("warning", path, pointer)
    ]


def test_a_valid_file_has_none_of_these_codes(tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    path.write_bytes(skinned().json())
    assert {finding.code for finding in lint_files([path])[1]}.isdisjoint(PLANTED)


def test_several_errors_are_found(tmp_path: Path) -> None:
    file = skinned()
    file.root["nodes"][1]["children"] = [2, 1]
    file.root["meshes"].append({"primitives": [{"attributes": {"POSITION": 99}}]})
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    found = {(one.code, one.diagnostic.pointer) for one in lint_files([path])[1]}
    assert ("F002", "/nodes/1/children") in found
    assert ("F002", "/meshes/1/primitives/0/attributes/POSITION") in found
