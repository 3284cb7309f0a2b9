"""Toon materials of VRM characters."""

import json
from pathlib import Path
from typing import Any

import pytest

from viewer.formats._source import Source
from viewer.formats.gltf.document import open_document
from viewer.formats.gltf.materials import reading_materials
from viewer.rig.material import Material

SHADERS = ["VRM/MToon", "VRM/UnlitTexture", "VRM_USE_GLTFSHADER", 5]


def materials_of(source: Source) -> tuple[Material, ...]:
    with reading_materials(open_document(source)) as finish:
        return finish()


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
def test_toon_materials_ignore_the_studio_light_with_a_note(
    tmp_path: Path, members: dict[str, Any], unlit: list[bool]
) -> None:
    color = {"baseColorFactor": [0.5, 0.25, 0.125, 1.0]}
    materials: list[dict[str, Any]] = [{"pbrMetallicRoughness": color} for _ in range(3)]
    if unlit[0] is False:
        materials[1]["extensions"] = {"VRMC_materials_mtoon": {"specVersion": "1.0"}}
    path = tmp_path / "hero.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "materials": materials, **members}))
    source = Source.open(path)
    found = materials_of(source)
    assert [material.unlit for material in found] == unlit
    assert found[0].base_color == (0.5, 0.25, 0.125, 1.0)
    (note,) = source.diagnostics
    assert (note.key, note.values["n"]) == ("F007.gltf-toon", 1)


def _read(tmp_path: Path, **members: Any) -> Any:
    path = tmp_path / "hero.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "materials": [{}], **members}))
    return materials_of(Source.open(path))[0]


