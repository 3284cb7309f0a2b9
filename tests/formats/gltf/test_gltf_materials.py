"""Materials of glTF files: values, textures, images, extensions, and invalid members."""

import base64
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from viewer.formats._source import Source
from viewer.formats.gltf.document import open_document
from viewer.formats.gltf.materials import (
    DEFAULT_MATERIAL,
    Glossiness,
    from_glossiness,
    reading_materials,
)
from viewer.formats.gltf.textures import DecodedImage, Slot, transform_matrix
from viewer.rigs.material import Material

PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 8, 7]]], dtype=np.uint8)


def file_of(kind: str, pixels=PIXELS, **options) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **options)
    return stream.getvalue()


def data_uri(data: bytes, kind: str = "image/png") -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def read(folder, **root):
    """Return the materials of a document with these members, and its source."""
    path = folder / "hero.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, **root}))
    source = Source.open(path)
    with reading_materials(open_document(source)) as finish:
        return finish(), source


def read_one(folder, material, **root):
    """Return the only material of a document with one image, and its source."""
    root = {"textures": [{"source": 0}], "images": [{"uri": data_uri(file_of("PNG"))}], **root}
    (found,), source = read(folder, materials=[material], **root)
    return found, source


def places(source) -> list[tuple[str, str]]:
    return [(one.key, one.pointer) for one in source.diagnostics.warnings]


def test_missing_members_have_the_defaults_of_the_specification(tmp_path):
    found, source = read_one(tmp_path, {})
    assert (found.base_color, found.metallic, found.roughness) == ((1.0, 1.0, 1.0, 1.0), 1.0, 1.0)
    assert (found.alpha_mode, found.alpha_cutoff, found.double_sided) == ("opaque", 0.5, False)
    assert (found.emissive, found.unlit, found.is_physical) == ((0.0, 0.0, 0.0), False, True)
    assert found.textures == {} and source.warnings == []
    for name in ("base_color", "metallic", "roughness", "double_sided", "is_physical"):
        assert getattr(DEFAULT_MATERIAL, name) == getattr(found, name)


def test_every_member_is_read(tmp_path):
    texture = {"index": 0, "texCoord": 2}
    found, source = read_one(
        tmp_path,
        {
            "name": "armour",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 0.125, 0.75],
                "metallicFactor": 0.25,
                "roughnessFactor": 0.5,
                "baseColorTexture": {"index": 0},
                "metallicRoughnessTexture": texture,
            },
            "normalTexture": {"index": 0, "scale": -0.5},
            "occlusionTexture": {"index": 0, "strength": 0.25},
            "emissiveTexture": {"index": 0},
            "emissiveFactor": [0.5, 0.25, 0.0],
            "alphaMode": "MASK",
            "alphaCutoff": 0.75,
            "doubleSided": True,
            "extensions": {
                "KHR_materials_unlit": {},
                "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
            },
        },
    )
    assert source.warnings == []
    assert (found.name, found.base_color) == ("armour", (0.5, 0.25, 0.125, 0.75))
    assert (found.metallic, found.roughness, found.normal_scale) == (0.25, 0.5, -0.5)
    assert (found.occlusion_strength, found.emissive) == (0.25, (2.0, 1.0, 0.0))
    assert (found.alpha_mode, found.alpha_cutoff) == ("mask", 0.75)
    assert found.double_sided and found.unlit
    channels = {name: texture.channel for name, texture in found.textures.items()}
    assert channels == {
        "base_texture": 0,
        "metallic_texture": 2,
        "roughness_texture": 1,
        "normal_texture": 0,
        "occlusion_texture": 0,
        "emissive_texture": 0,
    }
    sets = [found.textures[name].uv_set for name in ("base_texture", "roughness_texture")]
    assert sets == [0, 2]
    # One image is decoded once and shared.
    assert len({id(texture.image) for texture in found.textures.values()}) == 1
    assert_array_equal(found.image[..., :3], PIXELS)
    assert found.base_texture.encoded == file_of("PNG")


# Images


