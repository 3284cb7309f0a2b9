"""JSON of the commands: each key is documented, and has the documented type."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands.test_functions import leg, legs
from formats.gltf.files import skinned
from formats.vrm.swinging import swinging

import viewer
from viewer.cli import run
from viewer.schemas import KINDS, json_schema

KNOWN = {
    "array": list,
    "boolean": bool,
    "integer": int,
    "null": type(None),
    "number": (int, float),
    "object": dict,
    "string": str,
}


def faults(value: Any, schema: Any, types: Any, place: str = "") -> list[str]:
    """Return where data differ from a schema (draft 2020-12); unknown keys are faults, too."""
    if "$ref" in schema:
        return faults(value, types[schema["$ref"].removeprefix("#/$defs/")], types, place)
    if "anyOf" in schema:
        found = [faults(value, each, types, place) for each in schema["anyOf"]]
        return [] if [] in found else min(found, key=len)
    if "enum" in schema:
        return [] if value in schema["enum"] else [f"{place}: {value!r} not in {schema['enum']}"]
    if "type" not in schema:
        return []
    is_flag = isinstance(value, bool) and schema["type"] in ("integer", "number")
    if is_flag or not isinstance(value, KNOWN[schema["type"]]):
        return [f"{place}: {value!r} is no {schema['type']}"]
    if schema["type"] == "array":
        parts = [(f"[{n}]", each, schema["items"]) for n, each in enumerate(value)]
    elif schema["type"] == "object" and "properties" in schema:
        known = schema["properties"]
        odd = [f"{place}.{name}: unknown" for name in value if name not in known]
        odd += [f"{place}.{name}: missing" for name in schema["required"] if name not in value]
        parts = [(f".{name}", each, known[name]) for name, each in value.items() if name in known]
        return odd + [f for n, v, s in parts for f in faults(v, s, types, place + n)]
    elif schema["type"] == "object":
        parts = [(f".{n}", each, schema["additionalProperties"]) for n, each in value.items()]
    else:
        parts = []
    return [found for n, each, kind in parts for found in faults(each, kind, types, place + n)]


def check(kind: str, data: Any) -> set[str]:
    """Check data against the schema; return the classes of the schema."""
    assert data["schema"] == kind
    schema = json_schema(kind)
    assert schema["$schema"].startswith("https://json-schema.org/") and schema["$id"]
    assert faults(data, schema, schema["$defs"]) == []
    return {*schema["$defs"]}


def told(capsys: pytest.CaptureFixture[str], *words: object) -> Any:
    capsys.readouterr()
    run([*map(str, words)])
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("json")
    turns = np.zeros((6, 7, 3))
    turns[:, 2, 0] = np.linspace(0.0, 1.0, 6)
    act = viewer.animate(legs(), turns, fps=10, present=[True, True, False, True, True, True])
    viewer.export(act, made / "walk.bvh")
    viewer.export(act, made / "walk.glb")
    bad = leg([[1, 0], [1, 0], [0, 0.7], [0, 1]])
    viewer.export(viewer.Actor(bad), made / "bad.skel")
    (made / "skinned.glb").write_bytes(skinned().glb())
    (made / "broken.bvh").write_text("HIERARCHY\nnonsense\n")
    return made


@pytest.mark.parametrize(
    "files",
    [["body"], ["walk.bvh"], ["walk.glb"], ["bad.skel", "bad.skin"], ["skinned.glb"]],
    ids=lambda files: files[0],
)
def test_info_is_as_documented(files, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    check("info/1", told(capsys, "info", *files, "--json"))


def test_info_of_toon_materials_is_as_documented(tmp_path, capsys):
    (tmp_path / "a.vrm").write_bytes(swinging().glb())
    data = told(capsys, "info", tmp_path / "a.vrm", "--json")
    check("info/1", data)
    assert any("toon" in each for each in data["actors"][0]["mesh"]["materials"])


@pytest.mark.parametrize("files", [["bad.skel", "bad.skin"], ["broken.bvh"], ["walk.glb"]], ids=str)
def test_findings_are_as_documented(files, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    data = told(capsys, "lint", *files, "--json")
    assert check("lint/1", data) == {"LintData", "FindingData", "CountData", "BodyData"}
    assert files == ["walk.glb"] or data["findings"]


def test_differences_are_as_documented(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    data = told(capsys, "diff", "walk.glb", "walk.glb", "skinned.glb", "no.glb", "--json")
    check("diff/1", data)
    same, other, missing = data["comparisons"]
    assert same["actors"][0]["pose_errors"]["mpjpe"] == 0.0
    assert other["actors"][0]["pose_errors"] is None and missing["error"]


def test_lines_of_reports_are_as_documented(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    report = folder / "report.jsonl"
    words = ["batch", "info", "walk.glb", "broken.bvh", "--workers", "0", "--report", str(report)]
    run(words)
    lines = [json.loads(line) for line in report.read_text().splitlines()]
    for line in lines:
        check("batch/1", line)
    done = {line["name"]: line for line in lines}
    assert done["broken.bvh"]["diagnostics"] and done["broken.bvh"]["status"] == "failed"
    check("info/1", done["walk.glb"]["values"])


def test_checker_of_schemas_notices_what_is_wrong():
    schema = json_schema("lint/1")
    data = viewer.lint(viewer.Actor(leg([[1, 0], [1, 0], [0, 0.7], [0, 1]]))).to_dict()
    for change in (
        {"more": 1},
        {"counts": {"error": 0, "warning": 0}},
        {"counts": {"error": True, "warning": 0, "note": 0}},
        {"findings": [{**data["findings"][0], "severity": "worse"}]},
        {"findings": [{**data["findings"][0], "line": "3"}]},
        {"schema": "lint/0"},
    ):
        assert len(faults({**data, **change}, schema, schema["$defs"])) == 1
    assert {*KINDS} == {"lint/1", "diff/1", "info/1", "batch/1"}
