"""Mesh, materials and influences of one figure of a page, as the desktop's shaders take them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.exporters.html.motion import FINE, Tracks, size_of
from viewer.exporters.html.packing import Packer
from viewer.media.image import media_type
from viewer.media.png import encode_png
from viewer.rendering.gpu.index_sets import split_vertices, triangle_order
from viewer.rendering.gpu.surfaces import (
    SAMPLERS,
    drawn_sets,
    drawn_textures,
    joined_image,
    needs_materials,
    surface_uniforms,
)
from viewer.rigs.arrays import Floats
from viewer.rigs.file_record import Json
from viewer.rigs.material import TEXTURES, Material, Texture
from viewer.rigs.mesh import Mesh, bounding_box, visible_triangles
from viewer.rigs.skin import (
    Skin,
    bind_positions,
    has_influence,
    influence_counts,
    joint_fractions,
    strongest_first,
    weight_sums,
)
from viewer.rigs.skinning import Skinning, skin_used

_NORMAL_STEP = 2.0**-11  # 0.03 degrees
_UV_STEP = 2.0**-17  # a thirtieth of a texel of 4096
_COLOR_STEP = 2.0**-12
_WEIGHT_STEP = 2.0**-21
_EXCESS_STEP = 2.0**-26
_SHOWN = ("base_texture", "normal_texture")  # the textures of the page's shading, Blinn-Phong
_INTEGERS = {"u_uv_sets"}  # uniforms stored as bytes of integers


def pack_mesh(
    tracks: Tracks, hidden: frozenset[int], packer: Packer, notes: list[str]
) -> tuple[Json, Floats]:
    """Add a figure's mesh without hidden parts; return its members, and its centre (3,)."""
    assert tracks.offsets is not None  # the figure has a mesh
    mesh = tracks.rest.require_mesh()
    sources, uv_indices, triangles = split_vertices(tracks.rest)
    order = triangle_order(tracks.rest)
    order = order[visible_triangles(mesh, hidden)[order]]
    center = bounding_box(mesh.positions).mean(axis=0)
    rest = mesh.positions + tracks.offsets.mean - center
    materials = mesh.material_indices[order]
    edges = np.flatnonzero(np.diff(materials)) + 1
    starts = [0, *edges.tolist()] if len(order) else []
    ends = [*edges.tolist(), len(order)]
    sets = drawn_sets(mesh, notes)
    notes += _changed_looks(mesh)
    has_uvs = mesh.uvs is not None and len(mesh.uvs) > 0
    packed: Json = {
        "center": center.tolist(),
        "positions": packer.add(rest, FINE * size_of(tracks.rest)),
        "normals": packer.add(mesh.normals, _NORMAL_STEP),
        "sources": packer.add(sources),
        "triangles": packer.add(triangles[order].reshape(-1)),
        "runs": [
            [int(materials[first]), 3 * first, 3 * (last - first)]
            for first, last in zip(starts, ends, strict=False)
        ],
        "hasMaterials": needs_materials(mesh),
        "surfaces": _pack_surfaces(mesh.materials, sets if has_uvs else (), packer),
    }
    if has_uvs:
        packed["uvs"] = packer.add(_rows(mesh, 0)[uv_indices], _UV_STEP)
        others = [packer.add(_rows(mesh, each)[uv_indices], _UV_STEP) for each in sets[1:]]
        packed["otherUvs"] = others
    if mesh.colors is not None:
        packed["tints"] = packer.add(mesh.colors, _COLOR_STEP)
    return packed, center


def _changed_looks(mesh: Mesh) -> list[str]:
    """Return sentences about the surfaces that look different from those of the desktop."""
    materials = mesh.materials
    is_toon = [each.shade_color is not None for each in materials]
    others = [each for each, toon in zip(materials, is_toon, strict=True) if not toon]
    changes = {
        "toon surfaces are shown without their steps and outlines": any(is_toon),
        "unlit surfaces are shown with lighting": any(each.unlit for each in others),
        "metallic-roughness surfaces are shown with Blinn-Phong shading": any(
            each.is_physical and not each.unlit for each in others
        ),
    }
    return [sentence for sentence, is_seen in changes.items() if is_seen]


def _rows(mesh: Mesh, number: int) -> Floats:
    """Return a set of texture coordinates: (U, 2)."""
    assert mesh.uvs is not None  # checked by the caller
    return mesh.other_uvs[number - 1] if number else mesh.uvs


def pack_skin(skin: Skin, how: Skinning, packer: Packer) -> Json:
    """Add the influences that a skinning method uses, the strongest of each vertex first."""
    used = strongest_first(skin_used(skin, how))
    packed: Json = {
        "counts": packer.add(influence_counts(used)),
        "moved": packer.add(has_influence(used)),
        "joints": packer.add(used.joints),
        "weights": packer.add(used.weights, _WEIGHT_STEP),
        # Sums of rounded weights would displace vertices far from the origin.
        "excess": packer.add(weight_sums(used) - 1.0, _EXCESS_STEP),
        "fractions": joint_fractions(used).tolist(),
        "binds": bind_positions(used).reshape(-1).tolist(),
        "method": how.method,
        "blendFactor": -1.0 if how.blend_factor is None else how.blend_factor,
    }
    if used.dqs_fractions is not None:
        packed["dqsFractions"] = packer.add(used.dqs_fractions, _WEIGHT_STEP)
    return packed


def _pack_surfaces(
    materials: Sequence[Material], sets: Sequence[int], packer: Packer
) -> list[Json]:
    """Add the images of materials, each once; return their uniforms and textures."""
    units = dict(zip(TEXTURES, SAMPLERS.values(), strict=True))
    images: dict[tuple[object, ...], int] = {}
    found = []
    for material in materials:
        slots = {
            name: texture
            for name, texture in drawn_textures(material).items()
            if name in _SHOWN and texture.image is not None and texture.uv_set in sets
        }
        textures = []
        for name, texture in slots.items():
            key = id(texture.image), *(side == "mirror" for side in texture.wrap)
            if key not in images:
                images[key] = packer.add_file(*_picture(texture))
            textures.append(
                {
                    "unit": units[name],
                    "image": images[key],
                    "isLinear": name != "base_texture",
                    "repeats": [side != "clamp" for side in texture.wrap],
                    "isSmooth": texture.is_smooth,
                    "minification": texture.minification,
                }
            )
        uniforms = surface_uniforms(material, slots, sets)
        found.append(
            {
                "uniforms": {name: plain(name, value) for name, value in uniforms.items()},
                "textures": textures,
                "isBlended": material.alpha_mode == "blend",
                "isDoubleSided": material.double_sided,
            }
        )
    return found


def _picture(texture: Texture) -> tuple[bytes, str]:
    """Return the file of a texture's image, and its media type."""
    assert texture.image is not None  # checked by the caller
    data = None if "mirror" in texture.wrap else texture.encoded
    if data is None:
        data = encode_png(joined_image(texture.image, texture.wrap))
    return data, media_type(data)


def plain(name: str, value: object) -> object:
    """Return a uniform as JSON stores it: a number, or a list of numbers."""
    if isinstance(value, bytes):
        return np.frombuffer(value, "i4" if name in _INTEGERS else "f4").tolist()
    return [float(part) for part in value] if isinstance(value, tuple) else value
