"""Detection of closed meshes, and borders of openings."""

import numpy as np
import pytest

from viewer.rig.geometry.topology import _has_long_borders, shell_of, welded
from viewer.rig.mesh import Mesh
from viewer.rig.skin import skin_from_lists

# A cube from 0 to 1; corner (x, y, z) has the index 4 x + 2 y + z.
CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
SQUARES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
TRIANGLES = np.array([t for a, b, c, d in SQUARES for t in ((a, b, c), (a, c, d))])


def cube(triangles=TRIANGLES, positions=CORNERS) -> Mesh:
    return Mesh(positions, np.tile([0.0, 0.0, 1.0], (len(positions), 1)), triangles)


def fine_cube(n=8) -> Mesh:
    """Return a cube whose sides have n x n cells each, without shared vertices."""
    steps = np.linspace(0.0, 1.0, n + 1)
    u, v = (grid.ravel()[:, None] for grid in np.meshgrid(steps, steps, indexing="ij"))
    points, triangles = [], []
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    for number, (a, b, _, d) in enumerate(SQUARES):
        points.append(CORNERS[a] + u * (CORNERS[b] - CORNERS[a]) + v * (CORNERS[d] - CORNERS[a]))
        first = corner + number * (n + 1) ** 2
        right, up = first + n + 1, first + 1
        triangles += [np.stack([first, right, up], 1), np.stack([right, right + 1, up], 1)]
    return cube(np.concatenate(triangles), np.concatenate(points))


def test_a_cube_is_closed() -> None:
    shell = shell_of(cube(), None)
    assert shell is not None
    assert len(shell.borders) == len(shell.copies) == 0


@pytest.mark.parametrize(
    "triangles",
    [
        TRIANGLES[:, ::-1],  # faces inwards
        np.concatenate([TRIANGLES[:1, ::-1], TRIANGLES[1:]]),  # one triangle is reversed
        np.concatenate([TRIANGLES, [[0, 1, 6]]]),  # an edge of three triangles
        TRIANGLES[2:],  # an opening too large to determine the sign of the volume
        TRIANGLES[:0],
    ],
    ids=["inwards", "inconsistent", "three at an edge", "open", "empty"],
)
def test_meshes_with_other_errors_are_not_closed(triangles) -> None:
    assert shell_of(cube(triangles), None) is None


def test_mesh_with_an_inward_facing_part_is_not_closed() -> None:
    both = np.concatenate([TRIANGLES, TRIANGLES[:, ::-1] + 8])
    assert shell_of(cube(both, np.concatenate([CORNERS, CORNERS + 3.0])), None) is None
    both[12:] = TRIANGLES + 8
    assert shell_of(cube(both, np.concatenate([CORNERS, CORNERS + 3.0])), None) is not None


def test_border_of_a_small_opening_consists_of_its_corners() -> None:
    mesh = fine_cube()
    opened = cube(mesh.triangles[1:], mesh.positions)
    shell = shell_of(opened, None)
    assert shell is not None
    missing = {tuple(point) for point in mesh.positions[mesh.triangles[0]].tolist()}
    assert {tuple(point) for point in mesh.positions[shell.borders].tolist()} == missing


def test_seams_are_closed_if_their_vertices_move_together() -> None:
    mesh = fine_cube(2)
    # 8 corners with 3 vertices each and 12 midpoints with 2 have 28 copies.
    shell = shell_of(mesh, None)
    assert shell is not None and len(shell.copies) == 28
    assert shell.is_closed(2.0 * mesh.positions)
    moved = mesh.positions.copy()
    moved[shell.copies[0]] += 0.1
    assert not shell.is_closed(moved)


def test_seams_with_different_weights_are_open() -> None:
    mesh = fine_cube(2)
    pairs = [[(0, 0.5), (1, 0.5)] for _ in mesh.positions]
    inverse_bind = np.tile(np.eye(4), (2, 1, 1))
    assert shell_of(mesh, skin_from_lists(pairs, inverse_bind)) is not None
    pairs[0] = [(0, 1.0)]
    assert shell_of(mesh, skin_from_lists(pairs, inverse_bind)) is None


def grid(n: int) -> Mesh:
    """Return a flat grid of n x n cells: its border has 4 n vertices and edges."""
    x, y = (part.ravel() for part in np.mgrid[: n + 1, : n + 1])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    right, up = corner + n + 1, corner + 1
    triangles = [np.stack([corner, right, up], 1), np.stack([right, right + 1, up], 1)]
    return cube(np.concatenate(triangles), np.stack([x, y, 0.0 * x], axis=1))


def test_long_borders_are_found_without_comparing_edges() -> None:
    # At most 256 vertices may lie on openings: grids of 64 and 65 cells have 256 and 260.
    assert not _has_long_borders(grid(64).triangles.astype(np.int64), 65**2)
    assert _has_long_borders(grid(65).triangles.astype(np.int64), 66**2)
    closed = fine_cube()
    corners = welded(closed.positions, np.arange(closed.n_vertices))[closed.triangles]
    assert not _has_long_borders(corners, closed.n_vertices)
    assert shell_of(grid(65), None) is None