def test_images_of_all_sources_and_formats_are_read(tmp_path):
    (tmp_path / "a b.png").write_bytes(file_of("PNG"))
    grey = Image.fromarray(np.array([[0, 32768, 65535]], np.uint16))
    deep = io.BytesIO()
    grey.save(deep, "PNG")
    flat = np.full((8, 8, 3), (200, 100, 50), np.uint8)
    inks = Image.fromarray(flat).convert("CMYK")
    printed = io.BytesIO()
    inks.save(printed, "JPEG", quality=100)
    palette = Image.fromarray(PIXELS).quantize(4)
    listed = io.BytesIO()
    palette.save(listed, "PNG", transparency=bytes([255, 255, 255, 0]))
    embedded = file_of("JPEG", flat, quality=100)
    images = [
        {"uri": "a%20b.png"},
        {"bufferView": 0, "mimeType": "image/jpeg", "name": "skin"},
        {"uri": data_uri(file_of("WEBP", lossless=True), "image/webp")},
        {"uri": data_uri(deep.getvalue())},
        {"uri": data_uri(printed.getvalue(), "image/jpeg")},
        {"uri": data_uri(listed.getvalue())},
    ]
    materials, source = read(
        tmp_path,
        images=images,
        buffers=[{"uri": data_uri(embedded), "byteLength": len(embedded)}],
        bufferViews=[{"buffer": 0, "byteLength": len(embedded)}],
        textures=[{"source": index} for index in range(6)],
        materials=[{"emissiveTexture": {"index": index}} for index in range(6)],
    )
    assert source.warnings == []
    assert source.also_read == [tmp_path / "a b.png"]
    found = [material.emissive_texture for material in materials]
    assert [texture.name for texture in found[:3]] == ["a b.png", "skin", "image2"]
    assert_array_equal(found[0].image[..., :3], PIXELS)
    assert found[0].encoded is None and found[1].encoded == embedded and found[2].encoded is None
    assert_allclose(found[1].image[..., :3], flat, atol=2)
    assert_array_equal(found[2].image[..., :3], PIXELS)
    # 32768 / 257 is 127.5.
    assert found[3].image[0, :, 0].tolist() == [0, 128, 255]
    assert_allclose(found[4].image[..., :3], flat, atol=2)
    assert sorted(found[5].image[..., 3].ravel().tolist()) == [0, 255, 255, 255]


@pytest.mark.parametrize(
    ("image", "key"),
    [
        ({"uri": "none.png"}, "F005.gltf-image"),
        ({"uri": "../a.png"}, "F005.gltf-image"),
        ({"uri": "https://example.org/a.png"}, "F005.gltf-image"),
        ({"uri": data_uri(b"no image at all")}, "F005.gltf-image"),
        ({"uri": data_uri(file_of("PNG")[:50])}, "F005.gltf-image"),
        ({"bufferView": 3}, "F005.gltf-image"),
        ({}, "F005.gltf-image"),
        ({"uri": data_uri(b"\xabKTX 20\xbb\r\n\x1a\n")}, "F005.gltf-format"),
    ],
)
def test_unreadable_images_do_not_invalidate_the_material(tmp_path, image, key):
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.5}}
    found, source = read_one(tmp_path, material, images=[image])
    assert found.metallic == 0.5 and found.base_texture.image is None
    assert places(source) == [(key, "/images/0")]


def test_images_share_one_limit_of_decoded_pixels(tmp_path, monkeypatch):
    monkeypatch.setattr("viewer.media.image._MAX_PIXELS", 10)
    images = [{"uri": data_uri(file_of("PNG"))} for _ in range(3)]
    materials, source = read(
        tmp_path,
        images=images,
        textures=[{"source": index} for index in range(3)],
        materials=[{"normalTexture": {"index": index}} for index in range(3)],
    )
    shown = [material.normal_texture.image is not None for material in materials]
    assert shown == [True, True, False]
    assert places(source) == [("F005.gltf-image", "/images/2")]


def test_unused_images_are_not_read(tmp_path):
    assert read_one(tmp_path, {}, images=[{"uri": "none.png"}])[1].warnings == []


