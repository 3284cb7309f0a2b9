"""Accessors and buffer views: types, strides, targets, and the uses of one view."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from viewer.formats._gltf_lint.findings import Report, items_of
from viewer.formats._vrm.json_parts import part

__all__ = ["check_storage"]

_VERTICES, _INDICES = 34962, 34963
_TARGETS = {"vertex attributes": _VERTICES, "indices": _INDICES}
_UNNORMALIZED = (5125, 5126)  # component types that cannot be normalised: uint32 and float
_STRIDES = range(4, 253, 4)
_LARGEST = 3.4028235e38  # in single precision


def check_storage(root: dict[str, Any], report: Report) -> None:
    """Check all accessors and buffer views.

    Parameters
    ----------
    root : dict
        The document, as parsed from JSON.
    report : callable
        Records a warning.
    """
    for index, accessor in items_of(root, "accessors"):
        _check_accessor(accessor, index, report)
    for index, view in items_of(root, "bufferViews"):
        _check_view(root, view, index, report)
    _check_uses(root, report)


def _check_accessor(accessor: dict[str, Any], index: int, report: Report) -> None:
    path, kind = ("accessors", index), accessor.get("componentType")
    if accessor.get("normalized") is True and kind in _UNNORMALIZED:
        wanted = "integers of 8 or 16 bits"
        report("G002.storage", wanted, f"component type {kind}", (*path, "normalized"))
    if "byteOffset" in accessor and "bufferView" not in accessor:
        report("G002.storage", "a bufferView", "none", (*path, "byteOffset"))
    for name in ("min", "max"):
        bounds = accessor.get(name)
        if isinstance(bounds, list) and not all(map(_is_number, bounds)):
            report("G002.storage", "numbers", "other values", (*path, name))
        elif isinstance(bounds, list) and any(abs(each) > _LARGEST for each in bounds):
            found = max(bounds, key=abs)
            report("G002.storage", "numbers in single precision", found, (*path, name))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_view(root: dict[str, Any], view: dict[str, Any], index: int, report: Report) -> None:
    path, target, stride = ("bufferViews", index), view.get("target"), view.get("byteStride")
    if target is not None and target not in _TARGETS.values():
        report("G002.storage", "34962 or 34963", target, (*path, "target"))
    if stride is not None and stride not in _STRIDES:
        report("G002.storage", "a multiple of 4 from 4 to 252", stride, (*path, "byteStride"))
    length, start, buffer = view.get("byteLength"), view.get("byteOffset", 0), view.get("buffer")
    buffers = root.get("buffers")
    if not isinstance(buffers, list) or not isinstance(buffer, int):
        return
    if not 0 <= buffer < len(buffers):
        return
    size = part(buffers[buffer], "byteLength")
    if isinstance(length, int) and isinstance(start, int) and isinstance(size, int):
        if length < 1:
            report("G002.storage", "at least 1 byte", length, (*path, "byteLength"))
        elif start + length > size:
            wanted = f"an end within the {size} bytes of buffer {buffer}"
            report("G002.storage", wanted, f"byte {start + length}", (*path, "byteLength"))


def _check_uses(root: dict[str, Any], report: Report) -> None:
    """Check that each view has one kind of content, and the target and stride of that kind."""
    accessors, views = dict(items_of(root, "accessors")), dict(items_of(root, "bufferViews"))
    first: dict[int, str] = {}
    told: set[tuple[int, str]] = set()
    for accessor, kind, path in _uses(root):
        index = accessors.get(accessor, {}).get("bufferView")
        if not isinstance(index, int) or index not in views or (index, kind) in told:
            continue
        view = views[index]
        told.add((index, kind))
        common = first.setdefault(index, kind)
        target = _TARGETS.get(kind)
        if common != kind:
            report("G002.storage", f"a buffer view of {kind}", f"one of {common}", path)
        elif view.get("target") in _TARGETS.values() and view["target"] != target:
            found = f"target {view['target']}"
            report("G002.storage", f"target {target}" if target else "no target", found, path)
        elif "byteStride" in view and target != _VERTICES:
            found = f"a stride of {view['byteStride']}"
            report("G002.storage", f"{kind} without a stride", found, path)


def _uses(root: dict[str, Any]) -> Iterator[tuple[int, str, tuple[str | int, ...]]]:
    """Yield the accessors that are used, the kind of content, and the path to the reference."""
    given: list[tuple[Any, str, tuple[str | int, ...]]] = []
    for m, mesh in items_of(root, "meshes"):
        for p, primitive in items_of(mesh, "primitives"):
            path: tuple[str | int, ...] = ("meshes", m, "primitives", p)
            given.append((primitive.get("indices"), "indices", (*path, "indices")))
            morphs = [(("targets", t), target) for t, target in items_of(primitive, "targets")]
            for at, attributes in [(("attributes",), primitive.get("attributes")), *morphs]:
                for name, used in attributes.items() if isinstance(attributes, dict) else ():
                    given.append((used, "vertex attributes", (*path, *at, name)))
    for s, skin in items_of(root, "skins"):
        used = skin.get("inverseBindMatrices")
        given.append((used, "inverse bind matrices", ("skins", s, "inverseBindMatrices")))
    for a, animation in items_of(root, "animations"):
        for s, sampler in items_of(animation, "samplers"):
            for name in ("input", "output"):
                path = ("animations", a, "samplers", s, name)
                given.append((sampler.get(name), "keys of animations", path))
    for used, kind, path in given:
        if isinstance(used, int):
            yield used, kind, path
