"""Message from the child process: named arrays, and JSON that refers to them."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.rigs.file_record import Json

Arrays: TypeAlias = dict[str, NDArray[Any]]
"""Arrays by the names that the JSON uses for them."""
_JSON = "json"


def packed(arrays: Arrays, told: Json) -> bytes:
    """Return the bytes of a message."""
    text = np.frombuffer(json.dumps(told).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    np.savez(stream, **arrays, **{_JSON: text})  # type: ignore[arg-type]
    return stream.getvalue()


def unpacked(data: bytes) -> tuple[Arrays, Json] | None:
    """Return the arrays and the JSON of a message; None if it is incomplete."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, zipfile.BadZipFile):
        return None
    return arrays, json.loads(arrays.pop(_JSON).tobytes())