def test_webp_is_preferred_to_its_fallback_but_basis_is_not(tmp_path):
    images = [
        {"uri": data_uri(file_of("PNG"))},
        {"uri": data_uri(file_of("WEBP", PIXELS[::-1], lossless=True))},
    ]
    material = {"normalTexture": {"index": 0}}
    webp = {"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}
    found, source = read_one(tmp_path, material, images=images, textures=[webp])
    assert_array_equal(found.normal_texture.image[..., :3], PIXELS[::-1])
    basis = {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}
    found, source = read_one(tmp_path, material, images=images, textures=[basis])
    assert source.warnings == []
    assert_array_equal(found.normal_texture.image[..., :3], PIXELS)
    del basis["source"]
    found, source = read_one(tmp_path, material, images=images, textures=[basis])
    assert places(source) == [("F005.gltf-format", "/textures/0")]
    assert source.diagnostics.warnings[0].values["found"] == "KHR_texture_basisu"
    assert found.normal_texture.image is None


# Samplers and transforms


def test_samplers_set_wrap_modes_and_filters(tmp_path):
    sampler = {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9985}
    texture = {"source": 0, "sampler": 0}
    material = {"normalTexture": {"index": 0}}
    found, _ = read_one(tmp_path, material, textures=[texture], samplers=[sampler])
    assert found.normal_texture.wrap == ("clamp", "mirror")
    assert not found.normal_texture.is_smooth
    assert found.normal_texture.minification == "linear_mipmap_nearest"
    found, _ = read_one(tmp_path, material)
    assert found.normal_texture.wrap == ("repeat", "repeat") and found.normal_texture.is_smooth
    odd = {"wrapS": 5, "magFilter": "x"}
    found, source = read_one(tmp_path, material, textures=[texture], samplers=[odd])
    assert found.normal_texture.wrap == ("repeat", "repeat")
    assert places(source) == [
        ("F006.gltf-choice", "/samplers/0/wrapS"),
        ("F006.gltf-material", "/samplers/0/magFilter"),
    ]


def test_texture_transforms_rotate_counter_clockwise_on_the_image(tmp_path):
    """With v downwards, the upper right corner (1, 0) rotated by 90 degrees is at (0, -1)."""
    transform = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 3], "texCoord": 1}
    info = {"index": 0, "texCoord": 3, "extensions": {"KHR_texture_transform": transform}}
    found, source = read_one(tmp_path, {"normalTexture": info})
    texture = found.normal_texture
    assert source.warnings == [] and texture.uv_set == 1

    def moved(u, v):
        """Apply the transform to coordinates with v downwards."""
        x, y = texture.matrix @ [u, 1.0 - v, 1.0]
        return x, 1.0 - y

    assert_allclose(moved(0.0, 0.0), (0.25, 0.5), atol=1e-12)
    # Scaled to (2, 0), rotated to (0, -2), moved by the offset.
    assert_allclose(moved(1.0, 0.0), (0.25, -1.5), atol=1e-12)
    # Scaled to (0, 3), rotated to (3, 0), moved by the offset.
    assert_allclose(moved(0.0, 1.0), (3.25, 0.5), atol=1e-12)


def test_transform_without_members_has_no_effect():
    plain = transform_matrix(np.zeros(2), 0.0, np.ones(2))
    assert_array_equal(plain, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


# Extensions that are not drawn, and invalid members


def test_extensions_without_effect_are_not_reported(tmp_path):
    extensions = {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0}, "KHR_materials_ior": {}}
    materials, source = read(
        tmp_path, materials=[{"extensions": extensions}, {"extensions": extensions}]
    )
    assert len(materials) == 2
    (found,) = source.diagnostics.warnings
    assert found.key == "F007.gltf-not-drawn"
    assert found.values == {"extension": "KHR_materials_clearcoat", "n": 2}


@pytest.mark.parametrize(
    ("material", "key", "pointer"),
    [
        ({"alphaMode": "GLASS"}, "F006.gltf-choice", "/alphaMode"),
        ({"alphaCutoff": "x"}, "F006.gltf-material", "/alphaCutoff"),
        ({"doubleSided": 1}, "F006.gltf-material", "/doubleSided"),
        ({"emissiveFactor": [0, 1]}, "F006.gltf-material", "/emissiveFactor"),
        ({"pbrMetallicRoughness": []}, "F006.gltf-material", "/pbrMetallicRoughness"),
        ({"normalTexture": {"index": 7}}, "F006.gltf-material", "/normalTexture/index"),
        ({"normalTexture": {"index": -1}}, "F006.gltf-material", "/normalTexture/index"),
        (
            {"pbrMetallicRoughness": {"metallicFactor": 1.5}},
            "F006.gltf-range",
            "/pbrMetallicRoughness/metallicFactor",
        ),
        (
            {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, None, 1]}},
            "F006.gltf-material",
            "/pbrMetallicRoughness/baseColorFactor/2",
        ),
    ],
)
def test_invalid_members_are_ignored_and_reported_with_their_pointer(
    tmp_path, material, key, pointer
):
    found, source = read_one(tmp_path, material)
    assert places(source) == [(key, f"/materials/0{pointer}")]
    assert (found.base_color, found.metallic) == ((1.0, 1.0, 1.0, 1.0), 1.0)
    assert (found.alpha_mode, found.textures) == ("opaque", {})


def test_entries_that_are_not_objects_keep_the_indices_of_materials(tmp_path):
    materials, source = read(tmp_path, materials=[7, {"name": "second"}])
    assert [material.name for material in materials] == ["", "second"]
    assert places(source) == [("F006.gltf-material", "/materials/0")]


# Specular and glossiness


def glossy(diffuse, specular, glossiness=0.75, **slots):
    slots = {"diffuse_slot": None, "specular_slot": None} | slots
    return Glossiness((*diffuse, 1.0), specular, glossiness, **slots)


def test_specular_glossiness_dielectrics_and_metals_keep_their_colours():
    """At the limits the roots are simple: m = 0 for specular 0.04, and m = 1 without diffuse."""
    plastic = from_glossiness(glossy((0.5, 0.25, 0.125), (0.04, 0.04, 0.04)), {})
    assert_allclose(plastic["base_color"], (0.5, 0.25, 0.125, 1.0), atol=1e-6)
    assert (plastic["metallic"], plastic["roughness"]) == (0.0, 0.25)
    gold = from_glossiness(glossy((0.0, 0.0, 0.0), (0.9, 0.6, 0.2)), {})
    assert_allclose(gold["base_color"], (0.9, 0.6, 0.2, 1.0), atol=1e-6)
    assert gold["metallic"] == pytest.approx(1.0, abs=1e-6)


