"""Vertex attributes of primitives: names, component types, bounds and tangents."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf_lint.findings import Report, items_of
from viewer.formats._vrm.json_parts import part

__all__ = ["check_primitives"]

_KNOWN = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_(0|[1-9]\d*)|_.*")
_MORPHED = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR)_(0|[1-9]\d*)|_.*")
_BYTE, _UBYTE, _SHORT, _USHORT, _UINT, _FLOAT = 5120, 5121, 5122, 5123, 5125, 5126
_FRACTIONS = ((_FLOAT, False), (_UBYTE, True), (_USHORT, True))
# Component types of each attribute, and whether they are normalised (glTF 2.0, 3.7.2.1).
_TYPES = {
    **dict.fromkeys(("POSITION", "NORMAL", "TANGENT"), ((_FLOAT, False),)),
    **dict.fromkeys(("TEXCOORD", "COLOR", "WEIGHTS"), _FRACTIONS),
    "JOINTS": ((_UBYTE, False), (_USHORT, False)),
}
_INDICES = (_UBYTE, _USHORT, _UINT)
_ROUNDING = 5e-4  # tolerance of lengths and of the sign of tangents


def check_primitives(document: Document, report: Report) -> None:
    """Check the attributes of all primitives; errors that reading reported are not repeated."""
    root = document.root.values
    accessors, materials = dict(items_of(root, "accessors")), dict(items_of(root, "materials"))
    used = root.get("extensionsUsed")
    quantized = isinstance(used, list) and "KHR_mesh_quantization" in used
    for m, mesh in items_of(root, "meshes"):
        for p, primitive in items_of(mesh, "primitives"):
            path: tuple[str | int, ...] = ("meshes", m, "primitives", p)
            attributes = primitive.get("attributes")
            given = attributes if isinstance(attributes, dict) else {}
            _check_names(given, (*path, "attributes"), report)
            if not quantized:
                _check_types(accessors, given, (*path, "attributes"), report)
            _check_indices(accessors, primitive, path, report)
            _check_targets(accessors, primitive, given, path, report)
            _check_tangents(document, given, (*path, "attributes"), report)
            _check_texture_sets(materials, primitive, given, path, report)


def _check_names(given: dict[str, Any], path: tuple[str | int, ...], report: Report) -> None:
    for name in given:
        if not _KNOWN.fullmatch(name):
            wanted = "an attribute of the specification, or a name that begins with _"
            report("G002.storage", wanted, name, (*path, name))
    for kind in ("TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"):
        sets = sorted(int(n.split("_")[1]) for n in given if re.fullmatch(rf"{kind}_\d{{1,4}}", n))
        if sets != list(range(len(sets))):
            missing = next(n for n, found in enumerate([*sets, -1]) if n != found)
            report("G002.storage", f"{kind}_{missing}", f"{kind}_{sets[-1]}", path)


def _check_types(
    accessors: dict[int, Any], given: dict[str, Any], path: tuple[str | int, ...], report: Report
) -> None:
    for name, index in given.items():
        accessor = accessors.get(index, {}) if isinstance(index, int) else {}
        allowed = _TYPES.get(name.split("_")[0])
        kind, normalized = accessor.get("componentType"), accessor.get("normalized") is True
        if allowed and isinstance(kind, int) and (kind, normalized) not in allowed:
            how = "normalised" if normalized else "not normalised"
            wanted = " or ".join(f"{one}{' normalised' * flag}" for one, flag in allowed)
            report("G002.storage", f"component type {wanted}", f"{kind}, {how}", (*path, name))


def _check_indices(
    accessors: dict[int, Any],
    primitive: dict[str, Any],
    path: tuple[str | int, ...],
    report: Report,
) -> None:
    index = primitive.get("indices")
    kind = accessors.get(index, {}).get("componentType") if isinstance(index, int) else None
    if isinstance(kind, int) and kind not in _INDICES and kind != _FLOAT:
        report("G002.storage", "unsigned integers", f"component type {kind}", (*path, "indices"))


def _check_targets(
    accessors: dict[int, Any],
    primitive: dict[str, Any],
    given: dict[str, Any],
    path: tuple[str | int, ...],
    report: Report,
) -> None:
    if primitive.get("targets") == []:
        report("G002.storage", "at least one morph target", "none", (*path, "targets"))
    for t, target in items_of(primitive, "targets"):
        for name, index in target.items():
            at = (*path, "targets", t, name)
            if not _MORPHED.fullmatch(name):
                report("G002.storage", "an attribute that can be morphed", name, at)
            elif name not in given:
                report("G002.storage", f"{name} in the attributes of the primitive", "none", at)
            accessor = accessors.get(index, {}) if isinstance(index, int) else {}
            if name == "POSITION" and accessor and not {"min", "max"} <= accessor.keys():
                report("G002.storage", "an accessor with min and max", "one without", at)


def _check_tangents(
    document: Document, given: dict[str, Any], path: tuple[str | int, ...], report: Report
) -> None:
    index = given.get("TANGENT")
    if not isinstance(index, int) or not 0 <= index < len(document.accessors):
        return
    try:
        rows = document.accessors.components(index)
    except FormatError as problem:
        found = problem.diagnostic.message
        report("G002.storage", "readable tangents", found, (*path, "TANGENT"))
        return
    if rows is None or rows.shape[1] != 4 or not np.isfinite(rows).all():
        return
    lengths = np.linalg.norm(rows[:, :3], axis=1)
    odd = np.abs(lengths - 1.0) > _ROUNDING
    if odd.any():
        at = int(odd.argmax())
        found = f"{int(odd.sum())} of another length (first: {lengths[at]:.6g} at vertex {at})"
        report("G002.storage", "tangents of unit length", found, (*path, "TANGENT"))
    signs = np.abs(np.abs(rows[:, 3]) - 1.0) > _ROUNDING
    if signs.any():
        at = int(signs.argmax())
        found = f"{rows[at, 3]:.6g} at vertex {at}"
        report("G002.storage", "1 or -1 as the sign of a tangent", found, (*path, "TANGENT"))


def _check_texture_sets(
    materials: dict[int, dict[str, Any]],
    primitive: dict[str, Any],
    given: dict[str, Any],
    path: tuple[str | int, ...],
    report: Report,
) -> None:
    """Check that the primitive has the sets of texture coordinates that its material uses."""
    index = primitive.get("material")
    material = materials.get(index, {}) if isinstance(index, int) else {}
    surface = material.get("pbrMetallicRoughness")
    owners = [material, surface if isinstance(surface, dict) else {}]
    references = [
        value
        for each in owners
        for name, value in each.items()
        if name.endswith("Texture") and isinstance(value, dict)
    ]
    sets: set[int] = set()
    for each in references:
        moved = part(each, "extensions", "KHR_texture_transform", "texCoord")
        number = each.get("texCoord", 0) if moved is None else moved
        sets |= {number} if isinstance(number, int) else set()
    missing = sorted(number for number in sets if f"TEXCOORD_{number}" not in given)
    if missing:
        report("G002.storage", f"TEXCOORD_{missing[0]}, which the material uses", "none", path)
