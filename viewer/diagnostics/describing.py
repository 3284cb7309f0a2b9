"""Diagnostics as plain data, ready for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from viewer.diagnostics.diagnostic import Diagnostic
from viewer.diagnostics.phrase import Phrase
from viewer.phrases import printable

__all__ = ["described", "plain"]

# Maximum number of indices and names per diagnostic; the total is always included.
_LISTED = 100


def described(found: Diagnostic) -> dict[str, Any]:
    """Return all data of a diagnostic.

    Parameters
    ----------
    found : Diagnostic
        The diagnostic to describe.

    Returns
    -------
    dict
        Code, key, severity, message, file, line (or None), JSON pointer, part, count, values as
        returned by ``plain``, the first 100 indices, and the number of indices.
    """
    places = np.zeros(0, dtype=np.int32) if found.places is None else found.places
    return {
        "code": found.code,
        "key": found.key,
        "severity": found.severity,
        "message": printable(found.full_message, 2000),
        "file": None if found.path is None else printable(found.path, 1000),
        "line": found.line,
        "pointer": found.pointer,
        "part": found.part or None,
        "places": places[:_LISTED].tolist(),
        "n_places": len(places),
        "count": found.count,
        "values": plain(found.values),
    }


def plain(value: Any) -> Any:
    """Return a message value as JSON data.

    File bytes and non-finite numbers become strings, phrases become their text and values, and
    lists are truncated after 100 items.
    """
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, Phrase):
        return {"text": str(value), "values": plain(value.values)}
    if isinstance(value, Diagnostic):
        return described(value)
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, bool | int | float) or value is None:
        return value
    if isinstance(value, bytes):
        return printable(value.decode("utf-8", "replace"), 1000)
    if isinstance(value, Sequence) and not isinstance(value, str | Path):
        return [plain(item) for item in value[:_LISTED]]
    return printable(value, 1000)
