"""Separate parts of a mesh: which voxels are whose, and whether parts are joined or only touch.

A robot's arm is a chain of separate surfaces that move against each other, so its joints are where
one part ends and the next begins. Two objects in one file are separate surfaces, too, but they
touch in a place that is small for both.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from viewer.autorig.solid import Solid
from viewer.autorig.surface.welding import one_sided, stiff_islands, weld
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.topology import components
from viewer.rigs.mesh import Mesh, triangle_areas

MOST_PARTS = 100
"""Parts that are told apart, the largest: each is compared with all others."""
_SAMPLES = 20_000  # of the surface
_LEAST = 8  # samples of a part: a screw still has a place and a thickness
_GAP = 3.0  # distance in voxels up to which parts are joined: rounded ends, and gaps between links
# Radius of the area where two parts are near each other, relative to the largest radius of the
# thinner one: below it, they only touch.
_TOUCH = 0.35
# Depths in voxels of a visible surface, and of a surface that is inside another part.
_SEEN, _DEEP = 1.0, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Separate surfaces of a mesh."""

    rows: Ints
    labels: Ints
    """(S,). Voxels of samples of the visible surface, as rows of the solid, and their parts."""
    areas: Floats
    """(S,). The area that each sample stands for."""
    objects: Ints
    """(P,). Parts that are joined have the same number."""
    shares: Floats
    """(O,). Fraction of the solid in each object."""
    contact: Floats | None
    """(3,). Where two objects only touch, those of which the smaller one is largest; None if none
    do."""
    touching: float
    """Fraction of the solid in the smaller of these two; 0 for none."""
    stiff: Bools
    """(P,). Parts without vertices between their ends, which do not bend."""
    count: int
    """Number of separate parts of the mesh: P, or more if only the largest are told apart."""

    def around(self, levels: Ints) -> Ints:
        """Return the part with most of the surface around each level set, -1 without any: (L,).

        ``levels`` (N,): level set of each voxel.
        """
        votes = np.zeros((int(levels.max()) + 1, len(self.objects)))
        np.add.at(votes, (levels[self.rows], self.labels), self.areas)
        return np.where(votes.any(axis=1), votes.argmax(axis=1), -1).astype(np.int32)


def parts_of(mesh: Mesh, solid: Solid) -> Parts:
    """Return the separate parts of a mesh, the largest ``MOST_PARTS`` of many."""
    from scipy.spatial import cKDTree

    surface = one_sided(weld(mesh.positions, mesh.triangles))
    islands = surface.islands[surface.triangles[:, 0]]
    areas = np.bincount(islands, triangle_areas(surface.positions, surface.triangles))
    count = int((areas > 0.0).sum())
    large = np.argsort(-areas, kind="stable")[: min(count, MOST_PARTS)]
    shares = areas[large] / areas.sum()
    samples = [
        _samples(surface.positions, surface.triangles[islands == island], share)
        for island, share in zip(large.tolist(), shares.tolist(), strict=True)
    ]
    sizes = np.array([len(each) for each in samples])
    labels = np.repeat(np.arange(len(samples)), sizes)
    weights = np.repeat(shares / sizes, sizes)
    places = np.concatenate(samples)
    # The surface of one part inside another one is hidden.
    seen = solid.distance[tuple(solid.voxel_of(places).T)] <= _SEEN * solid.spacing
    places, labels, weights = places[seen], labels[seen], weights[seen]
    owners = labels[cKDTree(places).query(solid.centers(solid.voxels))[1]]
    widest = np.zeros(len(samples))
    np.maximum.at(widest, owners, solid.radii())
    # Inside several parts, as in a neck, the solid is wider than each of them.
    widest = np.minimum(widest, [_half_thickness(own) for own in samples])
    each = areas.sum() / _SAMPLES  # area of a sample
    trees = [cKDTree(own) for own in samples]
    joined, touching = list[tuple[int, int]](), dict[tuple[int, int], Floats]()
    for a, b in combinations(range(len(samples)), 2):
        gaps = trees[a].query(samples[b], distance_upper_bound=2.0 * _GAP * solid.spacing)[0]
        if not gaps.min() <= _GAP * solid.spacing:
            continue
        # Rounded parts are near each other around the place where they touch, too.
        near = gaps <= gaps.min() + solid.spacing
        radius = np.sqrt(each * near.sum() / np.pi)
        if radius >= _TOUCH * min(widest[a], widest[b]):
            joined.append((a, b))
        else:
            touching[a, b] = samples[b][near].mean(axis=0)
    joined += _overlaps(solid, samples, each, _TOUCH * widest)
    lowest = components(len(samples), np.array(joined, dtype=np.int32).reshape(-1, 2))
    objects = np.unique(lowest, return_inverse=True)[1].astype(np.int32)
    shown = labels.astype(np.int32)
    filled = np.bincount(objects[owners], minlength=int(objects.max()) + 1) / len(owners)
    apart = {
        pair: min(float(filled[objects[part]]) for part in pair)
        for pair in touching
        if objects[pair[0]] != objects[pair[1]]
    }
    largest = max(apart, key=lambda pair: apart[pair], default=None)
    return Parts(
        solid.nearest(places),
        shown,
        weights,
        objects,
        filled,
        None if largest is None else touching[largest],
        0.0 if largest is None else apart[largest],
        stiff_islands(surface)[large],
        count,
    )


def _overlaps(
    solid: Solid, samples: list[Floats], area: float, least: Floats
) -> Iterator[tuple[int, int]]:
    """Yield pairs of parts of which one has much of its surface inside the other."""
    from scipy.spatial import cKDTree

    for number, own in enumerate(samples):
        depths = solid.distance[tuple(solid.voxel_of(own).T)]
        inside = own[depths > _DEEP * solid.spacing]
        is_small = np.sqrt(area * len(inside) / np.pi) < least[number]
        if is_small or len(inside) == 0 or len(samples) == 1:
            continue
        others = [k for k in range(len(samples)) if k != number]
        gaps = [float(cKDTree(samples[k]).query(inside)[0].mean()) for k in others]
        yield number, others[int(np.argmin(gaps))]


def _half_thickness(points: Floats) -> float:
    """Return half of the smallest extent of points (N, 3) along their principal axes."""
    apart = points - points.mean(axis=0)
    return 0.5 * float(np.ptp(apart @ np.linalg.eigh(apart.T @ apart)[1], axis=0).min())


def _samples(positions: Floats, triangles: Ints, fraction: float) -> Floats:
    return sample_surface(positions, triangles, max(_LEAST, round(fraction * _SAMPLES))).positions
