"""Limbs of a solid: the paths to its tips from a place in it, as hubs and chains.

Tips are maxima of the geodesic distance (``medial.LevelSets``), and the shortest paths from them
through the middle of the solid form a tree (Sato et al. 2000).

- Loops are cut, as a skeleton has none: where they are narrow, as a hand that touches the hip, or
  farthest from the place.
- Branches closer to each other than the solid's radius there are one joint: a *hub*.
- A limb begins where its level set parts from those of the others: at the surface of the trunk.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from viewer.autorig.anatomy import arc_lengths
from viewer.autorig.medial import LevelSets, Paths, Protrusion
from viewer.autorig.solid import Solid
from viewer.autorig.weights.bone_weights import NEAR
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints

_MOST_LOOPS = 20  # loops that are cut: each takes a search
# Length of the corners of a cut, which are no limbs, and their distance from its middle: relative
# to its half width.
_RAGGED = 2.0
# Distance from a hub at which a limb begins, or half width of a level set, relative to the radius
# there, from which the trunk is a plate: it is 1 in a ball.
PLATE = 4.0
# Shortest limb: relative to the half width of its base, to the size, and in voxels. A bump is
# wider than long.
_OWN, _SHORTEST, _VOXELS = 1.0, 0.03, 3.0
# Length of a limb relative to the half width of its neck, from which it is one wherever it is: of
# any limb, and of one with a round neck, such as a thumb, unlike the flat corner of a bird's tail.
# A neck is round if the radius in it is at least this fraction of its half width.
_LONG, _STOUT, _ROUND = 3.0, 2.0, 0.5
# A hub's reach relative to the solid's radius there: two branches that touch the same inscribed
# ball are one.
_REACH = 1.0
_NARROWER = 0.8  # radius of a limb relative to that of the hub, below which it has its own joint
# Distance from the hub, relative to its radius, at which the only limb begins at the latest.
_TAPERED = 2.0
_SUDDEN = 2.0  # length in which the radius falls at a step, relative to the difference
# Distance of a path from the middle of a level set, relative to the half width, from which it is
# beside it, as in a plate that a limb meets in its middle; and the least length and half width of
# such a part at the end of a limb, relative to the half width of the limb, that is a plate.
_BESIDE, _RIM = 0.5, 2.0
HINGE = 3.0
"""Length up to which a part between two others is a hinge, relative to the half width."""
_POINTS = 64  # of a path outside its hub
_NOWHERE = np.zeros((0, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A part of the skeleton without branches."""

    start: int
    """Hub at which it begins."""
    end: int
    """Hub at which it ends; -1 for a tip."""
    points: Floats
    """(K, 3). Smooth path between both."""
    half_width: float
    """Median of the half widths of its level sets."""
    begin: float
    """Length of the part of the path inside the hub where it begins; 0 for none."""
    tips: frozenset[int]
    """All tips beyond its start."""
    seams: tuple[float, ...] = ()
    """Lengths along the path at which one separate part of the mesh ends and another begins."""
    stiff: tuple[bool, ...] = ()
    """Whether the part before each of them, and the one behind the last, does not bend."""

    @property
    def length(self) -> float:
        """Length of the path."""
        return float(arc_lengths(self.points)[-1])

    def starting(self, place: Floats) -> Chain:
        """Return the chain with its first point (3,) elsewhere in the hub."""
        old, new = (float(np.linalg.norm(self.points[1] - at)) for at in (self.points[0], place))
        points = np.concatenate([place[None], self.points[1:]])
        return replace(
            self, points=points, begin=max(self.begin + new - old, 0.0) if self.begin else 0.0
        )

    @property
    def outer(self) -> Floats:
        """Points of the path outside the hub, at even distances: (64, 3)."""
        return at_lengths(self.points, np.linspace(self.begin, self.length, _POINTS))


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Hubs and chains of a solid, outwards from a place in it."""

    hubs: Floats
    """(H, 3). Positions; the first is the place itself. A hub comes after the one before it."""
    radii: Floats
    """(H,). Distances from the surface there."""
    rows: Ints
    """(H,). Their voxels."""
    chains: tuple[Chain, ...]
    """Sorted by the hubs where they begin."""
    routes: tuple[Ints, ...]
    """Voxels of the path from the place to each tip."""
    cuts: Floats
    """(C, 3). Places where loops were cut."""
    levels: Ints
    """(N,). Level set of each voxel."""
    has_loops: bool = False
    """Whether it has more loops, which were not cut."""


def at_lengths(points: Floats, lengths: Floats) -> Floats:
    """Return points at lengths (N,) along a polyline (K, 3): (N, 3)."""
    known = arc_lengths(points)
    return np.stack([np.interp(lengths, known, column) for column in points.T], axis=1)


def least_limb(solid: Solid) -> float:
    """Return the length of the shortest limb, and the distance up to which places are the same."""
    size = solid.spacing * max(solid.inside.shape)
    return max(_SHORTEST * size, _VOXELS * solid.spacing)


class _Field:
    """Distances from a voxel of a solid, their level sets, and the paths from its tips."""

    def __init__(self, solid: Solid, paths: Paths, source: int, wanted: Floats) -> None:
        from scipy.sparse import csgraph

        self.solid, self.radii = solid, paths.radii
        self.centers = solid.centers(solid.voxels)
        self._least = least_limb(solid)
        self._wanted = wanted
        self.cuts = np.zeros((0, 3))
        """(C, 3). Places where loops were cut."""
        self._cut_widths: list[float] = []
        self.has_loops = False
        """Whether more loops are left."""
        while True:
            self.distances = csgraph.dijkstra(paths.steps, indices=[source], min_only=True)
            self._levels = LevelSets(paths.steps, self.distances, solid.spacing)
            self._widths = self._levels.half_widths(self.centers)
            loop = self._levels.loop(self._widths, self._least)
            if loop is None:
                break
            above, below = (np.isin(self._levels.labels, part) for part in loop)
            ends = None if paths.n_cuts >= _MOST_LOOPS else paths.cut(above, below)
            if ends is None:
                self.has_loops = True
                break
            self.cuts = np.concatenate([self.cuts, self.centers[ends].mean(axis=0)[None]])
            self._cut_widths.append(float(self._widths[np.concatenate(loop)].max()))
        self._middles = self._levels.middles(self.centers)
        self._depths = np.zeros(self._levels.count)
        np.maximum.at(self._depths, self._levels.labels, self.radii)
        self.tips = self._levels.tips(lambda found: self._is_limb(found) or self._is_wanted(found))
        routes = [route[::-1] for route in paths.to(np.array([source]), self.tips.rows)]
        stands = [k for k, route in enumerate(routes) if self._stands(k, route[::-1])]
        self.is_thick = self._widths[self._levels.labels] <= PLATE * self.radii
        """(N,). Which voxels are in no plate."""
        joined = paths.joined([routes[k] for k in stands], self.is_thick)
        self.routes = dict(zip(stands, joined, strict=True))
        """Paths to the tips of limbs, by the index of the tip."""

    def _is_limb(self, found: Protrusion) -> bool:
        if self._is_distinct(found):
            return True
        width = float(self._widths[list(found.base)].max())
        is_long = found.tip - found.junction >= max(_OWN * width, self._least)
        return is_long and not self._is_at_cut(found)

    def _is_distinct(self, found: Protrusion) -> bool:
        """Return whether a protrusion is long for its width at one of its junctions."""
        # On a plate, as a leg of a table, the base of a later junction is a part of the plate. The
        # first junction may be with a bump of the limb itself, such as a corner of its foot.
        for junction, base in found.necks:
            width = float(self._widths[list(base)].max())
            # Radii are known to half a voxel.
            depth = float(self._depths[list(base)].max()) + 0.5 * self.solid.spacing
            is_round = depth >= _ROUND * width
            if found.tip - junction >= (_STOUT if is_round else _LONG) * width:
                return True
        return False

    def _is_wanted(self, found: Protrusion) -> bool:
        """Return whether a protrusion ends where a limb is expected, and is more than a bump."""
        is_long = found.tip - found.junction >= self._least
        return is_long and self._is_near_wanted(self._middles[found.top])

    def _is_near_wanted(self, place: Floats) -> bool:
        return bool((np.linalg.norm(self._wanted - place, axis=1) <= self._least).any())

    def _is_at_cut(self, found: Protrusion) -> bool:
        """Return whether a protrusion is no longer than a cut is wide and begins there."""
        middle = self._middles[list(found.base)].mean(axis=0)
        gaps = np.linalg.norm(self.cuts - middle, axis=1)
        near = gaps <= _RAGGED * np.array(self._cut_widths)
        return bool(near.any()) and found.tip - found.junction <= _RAGGED * max(self._cut_widths)

    def _stands(self, tip: int, route: Ints) -> bool:
        """Return whether a tip is that of a limb, not of a ball, plate or box."""
        # From the middle of a ball or plate, level sets are as wide as they are far away; halfway
        # to the tip of a limb that met no other, they are narrower.
        half = 0.5 * float(self.distances[route[0]])
        there = route[int(np.abs(self.distances[route] - half).argmin())]
        if self.widths(there) < half or self._is_near_wanted(self.centers[route[0]]):
            return True
        # That may be inside of the trunk. The rim around a foot met the arm on it before.
        parted = max((at for at, those in self.tips.meetings if tip in those), default=0.0)
        # A level set reaches farther than the distance at which it begins.
        return bool(self.tips.stood_out[tip]) and parted + self._levels.thickness > half

    @property
    def levels(self) -> Ints:
        """Level set of each voxel: (N,)."""
        return self._levels.labels

    def widths(self, rows: Ints) -> Floats:
        """Return the half widths of the level sets of voxels."""
        found: Floats = self._widths[self._levels.labels[rows]]
        return found

    def inner(self, rows: Ints) -> Ints:
        """Return the voxels of the way to a tip without those to the rim of a plate at its end."""
        middles = self._middles[self._levels.labels[rows]]
        apart = np.linalg.norm(middles - self.centers[rows], axis=1)
        rest = self.distances[rows[-1]] - self.distances[rows]
        # The tip itself is a level set of its own.
        widths = self.widths(rows)
        is_inner = (apart <= _BESIDE * widths) & (rest >= self._least)
        last = int(np.flatnonzero(is_inner)[-1]) if is_inner.any() else 0
        usual, at_end = np.median(widths[: last + 1]), np.median(widths[last + 1 :])
        is_plate = last > 0 and min(rest[last], at_end) >= _RIM * usual
        return rows[: last + 1] if is_plate else rows

    def path(self, rows: Ints, ends: tuple[Floats, Floats | None], width: float) -> Floats:
        """Return a smooth path between ends along voxels (K,): (K, 3)."""
        middles = self._middles[self._levels.labels[rows]]
        points = self.centers[rows]
        # The middle of a level set may be beside the path, or in the hollow of a mug.
        near = np.linalg.norm(middles - points, axis=1) <= _BESIDE * self.widths(rows)
        near &= self.solid.gaps(middles) <= NEAR * self.solid.spacing
        points = np.where(near[:, None], middles, points)
        points[0] = ends[0]
        if ends[1] is not None:
            points[-1] = ends[1]
        return _smooth(points, 2 + int(width / self.solid.spacing))

    def parting(self, tips: frozenset[int]) -> float:
        """Return the distance at which the level sets of some tips part from all others."""
        others = {*self.routes} - tips
        met = [at for at, those in self.tips.meetings if those & tips and those & others]
        return max(met, default=0.0)

    def is_stub(self, row: int, tips: frozenset[int]) -> bool:
        """Return whether what some tips beyond a voxel have in common is wider than long."""
        met = [at for at, those in self.tips.meetings if len(those & tips) > 1]
        length = max(met, default=0.0) - self.parting(tips)
        return length <= _OWN * float(self.widths(np.array([row]))[0])


def tree_of(solid: Solid, paths: Paths, source: int, wanted: Floats = _NOWHERE) -> Tree:
    """Return the paths from the tips of a solid to one of its voxels, as hubs and chains.

    ``wanted`` (N, 3): places of tips, where short protrusions are limbs, too.
    """
    field = _Field(solid, paths, source, wanted)
    hub_of, hubs = _hubs(field, source)
    passed = {k: {hub_of.get(row) for row in route.tolist()} for k, route in field.routes.items()}
    members = [[row for row, hub in hub_of.items() if hub == number] for number in range(len(hubs))]
    places = np.array([field.centers[rows].mean(axis=0) for rows in members])
    places[0] = field.centers[source]
    chains: list[Chain] = []
    for number, route in field.routes.items():
        for first, last in _parts(route, hub_of):
            rows = route[first : last + 1]
            start, end = hub_of[int(rows[0])], hub_of.get(int(rows[-1]), -1)
            if end >= 0 and int(rows[-1]) != hubs[end]:
                continue  # another way to a hub
            if any(number in chain.tips and chain.end == end for chain in chains):
                continue
            if end < 0:
                rows = field.inner(rows)
            beyond = frozenset({number, *(k for k in passed if end >= 0 and end in passed[k])})
            wide = float(paths.radii[hubs[start]])
            reached = _beginning(field, rows, field.parting(beyond), wide, end >= 0)
            width = max(float(np.median(field.widths(rows[reached:]))), solid.spacing)
            ends = places[start], places[end] if end >= 0 else None
            points = field.path(rows, ends, width)
            lengths = arc_lengths(points)
            early = lengths >= float(lengths[reached]) - HINGE * width
            for sooner in range(reached, int(early.argmax()) - 1, -1):
                if is_bone_inside(solid, points[0], points[sooner]):
                    # The bone from the hub need not leave the solid, as below a seat to a leg.
                    reached = sooner
                    break
            begin = float(lengths[reached])
            chains.append(Chain(start, end, points, width, begin, beyond))
    ordered = tuple(sorted(chains, key=lambda chain: chain.start))
    rows = np.array(hubs, dtype=np.int32)
    routes = tuple(field.routes.values())
    return Tree(
        places,
        paths.radii[rows],
        rows,
        ordered,
        routes,
        field.cuts,
        field.levels,
        field.has_loops,
    )


def _beginning(field: _Field, rows: Ints, parting: float, wide: float, is_inner: bool) -> int:
    """Return the index of the voxel of a path at which it leaves its hub, 0 for the first.

    ``wide``: radius of the hub; ``is_inner``: whether the path ends at another hub.
    """
    outside = np.flatnonzero(field.distances[rows] >= parting)
    reached = int(outside[0]) if len(outside) else 0
    thick = float(np.median(field.radii[rows[reached:]]))
    if thick > _NARROWER * wide:
        # It continues its hub, as a spine does; a limb as thick begins where it parts from others.
        return 0 if is_inner else reached
    if parting == 0.0:
        # The only path of a base or a head: it begins where the radius has changed by half, if it
        # does so suddenly. A fish bends in front of that place, too.
        narrow = np.flatnonzero(field.radii[rows] <= np.sqrt(thick * wide))
        far = np.flatnonzero(field.distances[rows] >= _TAPERED * wide)
        reached = min(int(narrow[0]), int(far[0]) if len(far) else len(rows) - 1)
        # A stem begins at the surface of its pot, where the radius has fallen to its own as fast as
        # the surface comes nearer. Radii are known to half a voxel.
        half = 0.5 * field.solid.spacing
        thin = int(np.flatnonzero(field.radii[rows] <= thick + half)[0])
        fallen = float(field.radii[rows[reached]] - field.radii[rows[thin]])
        if field.distances[rows[thin]] - field.distances[rows[reached]] <= _SUDDEN * fallen:
            reached = max(reached, thin)
    return reached


def _hubs(field: _Field, source: int) -> tuple[dict[int, int], list[int]]:
    """Return the hub of each voxel where paths part, and the first voxel of each hub."""
    radii, centers = field.radii, field.centers
    above, along = {source: source}, {source: 0.0}
    below: dict[int, set[int]] = {source: set()}
    beyond: dict[int, set[int]] = {}
    for number, route in field.routes.items():
        rows = route.tolist()
        for before, row in pairwise(rows):
            below[before].add(row)
            beyond.setdefault(row, set()).add(number)
            if row not in above:
                above[row], below[row] = before, set()
                step = centers[row] - centers[before]
                along[row] = along[before] + float(np.linalg.norm(step))
    parting = sorted((row for row in below if len(below[row]) > 1), key=lambda row: along[row])
    hub_of, hubs = {source: 0}, [source]
    for row in parting:
        if row == source:
            continue
        tips = frozenset(beyond[row])
        way = [row]
        while way[-1] not in hub_of:
            way.append(above[way[-1]])
        is_far_inside = field.distances[row] + radii.max() < field.parting(tips)
        if is_far_inside or (not field.is_thick[way].all() and field.is_stub(row, tips)):
            # Far inside of a part that is wider than thick, as a seat, other limbs still have the
            # same level sets: it is one part, although the paths to a leg and to an arm have some
            # of their way in common. So are the corners of a plate. In a part as thick as wide, a
            # hub is a shoulder; behind a waist, it belongs to another part.
            # Radii are known to half a voxel: in a plate of three voxels, they differ by a third.
            half = 0.5 * field.solid.spacing
            if radii[way].min() + half >= _NARROWER * (radii[way].max() - half):
                hub_of[row] = hub_of[way[-1]]
                continue
        # In a wide part, several paths may run beside each other.
        gaps = np.linalg.norm(centers[hubs] - centers[row], axis=1)
        gaps = gaps / (_REACH * np.maximum(radii[hubs], radii[row]))
        hub = int(gaps.argmin())
        if gaps[hub] <= 1.0:
            hub_of[row] = hub
        else:
            hub_of[row] = len(hubs)
            hubs.append(row)
    return hub_of, hubs


def _parts(route: Ints, hub_of: dict[int, int]) -> Iterator[tuple[int, int]]:
    """Return the first and last index of each part of a route between different hubs."""
    found = [index for index, row in enumerate(route.tolist()) if row in hub_of]
    ends = [*found, len(route) - 1]
    for first, last in zip(found, ends[1:], strict=True):
        same = hub_of.get(int(route[last]), -1) == hub_of[int(route[first])]
        if last > first and not same:
            yield first, last


def _smooth(points: Floats, rounds: int) -> Floats:
    """Return a path without the corners of voxels; both ends stay."""
    for _ in range(rounds):
        inner = 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:]
        points = np.concatenate([points[:1], inner, points[-1:]])
    return points


def is_bone_inside(solid: Solid, start: Floats, end: Floats) -> bool:
    """Return whether a bone between two points (3,) stays in the solid."""
    count = 2 + int(np.linalg.norm(end - start) / solid.spacing)
    return bool(solid.gaps(np.linspace(start, end, count)).max() <= NEAR * solid.spacing)
