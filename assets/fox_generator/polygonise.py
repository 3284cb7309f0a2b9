"""Marching cubes over the left half of the body, on a grid that is finer at the head and paws."""

import numpy as np
from scipy.ndimage import label
from skimage.measure import marching_cubes

from .body import distance
from .shapes import Floats

BLOCK = 4  # grid cells per edge of the blocks that are skipped when far from the surface
COARSE, FINE = 0.0035, 0.0017  # metres between grid planes


def _planes(start: float, stop: float, fine: list[tuple[float, float]]) -> Floats:
    """Return ascending coordinates, spaced finely inside the ``fine`` intervals."""
    planes = [start]
    while planes[-1] < stop:
        here = planes[-1]
        planes.append(here + (FINE if any(a <= here < b for a, b in fine) else COARSE))
    missing = -(len(planes) - 1) % BLOCK
    planes += [planes[-1] + COARSE * (i + 1) for i in range(missing)]
    return np.array(planes)


def _sample(axes: list[Floats]) -> np.ndarray:
    """Sample the distance on the grid, exactly only in the blocks that the surface may cross."""
    shape = tuple(len(axis) for axis in axes)
    blocks = [np.stack([axis[:-1:BLOCK], axis[BLOCK::BLOCK]]) for axis in axes]
    centres = np.stack(np.meshgrid(*[b.mean(0) for b in blocks], indexing="ij"), axis=-1)
    spans = np.stack(np.meshgrid(*[np.ptp(b, axis=0) for b in blocks], indexing="ij"), axis=-1)
    middle = distance(centres.reshape(-1, 3)).reshape(centres.shape[:3])
    active = np.abs(middle) < 1.2 * np.linalg.norm(spans, axis=-1)
    wanted = np.zeros(shape, dtype=bool)
    grid = np.empty(shape)
    for i, j, k in np.ndindex(middle.shape):
        cells = tuple(slice(BLOCK * n, BLOCK * n + BLOCK + 1) for n in (i, j, k))
        if active[i, j, k]:
            wanted[cells] = True
        else:
            grid[cells] = middle[i, j, k]
    where = np.nonzero(wanted)
    points = np.stack([axis[index] for axis, index in zip(axes, where, strict=True)], axis=1)
    grid[where] = distance(points)
    return grid


def polygonise() -> tuple[Floats, np.ndarray]:
    """Return vertices (V, 3) and triangles (T, 3) of the half x >= 0, open along x = 0.

    The boundary vertices have x exactly 0, so the mirrored half closes the surface.
    """
    axes = [
        _planes(0.0, 0.130, [(0.0, 0.130)]),
        _planes(-0.012, 0.69, [(-0.012, 0.045), (0.40, 0.69)]),
        _planes(-0.71, 0.425, [(-0.22, -0.15), (0.09, 0.16), (0.22, 0.425)]),
    ]
    grid = _sample(axes)
    pieces, _ = label(grid < 0)
    inside = pieces == np.bincount(pieces[pieces > 0]).argmax()
    grid = np.where((grid < 0) & ~inside, 1e-4, grid)
    # skimage winds triangles clockwise for inside-negative fields unless told that values descend.
    indices, triangles, _, _ = marching_cubes(grid, 0.0, gradient_direction="descent")
    vertices = np.stack(
        [np.interp(indices[:, a], np.arange(len(axes[a])), axes[a]) for a in range(3)], axis=1
    )
    return vertices, triangles.astype(np.int64)
