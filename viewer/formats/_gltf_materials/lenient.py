"""Members whose errors are only warnings, because the shape can still be shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from viewer.errors import FormatError
from viewer.formats._gltf.elements import Element
from viewer.formats._source import Source

__all__ = ["bounded", "bounded_rows", "chosen", "lenient"]

Content = TypeVar("Content")


def lenient(source: Source, read: Callable[[], Content], default: Content) -> Content:
    """Return the result of a function; after an error, warn and return a default."""
    try:
        return read()
    except FormatError as problem:
        found = problem.diagnostic
        source.warn("F006.gltf-material", found.pointer, problem=found.message)
        return default


def bounded(
    element: Element, name: str, default: float, low: float = 0.0, high: float = 1.0
) -> float:
    """Return a member that is a number; values outside the limits are clamped with a warning."""
    value = lenient(element.source, lambda: element.number(name, default), default)
    return _clamped(element, name, (value,), low, high)[0]


def bounded_rows(
    element: Element, name: str, default: tuple[float, ...], high: float = 1.0
) -> tuple[float, ...]:
    """Return a member that is a list of numbers; outliers are clamped with a warning."""
    count = len(default)
    found = lenient(element.source, lambda: element.numbers(name, count), None)
    values = default if found is None else tuple(found.tolist())
    return _clamped(element, name, values, 0.0, high)


def chosen(element: Element, name: str, choices: tuple[str, ...], default: str) -> str:
    """Return a member that is one of several strings; warn about others and use the default."""
    word = lenient(element.source, lambda: element.text(name, default), default)
    if word in choices:
        return word
    element.warn("F006.gltf-choice", name, choices=choices, found=word, used=default)
    return default


def _clamped(
    element: Element, name: str, values: tuple[float, ...], low: float, high: float
) -> tuple[float, ...]:
    """Return values clamped to limits, with a warning if any was outside."""
    within = tuple(np.clip(values, low, high).tolist())
    if within != values:
        odd = next(place for place, value in enumerate(values) if value != within[place])
        limits = f"at least {low:g}" if high == np.inf else f"{low:g} to {high:g}"
        found, used = f"{values[odd]:g}", f"{within[odd]:g}"
        element.warn("F006.gltf-range", name, limits=limits, found=found, used=used)
    return within
