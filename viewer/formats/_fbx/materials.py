"""Materials and textures of an ``.fbx``."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Any

import numpy as np

from viewer.errors import FormatError
from viewer.formats._fbx.message import Arrays
from viewer.formats._mesh.texture import load_image
from viewer.formats._references import referenced_path
from viewer.formats._source import Source
from viewer.media.image import decode_picture
from viewer.rig.arrays import Bytes
from viewer.rig.material import Material, Texture

__all__ = ["materials_of"]

_LEAST_ALPHA = 255  # minimum alpha of opaque pixels


def materials_of(source: Source, arrays: Arrays, told: dict[str, Any]) -> tuple[Material, ...]:
    """Return all materials of a message; textures may be inside the file or next to it.

    A picture is searched for at the paths stated in the file, and by its file name next to the
    file, in ``textures``, and in ``<file>.fbm``, where exporters unpack pictures.
    """
    pictures: dict[int, Bytes | None] = {}
    sets: list[str] = next((mesh["uv_sets"] for mesh in told["meshes"] if mesh["uv_sets"]), [])

    def texture(number: int | None) -> Texture | None:
        if number is None:
            return None
        stated = told["textures"][number]
        name = _picture_name(source, stated["names"])
        if number not in pictures:
            pictures[number] = _picture(source, arrays[f"texture{number}"].tobytes(), name)
        matrix = np.array(stated["transform"])
        place = sets.index(stated["uv_set"]) if stated["uv_set"] in sets else 0
        return Texture(
            name,
            pictures[number],
            uv_set=place,
            transform=matrix[:2][:, [0, 1, 3]],
            wrap=tuple(stated["wrap"]),
        )

    return tuple(_material(source, each, texture) for each in told["materials"])


def _material(source: Source, told: dict[str, Any], texture: Any) -> Material:
    def number(name: str, default: float) -> float:
        value = told[name]["value"]
        return default if value is None else value[0]

    factor, color = number("base_factor", 1.0), told["base_color"]["value"] or [1.0] * 4
    base = texture(told["base_color"]["texture"])
    shown = [1.0, 1.0, 1.0] if base is not None else color[:3]
    red, green, blue = (min(max(factor * part, 0.0), 1.0) for part in shown[:3])
    opacity = min(max(number("opacity", 1.0), 0.0), 1.0)
    cut = texture(told["opacity"]["texture"])
    if cut is not None and (base is None or cut.name != base.name):
        source.warn("F007.fbx-opacity", material=told["name"], texture=cut.name)
        cut = None
    has_alpha = cut is not None and base is not None and _has_alpha(base.image)
    # In FBX, a texture replaces the value of its property; in a material, it multiplies the value.
    metallic, roughness = (
        texture(told["metalness"]["texture"]),
        texture(told["roughness"]["texture"]),
    )
    glow = texture(told["emission_color"]["texture"])
    emission = [1.0] * 3 if _is_drawn(glow) else told["emission_color"]["value"] or [0.0] * 3
    strength = number("emission_factor", 1.0)
    red_glow, green_glow, blue_glow = (max(strength * part, 0.0) for part in emission[:3])
    return Material(
        told["name"],
        base_texture=base,
        base_color=(red, green, blue, opacity),
        metallic=1.0 if _is_drawn(metallic) else min(max(number("metalness", 0.0), 0.0), 1.0),
        roughness=1.0 if _is_drawn(roughness) else min(max(number("roughness", 0.6), 0.0), 1.0),
        metallic_texture=metallic,
        roughness_texture=roughness,
        normal_texture=texture(told["normal_map"]["texture"]),
        occlusion_texture=texture(told["ambient_occlusion"]["texture"]),
        emissive=(red_glow, green_glow, blue_glow),
        emissive_texture=glow,
        alpha_mode="blend" if opacity < 1.0 or has_alpha else "opaque",
        is_physical=told["is_physical"],
    )


def _is_drawn(texture: Texture | None) -> bool:
    return texture is not None and texture.image is not None


def _has_alpha(image: Bytes | None) -> bool:
    return image is not None and int(image[..., 3].min()) < _LEAST_ALPHA


def _picture_name(source: Source, names: list[str]) -> str:
    """Return the first path at which the picture exists; if there is none, its bare file name."""
    folder = source.path.parent
    stated = [name.replace("\\", "/") for name in names if name]
    bare = PurePosixPath(stated[0]).name if stated else ""
    places = [*stated, bare, f"textures/{bare}", f"{source.path.stem}.fbm/{bare}"]
    for name in filter(None, places):
        path = referenced_path(folder, name)
        if path is not None and path.is_file():
            return name
    return bare


def _picture(source: Source, content: bytes, name: str) -> Bytes | None:
    """Return the pixels of a picture that is embedded in the file or lies below its folder."""
    if not content:
        return load_image(source, name, None) if name else None
    try:
        return decode_picture(source.path, content)
    except FormatError as problem:
        source.warn("F005.texture", problem=problem.diagnostic)
        return None
