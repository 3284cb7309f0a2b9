"""Reader of pickles with arrays and plain data, which neither unpickles nor runs code.

::

    reading.py this file: the pickle must be a dict of named values
    steps.py        the opcodes of protocols 0 to 5
    machine.py      bytes, stack, memo and budget of the machine that executes them
    names.py        the allowed names and their arguments values.py       inert values that
    represent these names resolving.py    conversion of values to arrays, sparse matrices and plain
    data, key by key

Arrays are views of the file's bytes. They are often unaligned, so an array that is used in a loop
should be copied first.
"""

from __future__ import annotations

from viewer.formats._archive.values import Archive, Value
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.resolving import resolve
from viewer.formats._pickle.steps import run
from viewer.formats._pickle.values import noun
from viewer.formats._source import Source
from viewer.phrases import printable

__all__ = ["open_pickle"]


def open_pickle(source: Source) -> Archive:
    """Open a pickle; raises as ``open_archive`` does.

    Parameters
    ----------
    source : Source
        Pickle, whose bytes stay in memory as long as any of the arrays exists.
    """
    machine = Machine(source)
    whole = run(machine)
    rest = len(source.data) - machine.at
    if rest:
        source.warn("F006.pickle-rest", n=rest)
    values = _named(source, whole)
    path, size = source.path, len(source.data)

    def load(key: str) -> Value:
        return resolve(path, size, key, values[key])

    return Archive(source, "pickle", tuple(values), load)


def _named(source: Source, whole: object) -> dict[str, object]:
    """Return the values by name; names may be bytes, as Python 3 writes strings of Python 2."""
    if not isinstance(whole, dict):
        raise source.fault("F002.pickle-named", found=noun(whole))
    values: dict[str, object] = {}
    for key, value in whole.items():
        if isinstance(key, int):
            raise source.fault("F002.pickle-key", found=key)
        name = key if isinstance(key, str) else key.decode("latin-1")
        if name in values:
            raise source.fault("F002.pickle-twice", item=printable(name, 60))
        values[name] = value
    return values
