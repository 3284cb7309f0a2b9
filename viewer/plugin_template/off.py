"""Reader of ``.off`` meshes (Object File Format).

::

    file  = ["OFF"] counts vertex+ face*
    counts = n_vertices n_faces n_edges
    vertex = x y z
    face   = n index{n} colour*

Lines that are empty or begin with ``#`` do not count. Faces of more than three vertices are fans of
triangles; colours are not read.
"""

import numpy as np

import viewer
from viewer.formats import Source

Line = tuple[int, list[bytes]]
"""Offset of a line in the file, and its words."""


def read(source: Source) -> viewer.Figure:
    """Return the mesh of a file; errors name its line."""
    lines = _lines(source)
    if lines and lines[0][1] == [b"OFF"]:
        del lines[0]
    start, words = lines[0] if lines else (source.end, [])
    counts = _numbers(source, start, words, "numbers of vertices, faces and edges", 2)
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    if len(lines) - 1 < n_vertices + n_faces:
        raise source.fault(
            "F002.off-lines: expected {wanted} lines after the counts, found {found}",
            lines[-1][0],
            wanted=n_vertices + n_faces,
            found=len(lines) - 1,
        )
    vertices = [
        _numbers(source, at, found, "three coordinates", 3)[:3]
        for at, found in lines[1 : 1 + n_vertices]
    ]
    triangles = [
        corners
        for at, found in lines[1 + n_vertices : 1 + n_vertices + n_faces]
        for corners in _triangles(source, at, found, n_vertices)
    ]
    if not triangles:
        raise source.fault("F002.off-faces: expected faces, found none", source.end)
    return viewer.figure(
        np.array(vertices), np.array(triangles, dtype=np.int32), name=source.path.stem
    )


def _lines(source: Source) -> list[Line]:
    """Return the lines that count."""
    found, offset = list[Line](), 0
    for line in source.data.splitlines(keepends=True):
        words = line.partition(b"#")[0].split()
        if words:
            found.append((offset, words))
        offset += len(line)
    return found


def _triangles(source: Source, start: int, words: list[bytes], n_vertices: int) -> list[list[int]]:
    """Return the triangles of one face."""
    count = int(_numbers(source, start, words, "the number of vertices of a face", 1)[0])
    corners = [int(each) for each in _numbers(source, start, words[1:], "indices", count)[:count]]
    wrong = [corner for corner in corners if not 0 <= corner < n_vertices]
    if count < 3 or wrong:
        raise source.fault(
            "F002.off-face: expected at least 3 indices from 0 to {last}, found {found}",
            start,
            last=n_vertices - 1,
            found=b" ".join(words).decode("utf-8", "replace"),
        )
    return [[corners[0], corners[i], corners[i + 1]] for i in range(1, count - 1)]


def _numbers(source: Source, start: int, words: list[bytes], what: str, least: int) -> list[float]:
    """Return at least some numbers from the words of a line."""
    try:
        found = [float(word) for word in words[:least]]
    except ValueError:
        found = []
    if len(found) < least or not np.isfinite(found).all():
        raise source.fault(
            "F002.off-numbers: expected {what}, found {found}",
            start,
            what=what,
            found=b" ".join(words).decode("utf-8", "replace") or "the end of the file",
        )
    return found
