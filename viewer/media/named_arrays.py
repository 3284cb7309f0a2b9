"""Writing of named arrays as ``.npz`` archives."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from viewer.media.saving import save_parts
from viewer.progress import report_bytes

_BLOCK = 1 << 22  # bytes that are compressed or written between reports of progress


def save_arrays(path: str | Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write named arrays as an ``.npz`` without pickled objects; see ``save_bytes``."""
    buffer = io.BytesIO()
    total = sum(array.nbytes for array in arrays.values())
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        compressed = _Compressed(f"compressing {Path(path).name}", total)
        for name, array in arrays.items():
            # A fixed date, so that the same arrays give the same bytes.
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.file_size = array.nbytes  # a large size needs another header
            with archive.open(entry, "w") as compressed.member:
                np.lib.format.write_array(compressed, array, allow_pickle=False)
    with buffer.getbuffer() as data:
        starts = range(0, len(data), _BLOCK)
        save_parts(path, (bytes(data[start : start + _BLOCK]) for start in starts))


class _Compressed:
    """Members of an archive, to which numpy writes arrays in blocks; reports the progress."""

    def __init__(self, what: str, total: int) -> None:
        self.member: IO[bytes] | None = None
        self._what, self._total, self._done = what, total, 0

    def write(self, block: bytes) -> None:
        """Compress a block."""
        assert self.member is not None  # set by the loop over the arrays
        for start in range(0, len(block), _BLOCK):
            part = block[start : start + _BLOCK]
            self.member.write(part)
            self._done += len(part)
            report_bytes(min(self._done, self._total), self._total, self._what)
