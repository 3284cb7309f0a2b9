"""Warnings about members of a document whose JSON may have any structure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element

__all__ = ["Report", "items_of", "reporter"]

Report: TypeAlias = Callable[[str, str, object, Sequence[str | int]], None]
"""Reports a key, what is expected, what is found, and the path to the member."""


def reporter(document: Document) -> Report:
    """Return a function that records a warning in the source of a document."""
    root = Element(document.source, {})

    def report(key: str, wanted: str, found: object, path: Sequence[str | int]) -> None:
        document.source.warn(key, root.at(*path), wanted=wanted, found=str(found))

    return report


def items_of(told: Any, name: str) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the objects in a list that is a member of an object, with their indices."""
    found = told.get(name) if isinstance(told, dict) else None
    for index, item in enumerate(found if isinstance(found, list) else ()):
        if isinstance(item, dict):
            yield index, item
