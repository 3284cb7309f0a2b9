"""Opening of pickles, ``.npz``, ``.npy``, torch and JSON files, detected by their first bytes."""

from __future__ import annotations

import json
import re
from functools import partial

from viewer.formats._archive.file_window import Data, FileWindow
from viewer.formats._archive.values import Archive, Value
from viewer.formats._joblib.compression import is_compressed
from viewer.formats._source import Source
from viewer.formats._text.json_places import MOST_DIGITS, deepest_place, long_number_place
from viewer.phrases import printable

__all__ = ["is_archive", "open_archive"]

_LARGE = 32 << 20  # bytes up to which pickles are read as a whole
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
    return head.startswith((*_ZIP, _NPY)) or _PICKLE.match(head) is not None or is_compressed(head)


def open_archive(source: Source) -> Archive:
    """Open a pickle, ``.npz``, ``.npy``, torch or JSON file, detected by its first bytes.

    Parameters
    ----------
    source : Source
        The file. Harmless errors are added to its warnings. Its ``max_size`` also limits the total
        unpacked size of compressed files.

    Raises
    ------
    FormatError
        If the file is none of these, is damaged, or contains anything other than data.
    """
    # Imported late, so that readers of other formats do not import them.
    from viewer.formats._archive.npz import open_npy, open_npz
    from viewer.formats._archive.zip_directory import open_directory
    from viewer.formats._joblib.compression import unpacked
    from viewer.formats._torch.zipped import is_torch, open_torch

    head = source.peek(4096)
    if head.startswith(_ZIP):
        with open_directory(source) as directory:
            if is_torch(directory):
                return open_torch(directory)
            return open_npz(directory, partial(_open_member, source), partial(_list_member, source))
    if head.startswith(_NPY):
        return open_npy(source, _open_objects)
    if head.startswith(_LFS):
        raise source.fault("F002.archive-pointer")
    if is_compressed(head):
        return _open_pickle(source, unpacked(source))
    if head.lstrip()[:1] in (b"{", b"["):
        return _open_json(source)
    if not is_archive(head):
        looks = source.looks_like() or "an unknown format"
        raise source.fault("F002.archive", found=looks)
    return _open_pickle(source, _pickle_data(source))


def _open_json(source: Source) -> Archive:
    """Open a JSON file; NaN and infinities are numbers, as Python writes them."""
    from viewer.formats._pickle.reading import named_archive

    text = source.data.decode("utf-8", "replace")
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as problem:
        offset = len(text[: problem.pos].encode())
        raise source.fault("F002.json", offset, reason=printable(problem.msg, 100)) from None
    except RecursionError:
        raise source.fault("F002.json-nesting", deepest_place(text)) from None
    except ValueError:  # decoding can raise no other error
        place = long_number_place(text)
        raise source.fault("F002.capture-digits", place, most=MOST_DIGITS) from None
    return named_archive(source, "json", len(source.data), whole)


def _pickle_data(source: Source) -> Data:
    """Return the bytes of a pickle; the bytes of a large file are read on demand."""
    from viewer.formats._archive.stored_file import StoredFile

    if source._data is None:
        storage = StoredFile(source)
        if storage.size > _LARGE:
            return FileWindow(storage)
    return source.data


def _open_pickle(source: Source, data: Data) -> Archive:
    """Open a pickle, or a legacy torch file, which begins like one."""
    from viewer.formats._pickle.machine import Machine
    from viewer.formats._pickle.reading import named_archive, warn_of_rest
    from viewer.formats._pickle.steps import run
    from viewer.formats._torch.legacy import MAGIC, read_bytes, read_stream

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    whole = read_stream(machine) if data[: len(MAGIC)] == MAGIC else run(machine)
    warn_of_rest(machine)
    return named_archive(source, "pickle", len(data), whole)


def _open_member(source: Source, key: str, data: bytes) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects of an ``.npz``; None for others."""
    from viewer.formats._pickle.machine import Machine
    from viewer.formats._pickle.reading import nested_archive
    from viewer.formats._pickle.steps import run
    from viewer.formats._torch.legacy import read_bytes

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    return nested_archive(source, "npz", len(data), run(machine), (key,))


def _list_member(source: Source, key: str, data: bytes) -> Value:
    """Return the objects in an array of objects of an ``.npz`` as a list; None for others."""
    from viewer.formats._pickle.machine import Machine
    from viewer.formats._pickle.reading import listed
    from viewer.formats._pickle.steps import run
    from viewer.formats._torch.legacy import read_bytes

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    return listed(source, len(data), key, run(machine))


def _open_objects(source: Source, offset: int) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects; None for other objects."""
    from viewer.formats._pickle.machine import Machine
    from viewer.formats._pickle.reading import has_names, named_archive, warn_of_rest
    from viewer.formats._pickle.steps import run
    from viewer.formats._torch.legacy import read_bytes

    data = _pickle_data(source)
    machine = Machine(source, data, offset)
    machine.load_bytes = read_bytes
    whole = run(machine)
    warn_of_rest(machine)
    return named_archive(source, "npy", len(data), whole) if has_names(whole) else None
