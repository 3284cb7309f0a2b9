"""Comparison of materials and of the names of parts, blend shapes and animations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.rig.figure import Figure
from viewer.rig.material import Material, Texture
from viewer.rig.materials.toon import Outline, Rim

__all__ = ["content_notes"]

_ROUNDING = 1e-5  # relative tolerance for numbers that were written as text or as float32
_WORDS = {"is_physical": "surface model", "double_sided": "sidedness", "unlit": "lighting"}


def content_notes(first: Figure, second: Figure) -> list[Diagnostic]:
    """Return notes about materials, parts, blend shapes and animations that differ.

    Parameters
    ----------
    first, second : Figure
        The figures. Kinds of content that only one figure has are not reported: few formats store
        them.
    """
    notes = []
    for what, names in (
        ("parts", _parts),
        ("blend shapes", _shapes),
        ("animations", _animations),
    ):
        notes += _lone(what, names(first), names(second))
    return notes + _materials(first, second)


def _parts(figure: Figure) -> Sequence[str]:
    return () if figure.mesh is None else figure.mesh.parts


def _shapes(figure: Figure) -> Sequence[str]:
    return () if figure.blend_shapes is None else figure.blend_shapes.names


def _animations(figure: Figure) -> Sequence[str]:
    return [animation.name for animation in figure.animations]


def _lone(what: str, first: Sequence[str], second: Sequence[str]) -> list[Diagnostic]:
    """Return notes about names that only one of two lists has."""
    if not first or not second:
        return []
    notes = []
    for side, names, others in (("first", first, second), ("second", second, first)):
        lone = sorted(set(names) - set(others))
        if lone:
            values = {"what": what, "side": side, "names": lone}
            notes.append(Diagnostic("D002.only", values=values))
    return notes


def _materials(first: Figure, second: Figure) -> list[Diagnostic]:
    """Return notes about materials, matched by name, or by index if unnamed."""
    if first.mesh is None or second.mesh is None:
        return []
    one, other = _named(first.mesh.materials), _named(second.mesh.materials)
    notes = _lone("materials", list(one), list(other))
    for name in one.keys() & other.keys():
        properties = _different(one[name], other[name])
        if properties:
            values = {"name": name, "properties": properties}
            notes.append(Diagnostic("D002.material", values=values))
    return sorted(notes, key=lambda note: str(note.values.get("name", "")))


def _named(materials: Sequence[Material]) -> dict[str, Material]:
    """Return materials by name; those without a name, or with one already used, by index."""
    result: dict[str, Material] = {}
    for index, material in enumerate(materials):
        is_own = material.name and material.name not in result
        result[material.name if is_own else f"#{index}"] = material
    return result


def _different(one: Material, other: Material) -> list[str]:
    """Return the names of the properties in which two materials differ."""
    names = [each.name for each in fields(Material) if each.name != "name"]
    return [
        _WORDS.get(name, name.replace("_", " "))
        for name in names
        if not _equal(getattr(one, name), getattr(other, name))
    ]


def _equal(one: object, other: object) -> bool:
    if isinstance(one, Texture) and isinstance(other, Texture):
        return _same_texture(one, other)
    if isinstance(one, Rim | Outline) and type(one) is type(other):
        return all(_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, float | tuple) and isinstance(other, float | tuple):
        first, second = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
        return first.shape == second.shape and np.allclose(first, second, atol=_ROUNDING)
    return one == other


def _same_texture(one: Texture, other: Texture) -> bool:
    """Return whether two textures look the same: their names are file names."""
    placed = (one.channel, one.uv_set, one.wrap) == (other.channel, other.uv_set, other.wrap)
    if not placed or not _same_transform(one, other):
        return False
    if one.image is None or other.image is None:
        return one.image is other.image
    return one.image is other.image or np.array_equal(one.image, other.image)


def _same_transform(one: Texture, other: Texture) -> bool:
    if one.transform is None or other.transform is None:
        return one.transform is other.transform
    return np.allclose(one.transform, other.transform, atol=_ROUNDING)
