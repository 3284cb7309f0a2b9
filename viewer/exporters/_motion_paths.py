"""File names of exported motions: one per actor, per part or per frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from viewer.errors import ViewerError
from viewer.exporters._exporter import Exporter, Part
from viewer.exporters._gaps import file_spans
from viewer.exporters._options import ExportOptions
from viewer.phrases import printable
from viewer.rigs.captures.person import person_name
from viewer.rigs.scene import Actor

PERSON = "{person}"
"""Placeholder in file names for the number of a person or actor."""


def motion_paths(output: Path, actors: Sequence[Actor]) -> list[Path]:
    """Return each actor's file: its number for ``{person}``, else numbered from the second."""
    persons = [actor.person for actor in actors]
    known = [person_name(person).replace(" ", "-") for person in persons if person is not None]
    has_numbers = len(set(known)) == len(persons)
    if PERSON in output.name:
        own = known if has_numbers else [str(number) for number, _ in enumerate(actors, 1)]
        return [output.with_name(output.name.replace(PERSON, name)) for name in own]
    if len(actors) == 1:
        return [output]
    if has_numbers:
        names = [f"-{name}" for name in known]
    else:
        names = [f"-{number}" if number > 1 else "" for number, _ in enumerate(persons, 1)]
    return [output.with_name(f"{output.stem}{name}{output.suffix}") for name in names]


def is_together(kind: Exporter, output: Path, options: ExportOptions) -> bool:
    """Return whether all actors are written to one file, or folder."""
    is_apart = PERSON in output.name or options.closing == "split"
    return bool(kind.folder) or (kind.stores_many and not is_apart)


def part_paths(
    kind: Exporter, output: Path, actors: Sequence[Actor], options: ExportOptions
) -> list[Path]:
    """Return the file of each actor, or the same one for all."""
    if is_together(kind, output, options):
        return [output] * len(actors)
    return motion_paths(output, actors)


def files_at(kind: Exporter, path: Path) -> list[Path]:
    """Return all files that are written for a path: a folder, or a file and those beside it."""
    if kind.folder:
        return [path / kind.folder]
    suffixes = kind.written.get(path.suffix.lower(), ("",))
    return [path.with_suffix(each) if each else path for each in suffixes]


def split_paths(path: Path, count: int) -> list[Path]:
    """Return the files of a motion that is split at gaps: ``name-1.bvh``, ``name-2.bvh`` …."""
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}-{number}{path.suffix}") for number in range(1, count + 1)]


def numbered_paths(path: Path, frames: Iterable[int]) -> list[Path]:
    """Return the file of each frame; its number replaces ``{frame}`` in the name."""
    numbers = [int(frame) for frame in frames]
    try:
        files = [path.with_name(path.name.format(frame=number)) for number in numbers]
    except (ValueError, LookupError, AttributeError, TypeError, MemoryError):
        files = []
    if len(set(files)) < len(numbers):
        raise ViewerError(
            f"{printable(path, 300)}: expected a name with {{frame}}, such as walk_{{frame:05}}"
            f"{path.suffix}, for one file per frame"
        )
    return files


def part_files(kind: Exporter, part: Part, path: Path, options: ExportOptions) -> list[Path]:
    """Return all files that are written for a part: several if it is split, or one per frame."""
    if part.content == "frames" and kind.is_numbered:
        present, first = part.present, part.animation.first_frame
        is_whole = options.gaps in ("hold", "interpolate")
        return numbered_paths(
            path, first + (np.arange(len(present)) if is_whole else np.flatnonzero(present))
        )
    paths = [path]
    if part.content == "frames" and not kind.keeps_gaps:
        paths = split_paths(path, len(file_spans(part.present, options.closing)))
    return [file for each in paths for file in files_at(kind, each)]
