"""Files of one mesh, a file per frame, as a moving mesh.

Files are frames in the order of the numbers in their names: ``walk_2.obj`` before ``walk_10.obj``.
If the names differ only by a number, it is the number of the frame, and missing numbers are gaps.
All files must have the vertices and faces of the first one; only positions may differ. Quads may be
divided along the other diagonal, because readers choose it by the shape of the quad.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, frame_range, note
from viewer.errors import FormatError
from viewer.formats import Source, natural_key, read
from viewer.phrases import counted, listed, printable
from viewer.progress import report
from viewer.rigs.arrays import Ints
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.moving_mesh import MovingMesh, bind_row, room_for
from viewer.rigs.motion.timing import DEFAULT_RATE

SEQUENCES = (".obj", ".ply")
"""Suffixes of files that may be the frames of a mesh."""
_NUMBER = re.compile(r"(\d+)(?=\D*$)")


def read_mesh_sequence(
    paths: Sequence[Path], rate: float | None = None, bind: int | None = None
) -> tuple[MovingMesh, list[Diagnostic]]:
    """Read the frames of a mesh, in natural order, and return notes about them.

    ``bind``: number of the bind frame, by default the first one. ``FormatError`` at the first
    vertex or face that differs from those of the first file.
    """
    ordered = sorted(paths, key=lambda path: natural_key(path.as_posix()))
    numbers, notes = frame_numbers(ordered)
    row = bind_row(numbers, bind)
    first = _mesh_of(Source.open(ordered[0]))
    mesh = first.require_mesh()
    if mesh.n_triangles == 0:
        raise FormatError.fault("F002.sequence-faces: expected faces, found none", ordered[0])
    positions = room_for(len(ordered), mesh.n_vertices)
    positions[0], bound = mesh.positions, first
    for number, path in enumerate(ordered[1:], start=1):
        report(number, len(ordered), "frames", "reading")
        source = Source.open(path)
        figure = _mesh_of(source)
        _check_same(source, figure.require_mesh(), mesh, ordered[0])
        positions[number] = figure.require_mesh().positions
        if number == row:
            bound = figure
    name = _NUMBER.sub("", ordered[0].stem).strip("_-. ") or ordered[0].parent.name or "mesh"
    whole = Figure(name, bound.mesh, up=bound.up, unit=bound.unit)
    return MovingMesh(whole, positions, numbers, rate or DEFAULT_RATE, row), notes


def frame_numbers(paths: Sequence[Path]) -> tuple[Ints, list[Diagnostic]]:
    """Return the number of each frame (F,) from its name, and notes about missing ones.

    >>> paths = [Path("a_0010.obj"), Path("a_0020.obj"), Path("a_0040.obj")]
    >>> numbers, (missing,) = frame_numbers(paths)
    >>> numbers.tolist(), str(missing)
    ([10, 20, 40], 'frame 30 of 10 to 40 is missing: interpolated')
    """
    found = [_NUMBER.search(path.stem) for path in paths]
    counted_up: Ints = np.arange(len(paths), dtype=np.int32)
    if not all(found):
        return counted_up, []
    names = {path.with_name(_NUMBER.sub("", path.stem) + path.suffix) for path in paths}
    values = [int(each[0]) for each in found if each is not None]
    steps = np.diff(np.array(values, dtype=np.float64))
    if len(names) > 1 or not (steps > 0).all() or values[-1] >= 2**31:
        # Files of several names, or two spellings of one number, are frames one after the other.
        return counted_up, []
    numbers: Ints = np.array(values, dtype=np.int32)
    step = int(np.gcd.reduce(np.diff(numbers))) if len(numbers) > 1 else 1
    missing = np.setdiff1d(np.arange(numbers[0], numbers[-1] + 1, step), numbers)
    if not len(missing):
        return numbers, []
    runs = np.split(missing, np.flatnonzero(np.diff(missing) > step) + 1)
    spans = [frame_range(int(run[0]), int(run[-1])) for run in runs]
    return numbers, [
        note(
            "F007.frames-missing: {frames} of {first} to {last} {are} missing: interpolated",
            frames=listed(spans),
            first=int(numbers[0]),
            last=int(numbers[-1]),
            are="is" if len(missing) == 1 else "are",
        )
    ]


def _mesh_of(source: Source) -> Figure:
    content = read(source)
    if not isinstance(content, Figure) or content.mesh is None or content.skeleton is not None:
        raise source.fault("F004.sequence-mesh: expected a mesh without a skeleton, one per frame")
    return content


def _check_same(source: Source, mesh: Mesh, first: Mesh, path: Path) -> None:
    """Raise at the first element of a file that is not one of the first file."""
    extra = mesh.n_vertices - first.n_vertices
    if extra:
        raise FormatError.fault(
            "F004.sequence-vertices: expected {wanted} as in {first}, found {found}",
            source.path,
            _line(source, "positions", min(first.n_vertices, mesh.n_vertices - 1)),
            wanted=counted(first.n_vertices, "vertex"),
            first=printable(path.name, 60),
            found=mesh.n_vertices,
        )
    if mesh.n_triangles != first.n_triangles:
        raise FormatError.fault(
            "F004.sequence-triangles: expected the faces of {first}, {wanted}, found {found}",
            source.path,
            _line(source, "triangles", min(first.n_triangles, mesh.n_triangles - 1)),
            wanted=counted(first.n_triangles, "triangle"),
            first=printable(path.name, 60),
            found=mesh.n_triangles,
        )
    wrong = _first_other_face(mesh.triangles, first.triangles)
    if wrong is not None:
        raise FormatError.fault(
            "F004.sequence-face: expected vertices {wanted} as in {first}, found {found}",
            source.path,
            _line(source, "triangles", wrong),
            wanted=listed(first.triangles[wrong].tolist()),
            first=printable(path.name, 60),
            found=listed(mesh.triangles[wrong].tolist()),
        )


def _first_other_face(triangles: Ints, others: Ints) -> int | None:
    """Return a row of the first face that differs, regardless of the diagonals of polygons."""
    differs = (np.sort(triangles, axis=1) != np.sort(others, axis=1)).any(axis=1)
    if not differs.any():
        return None
    # The triangles of a polygon have its outline as their boundary, however it is divided: without
    # the triangles that both have, the boundaries (edges that an odd number has) must be equal.
    if np.array_equal(_odd_edges(triangles[differs]), _odd_edges(others[differs])):
        return None
    return int(differs.argmax())


def _odd_edges(triangles: Ints) -> Ints:
    """Return the edges (E, 2) that an odd number of triangles has, in order."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    found, counts = np.unique(edges, axis=0, return_counts=True)
    return found[counts % 2 == 1]


def _line(source: Source, kind: str, index: int) -> int | None:
    place = source.place(kind, index)
    return None if place is None else place[1]
