"""Cache of figures that many runs in one process read, such as the model of a batch."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, TypeVar

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.formats._source import Source
from viewer.rigs.figure import Figure

_Content = TypeVar("_Content")


@dataclass(frozen=True)
class _Kept:
    """An immutable figure, and what its reader recorded."""

    state: tuple[object, ...]
    content: Any
    diagnostics: tuple[Diagnostic, ...]
    also_read: tuple[Path, ...]
    used_options: frozenset[str]


_kept: dict[Path, _Kept] = {}
_wanted: frozenset[Path] = frozenset()


@contextlib.contextmanager
def keeping_figures(paths: Collection[Path]) -> Iterator[None]:
    """Cache the figures of files, until changed, for later runs, until a run caches others."""
    global _wanted
    before = _wanted
    _wanted = frozenset(path.resolve() for path in paths)
    for path in _kept.keys() - _wanted:
        del _kept[path]
    try:
        yield
    finally:
        _wanted = before


def kept_or_read(source: Source, reader: Callable[[Source], _Content]) -> _Content:
    """Return the content of a file from an earlier run, or read it."""
    path = source.path.resolve() if _wanted else source.path
    if path not in _wanted or source.is_folder:
        return reader(source)
    # Files to which a figure refers are checked too: textures or buffers may be replaced alone.
    known = _kept.get(path)
    if known is not None and known.state == _state(source, known.also_read):
        for found in known.diagnostics:
            source.diagnostics.add(found)
        source.also_read += known.also_read
        source.used_options |= known.used_options
        return known.content
    n_found, n_read = len(source.diagnostics), len(source.also_read)
    content = reader(source)
    from viewer.rigs.figure import FigureGroup

    if isinstance(content, Figure | FigureGroup):
        also = tuple(source.also_read[n_read:])
        new = tuple(source.diagnostics)[n_found:]
        state = _state(source, also)
        _kept[path] = _Kept(state, content, new, also, frozenset(source.used_options))
    return content


def _state(source: Source, others: Collection[Path]) -> tuple[object, ...]:
    """Return a key that changes if a figure would now be read differently."""
    stamps = []
    for path in (source.path, *others):
        try:
            status = path.stat()
            stamps.append((status.st_ino, status.st_size, status.st_mtime_ns))
        except OSError:
            stamps.append((0, 0, 0))
    return (str(source.path), source.max_size, tuple(sorted(source.options.items())), *stamps)
