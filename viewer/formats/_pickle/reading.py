"""Reader of pickles with arrays and plain data, which neither unpickles nor runs code.

::

    reading.py        this file: the pickle must be a dict of named values, or a list of such dicts
    steps.py          the opcodes of protocols 0 to 5
    machine.py        bytes, stack, memo and budget of the machine that executes them
    names.py          the allowed names and their arguments
    values.py         inert values that represent these names
    tensors.py        tensors of torch
    joblib_arrays.py  arrays that follow their description, as joblib writes them
    resolving.py      conversion of values to arrays, sparse matrices and plain data, key by key

Arrays are views of the file's bytes. They are often unaligned, so an array that is used in a loop
should be copied first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from viewer.formats._archive.values import Archive, Value
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.resolving import resolve
from viewer.formats._pickle.values import Array, noun
from viewer.formats._source import Source
from viewer.formats._text.json_places import Keys
from viewer.phrases import printable

__all__ = ["has_names", "listed", "named_archive", "nested_archive", "warn_of_rest"]


def warn_of_rest(machine: Machine) -> None:
    """Record a note about bytes after the end of a pickle."""
    rest = machine.end - machine.at
    if rest:
        machine.source.warn("F006.pickle-rest", n=rest)


def named_archive(source: Source, kind: str, size: int, whole: object) -> Archive:
    """Return the values that a pickle builds, as an archive.

    Parameters
    ----------
    source : Source
        Its file, whose bytes stay in memory as long as any of the arrays exists.
    kind : str
        As for ``Archive``.
    size : int
        Bytes from which the values were read, which limit their number.
    whole : object
        The value on the machine's stack.

    Raises
    ------
    FormatError
        If it is neither a dict with string keys, nor a list or dict of dicts.
    """
    found = _objects(whole)
    is_list = not isinstance(found, dict)
    return _archive(source, kind, size, _named(source, found), (), is_list)


def nested_archive(
    source: Source, kind: str, size: int, whole: object, path: Keys
) -> Archive | None:
    """Return the values that a pickle inside an archive builds; None if they have no names.

    ``path`` has the keys and indices that lead to it; for the others, see ``named_archive``.
    """
    found = _items(_objects(whole))
    if found is None:
        return None
    is_list = not isinstance(_objects(whole), dict)
    return _archive(source, kind, size, _strings(source, found), path, is_list)


def listed(source: Source, size: int, key: str, whole: object) -> Value:
    """Return the objects of an array of objects in nested lists; None for other values."""
    if not isinstance(whole, Array) or whole.items is None:
        return None
    items, (_, *sides) = whole.items, whole.shape or (1,)
    if sides and (whole.is_fortran or math.prod(whole.shape) != len(items) or not items):
        return None
    for side in reversed(sides):
        items = [items[start : start + side] for start in range(0, len(items), side)]
    return resolve(source.path, size, key, items)


def has_names(whole: object) -> bool:
    """Return whether an array of objects contains one dict, or only dicts."""
    return _items(_objects(whole)) is not None


def _objects(whole: object) -> object:
    """Return the objects of an array of objects; a single one is returned unchanged."""
    if not isinstance(whole, Array) or whole.items is None:
        return whole
    return whole.items[0] if len(whole.items) == 1 else whole.items


def _archive(
    source: Source,
    kind: str,
    size: int,
    values: dict[str, object],
    path: Keys,
    is_list: bool,
) -> Archive:
    label = "".join(f"{key}." for key in path)

    def load(key: str) -> Value:
        return resolve(source.path, size, label + key, values[key])

    def branch(key: str) -> Archive | None:
        inner = (*path, int(key) if is_list else key)
        return nested_archive(source, kind, size, values[key], inner)

    def objects(key: str) -> Value:
        return listed(source, size, label + key, values[key])

    keys = tuple(values)
    return Archive(source, kind, keys, load, branch, label, objects, is_list, path)


def _items(value: object) -> Mapping[str | bytes | int, object] | None:
    """Return a dict, or by index the dicts of a list, or its lists of dicts; else None.

    None and empty items of a list stand for missing frames.
    """
    if isinstance(value, dict):
        return value
    if isinstance(value, list | tuple) and any(map(_has_dict, value)) and all(map(_is_nest, value)):
        return dict(enumerate(value))
    return None


def _has_dict(item: object) -> bool:
    return isinstance(item, dict) or (isinstance(item, list | tuple) and any(map(_has_dict, item)))


def _is_nest(item: object) -> bool:
    """Return whether an item of a list is a dict, None, or a list of these, which may be empty."""
    if isinstance(item, list | tuple):
        return all(inner is None or isinstance(inner, dict) for inner in item)
    return item is None or isinstance(item, dict)


def _named(source: Source, whole: object) -> dict[str, object]:
    """Return the values by name; numbers are names only of dicts, such as people."""
    found = _items(whole)
    if found is None:
        raise source.fault("F002.pickle-named", found=noun(whole))
    is_lost = any(isinstance(value, dict | list | tuple) for value in found.values())
    for key, value in found.items():
        if is_lost and value is None:
            continue  # a frame without people
        if isinstance(key, int) and not isinstance(value, dict | list | tuple):
            raise source.fault("F002.pickle-key", found=key)
    return _strings(source, found)


def _strings(source: Source, found: Mapping[str | bytes | int, object]) -> dict[str, object]:
    """Return values by name; names may be bytes, as Python 3 writes strings of Python 2."""
    values: dict[str, object] = {}
    for key, value in found.items():
        name = key.decode("latin-1") if isinstance(key, bytes) else str(key)
        if name in values:
            raise source.fault("F002.pickle-twice", item=printable(name, 60))
        values[name] = value
    return values
