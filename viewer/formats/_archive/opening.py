"""Opens archives: pickles, ``.npz`` and ``.npy`` files, detected by their first bytes."""

from __future__ import annotations

import re

from viewer.formats._archive.values import Archive
from viewer.formats._source import Source

__all__ = ["is_archive", "open_archive"]

_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
_NPY = b"\x93NUMPY"
_LFS = b"version https://git-lfs"
# Protocols 2 to 5 have a header; protocols 0 and 1 begin with the value that they build.
_PICKLE = re.compile(
    rb"\x80[\x02-\x05]|\(d[pqSUVX(.]|\}[q(.]|\(lp[0-9]|\][q(.]"
    rb"|c(?:__builtin__|builtins|copy_reg|collections|numpy|scipy|chumpy|os|posix|nt)[\w.]*\r?\n"
)


def is_archive(head: bytes) -> bool:
    r"""Return whether a file that begins with these bytes is a pickle, an ``.npz`` or an ``.npy``.

    >>> is_archive(b"\x80\x02}q\x01."), is_archive(b"positions 4 {")
    (True, False)
    """
    return head.startswith((*_ZIP, _NPY)) or _PICKLE.match(head) is not None


def open_archive(source: Source) -> Archive:
    """Open a pickle, ``.npz`` or ``.npy`` file, detected by its first bytes.

    Parameters
    ----------
    source : Source
        The file. Harmless errors are added to its warnings. Its ``max_size`` also limits the total
        unpacked size of all members of an ``.npz``.

    Raises
    ------
    FormatError
        If the file is none of these, is damaged, or contains anything other than data.
    """
    # Imported late, so that readers of other formats do not import them.
    from viewer.formats._archive.npz import open_npy, open_npz
    from viewer.formats._pickle.reading import open_pickle

    head = source.peek(4096)
    if head.startswith(_ZIP):
        return open_npz(source)
    if head.startswith(_NPY):
        return open_npy(source)
    if head.startswith(_LFS):
        raise source.fault("F002.archive-pointer")
    if not is_archive(head):
        looks = source.looks_like() or "an unknown format"
        raise source.fault("F002.archive", found=looks)
    return open_pickle(source)
