"""Keys of items: hashes of inputs, options and program version that identify finished items."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from hashlib import blake2b

from viewer.batching.items import Item

__all__ = ["item_key"]

_CHUNK = 1 << 20
_SIZE = 16  # bytes of a key
_remembered: dict[tuple[object, ...], bytes] = {}


def item_key(item: Item, settings: str, shared: Iterable[str] = ()) -> str:
    """Return the key of an item, which changes whenever its result may change.

    Files that an input refers to, such as textures, are not included.

    Parameters
    ----------
    item : Item
        The item; the key includes the content of its files, not their location, and the output's
        name.
    settings : str
        Everything else that affects the result: job, options, version of the program.
    shared : iterable of str
        Files that all items read; each is read once per process.

    Raises
    ------
    OSError
        If a file cannot be read, or is a pipe or device.
    """
    total = blake2b(digest_size=_SIZE)
    where = item.output or item.name
    for text in (settings, where):
        total.update(os.fsencode(text) + b"\0")
    for path in item.files:
        total.update(_digest(path))
    for path in shared:
        known = _stamp(path)
        if known not in _remembered:
            _remembered[known] = _digest(path)
        total.update(_remembered[known])
    return total.hexdigest()


def _stamp(path: str) -> tuple[object, ...]:
    """Return a path with the sizes and times of its files, which a folder itself does not have."""
    inner = [os.path.join(folder, name) for folder, _, names in os.walk(path) for name in names]
    files = [path, *sorted(filter(os.path.isfile, inner))]
    states = [(file, os.stat(file)) for file in files]
    return tuple((file, state.st_size, state.st_mtime_ns) for file, state in states)


def _digest(path: str) -> bytes:
    """Return the hash of a file, of a folder's files and their names, or of an archive member."""
    total = blake2b(digest_size=_SIZE)
    if os.path.isdir(path):
        for folder, folders, files in os.walk(path):
            folders.sort()
            for name in sorted(files):
                inner = os.path.join(folder, name)
                total.update(os.fsencode(os.path.relpath(inner, path)) + b"\0")
                # Pipes and devices may never end, and links may be broken.
                total.update(_digest(inner) if os.path.isfile(inner) else b"-")
        return total.digest()
    member = ""
    while not os.path.exists(path) and os.path.dirname(path) not in ("", path):
        path, last = os.path.split(path)
        member = f"{last}/{member}"
    total.update(os.fsencode(member))
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(errno.EINVAL, "not a file", path)
    with open(path, "rb", buffering=0) as stream:
        while chunk := stream.read(_CHUNK):
            total.update(chunk)
    return total.digest()
