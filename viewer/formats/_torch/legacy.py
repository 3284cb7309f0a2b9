r"""Legacy streams of torch: files before version 1.6, and storages inside other pickles.

::

    stream  = magic number, protocol 1001, {"little_endian": …}, value, [key, …], storage …
    storage = number of elements (8 bytes), their bytes; in the order of the keys

The first five items are consecutive pickles. Storages in the value are persistent ids.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

from viewer.diagnostics import Phrase
from viewer.formats._misfit import MisfitError
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.steps import run
from viewer.formats._pickle.tensors import Storage, storage_of
from viewer.formats._pickle.values import Span, noun

__all__ = ["MAGIC", "read_bytes", "read_stream"]

_NUMBER = 0x1950A86A20F9469CFC6C
_PROTOCOL = 1001

MAGIC = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."
"""The first bytes of a legacy file."""


def read_bytes(outer: Machine, data: Span) -> object:
    """Return the storage that a pickle of tensors contains as bytes; see ``read_stream``."""
    inner = outer.nested(data.data, data.start, data.stop)
    found = read_stream(inner)
    outer.rejoin(inner)
    if not isinstance(found, Storage):
        raise outer.fail(Phrase("torch-bytes", found=noun(found)))
    return found


def read_stream(machine: Machine) -> object:
    """Return the value of a legacy stream, with its storages in place.

    Parameters
    ----------
    machine : Machine
        At the start of the stream; at its end afterwards.

    Raises
    ------
    FormatError
        If the stream is damaged, or a storage is missing or does not have the declared size.
    """
    if run(machine) != _NUMBER:
        raise machine.fail(Phrase("torch-magic"))
    if run(machine) != _PROTOCOL:
        raise machine.fail(Phrase("torch-protocol", expected=_PROTOCOL))
    system = run(machine)
    is_little = not isinstance(system, dict) or system.get("little_endian") is not False
    storages: dict[str, Storage] = {}
    machine.persistent = partial(_declare, storages, "<" if is_little else ">")
    found = run(machine)
    machine.persistent = None
    keys = run(machine)
    for key in keys if isinstance(keys, list) else []:
        _take(machine, storages, key)
    if any(storage.load is None for storage in storages.values()):
        raise machine.fail(Phrase("tensor-no-storage"))
    return found


def _declare(storages: dict[str, Storage], order: Literal["<", ">"], persistent: object) -> Storage:
    """Return the storage of a persistent id, the same one for the same key."""
    found = storage_of(persistent)
    if found is None:
        raise MisfitError(Phrase("tensor-persistent"))
    key, storage = found
    storage.order = order
    known = storages.setdefault(key, storage)
    if (known.code, known.count) != (storage.code, storage.count):
        raise MisfitError(Phrase("tensor-storages", item=key))
    return known


def _take(machine: Machine, storages: dict[str, Storage], key: object) -> None:
    """Find the bytes of a storage, whose number must be the declared one."""
    name = key.text() if isinstance(key, Span) and key.coding is not None else ""
    storage = storages.get(name)
    if storage is None or storage.load is not None:
        raise machine.fail(Phrase("tensor-key", item=name))
    count = machine.number(8, is_signed=True)
    if count != storage.count:
        values = {"item": name, "expected": storage.count, "found": count}
        raise machine.fail(Phrase("tensor-count", **values))
    start = machine.skip(storage.size)
    storage.load = Span(machine.data, start, machine.at).view
