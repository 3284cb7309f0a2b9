"""Diagnostics that say the same of different places, as one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.diagnostics.diagnostic import Diagnostic


def merged(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return diagnostics in order, those of one kind joined to their first.

    They are of one kind if they have the same message, file and part, and name the same things:
    values that are ``str`` are names, others (numbers, words of a file in ``bytes``) may differ.
    """
    kinds: dict[tuple[object, ...], list[Diagnostic]] = {}
    for one in found:
        if one.count == 0:
            continue
        names = (item for item in sorted(one.values.items()) if isinstance(item[1], str))
        kinds.setdefault((one.key, one.path, one.part, *names), []).append(one)
    return [_joined(alike) for alike in kinds.values()]


def _joined(alike: list[Diagnostic]) -> Diagnostic:
    if len(alike) == 1:
        return alike[0]
    known = [one.places for one in alike if one.places is not None]
    places = np.unique(np.concatenate(known)) if known else None
    return replace(alike[0], places=places, count=sum(one.count for one in alike))
