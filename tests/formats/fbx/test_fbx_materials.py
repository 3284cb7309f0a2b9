"""Materials of ``.fbx``: values and the textures that replace them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from viewer.formats import Source
from viewer.formats.fbx.contents import materials_of
from viewer.media.png import encode_png

GREY = encode_png(np.full((1, 1, 4), 128, dtype=np.uint8))
NAMES = (
    *("base_factor", "base_color", "roughness", "metalness", "emission_factor"),
    *("emission_color", "opacity", "normal_map", "ambient_occlusion"),
)
VALUES = {
    "emission_factor": [0.5],
    "emission_color": [0.0, 0.0, 0.2, 1.0],
    "metalness": [0.25],
    "roughness": [0.75],
}


def material(content: bytes, textured: tuple[str, ...]) -> Any:
    """Return a material with values, and a texture on some properties."""
    told: dict[str, Any] = {"name": "skin", "is_physical": True}
    for name in NAMES:
        number = 0 if name in textured else None
        told[name] = {"value": VALUES.get(name), "texture": number}
    stated = {
        "names": ["map.png"],
        "uv_set": "",
        "wrap": ["repeat", "repeat"],
        "transform": np.eye(4).tolist(),
    }
    message = {"materials": [told], "textures": [stated], "meshes": []}
    arrays = {"texture0": np.frombuffer(content, dtype=np.uint8)}
    (found,) = materials_of(Source(Path("figure.fbx"), b""), arrays, message)
    return found


def test_values_apply_without_textures() -> None:
    found = material(GREY, ())
    assert (found.metallic, found.roughness) == (0.25, 0.75)
    assert found.emissive == pytest.approx((0.0, 0.0, 0.1))


def test_textures_replace_values() -> None:
    found = material(GREY, ("metalness", "roughness", "emission_color"))
    assert (found.metallic, found.roughness) == (1.0, 1.0)
    assert found.emissive == pytest.approx((0.5, 0.5, 0.5))
    assert found.emissive_texture.image is not None


def test_values_replace_textures_that_cannot_be_read() -> None:
    found = material(b"not an image", ("metalness", "roughness", "emission_color"))
    assert (found.metallic, found.roughness) == (0.25, 0.75)
    assert found.emissive == pytest.approx((0.0, 0.0, 0.1))
    assert found.metallic_texture.image is None
