"""Materials of rigged meshes as arrays of an ``.npz``.

::

    material_names (M,)   material_textures (M,)   image_0 (H, W, 4) …            base colours
    material_records (M,): JSON, other fields of each material that differ from the default
    picture_0 (H, W, 4) …                          images of the other textures, without duplicates

The rim light and the outline of a toon material are objects in its record, with their textures.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.errors import RigError
from viewer.formats._archive.values import Archive
from viewer.rig.arrays import Bytes
from viewer.rig.material import TEXTURES, Material, Outline, Rim, Texture
from viewer.rig.mesh import Mesh

__all__ = ["material_arrays", "read_materials", "texts"]

_PLAIN_MATERIAL, _PLAIN_TEXTURE = Material(), Texture("")
_LOOKS: dict[str, Callable[..., Any]] = {"rim": Rim, "outline": Outline}
_NUMBERS = tuple(
    field.name for field in fields(Material) if field.name not in ("name", *TEXTURES, *_LOOKS)
)
_PLACING = ("channel", "uv_set", "transform", "wrap", "is_smooth", "minification")
_RECORDS = "material_records"


def material_arrays(mesh: Mesh) -> dict[str, NDArray[Any]]:
    """Return the arrays that describe a mesh's materials; an empty dict if it has no material."""
    if not mesh.materials:
        return {}
    arrays: dict[str, NDArray[Any]] = {
        "material_names": np.array([material.name for material in mesh.materials]),
        "material_textures": np.array([material.texture or "" for material in mesh.materials]),
        "triangle_materials": mesh.material_indices,
    }
    pictures: dict[int, tuple[int, Bytes]] = {}
    for index, material in enumerate(mesh.materials):
        if material.image is not None:
            arrays[f"image_{index}"] = material.image
    records = [_record(material, pictures) for material in mesh.materials]
    if any(records):
        arrays[_RECORDS] = np.array([json.dumps(record) for record in records])
    return arrays | {f"picture_{number}": image for number, image in pictures.values()}


def _record(material: Material, pictures: dict[int, tuple[int, Bytes]]) -> dict[str, Any]:
    """Return the fields that differ from their defaults, as plain data."""
    record: dict[str, Any] = {}
    for name in _NUMBERS:
        if getattr(material, name) != getattr(_PLAIN_MATERIAL, name):
            record[name] = getattr(material, name)
    for name, texture in material.textures.items():
        placing = _placing(texture, None if name == "base_texture" else pictures)
        if placing:
            record[name] = placing
    for name in _LOOKS:
        look = getattr(material, name)
        if look is not None:
            values = {field.name: getattr(look, field.name) for field in fields(look)}
            record[name] = {
                key: _placing(value, pictures) if isinstance(value, Texture) else value
                for key, value in values.items()
                if value is not None
            }
    return record


def _placing(texture: Texture, pictures: dict[int, tuple[int, Bytes]] | None) -> dict[str, Any]:
    """Return the fields of a texture that differ from their defaults, as plain data.

    ``pictures``: extended by its image; None if name and image are stored elsewhere.
    """
    placing: dict[str, Any] = {}
    for part in _PLACING:
        value = np.asarray(getattr(texture, part)).tolist()
        if value != np.asarray(getattr(_PLAIN_TEXTURE, part)).tolist():
            placing[part] = value
    if pictures is not None:
        placing["name"] = texture.name
        if texture.image is not None:
            number = pictures.setdefault(id(texture.image), (len(pictures), texture.image))[0]
            placing["picture"] = number
    return placing


def read_materials(archive: Archive) -> tuple[Material, ...]:
    """Return the materials of an archive.

    Raises
    ------
    FormatError
        If arrays do not match each other, or a record does not describe a material.
    """
    if not archive.has("material_names"):
        return ()
    names, textures = texts(archive, "material_names"), texts(archive, "material_textures")
    if len(names) != len(textures):
        raise archive.fault(
            "F002.value", item="material_textures", expected=len(names), found=len(textures)
        )
    materials = []
    for index, (name, texture) in enumerate(zip(names, textures, strict=True)):
        image = _picture(archive, f"image_{index}")
        has_texture = texture or image is not None
        materials.append(Material(name, Texture(texture, image) if has_texture else None))
    if not archive.has(_RECORDS):
        return tuple(materials)
    records = texts(archive, _RECORDS)
    if len(records) != len(names):
        raise archive.fault("F002.value", item=_RECORDS, expected=len(names), found=len(records))
    pictures: dict[str, Bytes | None] = {}
    return tuple(
        _completed(archive, material, records[index], index, pictures)
        for index, material in enumerate(materials)
    )


def _completed(
    archive: Archive,
    material: Material,
    text: str,
    index: int,
    pictures: dict[str, Bytes | None],
) -> Material:
    """Return a material with the fields of its record."""
    try:
        record = json.loads(text)
        found = {name: _tuples(record.pop(name)) for name in _NUMBERS if name in record}
        for name in TEXTURES:
            if name not in record:
                continue
            base = material.base_texture if name == "base_texture" else None
            found[name] = _placed(archive, base or Texture(""), record.pop(name), pictures)
        for name, kind in _LOOKS.items():
            if name in record:
                found[name] = kind(
                    **{
                        key: _placed(archive, Texture(""), value, pictures)
                        if isinstance(value, dict)
                        else _tuples(value)
                        for key, value in record.pop(name).items()
                    }
                )
        return replace(material, **found, **record)
    except (ValueError, TypeError, AttributeError, RecursionError, RigError) as problem:
        raise archive.fault(
            "F002.rig-material", item=_RECORDS, index=index, problem=str(problem)[:200]
        ) from None


def _placed(
    archive: Archive, texture: Texture, record: Any, pictures: dict[str, Bytes | None]
) -> Texture:
    """Return a texture with the fields of its record."""
    placing = {part: _tuples(value) for part, value in record.items()}
    number = placing.pop("picture", None)
    if number is not None:
        key = f"picture_{int(number)}"
        if key not in pictures:
            pictures[key] = _picture(archive, key)
        placing["image"] = pictures[key]
    return replace(texture, **placing)


def _tuples(value: Any) -> Any:
    """Return a JSON value with tuples in place of lists."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _picture(archive: Archive, key: str) -> Bytes | None:
    return archive.array(key, (None, None, 4)).values() if archive.has(key) else None


def texts(archive: Archive, key: str) -> tuple[str, ...]:
    """Return an array of strings."""
    return tuple(map(str, archive.array(key, (None,), "SU").values().astype(str).tolist()))
