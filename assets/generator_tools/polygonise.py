"""Marching cubes over the left half of a figure, on a grid with planes of uneven spacing."""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import label
from skimage.measure import marching_cubes

from .shapes import Floats

BLOCK = 4  # number of grid cells per side of a block; blocks far from the surface are skipped
Distance = Callable[[Floats], Floats]


def planes(
    start: float, stop: float, fine: list[tuple[float, float]], steps: tuple[float, float]
) -> Floats:
    """Return ascending coordinates at spacings ``steps`` (coarse, fine), fine in some intervals."""
    coarse, small = steps
    places = [start]
    while places[-1] < stop:
        here = places[-1]
        places.append(here + (small if any(a <= here < b for a, b in fine) else coarse))
    missing = -(len(places) - 1) % BLOCK
    places += [places[-1] + coarse * (i + 1) for i in range(missing)]
    return np.array(places)


def _sample(distance: Distance, axes: list[Floats]) -> np.ndarray:
    """Sample the distance on the grid; it is exact only in blocks that the surface may cross."""
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


def polygonise(distance: Distance, axes: list[Floats]) -> tuple[Floats, np.ndarray]:
    """Return vertices (V, 3) and triangles (T, 3) of the half x >= 0, open along x = 0.

    The first axis starts at 0 and the boundary vertices have x exactly 0, so that the mirrored
    half closes the surface. If there are several pieces, only the largest is returned.
    """
    grid = _sample(distance, axes)
    pieces, _ = label(grid < 0)
    inside = pieces == np.bincount(pieces[pieces > 0]).argmax()
    grid = np.where((grid < 0) & ~inside, 1e-4, grid)
    # For fields that are negative inside, skimage winds triangles clockwise by default.
    indices, triangles, _, _ = marching_cubes(grid, 0.0, gradient_direction="descent")
    vertices = np.stack(
        [np.interp(indices[:, a], np.arange(len(axes[a])), axes[a]) for a in range(3)], axis=1
    )
    return vertices, triangles.astype(np.int64)
