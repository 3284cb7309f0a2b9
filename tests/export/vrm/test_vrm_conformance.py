"""Characters against the specification: found by lint, and never written again as they were."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from formats.vrm.swinging import swinging

from viewer.cli import run
from viewer.lint import lint_files

Change = Callable[[dict[str, Any]], object]
BONES = "/extensions/VRMC_vrm/humanoid/humanBones"
FIXED = "violated the specification:"
OLD_BONES = "/extensions/VRM/humanoid/humanBones"


def _bones(told: dict[str, Any]) -> Any:
    return told["humanoid"]["humanBones"]


def _on_node_of_chest(told: dict[str, Any]) -> None:
    _bones(told)["upperChest"] = dict(_bones(told)["chest"])


def _heavy(told: dict[str, Any]) -> None:
    (bind, *_) = told["expressions"]["preset"]["happy"]["morphTargetBinds"]
    told["expressions"]["preset"]["happy"] = {"morphTargetBinds": [{**bind, "weight": 1.5}]}


def _heavy_old(told: dict[str, Any]) -> None:
    told["blendShapeMaster"]["blendShapeGroups"][0]["binds"][0]["weight"] = 150


# The change, the JSON pointer of the error, and what convert says; None if it refuses.
FAULTS: dict[str, tuple[int, Change, str, str | None]] = {
    "no hips": (1, lambda told: _bones(told).pop("hips"), BONES, None),
    "one node": (1, _on_node_of_chest, f"{BONES}/upperChest", f"{FIXED} human bone upperChest"),
    "no meta": (1, lambda told: told.pop("meta"), "/extensions/VRMC_vrm", None),
    "no authors": (
        1,
        lambda told: told.update(meta={**told["meta"], "authors": []}),
        "/extensions/VRMC_vrm/meta",
        None,
    ),
    "no version": (
        1,
        lambda told: told.pop("specVersion"),
        "/extensions/VRMC_vrm",
        f"{FIXED} specVersion",
    ),
    "beta": (
        1,
        lambda told: told.update(specVersion="1.0-beta"),
        "/extensions/VRMC_vrm/specVersion",
        f"{FIXED} specVersion",
    ),
    "weight": (
        1,
        _heavy,
        "/extensions/VRMC_vrm/expressions/preset/happy/morphTargetBinds/0/weight",
        f"{FIXED} weights of happy",
    ),
    "old weight": (
        0,
        _heavy_old,
        "/extensions/VRM/blendShapeMaster/blendShapeGroups/0/binds/0/weight",
        f"{FIXED} weights of happy",
    ),
    "bone twice": (
        0,
        lambda told: _bones(told).append(dict(_bones(told)[0])),
        f"{OLD_BONES}/17",
        "no counterpart in VRM 1.0: humanoid.humanBones[17]",
    ),
    "no old meta": (0, lambda told: told.pop("meta"), "/extensions/VRM", None),
}


def _errors(path: Path) -> list[str]:
    found = lint_files([path])[1]
    return [one.diagnostic.pointer for one in found if one.code == "G008"]


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_found_and_corrected_or_refused(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    version, change, pointer, corrected = FAULTS[name]
    file = swinging(version)
    change(file.root["extensions"]["VRMC_vrm" if version else "VRM"])
    path, out = tmp_path / "a.vrm", tmp_path / "out.vrm"
    path.write_bytes(file.glb())
    assert _errors(path) == [pointer]
    code = run(["convert", str(path), "-o", str(out)])
    text = capsys.readouterr().out
    if corrected is None:
        assert code == 2 and not out.exists()
        return
    assert code == 0 and corrected in text
    assert _errors(out) == []


@pytest.mark.parametrize("version", [0, 1])
def test_valid_characters_have_no_errors(tmp_path: Path, version: int) -> None:
    path = tmp_path / "a.vrm"
    path.write_bytes(swinging(version).glb())
    assert _errors(path) == []


def test_two_versions_in_one_file_are_an_error(tmp_path: Path) -> None:
    file, path, out = swinging(1), tmp_path / "a.vrm", tmp_path / "out.vrm"
    file.root["extensions"]["VRM"] = swinging(0).root["extensions"]["VRM"]
    path.write_bytes(file.glb())
    assert _errors(path) == ["/extensions/VRM"]
    assert run(["convert", str(path), "-o", str(out)]) == 0
    data = out.read_bytes()
    root = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    assert "VRM" not in root["extensions"] and _errors(out) == []


def test_bone_that_json_repeats_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a.vrm"
    text = swinging(1).json().decode()
    place = text.index('"head": {"node"')
    path.write_bytes(f'{text[:place]}"head": {{"node": 0}}, {text[place:]}'.encode())
    assert _errors(path) == [f"{BONES}/head"]


def test_missing_meta_data_can_be_given(tmp_path: Path) -> None:
    file, path, out = swinging(1), tmp_path / "a.vrm", tmp_path / "out.vrm"
    del file.root["extensions"]["VRMC_vrm"]["meta"]
    path.write_bytes(file.glb())
    licence = "https://vrm.dev/licenses/1.0/"
    options = ["--vrm-author", "A", "--vrm-licence", licence]
    assert run(["convert", str(path), "-o", str(out), *options]) == 0
    assert _errors(out) == []
