"""Arrays of a PIG model, read from text tables or an archive with the same checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part as FaultPart
from viewer.diagnostics import Phrase
from viewer.formats._archive.checking import archive_of, finite
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats._text.table import read_table
from viewer.phrases import printable
from viewer.rig.arrays import Floats

__all__ = ["CORE", "OPTIONAL", "Part", "PigFiles", "open_parts"]

CORE = {
    "vertices": 3,
    "t_pose_joints": 3,
    "parents": 1,
    "skinning_weights": 3,
    "faces_vert": 3,
}
"""Required arrays, with their columns in a text file."""

OPTIONAL = {
    "J_regressor": 3,
    "textures": 2,
    "faces_tex": 3,
    "body_parts": 1,
    "reduced_ids": 1,
    "reduced_faces": 3,
    "sym": 1,
}
"""Optional arrays."""

_SPARSE = ("skinning_weights", "J_regressor")
_WIDTHS = {**CORE, **OPTIONAL}
_PARTS: dict[str, FaultPart] = {
    "vertices": "positions",
    "t_pose_joints": "joints",
    "parents": "joints",
    "faces_vert": "triangles",
}


@dataclass(frozen=True, slots=True)
class Part:
    """One array and its origin.

    Attributes
    ----------
    name : str
        File name or key, for messages.
    values : (N, columns)
        Numbers; for a sparse matrix, rows of (joint, vertex, weight).
    source : Source
        The file, which records errors.
    offset_of : callable or None
        Returns the offset of a row in a text file; None for archives, which have no lines.
    """

    name: str
    values: NDArray[Any]
    source: Source
    offset_of: Callable[[int], int] | None = None

    def offset(self, row: int) -> int | None:
        """Return the offset of a row in the file; None for archives."""
        return None if self.offset_of is None else self.offset_of(row)

    def item(self, row: int | None = None) -> Phrase | str:
        """Return the name of a row or of the array in messages; empty if the file identifies it."""
        if self.offset_of is not None:
            return ""
        name = printable(self.name, 60)
        return name if row is None else Phrase("row-of", name=name, index=row)

    def odd_offset(self, wanted: int) -> int | None:
        """Return the offset of the first surplus row, or of the last row if rows are missing."""
        return self.offset(min(wanted, len(self.values) - 1))

    def remember(self, kind: str, row_of: Callable[[int], int]) -> None:
        """Register a function that finds the row of an element; see ``Source.remember``."""
        offset_of = self.offset_of
        if offset_of is not None:
            self.source.remember(kind, lambda index: offset_of(row_of(index)))


@dataclass(slots=True)
class PigFiles:
    """All arrays of a model that are present."""

    parts: dict[str, Part] = field(default_factory=dict)
    part_names: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()


def open_parts(source: Source) -> PigFiles:
    """Read all arrays of a text folder, pickle or ``.npz``.

    Raises
    ------
    FormatError
        If a required array is missing; the message lists all missing arrays.
    """
    return _from_folder(source) if source.is_folder else _from_archive(source)


def _from_folder(source: Source) -> PigFiles:
    present = {path.name for path in source.path.iterdir()}
    missing = [f"{name}.txt" for name in CORE if f"{name}.txt" not in present]
    if missing:
        raise source.fault("F002.pig-folder", missing=missing)
    files = PigFiles()
    for name, columns in _WIDTHS.items():
        if f"{name}.txt" in present:
            part = _text_part(source.inside(f"{name}.txt"), name, columns)
            if len(part.values):
                files.parts[name] = part
    if "body_part_defs.txt" in present:
        text = source.inside("body_part_defs.txt").data.decode("utf-8", "replace")
        files.part_names = tuple(
            printable(line.strip(), 60) for line in text.splitlines() if line.strip()
        )
    known = {f"{name}.txt" for name in (*_WIDTHS, "body_part_defs")}
    files.ignored = tuple(sorted(name for name in present - known if not name.startswith(".")))
    return files


def _text_part(source: Source, name: str, columns: int) -> Part:
    rows, offset_of = read_table(source, columns, _PARTS.get(name, ""))
    if name not in CORE and np.isnan(rows.sum()):
        rows = rows[:0]  # an incomplete array cannot be used
    return Part(f"{name}.txt", rows, source, offset_of)


def _from_archive(source: Source) -> PigFiles:
    archive = archive_of(source)
    missing = [name for name in CORE if not archive.has(name)]
    if missing:
        raise source.fault("F002.pig-keys", missing=missing, found=list(archive.keys))
    files = PigFiles()
    for name, columns in _WIDTHS.items():
        if archive.has(name):
            files.parts[name] = _archive_part(source, name, columns)
    if archive.has("body_part_defs"):
        files.part_names = _names(source)
    files.ignored = tuple(key for key in archive.keys if key not in (*_WIDTHS, "body_part_defs"))
    return files


def _archive_part(source: Source, name: str, columns: int) -> Part:
    archive = archive_of(source)

    if name in _SPARSE and not _is_entries(archive, name):
        joints, vertices, weights = _entries(archive, name)
        return Part(name, np.stack([joints, vertices, weights], axis=1), source)
    shape = (None,) if columns == 1 else (None, columns)
    if columns == 1 and len(getattr(archive.get(name), "shape", ())) == 2:
        shape = (None, 1)
    numbers = archive.array(name, shape).values()
    values = finite(archive, name, numbers, _PARTS.get(name, "")).reshape(-1, columns)
    if len(values) == 0:
        raise archive.fault("F002.no-rows", item=name)
    return Part(name, values, source)


def _entries(archive: Archive, name: str) -> tuple[NDArray[Any], NDArray[Any], Floats]:
    """Return joint, vertex and weight of each entry of a J x V or V x J matrix."""
    n_joints, n_vertices = _rows(archive, "t_pose_joints"), _rows(archive, "vertices")
    is_turned = getattr(archive.get(name), "shape", ()) == (n_vertices, n_joints) != (n_joints,) * 2
    sides = (n_vertices, n_joints) if is_turned else (n_joints, n_vertices)
    rows, columns, numbers = archive.sparse(name, sides).entries()
    part: FaultPart = "weights" if name == "skinning_weights" else ""
    weights = finite(archive, name, numbers, part, rows if is_turned else columns)
    return (columns, rows, weights) if is_turned else (rows, columns, weights)


def _is_entries(archive: Archive, name: str) -> bool:
    """Return whether a matrix is stored as rows of (joint, vertex, weight), as in text folders."""
    shape: tuple[int, ...] = getattr(archive.get(name), "shape", ())
    sides = _rows(archive, "t_pose_joints"), _rows(archive, "vertices")
    return shape[1:] == (3,) and shape not in (sides, sides[::-1])


def _rows(archive: Archive, name: str) -> int:
    return archive.array(name, (None, 3)).shape[0]


def _names(source: Source) -> tuple[str, ...]:
    archive = archive_of(source)
    value = archive.get("body_part_defs")
    if isinstance(value, list | tuple):
        return tuple(printable(name, 60) for name in value if isinstance(name, str))
    names = archive.array("body_part_defs", (None,), "SU").values()
    return tuple(printable(name, 60) for name in names.astype(str).tolist())
