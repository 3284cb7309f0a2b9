"""Toon materials of VRM characters."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from viewer.formats._gltf.document import open_document
from viewer.formats._gltf_materials.materials import read_materials
from viewer.formats._source import Source

SHADERS = ["VRM/MToon", "VRM/UnlitTexture", "VRM_USE_GLTFSHADER", 5]


@pytest.mark.parametrize(
    ("members", "unlit"),
    [
        (
            {"extensions": {"VRM": {"materialProperties": [{"shader": s} for s in SHADERS]}}},
            [True, True, False],
        ),
        ({}, [False, True, False]),
        ({"extensions": {"VRM": {"materialProperties": {}}}}, [False, True, False]),
    ],
)
def test_toon_materials_are_unlit_with_a_note(
    tmp_path: Path, members: dict[str, Any], unlit: list[bool]
) -> None:
    color = {"baseColorFactor": [0.5, 0.25, 0.125, 1.0]}
    materials: list[dict[str, Any]] = [{"pbrMetallicRoughness": color} for _ in range(3)]
    if unlit[0] is False:
        materials[1]["extensions"] = {"VRMC_materials_mtoon": {"specVersion": "1.0"}}
    path = tmp_path / "hero.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "materials": materials, **members}))
    source = Source.open(path)
    found = read_materials(open_document(source))
    assert [material.unlit for material in found] == unlit
    assert found[0].base_color == (0.5, 0.25, 0.125, 1.0)
    (note,) = source.diagnostics
    assert (note.key, note.values["n"]) == ("F007.gltf-toon", 1)
