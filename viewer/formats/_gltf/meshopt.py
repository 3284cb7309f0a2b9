"""Compressed buffer views (EXT_meshopt_compression and KHR_meshopt_compression)."""

from __future__ import annotations

from collections.abc import Callable

from viewer.formats._gltf.elements import Element
from viewer.formats._meshopt.attributes import decoded_attributes
from viewer.formats._meshopt.filters import FILTERS, filtered
from viewer.formats._meshopt.indices import decoded_indices, decoded_triangles
from viewer.rig.arrays import Bytes

__all__ = ["decoded_view", "meshopt_of"]

_NAMES = ("KHR_meshopt_compression", "EXT_meshopt_compression")
_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_STRIDES = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}
_LARGEST_STRIDE = 256


def meshopt_of(view: Element) -> Element | None:
    """Return the extension that describes the compressed form of a buffer view, if it has one."""
    if not view.has("extensions"):
        return None
    found = (view.extension(name) for name in _NAMES)
    return next((part for part in found if part is not None), None)


def decoded_view(compressed: Element, data: Bytes, spend: Callable[[int, str], None]) -> Bytes:
    """Return the contents of a compressed buffer view: (N,) uint8, read-only.

    Parameters
    ----------
    compressed : Element
        The extension, as ``meshopt_of`` returns it.
    data : (M,) uint8
        The compressed data.
    spend : callable
        Counts bytes that are about to be decoded; see ``Document.spend``.

    Raises
    ------
    FormatError
        If the extension is malformed or the data are damaged.
    """
    mode = compressed.choice("mode", _MODES)
    kind = compressed.choice("filter", FILTERS, "NONE")
    count, stride = compressed.whole("count"), compressed.whole("byteStride")
    _check(compressed, mode, kind, stride)
    spend(count * stride, compressed.pointer)
    if mode == "ATTRIBUTES":
        decoded = decoded_attributes(data, count, stride)
    elif mode == "TRIANGLES":
        decoded = decoded_triangles(data, count, stride)
    else:
        decoded = decoded_indices(data, count, stride)
    if decoded is None:
        raise compressed.fault("F002.gltf-compressed")
    result = filtered(decoded, kind, stride)
    result.flags.writeable = False
    return result


def _check(compressed: Element, mode: str, kind: str, stride: int) -> None:
    """Refuse a stride or filter that does not match the mode."""
    if mode != "ATTRIBUTES":
        if stride not in (2, 4):
            raise compressed.wrong("byteStride", "2 or 4")
        if kind != "NONE":
            raise compressed.wrong("filter", f"no filter in mode {mode}")
    elif stride % 4 or not 0 < stride <= _LARGEST_STRIDE:
        raise compressed.wrong("byteStride", f"a multiple of 4 up to {_LARGEST_STRIDE}")
    elif kind in _STRIDES and stride not in _STRIDES[kind]:
        raise compressed.wrong("byteStride", " or ".join(map(str, _STRIDES[kind])))
