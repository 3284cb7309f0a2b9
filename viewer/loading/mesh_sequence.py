"""The frames of a mesh as a moving mesh: a file per frame, or an archive of all vertices.

Files are frames in the order of the numbers in their names: ``walk_2.obj`` before ``walk_10.obj``.
If the names differ only by a number, it is the number of the frame, and missing numbers are gaps.
All files must have the vertices and faces of the first one; only positions may differ. Quads may be
divided along the other diagonal, because readers choose it by the shape of the quad.

An archive has vertices (F, V, 3), with faces (T, 3) or quads (Q, 4) in it or in a mesh file that is
given with it. It is read one frame at a time::

    npz = vertices | verts | positions | points (F, V, 3)   faces | triangles | f (T, 3 or 4)
          fps | frame_rate | …
    npy = (F, V, 3)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.errors import FormatError
from viewer.formats import Source, natural_key, read
from viewer.formats._archive.checking import archive_of, corners_of
from viewer.formats._archive.values import Archive
from viewer.formats._body_keys import rate_in
from viewer.formats._frame_gaps import frame_spans
from viewer.formats._polygons import triangulate
from viewer.phrases import axes, counted, listed, printable, rounded
from viewer.progress import report
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, side_lengths, vertex_normals
from viewer.rigs.motion.moving_mesh import MovingMesh, bind_row, room_for
from viewer.rigs.motion.timing import DEFAULT_RATE

SEQUENCES = (".obj", ".ply")
"""Suffixes of files that may be the frames of a mesh."""
ARCHIVES = (".npz", ".npy")
"""Suffixes of files that may have all frames of a mesh."""
_VERTICES = ("vertices", "verts", "positions", "points", "arr_0")
_FACES = ("faces", "triangles", "f")
_LARGEST = 1 << 40  # bytes of an archive, of which one frame is in memory
# Median ratio of the lengths of edges, beyond the growth of the mesh, at which vertices are in
# another order: skin and cloth stretch to at most about twice their length.
_STRETCHED = 3.0
_TINY = 1e-300
_NUMBER = re.compile(r"(\d+)(?=\D*$)")


def read_mesh_sequence(
    paths: Sequence[Path], rate: float | None = None, bind: int | None = None
) -> tuple[MovingMesh, list[Diagnostic]]:
    """Read the frames of a mesh, in natural order, and return notes about them.

    ``paths``: a file per frame, or those of ``stores_frames``. ``bind``: number of the bind frame,
    by default the first one. ``FormatError`` at the first vertex or face that differs from those of
    the first file.
    """
    if stores_frames(paths):
        return _read_archive(paths, rate, bind)
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
        _check_order(source, figure.require_mesh(), mesh, ordered[0])
        positions[number] = figure.require_mesh().positions
        if number == row:
            bound = figure
    name = _NUMBER.sub("", ordered[0].stem).strip("_-. ") or ordered[0].parent.name or "mesh"
    whole = Figure(name, bound.mesh, up=bound.up, unit=bound.unit)
    return MovingMesh(whole, positions, numbers, rate or DEFAULT_RATE, row), notes


def stores_frames(paths: Sequence[Path]) -> bool:
    """Return whether files are an archive of a moving mesh, with or without a file of its faces."""
    archives, others = _divided(paths)
    if len(archives) != 1 or len(others) > 1 or any(not _is_frame(path) for path in others):
        return False
    archive = archive_of(Source.open(archives[0], max_size=_LARGEST))
    return _key_of_vertices(archive) is not None and (
        len(others) == 1 or any(archive.has(key) for key in _FACES)
    )


def _divided(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the archives among some files, and the others."""
    archives = [path for path in paths if path.suffix.lower() in ARCHIVES]
    return archives, [path for path in paths if path not in archives]


def _is_frame(path: Path) -> bool:
    return path.suffix.lower() in SEQUENCES


def _key_of_vertices(archive: Archive) -> str | None:
    shapes = {key: archive.shape(key) for key in _VERTICES if archive.has(key)}
    return next((key for key, shape in shapes.items() if len(shape) == 3 and shape[2] == 3), None)


