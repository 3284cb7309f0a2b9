"""Merging of diagnostics that differ only in their locations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from viewer.diagnostics.diagnostic import Diagnostic
from viewer.diagnostics.phrase import Phrase


def merged(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return diagnostics in order, with similar ones merged into the first of them.

    Two are similar if message, file, part and names are equal: values of type ``str`` are names,
    while numbers and text from a file (``bytes``) may differ.
    """
    kinds: dict[tuple[object, ...], list[Diagnostic]] = {}
    for one in found:
        if one.count == 0:
            continue
        kinds.setdefault((one.key, one.path, one.part, *_names(one.values)), []).append(one)
    return [_joined(alike) for alike in kinds.values()]


def _names(values: Mapping[str, Any]) -> Iterator[tuple[object, ...]]:
    for name, value in sorted(values.items()):
        if isinstance(value, Phrase | Diagnostic):
            yield (name, value.key, *_names(value.values))
        elif isinstance(value, str):
            yield name, value


def _joined(alike: list[Diagnostic]) -> Diagnostic:
    if len(alike) == 1:
        return alike[0]
    known = [one.places for one in alike if one.places is not None]
    places = np.unique(np.concatenate(known)) if known else None
    return replace(alike[0], places=places, count=sum(one.count for one in alike))
