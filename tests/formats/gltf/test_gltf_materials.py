"""Materials of glTF files: values, textures, images, extensions, and invalid members."""

import base64
import io
import json
import math

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
