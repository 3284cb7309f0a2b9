"""Level sets of the geodesic distance in a solid, and shortest paths through its middle."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from viewer.autorig.solid import Solid
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_BAND = 1.5  # thickness of a level set of the geodesic distance, in voxels
# Exponent of the radius in the cost of a path. Above 1, a detour through the middle of a wide part
# is worth its length.
_MEDIAL = 1.5
# A loop: its height, half of its length, relative to the half width of its sides. That around a
# small hole is none. It is cut where it is narrow: relative to the median of its sides.
_LOOP, _NARROW = 2.0, 0.5
_SPAN = 2  # bands that a step to a neighbour crosses at most: it is up to 1.2 bands long


class Paths:
    """Shortest paths through the middle of a solid."""

    def __init__(self, solid: Solid) -> None:
        self.steps: csr_array = solid.graph()
        self.radii, self._spacing = solid.radii(), solid.spacing
        # Close to the surface, the radius is known to half a voxel only.
        wide = np.maximum(self.radii / solid.spacing, 0.5)
        self._graph = _weighted(self.steps, wide**-_MEDIAL)
        self.n_cuts = 0
        """Number of cuts."""

    def cut(self, first: Bools, second: Bools) -> Ints | None:
        """Remove the steps between two sets of voxels (N,) each, and return where they began.

        None, and nothing is removed, if the solid would fall apart.
        """
        from scipy.sparse import csgraph

        steps, starts = _cut(self.steps, first, second)
        if csgraph.connected_components(steps, directed=False, return_labels=False) > 1:
            return None
        self.steps, self._graph = steps, _cut(self._graph, first, second)[0]
        self.n_cuts += 1
        return starts

    def to(self, ends: Ints, starts: Ints, without: Ints | None = None) -> list[Ints]:
        """Return the path from each start to the nearest of the ends, as rows of the solid.

        ``without``: rows that paths avoid; a path that has no other way is only its start.
        """
        from scipy.sparse import csgraph

        graph = self._graph
        if without is not None:
            avoided = np.zeros(len(self.radii), dtype=np.bool_)
            avoided[without] = True
            graph = _cut(graph, avoided, np.ones_like(avoided))[0]
        _, before, _ = csgraph.dijkstra(
            graph, indices=ends, min_only=True, return_predecessors=True
        )
        found = []
        for start in starts.tolist():
            rows = [start]
            while before[rows[-1]] >= 0:
                rows.append(int(before[rows[-1]]))
            found.append(np.array(rows, dtype=np.int32))
        return found

    def joined(self, routes: list[Ints], thick: Bools) -> list[Ints]:
        """Return routes from the same voxel, those that run beside each other as one.

        If the middle of a limb is between voxels, routes through it may use different ones of them,
        so that they seem to part long before their limbs do. Beside means in neighbouring voxels;
        where limbs part, their routes are still beside each other for about the radius there.
        ``thick`` (N,): voxels that are in no plate, through which routes are beside each other by
        chance.
        """
        ways: dict[int, list[int]] = {}  # to each voxel, which is the last
        found = []
        for route in routes:
            rows = route.tolist()
            shared = max((k for k, row in enumerate(rows) if row in ways), default=len(rows))
            last = None
            for index in range(len(rows) - 1, shared, -1):
                row = rows[index]
                start, end = self.steps.indptr[row : row + 2]
                near = [each for each in self.steps.indices[start:end].tolist() if each in ways]
                if not near:
                    continue
                last = index if last is None else last
                if not thick[rows[last]]:
                    break
                if (last - index) * self._spacing >= self.radii[rows[last]]:
                    rows = [*min((ways[each] for each in near), key=len), *rows[index:]]
                    break
            for index, row in enumerate(rows):
                ways.setdefault(row, rows[: index + 1])
            found.append(np.array(rows, dtype=np.int32))
        return found


def _weighted(steps: csr_array, costs: Floats) -> csr_array:
    """Return steps whose lengths inside each voxel are multiplied by costs (N,)."""
    from scipy.sparse import csr_array

    starts = np.repeat(np.arange(len(costs)), np.diff(steps.indptr))
    lengths = steps.data * 0.5 * (costs[starts] + costs[steps.indices])
    return csr_array((lengths, steps.indices, steps.indptr), steps.shape)


def _cut(graph: csr_array, first: Bools, second: Bools) -> tuple[csr_array, Ints]:
    from scipy.sparse import coo_array, csr_array

    links = graph.tocoo()
    crosses = (first[links.row] & second[links.col]) | (second[links.row] & first[links.col])
    kept = links.data[~crosses], (links.row[~crosses], links.col[~crosses])
    starts: Ints = links.row[crosses]
    return csr_array(coo_array(kept, graph.shape)), starts


@dataclass(frozen=True, slots=True, eq=False)
class Protrusion:
    """A part of the level sets above a junction, as seen from there."""

    top: int
    """The level set of its tip."""
    tip: float
    """Largest distance of its tip."""
    junction: float
    """Distance at which it merges with others."""
    base: tuple[int, ...]
    """Its level sets just above the junction."""
    necks: tuple[tuple[float, tuple[int, ...]], ...]
    """Junctions and bases where it stayed before."""


@dataclass(frozen=True, slots=True, eq=False)
class Tips:
    """The ends of the protrusions of a solid."""

    rows: Ints
    """(N,). The farthest voxel of each, as rows of the solid, in ascending order of level sets."""
    stood_out: Bools
    """(N,). Whether it stayed where it met another protrusion, even if it was the longest."""
    meetings: tuple[tuple[float, frozenset[int]], ...]
    """Distances at which two or more of them merge, and the indices of all that have merged."""


class LevelSets:
    """Connected level sets of the geodesic distance from a part of a solid."""

    def __init__(self, steps: csr_array, distances: Floats, spacing: float) -> None:
        from scipy.sparse import coo_array, csgraph

        self._distances = distances
        self.thickness = _BAND * spacing
        """Difference of the distances in a level set."""
        bands = (distances / self.thickness).astype(np.int64)
        links = steps.tocoo()
        same = bands[links.row] == bands[links.col]
        level = coo_array(
            (np.ones(int(same.sum())), (links.row[same], links.col[same])), steps.shape
        )
        self.count, self.labels = csgraph.connected_components(level, directed=False)
        """Number of level sets, and the one of each voxel (N,)."""
        self._farthest = np.zeros(self.count)
        np.maximum.at(self._farthest, self.labels, distances)
        self._band = np.zeros(self.count, dtype=np.int64)
        self._band[self.labels] = bands
        below = bands[links.row] > bands[links.col]
        pairs = np.stack([self.labels[links.row[below]], self.labels[links.col[below]]], 1)
        self._above: list[list[int]] = [[] for _ in range(self.count)]
        self._below: list[list[tuple[int, int]]] = [[] for _ in range(self.count)]
        links_of, counts = np.unique(pairs, axis=0, return_counts=True)
        for (high, low), count in zip(links_of.tolist(), counts.tolist(), strict=True):
            self._above[low].append(high)
            self._below[high].append((count, low))

    def tips(self, stays: Callable[[Protrusion], bool]) -> Tips:
        """Return the prominent maxima of the distance.

        Protrusions that merge are one, with the tip of the longest, unless the shorter one
        ``stays``. Level sets are used because a surface of voxels has many small maxima.
        """
        group = list(range(self.count))
        kept = [[node] for node in range(self.count)]
        meetings: list[tuple[float, list[int]]] = []
        necks: dict[int, list[tuple[float, tuple[int, ...]]]] = {}

        def root(node: int) -> int:
            while group[node] != node:
                group[node] = group[group[node]]
                node = group[node]
            return node

        # From the farthest level sets inwards, each keeps the tips of those above it.
        for node in np.argsort(-self._band, kind="stable").tolist():
            bases: dict[int, list[int]] = {}
            for high in self._above[node]:
                bases.setdefault(root(high), []).append(high)
            base_of = {tip: tuple(base) for one, base in bases.items() for tip in kept[one]}
            tips = sorted(base_of, key=lambda tip: float(self._farthest[tip]))
            if tips:
                junction = self.thickness * float(self._band[node])
                passed = [
                    tip
                    for tip in tips
                    if len(tips) > 1
                    and stays(
                        Protrusion(
                            tip,
                            float(self._farthest[tip]),
                            junction,
                            base_of[tip],
                            tuple(necks.get(tip, ())),
                        )
                    )
                ]
                for tip in passed:
                    necks.setdefault(tip, []).append((junction, base_of[tip]))
                others = [tip for tip in passed if tip != tips[-1]]
                kept[node] = others + tips[-1:]
                if len({base_of[tip] for tip in kept[node]}) > 1:
                    meetings.append((junction, kept[node]))
            for one in bases:
                group[one] = node
        found = sorted(
            {tip for node in range(self.count) if root(node) == node for tip in kept[node]}
        )
        number = {tip: index for index, tip in enumerate(found)}
        met = [
            (at, frozenset(number[tip] for tip in those if tip in number)) for at, those in meetings
        ]
        rows = np.flatnonzero(np.isin(self.labels, found))
        # The farthest voxel of each of these level sets.
        order = rows[np.lexsort((-self._distances[rows], self.labels[rows]))]
        first = np.unique(self.labels[order], return_index=True)[1]
        return Tips(
            order[first].astype(np.int32),
            np.array([tip in necks for tip in found], dtype=np.bool_),
            tuple((at, those) for at, those in met if len(those) > 1),
        )

    def loop(self, widths: Floats, least: float) -> tuple[Ints, Ints] | None:
        """Return the level sets on both sides of a cut through a loop; None without a loop.

        ``widths``: half widths of all level sets; ``least``: smallest one that counts.
        """
        # The tree of level sets, each below the one with the largest contact in the next band. A
        # link to one that is not above it closes a loop, down to where both have met.
        before = np.full(self.count, -1)
        contact = np.zeros(self.count)
        for node, below in enumerate(self._below):
            if below:
                near = max(self._band[low] for _, low in below)
                contact[node], before[node] = max(
                    link for link in below if self._band[link[1]] == near
                )
        for high in np.argsort(-self._band, kind="stable").tolist():
            for _, low in self._below[high]:
                sides = self._sides(high, low, before)
                if sides is None:
                    continue
                around = [*sides[0], *sides[1]]
                height = self.thickness * float(self._band[high] - self._band[around].min())
                if height <= _LOOP * max(float(np.median(widths[around])), least):
                    continue
                if self._are_joined(*sides):
                    continue
                narrow = min(around, key=lambda node: contact[node])
                if contact[narrow] < _NARROW * float(np.median(contact[around])):
                    return self._cut(narrow, int(before[narrow]))
                return self._cut(high, low)
        return None

    def _sides(self, high: int, low: int, before: Ints) -> tuple[list[int], list[int]] | None:
        """Return both sides of a loop down to where they part; None if one is above the other."""
        sides: tuple[list[int], list[int]] = ([], [])
        ends = [high, low]
        while ends[0] != ends[1]:
            side = 0 if self._band[ends[0]] >= self._band[ends[1]] else 1
            sides[side].append(ends[side])
            ends[side] = int(before[ends[side]])
        return sides if sides[1] else None

    def _are_joined(self, first: list[int], second: list[int]) -> bool:
        """Return whether both sides of a loop touch between its ends, so that it has no hole."""
        # Voxels at the border of a plate may be level sets of their own beside the large ones.
        other = {int(self._band[node]): node for node in first}
        bands = self._band[second]
        for node, band in zip(second, bands.tolist(), strict=True):
            if bands.min() + _SPAN < band < bands.max() - _SPAN and band in other:
                near = self._joined(node, band - _SPAN, band + _SPAN)
                if other[band] in near:
                    return True
        return False

    def _cut(self, high: int, low: int) -> tuple[Ints, Ints]:
        """Return the level sets near a link, above and below it."""
        top = int(self._band[low])
        return self._joined(high, top + 1, top + _SPAN), self._joined(low, top + 1 - _SPAN, top)

    def _joined(self, start: int, first: int, last: int) -> Ints:
        """Return the level sets joined with one within some bands."""
        found, todo = {start}, [start]
        while todo:
            node = todo.pop()
            for other in (*self._above[node], *(low for _, low in self._below[node])):
                if other not in found and first <= self._band[other] <= last:
                    found.add(other)
                    todo.append(other)
        return np.array(sorted(found))

    def middles(self, centers: Floats) -> Floats:
        """Return the mean of each level set's voxels, from all centres (N, 3)."""
        sizes = np.bincount(self.labels, minlength=self.count)
        sums = np.stack([np.bincount(self.labels, column) for column in centers.T], axis=1)
        means: Floats = sums / sizes[:, None]
        return means

    def half_widths(self, centers: Floats) -> Floats:
        """Return the half of each level set's largest extent, from its voxels' centres (N, 3)."""
        # A disc of radius r has a variance of r^2 / 4 along each of its axes, so that r is twice
        # the root of the largest eigenvalue of the covariance; a strip of width w gets 0.58 w.
        sizes = np.bincount(self.labels, minlength=self.count)
        apart = centers - self.middles(centers)[self.labels]
        covariance = np.zeros((self.count, 3, 3))
        for i in range(3):
            for j in range(3):
                covariance[:, i, j] = np.bincount(self.labels, apart[:, i] * apart[:, j]) / sizes
        widths: Floats = 2.0 * np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, 2], 0.0))
        return widths
