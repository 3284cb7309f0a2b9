"""Mesh, materials and influences of one figure of a page, as the desktop's shaders take them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.exporters.html.motion import FINE, Tracks, size_of
from viewer.exporters.html.packing import Packer
from viewer.media.image import media_type
from viewer.media.png import encode_png
from viewer.rendering.gpu.index_sets import split_vertices, triangle_order
from viewer.rendering.gpu.studio import studio_arrays
from viewer.rendering.gpu.surfaces import (
    PLAIN,
    SAMPLERS,
    changing_uniforms,
    drawn_sets,
    drawn_textures,
    has_linear_texels,
    joined_image,
    needs_materials,
    outline_uniforms,
    surface_uniforms,
)
from viewer.rendering.options import DisplayOptions
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
from viewer.rigs.units import METRES

_NORMAL_STEP = 2.0**-11  # 0.03 degrees
_UV_STEP = 2.0**-17  # a thirtieth of a texel of 4096
_COLOR_STEP = 2.0**-12
_WEIGHT_STEP = 2.0**-21
_EXCESS_STEP = 2.0**-26
_STUDIO_STEP = 2.0**-5  # of the binary logarithm: 1 % of the light, half a step of 8-bit sRGB
_TABLE_STEP = 2.0**-9
_INTEGERS = {"u_uv_sets"}  # uniforms stored as bytes of integers


def pack_mesh(
    tracks: Tracks, hidden: frozenset[int], packer: Packer, notes: list[str]
) -> tuple[Json, Floats]:
    """Add a figure's mesh without hidden parts; return its members, and its centre (3,)."""
    assert tracks.surface is not None  # the figure has a mesh
    mesh = tracks.rest.require_mesh()
    sources, uv_indices, triangles = split_vertices(tracks.rest)
    order = triangle_order(tracks.rest)
    order = order[visible_triangles(mesh, hidden)[order]]
    center = bounding_box(mesh.positions).mean(axis=0)
    rest = mesh.positions + tracks.surface.mean - center
    materials = mesh.material_indices[order]
    edges = np.flatnonzero(np.diff(materials)) + 1
    starts = [0, *edges.tolist()] if len(order) else []
    ends = [*edges.tolist(), len(order)]
    sets = drawn_sets(mesh, notes)
    has_uvs = mesh.uvs is not None and len(mesh.uvs) > 0
    packed: Json = {
        "center": center.tolist(),
        "positions": packer.add(rest, FINE * size_of(tracks.rest)),
        "normals": packer.add(tracks.surface.normals, _NORMAL_STEP),
        "sources": packer.add(sources),
        "triangles": packer.add(triangles[order].reshape(-1)),
        "runs": [
            [int(materials[first]), 3 * first, 3 * (last - first)]
            for first, last in zip(starts, ends, strict=False)
        ],
        "hasMaterials": needs_materials(mesh),
        "shading": "pbr" if any(each.is_physical for each in mesh.materials) else "phong",
        "plain": _plain_all(_surface_values(PLAIN.uniforms)),
        "surfaces": _pack_surfaces(tracks, sets if has_uvs else (), packer),
    }
    if has_uvs:
        packed["uvs"] = packer.add(_rows(mesh, 0)[uv_indices], _UV_STEP)
        others = [packer.add(_rows(mesh, each)[uv_indices], _UV_STEP) for each in sets[1:]]
        packed["otherUvs"] = others
    if mesh.colors is not None:
        packed["tints"] = packer.add(mesh.colors, _COLOR_STEP)
    return packed, center


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


def _pack_surfaces(tracks: Tracks, sets: Sequence[int], packer: Packer) -> list[Json]:
    """Add the images of materials, each once; return their uniforms and textures."""
    units = dict(zip(TEXTURES, SAMPLERS.values(), strict=True))
    images: dict[tuple[object, ...], int] = {}
    found = []
    metre = METRES.get(tracks.rest.unit, 1.0)
    for number, first in enumerate(tracks.rest.require_mesh().materials):
        looks = tracks.looks.get(number, [first])
        material = looks[0]
        slots = {
            name: texture
            for name, texture in drawn_textures(material).items()
            if texture.image is not None and texture.uv_set in sets
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
                    "isLinear": has_linear_texels(material, name),
                    "repeats": [side != "clamp" for side in texture.wrap],
                    "isSmooth": texture.is_smooth,
                    "minification": texture.minification,
                }
            )
        values = _surface_values(surface_uniforms(material, slots, sets))
        packed: Json = {
            "uniforms": _plain_all(values),
            "textures": textures,
            "isBlended": material.alpha_mode == "blend",
            "isDoubleSided": material.double_sided,
        }
        if material.outline is not None:
            has_map = units["occlusion_texture"] in [each["unit"] for each in textures]
            on_screen = material.outline.mode == "screen"
            packed["outline"] = {
                "uniforms": _plain_all(outline_uniforms(material.outline, values, has_map)),
                # Lengths are in units of the figure.
                "width": material.outline.width / (1.0 if on_screen else metre),
            }
        if number in tracks.looks:
            packed["changes"] = _pack_changes(looks, packed, packer)
        found.append(packed)
    return found


def _pack_changes(looks: Sequence[Material], packed: Json, packer: Packer) -> Json:
    """Add the uniforms that differ between the frames of a material; return their items by name."""
    rows = [changing_uniforms(each) for each in looks]
    # Rim light that has no effect adds nothing, but a fraction of a switch would turn it off.
    packed["uniforms"]["u_has_rim"] = any(row.pop("u_has_rim") for row in rows)
    for row, look in zip(rows, looks, strict=True):
        if look.outline is not None:
            row["u_outline_color"] = look.outline.color
    tables = {name: np.array([plain(name, row[name]) for row in rows]) for name in rows[0]}
    return {
        name: packer.add(table, _UV_STEP if name == "u_places" else _COLOR_STEP)
        for name, table in tables.items()
        if (table != table[0]).any()
    }


def _surface_values(uniforms: dict[str, object]) -> dict[str, object]:
    """Return the uniforms of a surface with the values of materials that do not specify them."""
    options = DisplayOptions()
    return {"u_metallic": options.metallic, "u_roughness": options.roughness, **uniforms}


def _plain_all(values: dict[str, object]) -> Json:
    return {name: plain(name, value) for name, value in values.items()}


def is_lit(figure: Json) -> bool:
    """Return whether the studio lights a surface of a packed figure."""
    mesh = figure.get("mesh")
    if mesh is None or mesh["shading"] != "pbr":
        return False
    drawn = {index for index, _, _ in mesh["runs"]}
    values = [
        mesh["surfaces"][index]["uniforms"] if index >= 0 else mesh["plain"] for index in drawn
    ]
    return any(not (each["u_unlit"] or each["u_toon"]) for each in values)


def pack_studio(packer: Packer) -> Json:
    """Add the studio's light, and the table of the split-sum approximation."""
    light, table = studio_arrays()
    layers, side = light.shape[:2]
    red, green, blue = np.moveaxis(np.log2(light.astype(np.float64)), -1, 0).reshape(3, -1)
    # The colours of lamps differ little, so red and blue are stored relative to green.
    columns = [green, red - green, blue - green]
    return {
        "layers": layers,
        "side": side,
        "light": [packer.add(each, _STUDIO_STEP) for each in columns],
        "table": packer.add(table.reshape(-1, 2), _TABLE_STEP),
        "tableSide": len(table),
    }


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
