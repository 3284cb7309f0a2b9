"""Surfaces with invalid triangles, which may or may not be treated as closed."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from viewer.lint import lint_files


def grid(n: int, wraps: bool) -> np.ndarray:
    """Return the triangles of n x n vertices row by row, or of a torus if they wrap around."""
    rows, columns = np.divmod(np.arange(n * n), n)
    quads = [
        (rows + down) % n * n + (columns + right) % n
        for down, right in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    inside = np.full(n * n, wraps) | ((rows < n - 1) & (columns < n - 1))
    a, b, c, d = (quad[inside] for quad in quads)
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)


def bowl(n: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and triangles of an open sheet with a low or high middle."""
    y, x = np.divmod(np.arange(n * n), n)
    middle = (n - 1) / 2
    z = height * ((x - middle) ** 2 + (y - middle) ** 2)
    return np.stack([x, y, z], axis=1), grid(n, wraps=False)


def ring(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and triangles of a closed torus that is inside out."""
    turns, tilts = 2 * np.pi * np.stack(np.divmod(np.arange(n * n), n)) / n
    radii = 3 + np.cos(tilts)
    positions = np.stack([radii * np.cos(turns), radii * np.sin(turns), np.sin(tilts)], axis=1)
    triangles = grid(n, wraps=True)
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    # The expected direction is independent of the check: outwards is away from the centre circle.
    middle = (a + b + c) / 3
    core = middle * [1, 1, 0]
    outward = middle - 3 * core / np.linalg.norm(core, axis=1, keepdims=True)
    sides = np.einsum("ta,ta->t", np.cross(b - a, c - a), outward)
    assert (sides > 0).all() or (sides < 0).all()
    return positions, triangles[:, ::-1] if sides[0] > 0 else triangles


def codes(
    folder: Path,
    mesh: tuple[np.ndarray, np.ndarray],
    lost: Iterable[int] = (),
    nowhere: Iterable[int] = (),
) -> set[str]:
    """Write a mesh with triangles that use vertex 999 and vertices at nan; return the codes."""
    positions, triangles = mesh
    gone, blank = set(lost), set(nowhere)
    lines = [
        f"v {x:.6g} {y:.6g} {'nan' if vertex in blank else format(z, '.6g')}"
        for vertex, (x, y, z) in enumerate(positions.tolist())
    ]
    lines += [
        f"f {a} {b} {999 if triangle in gone else c}"
        for triangle, (a, b, c) in enumerate((triangles + 1).tolist())
    ]
    (folder / "a.obj").write_text("\n".join(lines) + "\n")
    return {finding.code for finding in lint_files([folder / "a.obj"])[1]}


def border(n: int) -> tuple[list[int], list[int]]:
    """Return the triangles and vertices at the border of a bowl."""
    y, x = np.divmod(np.arange(n * n), n)
    at_end = (x % (n - 1) == 0) | (y % (n - 1) == 0)
    touching = at_end[grid(n, wraps=False)].any(axis=1)
    return np.flatnonzero(touching).tolist(), np.flatnonzero(at_end).tolist()


@pytest.mark.parametrize("height", [0.1, -0.1, 0.02, -0.02])
@pytest.mark.parametrize("n", [4, 6, 12])
def test_open_sheet_without_its_border_is_not_closed(tmp_path: Path, n: int, height: float) -> None:
    triangles, vertices = border(n)
    mesh = bowl(n, height)
    assert codes(tmp_path, mesh) == {"M005"}
    assert "M003" not in codes(tmp_path, mesh, lost=triangles)
    assert "M003" not in codes(tmp_path, mesh, nowhere=vertices)
    assert "M003" not in codes(tmp_path, mesh, lost=range(0, len(mesh[1]), 2))


def test_closed_surface_with_few_lost_triangles_is_still_inside_out(tmp_path: Path) -> None:
    mesh = ring(12)  # the square of 8 open edges is less than a quarter of the 288 triangles
    assert codes(tmp_path, mesh) == {"M003"}
    assert codes(tmp_path, mesh, lost=[7]) == {"M003", "F002"}
    assert codes(tmp_path, mesh, lost=[7, 99]) == {"M003", "F002"}
    assert codes(tmp_path, mesh, nowhere=[50]) == {"M003", "F003"}


def test_closed_surface_with_many_lost_triangles_is_not_checked(tmp_path: Path) -> None:
    mesh = ring(12)
    assert codes(tmp_path, mesh, lost=[7, 99, 150]) == {"F002"}
    assert codes(tmp_path, mesh, lost=range(0, 288, 2)) == {"F002"}
    assert codes(tmp_path, mesh, nowhere=range(0, 144, 3)) == {"F003"}
