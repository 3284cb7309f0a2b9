"""A template's pose correctives on another mesh."""

from __future__ import annotations

import numpy as np

from viewer.autorig.surface.welding import edges, weld
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.blendshapes import Correctives
from viewer.rig.geometry.closest_point import SurfacePoints, interpolate

__all__ = ["MOST_NUMBERS", "carry_correctives"]

MOST_NUMBERS = 120_000_000
"""Of all carried correctives, 1 GB: more are left out."""

_ROUNDS = 10  # of evening out where correctives fade


def carry_correctives(
    correctives: Correctives,
    points: SurfacePoints,
    triangles: Ints,
    matched: Bools,
    positions: Floats,
    target_triangles: Ints,
    scale: float,
) -> Correctives | None:
    """Return correctives for the target: those of the template's point under each vertex, scaled.

    Where a vertex does not lie on the template its closest point may be on another limb: there
    the correctives fade to 0, smoothly.

    Parameters
    ----------
    correctives : Correctives
        Of the template's vertices.
    points : SurfacePoints
        The template's point for each of the target's V vertices.
    triangles : (T, 3)
        The template's.
    matched : (V,) bool
        Vertices that lie on the template.
    positions : (V, 3)
        The target's vertices.
    target_triangles : (F, 3)
        Its triangles.
    scale : float
        Target units per template unit.

    Returns
    -------
    Correctives or None
        None if there would be more than ``MOST_NUMBERS`` numbers.
    """
    offsets = correctives.values()
    if len(offsets) * len(positions) * 3 > MOST_NUMBERS:
        return None
    factors = scale * _fade(matched, positions, target_triangles)
    carried = np.empty((len(offsets), len(positions), 3))
    # One direction after the other: all at once would take their memory three times.
    for row, direction in zip(carried, offsets, strict=True):
        np.multiply(interpolate(points, triangles, direction), factors[:, None], out=row)
    return Correctives(carried)


def _fade(matched: Bools, positions: Floats, triangles: Ints) -> Floats:
    """Return 1 on the template, 0 away from it, evened out between: (V,)."""
    if matched.all():
        return np.ones(len(matched))
    welded = weld(positions, triangles)
    count = len(welded.positions)
    share = np.zeros(count)
    share[welded.vertices] = matched
    links = edges(welded.triangles)
    degree = np.bincount(links.ravel(), minlength=count)
    for _ in range(_ROUNDS):
        sums = np.bincount(links[:, 0], share[links[:, 1]], minlength=count)
        sums += np.bincount(links[:, 1], share[links[:, 0]], minlength=count)
        mean = np.where(degree > 0, sums / np.maximum(degree, 1), share)
        share = 0.5 * (share + mean)
    return np.asarray(share[welded.vertices], dtype=np.float64)