def _read_archive(
    paths: Sequence[Path], rate: float | None, bind: int | None
) -> tuple[MovingMesh, list[Diagnostic]]:
    """Read a moving mesh from an archive, one frame at a time."""
    (path,), others = _divided(paths)
    source = Source.open(path, max_size=_LARGEST)
    archive = archive_of(source)
    key = _key_of_vertices(archive)
    assert key is not None  # checked by stores_frames
    stored = archive.array(key)
    count, n_vertices, _ = stored.shape
    if not count or not n_vertices:
        raise archive.fault(
            "F002.sequence-empty: {item}: expected vertices in frames, found shape {shape}",
            item=key,
            shape=axes(stored.shape),
        )
    row = bind_row(np.arange(count, dtype=np.int32), bind)
    positions = room_for(count, n_vertices)
    for frame, block in enumerate(stored.blocks(1)):
        report(frame, count, "frames", "reading")
        if not np.isfinite(block).all():
            raise archive.fault(
                "F003.sequence-number: {item}: expected finite numbers, found {found} at vertex "
                "{vertex} of frame {frame}",
                item=key,
                found=float(block[~np.isfinite(block)][0]),
                vertex=int(np.argwhere(~np.isfinite(block[0]))[0][0]),
                frame=frame,
            )
        positions[frame] = block[0]
    if others:
        whole = _mesh_of(Source.open(others[0]))
        mesh = whole.require_mesh()
        if mesh.n_vertices != n_vertices:
            raise archive.fault(
                "F004.sequence-mesh-vertices: {item}: expected {wanted} as in {first}, found "
                "{found}",
                item=key,
                wanted=counted(mesh.n_vertices, "vertex"),
                first=printable(others[0].name, 60),
                found=n_vertices,
            )
        bound = replace(
            mesh,
            positions=positions[row],
            normals=vertex_normals(positions[row], mesh.triangles),
        )
        figure = replace(whole, mesh=bound)
    else:
        triangles = _faces_in(archive, positions[row])
        bound = Mesh(positions[row], vertex_normals(positions[row], triangles), triangles)
        figure = Figure(path.stem, bound)
    numbers = np.arange(count, dtype=np.int32)
    rate = rate or rate_in(archive) or DEFAULT_RATE
    return MovingMesh(figure, positions, numbers, rate, row), list(source.diagnostics)


def _faces_in(archive: Archive, positions: Floats) -> Ints:
    """Return the triangles (T, 3) of an archive with triangles or quads."""
    key = next(key for key in _FACES if archive.has(key))
    shape = archive.shape(key)
    corners = 4 if len(shape) == 2 and shape[1] == 4 else 3
    listed = archive.array(key, (None, corners)).values()
    if not len(listed):
        raise archive.fault("F002.sequence-no-faces: {item}: expected faces, found none", item=key)
    faces = corners_of(archive, key, listed, len(positions))
    sizes = np.full(len(faces), corners, dtype=np.int32)
    picks = triangulate(positions, faces.ravel(), sizes)[0]
    triangles: Ints = faces.ravel()[picks].astype(np.int32)
    return triangles


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
    if 1 < len(names) < len(paths):
        # Some names have several numbers: a file of another sequence may be among them.
        shown = [printable(path.name, 60) for path in sorted(names)]
        return counted_up, [
            note(
                "F007.frames-names: files of {n} different names are frames of one mesh, one after "
                "the other: {names}; give only those of one sequence",
                n=len(names),
                names=listed(shown[:3] + ["…"] * (len(shown) > 3)),
            )
        ]
    if len(names) > 1 or not (steps > 0).all() or values[-1] >= 2**31:
        # Files of several names, or two spellings of one number, are frames one after the other.
        return counted_up, []
    numbers: Ints = np.array(values, dtype=np.int32)
    step = int(np.gcd.reduce(np.diff(numbers))) if len(numbers) > 1 else 1
    missing = np.setdiff1d(np.arange(numbers[0], numbers[-1] + 1, step), numbers)
    if not len(missing):
        return numbers, []
    return numbers, [
        note(
            "F007.frames-missing: {frames} of {first} to {last} {are} missing: interpolated",
            frames=listed(frame_spans(missing, step)),
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


def _check_order(source: Source, mesh: Mesh, first: Mesh, path: Path) -> None:
    """Raise if the vertices of a file are probably those of the first file in another order."""
    lengths, before = (side_lengths(each.positions, each.triangles) for each in (mesh, first))
    grown = np.ptp(mesh.positions, axis=0).max() / max(np.ptp(first.positions, axis=0).max(), _TINY)
    known = before > 0.0
    if not known.any():
        return
    ratio = float(np.median(lengths[known] / before[known]))
    if ratio > _STRETCHED * max(grown, 1.0):
        raise FormatError.fault(
            "F004.sequence-order: expected edges about as long as in {first}, found half of them "
            "more than {ratio} times as long: the vertices seem to be in another order",
            source.path,
            first=printable(path.name, 60),
            ratio=rounded(ratio, 2),
        )


def _first_other_face(triangles: Ints, others: Ints) -> int | None:
    """Return a row of the first face that differs, regardless of the diagonals of polygons."""
    differs = (np.sort(triangles, axis=1) != np.sort(others, axis=1)).any(axis=1)
    if not differs.any():
        return None
    # The triangles of a polygon follow each other, and have its outline as their boundary (the
    # edges that an odd number of them has) however it is divided. That of a whole closed mesh is
    # empty, whatever its faces are.
    rows = np.flatnonzero(differs)
    first, outline, other = int(rows[0]), set[tuple[int, int]](), set[tuple[int, int]]()
    for row, following in zip(rows.tolist(), [*rows[1:].tolist(), -1], strict=True):
        outline ^= _edges(triangles[row])
        other ^= _edges(others[row])
        if outline and outline == other:
            first, outline, other = following, set(), set()
    return None if first < 0 else first


def _edges(triangle: Ints) -> set[tuple[int, int]]:
    a, b, c = sorted(triangle.tolist())
    return {(a, b), (b, c), (a, c)}


def _line(source: Source, kind: str, index: int) -> int | None:
    place = source.place(kind, index)
    return None if place is None else place[1]