def test_glossiness_maps_are_converted_texel_by_texel():
    """One texel is plastic and one chrome; the glossiness is in alpha."""
    painted = np.array([[[255, 0, 0, 255], [0, 0, 0, 128]]], np.uint8)
    mirrored = np.array([[[56, 56, 56, 51], [255, 255, 255, 255]]], np.uint8)
    images = {0: DecodedImage("d", painted), 1: DecodedImage("s", mirrored)}
    slots = {"diffuse_slot": Slot(0, {}), "specular_slot": Slot(1, {})}
    found = from_glossiness(glossy((1, 1, 1), (1, 1, 1), 1.0, **slots), images)
    # sRGB 56 is 0.0395, just below the reflectance of dielectrics.
    base, packed = found["base_texture"].image, found["metallic_texture"].image
    assert_allclose(base[0], [[255, 0, 0, 255], [255, 255, 255, 128]], atol=1)
    assert packed[0, :, 1].tolist() == [204, 0]
    assert packed[0, :, 2].tolist() == [0, 255]
    assert (found["roughness_texture"].channel, found["metallic_texture"].channel) == (1, 2)


def test_the_core_model_is_preferred_to_the_archived_one(tmp_path):
    extension = {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 0.25}}
    both = {"pbrMetallicRoughness": {"roughnessFactor": 0.5}, "extensions": extension}
    found, source = read_one(tmp_path, both)
    assert found.roughness == 0.5 and source.warnings == []
    found, source = read_one(tmp_path, {"extensions": extension})
    assert found.roughness == 0.75
    assert places(source) == [("F007.gltf-glossiness", "/materials")]


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
def test_toon_materials_ignore_the_studio_light_with_a_note(tmp_path, members, unlit):
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


def test_modern_toon_materials_have_a_shade_colour_and_a_step(tmp_path):
    toon = {"shadeColorFactor": [0.5, 0.25, 0.0], "shadingToonyFactor": 0.75}
    toon["shadingShiftFactor"] = -0.5
    material = _read(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert material.shade_color == (0.5, 0.25, 0.0)
    # From toony - 1 - shift to 1 - toony - shift.
    assert material.shade_range == (0.25, 0.75)
    plain = _read(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": {}}}])
    assert plain.shade_color == (0.0, 0.0, 0.0)
    assert plain.shade_range == pytest.approx((-0.1, 0.1), abs=1e-12)


def test_old_toon_materials_have_srgb_colours_and_different_thresholds(tmp_path):
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


def test_old_textures_are_placed_like_the_main_texture(tmp_path):
    """The offset is (0.25, 0.125) and the scale (2, 3), with v from the bottom of the image."""
    core = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    place = {"vectorProperties": {"_MainTex": [0.25, 0.125, 2.0, 3.0]}}
    found = _old(tmp_path, core, **place)
    wanted = [[2.0, 0.0, 0.25], [0.0, 3.0, 0.125]]
    assert found.base_texture.matrix.tolist() == wanted
    unlit = _old(tmp_path, core, **place, shader="VRM/UnlitTexture")
    assert unlit.base_texture.matrix.tolist() == wanted and unlit.shade_color is None


def test_old_materials_add_what_the_core_material_omits(tmp_path):
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


def test_old_colours_replace_those_of_the_core_material(tmp_path):
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


def test_invalid_toon_values_disable_the_shade(tmp_path):
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


def test_rim_light_and_outline_are_read(tmp_path):
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


def test_defaults_are_those_of_the_extension(tmp_path):
    found, _ = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": {}}}])
    assert found.outline is None and not found.rim.has_effect
    assert (found.rim.power, found.rim.lift, found.rim.mix) == (5.0, 0.0, 1.0)


def test_members_that_are_not_drawn_are_listed(tmp_path):
    toon = {
        "uvAnimationScrollXSpeedFactor": 0.5,
        "uvAnimationScrollYSpeedFactor": 0.0,
        "shadingShiftTexture": {"index": 0},
    }
    _, note = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert note.values["names"] == ["uvAnimationScrollXSpeedFactor", "shadingShiftTexture"]


def test_old_outlines_are_centimetres_or_hundredths_of_half_the_height(tmp_path):
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
def test_invalid_rim_lights_and_outlines_are_ignored(tmp_path, toon):
    found, _ = _warned(tmp_path, materials=[{"extensions": {"VRMC_materials_mtoon": toon}}])
    assert found.outline is None and not found.rim.has_effect
