"""Changes of materials by expressions of VRM files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

from viewer.loading import load
from viewer.rig.blendshapes import BlendShapes


def opened(file: File, folder: Path) -> tuple[BlendShapes, list[Any]]:
    """Return the blend shapes of the only figure, and the findings."""
    path = folder / "ada.vrm"
    path.write_bytes(file.glb())
    scene = load(path)
    shapes = scene.actors[0].figure.blend_shapes
    assert shapes is not None
    return shapes, [each for each in scene.diagnostics if each.key == "F007.vrm-materials"]


def rows(shapes: BlendShapes) -> list[tuple[str, int, str, list[float]]]:
    binds = shapes.material_binds
    assert binds is not None
    return [
        (shapes.names[shape], material, kind, target)
        for shape, material, kind, target in zip(
            binds.shapes.tolist(),
            binds.materials.tolist(),
            binds.kinds,
            binds.targets.tolist(),
            strict=True,
        )
    ]


def test_binds_of_version_1_are_read(tmp_path: Path) -> None:
    shapes, found = opened(swinging(), tmp_path)
    assert rows(shapes) == [
        ("angry", 1, "color", [1.0, 0.0, 0.0, 1.0]),
        ("angry", 0, "transform", [1.0, 1.0, 0.5, 0.0]),
    ]
    assert not found
    assert shapes.is_expression(shapes.names.index("angry"))


def old_values(*values: tuple[str, Any, list[float]]) -> File:
    file = swinging(0)
    groups = file.root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    groups[1]["materialValues"] = [
        {"materialName": material, "propertyName": name, "targetValue": value}
        for material, name, value in values
    ]
    return file


def test_values_of_version_0_are_converted(tmp_path: Path) -> None:
    file = old_values(
        ("cloth", "_Color", [0.5, 1.0, 0.0, 0.25]),
        ("skin", "_EmissionColor", [0.5, 2.0, 0.0, 1.0]),
        ("skin", "_MainTex_ST", [0.5, 0.25, 0.1, 0.2]),
    )
    shapes, found = opened(file, tmp_path)
    (_, cloth, color, red), (_, skin, glow, light), (_, moved, kind, place) = rows(shapes)
    assert (cloth, color, skin, glow, moved, kind) == (
        1,
        "color",
        0,
        "emissionColor",
        0,
        "transform",
    )
    assert_allclose(red, [0.2140411, 1.0, 0.0, 0.25], atol=1e-7)  # sRGB, except the opacity
    assert light == [0.5, 2.0, 0.0, 1.0]
    # The first row of the image is the bottom in Unity, and the top in glTF: 1 - 0.2 - 0.25.
    assert_allclose(place, [0.5, 0.25, 0.1, 0.55], atol=1e-12)
    assert not found


def test_values_for_one_axis_keep_the_other(tmp_path: Path) -> None:
    file = old_values(("skin", "_MainTex_ST_S", [0.5, 9.0, 0.25, 9.0]))
    properties = file.root["extensions"]["VRM"]["materialProperties"][0]
    properties["vectorProperties"]["_MainTex"] = [0.1, 0.2, 2.0, 0.5]
    shapes, _ = opened(file, tmp_path)
    assert_allclose(rows(shapes)[0][3], [0.5, 0.5, 0.25, 1.0 - 0.2 - 0.5], atol=1e-12)


def test_changes_without_effect_are_reported(tmp_path: Path) -> None:
    file = old_values(
        ("cloth", "_Cutoff", [0.5, 0, 0, 0]),
        ("hood", "_Color", [1, 0, 0, 1]),
        ("cloth", "_Color", [1, 0, 0, 1]),
    )
    shapes, (found,) = opened(file, tmp_path)
    assert found.values["names"] == ["Blush: cloth _Cutoff", "Blush: hood _Color"]
    assert len(rows(shapes)) == 1


def test_invalid_values_of_version_0_are_ignored(tmp_path: Path) -> None:
    file = old_values(("cloth", ["_Color"], [1, 0, 0, 1]), ("cloth", "_Color", [10**400, 0, 0, 1]))
    groups = file.root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    groups[0]["binds"][0]["weight"] = 10**400
    shapes, (found,) = opened(file, tmp_path)
    assert found.values["names"] == ["Blush: cloth ['_Color']", "Blush: cloth _Color"]
    assert shapes.material_binds is None


@pytest.mark.parametrize(
    "bind",
    [
        {"material": 9, "type": "color", "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": "glow", "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": ["color"], "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": "color", "targetValue": "red"},
        {"material": 0, "type": "color"},
        7,
    ],
)
def test_invalid_binds_are_ignored(tmp_path: Path, bind: Any) -> None:
    file = swinging()
    preset = file.root["extensions"]["VRMC_vrm"]["expressions"]["preset"]
    preset["angry"] = {"materialColorBinds": [bind]}
    shapes, found = opened(file, tmp_path)
    assert shapes.material_binds is None and "angry" not in shapes.names
    assert len(found) == 1


def test_figures_without_morph_targets_have_sliders_for_materials(tmp_path: Path) -> None:
    file = swinging()
    del file.root["meshes"][0]["primitives"][0]["targets"]
    del file.root["meshes"][0]["weights"]
    del file.root["meshes"][0]["extras"]
    shapes, _ = opened(file, tmp_path)
    assert shapes.names == ("angry",)
    assert not shapes.displacement(np.ones(1)).any()
