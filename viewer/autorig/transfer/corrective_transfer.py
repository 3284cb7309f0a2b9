"""Transfer of pose correctives to another mesh."""

from __future__ import annotations

import numpy as np

from viewer.autorig.surface.laplacian import neighbour_means
from viewer.autorig.surface.welding import edges, weld
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.geometry.closest_point import SurfacePoints, interpolate

MOST_NUMBERS = 120_000_000
"""Maximum size of all transferred correctives, 1 GB: larger ones are dropped."""

_ROUNDS = 10  # number of smoothing iterations of the region in which correctives fade out


def transfer_correctives(
    correctives: Correctives,
    points: SurfacePoints,
    triangles: Ints,
    matched: Bools,
    positions: Floats,
    target_triangles: Ints,
    scale: float,
) -> Correctives | None:
    """Return correctives interpolated at the closest template point of each vertex, and scaled.

    The closest point of an unmatched vertex may be on a different limb, so correctives fade
    smoothly to 0 at unmatched vertices. None if the result would have more than ``MOST_NUMBERS``
    values.
    """
    offsets = correctives.values()
    if len(offsets) * len(positions) * 3 > MOST_NUMBERS:
        return None
    factors = scale * _fade(matched, positions, target_triangles)
    transferred = np.empty((len(offsets), len(positions), 3))
    # Correctives are processed one at a time, to bound the memory of temporary arrays.
    for row, direction in zip(transferred, offsets, strict=True):
        np.multiply(interpolate(points, triangles, direction), factors[:, None], out=row)
    return Correctives(transferred, correctives.feature)


def _fade(matched: Bools, positions: Floats, triangles: Ints) -> Floats:
    """Return weights that are 1 on the template, 0 away from it, and smooth in between: (V,)."""
    if matched.all():
        return np.ones(len(matched))
    welded = weld(positions, triangles)
    count = len(welded.positions)
    fraction = np.zeros(count)
    fraction[welded.vertices] = matched
    means = neighbour_means(edges(welded.triangles), count)
    is_alone = np.diff(means.indptr) == 0
    for _ in range(_ROUNDS):
        fraction = 0.5 * (fraction + np.where(is_alone, fraction, means @ fraction))
    return np.asarray(fraction[welded.vertices], dtype=np.float64)