def test_modern_toon_materials_have_a_shade_colour_and_a_step(tmp_path: Path) -> None:
    toon = {"shadeColorFactor": [0.5, 0.25, 0.0], "shadingToonyFactor": 0.75}
    toon["shadingShiftFactor"] = -0.5
    material = _read(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert material.shade_color == (0.5, 0.25, 0.0)
    # From toony - 1 - shift to 1 - toony - shift.
    assert material.shade_range == (0.25, 0.75)
    plain = _read(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": {}}}])
    assert plain.shade_color == (0.0, 0.0, 0.0)
    assert plain.shade_range == pytest.approx((-0.1, 0.1), abs=1e-12)


def test_old_toon_materials_have_srgb_colours_and_different_thresholds(tmp_path: Path) -> None:
    told = {
        "shader": "VRM/MToon",
        "vectorProperties": {"_ShadeColor": [1.0, 0.5, 0.0, 1.0]},
        "floatProperties": {"_ShadeToony": 0.5, "_ShadeShift": 0.0},
    }
    material = _read(tmp_path, extensions={"VRM": {"materialProperties": [told]}})
    # 0.5 in sRGB: ((0.5 + 0.055) / 1.055) ^ 2.4.
    assert material.shade_color == pytest.approx((1.0, 0.2140411, 0.0), abs=1e-7)
    # toony = lerp(0.5, 1, 0.5) = 0.75, shift = -0 - 0.25, so the lit side is from 0 to 0.5.
    assert material.shade_range == pytest.approx((0.0, 0.5), abs=1e-12)


def _old(tmp_path: Path, material: dict[str, Any], **told: Any) -> Any:
    """Return a material that VRM 0.x overrides; both of its textures have the same image."""
    told = {"shader": "VRM/MToon", **told}
    return _read(
        tmp_path,
        materials=[material],
        images=[{"uri": "missing.png"}],
        textures=[{"source": 0}, {"source": 0}],
        extensions={"VRM": {"materialProperties": [told]}},
    )


def test_old_textures_are_placed_like_the_main_texture(tmp_path: Path) -> None:
    """The offset is (0.25, 0.125) and the scale (2, 3), with v from the bottom of the image."""
    core = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    place = {"vectorProperties": {"_MainTex": [0.25, 0.125, 2.0, 3.0]}}
    found = _old(tmp_path, core, **place)
    wanted = [[2.0, 0.0, 0.25], [0.0, 3.0, 0.125]]
    assert found.base_texture.matrix.tolist() == wanted
    unlit = _old(tmp_path, core, **place, shader="VRM/UnlitTexture")
    assert unlit.base_texture.matrix.tolist() == wanted and unlit.shade_color is None


def test_old_materials_add_what_the_core_material_omits(tmp_path: Path) -> None:
    told = {
        "textureProperties": {"_MainTex": 0, "_BumpMap": 1},
        "floatProperties": {"_BumpScale": 0.5, "_Cutoff": 0.25, "_CullMode": 0},
        "keywordMap": {"_ALPHATEST_ON": True},
    }
    found = _old(tmp_path, {}, **told)
    assert found.base_texture is not None and found.normal_texture is not None
    assert (found.normal_scale, found.alpha_mode, found.alpha_cutoff) == (0.5, "mask", 0.25)
    assert found.double_sided
    found = _old(tmp_path, {"alphaMode": "OPAQUE", "doubleSided": False}, **told)
    assert (found.alpha_mode, found.double_sided) == ("opaque", False)
    assert _old(tmp_path, {}, keywordMap={"_ALPHABLEND_ON": True}).alpha_mode == "blend"
    for kind, mode in (("Cutout", "mask"), ("TransparentZWrite", "blend"), ("Texture", "opaque")):
        assert _old(tmp_path, {}, shader=f"VRM/Unlit{kind}").alpha_mode == mode


def test_old_colours_replace_those_of_the_core_material(tmp_path: Path) -> None:
    """Some exporters write an emission of 1 to the core material of every toon material."""
    core = {
        "pbrMetallicRoughness": {"baseColorFactor": [1.0, 1.0, 1.0, 1.0]},
        "emissiveFactor": [1.0, 1.0, 1.0],
    }
    colors = {"_Color": [1.0, 0.5, 0.0, 0.25], "_EmissionColor": [0.0, 0.0, 0.0, 1.0]}
    found = _old(tmp_path, core, vectorProperties=colors)
    # 0.5 in sRGB is 0.2140411, as above; the opacity is linear.
    assert found.base_color == pytest.approx((1.0, 0.2140411, 0.0, 0.25), abs=1e-7)
    assert found.emissive == (0.0, 0.0, 0.0)
    bright = {"_EmissionColor": [4.0, 2.0, 0.5, 1.0]}
    assert _old(tmp_path, core, vectorProperties=bright).emissive == (4.0, 2.0, 0.5)
    assert _old(tmp_path, core, vectorProperties={"_Color": "red"}).emissive == (1.0, 1.0, 1.0)


def test_invalid_toon_values_disable_the_shade(tmp_path: Path) -> None:
    toon = {"shadeColorFactor": "red", "shadingToonyFactor": 7}
    material = _read(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert material.unlit and material.shade_color == (1.0, 1.0, 1.0)
    assert material.shade_range == (0.0, 0.0)


def _warned(tmp_path: Path, **members: Any) -> tuple[Any, Any]:
    """Return the first material, and the note about toon materials."""
    path = tmp_path / "hero.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "materials": [{}], **members}))
    source = Source.open(path)
    found = materials_of(source)[0]
    (note,) = [each for each in source.diagnostics if each.key == "F007.gltf-toon"]
    return found, note


def test_rim_light_and_outline_are_read(tmp_path: Path) -> None:
    toon = {
        "parametricRimColorFactor": [0.5, 0.25, 0.0],
        "parametricRimFresnelPowerFactor": 3.0,
        "parametricRimLiftFactor": 0.125,
        "rimLightingMixFactor": 0.5,
        "matcapFactor": [1.0, 0.5, 0.0],
        "outlineWidthMode": "screenCoordinates",
        "outlineWidthFactor": 0.01,
        "outlineColorFactor": [0.25, 0.0, 0.0],
        "outlineLightingMixFactor": 0.75,
    }
    found, note = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    rim, outline = found.rim, found.outline
    assert (rim.color, rim.power, rim.lift, rim.mix) == ((0.5, 0.25, 0.0), 3.0, 0.125, 0.5)
    assert rim.matcap_factor == (1.0, 0.5, 0.0)
    assert (outline.mode, outline.width) == ("screen", 0.01)
    assert (outline.color, outline.mix) == ((0.25, 0.0, 0.0), 0.75)
    assert note.values["names"] == []


def test_defaults_are_those_of_the_extension(tmp_path: Path) -> None:
    found, _ = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": {}}}])
    assert found.outline is None and not found.rim.has_effect
    assert (found.rim.power, found.rim.lift, found.rim.mix) == (5.0, 0.0, 1.0)


def test_members_that_are_not_drawn_are_listed(tmp_path: Path) -> None:
    toon = {
        "uvAnimationScrollXSpeedFactor": 0.5,
        "uvAnimationScrollYSpeedFactor": 0.0,
        "shadingShiftTexture": {"index": 0},
    }
    _, note = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert note.values["names"] == ["uvAnimationScrollXSpeedFactor", "shadingShiftTexture"]


def test_old_outlines_are_centimetres_or_hundredths_of_half_the_height(tmp_path: Path) -> None:
    for mode, width in ((1, 0.004), (2, 0.002)):
        numbers = {"_OutlineWidthMode": mode, "_OutlineWidth": 0.4, "_ShadingGradeRate": 0.5}
        told = {
            "name": "skin",
            "shader": "VRM/MToon",
            "floatProperties": numbers,
            "vectorProperties": {"_OutlineColor": [1.0, 0.5, 0.0, 1.0]},
        }
        found, note = _warned(tmp_path, extensions={"VRM": {"materialProperties": [told]}})
        assert found.outline.width == pytest.approx(width, abs=1e-12)
        assert found.outline.mode == ("world", "screen")[mode - 1]
        assert found.outline.color == pytest.approx((1.0, 0.2140411, 0.0), abs=1e-7)
        assert found.outline.mix == 0.0  # a fixed colour
        assert note.values["names"] == ["skin _ShadingGradeRate"]


@pytest.mark.parametrize(
    "toon",
    [
        {"outlineWidthMode": 5, "outlineWidthFactor": 1.0},
        {"outlineWidthMode": "worldCoordinates", "outlineWidthFactor": "a"},
        {"outlineWidthMode": "worldCoordinates", "outlineWidthFactor": -1.0},
        {"parametricRimColorFactor": [1.0], "parametricRimFresnelPowerFactor": -5.0},
        {"matcapTexture": 3, "rimMultiplyTexture": {"index": "x"}},
    ],
)
def test_invalid_rim_lights_and_outlines_are_ignored(tmp_path: Path, toon: dict[str, Any]) -> None:
    found, _ = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert found.outline is None and not found.rim.has_effect
