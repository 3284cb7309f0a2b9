"""Compressed buffer views (EXT_meshopt_compression and KHR_meshopt_compression)."""

from __future__ import annotations

from viewer.formats._gltf.elements import Element

__all__ = ["meshopt_of"]

_NAMES = ("KHR_meshopt_compression", "EXT_meshopt_compression")


def meshopt_of(view: Element) -> Element | None:
    """Return the extension that describes the compressed form of a buffer view, if it has one."""
    found = (view.extension(name) for name in _NAMES)
    return next((part for part in found if part is not None), None)
