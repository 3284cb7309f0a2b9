"""Curve skeleton of any solid with limbs: joints where it branches and bends, or evenly spaced.

The limbs are the protrusions of the solid as seen from its trunk: tips are maxima of the geodesic
distance (``medial.LevelSets``), and the shortest paths from them through the middle of the solid
form a tree (Sato et al. 2000). It is made twice: first from the deepest voxel, to find the trunk,
then from there; and up to three times more from the middle of a trunk that is a plate, such as the
top of a table, which each of them finds better. The trunk is where most limbs meet, so that no
branch has most of the tips; the foot of what stands on one limb, such as a plant or a robot's arm;
the thick part between two limbs; or the thicker end of what has no branches.

- Loops are cut, as a skeleton has none: where they are narrow, as a hand that touches the hip, or
  farthest from the trunk.
- Branches closer to each other than the solid's radius there are one joint: a *hub*.
- A limb begins where its level set parts from those of the others: at the surface of the trunk.
- Joints are where separate parts of a limb meet, as those of a robot's arm. Otherwise, they are
  where the path bends (Douglas and Peucker 1973) if it bends sharply a few times, as a leg does. A
  straight or smoothly curved limb gets joints at even distances, whose number grows with its length
  relative to its width: tails, tentacles, snakes, fingers. Where a bone would leave the solid, it
  gets another joint.
- Limbs on both sides of a plane of symmetry are paired. Both get the same number of joints, and
  mirrored positions if they are in mirrored poses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from viewer.autorig.alignment.orientation_search import (
    axis_direction,
    axis_rotations,
)
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.anatomy import Limb, arc_lengths, paired, sagittal_plane
from viewer.autorig.checks import require_target
from viewer.autorig.medial import LevelSets, Paths, Protrusion
from viewer.autorig.parts import MOST_PARTS, Parts, parts_of
from viewer.autorig.settings import SkeletonSettings
from viewer.autorig.solid import Solid, solid_within
from viewer.autorig.weights.bone_weights import NEAR
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import Remedy, counted, listed, rounded
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.skeleton import ball_skeleton

_FINEST = 160  # voxels along the longest side of thin meshes: legs of spiders
# Fractions of the solid in an object that only touches the largest one: of one that is refused,
# and of one that is reported. Smaller ones are ornaments.
_OBJECT, _PART = 0.2, 0.05
_APART, _FEW = 3.0, 0.02  # distance in voxels from the solid, and fraction of the vertices there
# Distance from the skeleton, relative to its half width and to the largest radius of the solid, and
# fraction of the solid there for which sheets are reported.
_FAR, _MISSED = 2.0, 0.1
# Radius of what is thin, such as a fin, relative to the largest one, and fraction of the surface
# from which it is reported if it has no joints.
_SLIM, _SEEN = 0.5, 0.02
_MOST_LOOPS = 20  # loops that are cut: each takes a search
# Length of the corners of a cut, which are no limbs, and their distance from its middle: relative
# to its half width.
_RAGGED = 2.0
_SAME = 2.0  # distance in voxels up to which cuts are one: some need two searches
# Least radius, relative to the largest one, of the place where the search for the trunk begins: the
# deepest one may be at a border, as where the seat, the back and a leg of a chair meet.
_DEEP = 0.75
# Distance from a hub at which a limb begins, or half width of a level set, relative to the radius
# there, from which the trunk is a plate: it is 1 in a ball.
_PLATE = 4.0
_ROUNDS = 4  # searches from the trunk: each finds the middle of a plate better
_THIN = 1.0  # radius in voxels of a sheet: its voxels are those of the surface

# Limbs.
# Shortest limb: relative to the half width of its base, to the size, and in voxels. A bump is
# wider than long.
_OWN, _SHORTEST, _VOXELS = 1.0, 0.03, 3.0
_LONG = 3.0  # length of a limb relative to its neck, from which it is one wherever it is
# A hub's reach relative to the solid's radius there: two branches that touch the same inscribed
# ball are one.
_REACH = 1.0
_NARROWER = 0.8  # radius of a limb relative to that of the hub, below which it has its own joint
# Distance from the hub, relative to its radius, at which the only limb begins at the latest.
_TAPERED = 2.0
# Distance of a path from the middle of a level set, relative to the half width, from which it is
# beside it, as in a plate that a limb meets in its middle; and the least length and half width of
# such a part at the end of a limb, relative to the half width of the limb, that is a plate.
_BESIDE, _RIM = 0.5, 2.0
# What stands on one limb: heights of the lowest surface of the foot and of all other tips, relative
# to the solid's, and the ratio of the foot's half width to their radii.
_FOOT, _STANDS, _STEADY = 0.05, 0.12, 1.5
_UPRIGHT = 0.3  # height, relative to the size, of what stands rather than lies
# Radius of a trunk between two limbs, relative to both: of a kettlebell, not of a snake.
_BODY = 2.0

# Length of the part of a trunk beyond its middle, relative to its half width, if it is long.
_SLENDER = 2.0

# Joints along limbs.
_TOLERANCE = 0.5  # of the polyline, relative to the half width
_ROUGH = 1.0  # of the polyline, in voxels: paths are known to half a voxel
_BENT = np.radians(20.0)  # least change of direction at a joint
_SHARP = np.radians(35.0)  # change of direction that a jointed limb has at least once
# A bend is sharp if most of its change of direction is within this length on both sides, relative
# to the half width; a limb is jointed if most of its bends are sharp, weighted by their
# squared angles.
_AROUND, _MOST = 1.0, 0.6
# Exponent in the number of bones of a smooth limb, (length / half width)^k. It gives a finger (8) 3
# bones, a tentacle (30) 8, a snake (50) 10; joints as dense as in a finger would give a snake 20.
_DENSITY = 0.6
# Parts of a chain, relative to the half width: up to the first length, a part between two others is
# a hinge; beyond the second, it is not rigid and has joints of its own.
_HINGE, _RIGID = 3.0, 10.0
# Least distance of bends, relative to the half width and to the length: a rounded knee is one bend.
_CLOSEST, _CLOSEST_PART = 3.0, 0.1
_END = 0.5  # distance of the last joint from the tip, relative to the half width
_STRAIGHT = 1e-6  # distance from a bone up to which a path is straight, relative to its length

# Symmetry.
# Fraction of the voxels whose mirror images are inside: without a doubt; and of a figure in an
# asymmetric pose, if at least half of its tips are those of pairs.
_SYMMETRIC, _POSED = 0.85, 0.5
_CENTRAL = 1.5  # distance from the plane, in voxels or half widths, up to which a limb is central
_AROUND_MIDDLE = 0.25  # the same of the root, relative to where the first limb begins
_MIRRORED = 1.5  # distance of a limb's path from the mirrored one, likewise
_SAMPLES = 64  # points of paths that are compared
_NOWHERE = np.zeros((0, 3))
_ON_GROUND = 0.12  # height of the tip of a leg, relative to the solid's, as in ``anatomy``
_ASKEW = 0.5  # cosine of the angle between directions that are different ones
_TRUNK = "trunk"


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


def _least(solid: Solid) -> float:
    """Return the length of the shortest limb, and the distance up to which places are the same."""
    size = solid.spacing * max(solid.inside.shape)
    return max(_SHORTEST * size, _VOXELS * solid.spacing)


class _Field:
    """Distances from a voxel of a solid, their level sets, and the paths from its tips."""

    def __init__(self, solid: Solid, paths: Paths, source: int, wanted: Floats) -> None:
        from scipy.sparse import csgraph

        self.solid, self.radii = solid, paths.radii
        self.centers = solid.centers(solid.voxels)
        self._least = _least(solid)
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
        self.tips = self._levels.tips(lambda found: self._is_limb(found) or self._is_wanted(found))
        routes = [route[::-1] for route in paths.to(np.array([source]), self.tips.rows)]
        stands = [k for k, route in enumerate(routes) if self._stands(k, route[::-1])]
        thick = self._widths[self._levels.labels] <= _PLATE * self.radii
        joined = paths.joined([routes[k] for k in stands], thick)
        self.routes = dict(zip(stands, joined, strict=True))
        """Paths to the tips of limbs, by the index of the tip."""

    def _is_limb(self, found: Protrusion) -> bool:
        # On a plate, as a leg of a table, the base of a later junction is a part of the plate. The
        # first junction may be with a bump of the limb itself, such as a corner of its foot.
        for junction, base in found.necks:
            if found.tip - junction >= _LONG * float(self._widths[list(base)].max()):
                return True
        width = float(self._widths[list(found.base)].max())
        is_long = found.tip - found.junction >= max(_OWN * width, self._least)
        return is_long and not self._is_at_cut(found)

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
        return bool(self.tips.stood_out[tip]) and parted > half

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
            early = lengths >= float(lengths[reached]) - _HINGE * width
            for sooner in range(reached, int(early.argmax()) - 1, -1):
                if _is_inside(solid, points[0], points[sooner]):
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
        if field.distances[row] + radii.max() < field.parting(frozenset(beyond[row])):
            # Far inside of a part that is wider than thick, as a seat, other limbs still have the
            # same level sets: it is one part, although the paths to a leg and to an arm have some
            # of their way in common. In a part as thick as wide, a hub is a shoulder; behind a
            # waist, it belongs to another part.
            way = [row]
            while way[-1] not in hub_of:
                way.append(above[way[-1]])
            if radii[way].min() >= _NARROWER * radii[way].max():
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


def rooted_tree(solid: Solid, paths: Paths, up: Floats) -> Tree:
    """Return the hubs and chains of a solid outwards from its trunk."""
    centers = solid.centers(solid.voxels)
    deep = np.flatnonzero(_is_deep(solid))
    middle = centers.mean(axis=0)
    source = int(deep[np.linalg.norm(centers[deep] - middle, axis=1).argmin()])
    report_fraction(0.1)
    tree = tree_of(solid, paths, source)
    report_fraction(0.4)
    root: int | None = source
    if len(tree.chains):
        root = _trunk(solid, paths, tree, centers @ up)
        if root == source:
            root = _middle_of_plate(solid, tree)
    cuts = [tree.cuts]
    for _ in range(_ROUNDS):
        if root is None or root == tree.rows[0]:
            break
        # Loops stay cut.
        tree = tree_of(solid, paths, root)
        cuts.append(tree.cuts)
        root = _middle_of_plate(solid, tree)
    return replace(tree, cuts=np.concatenate(cuts))


def _is_deep(solid: Solid) -> Bools:
    """Return which voxels (N,) have none around them that is deeper, and are deep themselves."""
    from scipy.ndimage import maximum_filter

    radii, around = solid.radii(), maximum_filter(solid.distance, 3)[tuple(solid.voxels.T)]
    found: Bools = (radii >= around) & (radii >= _DEEP * radii.max())
    return found


def _trunk(solid: Solid, paths: Paths, tree: Tree, heights: Floats) -> int:
    """Return the voxel in which the skeleton has its root; ``heights`` (N,) of all voxels."""
    low, high = float(heights.min()), float(heights.max())
    inwards = [route[::-1] for route in tree.routes]
    ends = [int(route[0]) for route in inwards]
    if sum(chain.start == 0 for chain in tree.chains) == 1:
        blunt, is_long = _blunt_end(solid, paths, tree)
        inwards.append(blunt)
        ends.append(int(blunt[0 if is_long else -1]))
    inside = [_inside_end(solid, paths, route) for route in inwards]
    wide = paths.radii[inside]
    relative = (heights[inside] - wide - low) / max(high - low, solid.spacing)
    foot = int(relative.argmin())
    others = np.delete(np.arange(len(inside)), foot)
    steady = float(wide[foot])
    if high - low >= _UPRIGHT * solid.spacing * max(solid.inside.shape):
        # A foot may be a flat disc, which is as steady as it is wide; the jaw of a snake is none.
        steady = max(steady, _footprint(solid, heights <= low + _FOOT * (high - low)))
    if (
        relative[foot] <= _FOOT
        and (relative[others] >= _STANDS).all()
        and (steady >= _STEADY * wide[others]).all()
    ):
        top = low + 2.0 * float(wide[foot])
        if top > 0.5 * (low + high):  # a snake
            return inside[foot]
        # The way from a tip enters a foot at its rim. Nothing else is as low.
        is_foot = heights <= top
        return _deepest_near(solid, solid.centers(solid.voxels[is_foot]).mean(axis=0))
    if len(inwards) == 2:
        between = sum(chain.start == 0 for chain in tree.chains) == 2
        thickest = max(chain.half_width for chain in tree.chains)
        if between and tree.radii[0] >= _BODY * thickest:
            return int(tree.rows[0])
        return _thicker_end(solid, paths, ends)
    # As in the centroid of a tree, with tips as weights; ties go to the wider place.
    count = len(tree.routes)
    most = []
    for hub in range(len(tree.hubs)):
        beyond = [len(chain.tips) for chain in tree.chains if chain.start == hub]
        before = count - sum(beyond) if hub else 0
        most.append((max([before, *beyond]), -float(tree.radii[hub])))
    return int(tree.rows[min(range(len(most)), key=lambda hub: most[hub])])


def _footprint(solid: Solid, lowest: Bools) -> float:
    """Return the radius of the largest circle below the lowest voxels, a mask (N,) of all."""
    from scipy import ndimage

    voxels = solid.voxels[lowest]
    upwards = int(np.ptp(voxels, axis=0).argmin())
    ground = np.zeros(np.delete(solid.inside.shape, upwards), dtype=np.bool_)
    ground[tuple(np.delete(voxels, upwards, axis=1).T)] = True
    return solid.spacing * float(ndimage.distance_transform_edt(ground).max())


def _blunt_end(solid: Solid, paths: Paths, tree: Tree) -> tuple[Ints, bool]:
    """Return the voxels of the way from the end opposite of the only limb to the first hub.

    Also returns whether that part is long: the head of a fish is no limb, as it is wider than long,
    but the end of a long trunk. The foot of a bottle or the hat of a mushroom is not.
    """
    from scipy.sparse import csgraph

    hub = int(tree.rows[0])
    ways = csgraph.dijkstra(paths.steps, indices=[int(tree.routes[0][-1])], min_only=True)
    end, beyond = int(ways.argmax()), ways >= ways[hub]
    (found,) = paths.to(np.array([hub]), np.array([end]))
    if end == hub:
        return found, False
    # As in ``LevelSets.half_widths``, but of the second largest extent: a plate has two.
    extents = np.linalg.eigvalsh(np.cov(solid.centers(solid.voxels[beyond]).T))
    return found, bool(ways[end] - ways[hub] >= _SLENDER * 2.0 * np.sqrt(extents[1]))


def _middle_of_plate(solid: Solid, tree: Tree) -> int | None:
    """Return the voxel in the middle of a trunk that is a plate, as a table's; None for others."""
    limbs = [chain for chain in tree.chains if chain.start == 0]
    if len(limbs) < 3 or np.median([limb.begin for limb in limbs]) <= _PLATE * tree.radii[0]:
        return None
    # The deepest place may be where the plate and one leg meet.
    bases = [at_lengths(limb.points, np.array([limb.begin]))[0] for limb in limbs]
    return _deepest_near(solid, np.mean(bases, axis=0))


def _deepest_near(solid: Solid, place: Floats) -> int:
    """Return the deepest voxel around the one that is nearest to a place (3,)."""
    centers, radii = solid.centers(solid.voxels), solid.radii()
    apart = np.linalg.norm(centers - centers[solid.nearest(place[None])[0]], axis=1)
    near = np.flatnonzero(apart <= radii.max())
    return int(near[np.lexsort((apart[near], -radii[near]))[0]])


def _thicker_end(solid: Solid, paths: Paths, ends: list[int]) -> int:
    """Return the end of a solid without branches at which its third is thicker."""
    (route,) = paths.to(np.array(ends[:1]), np.array(ends[1:]))
    third = max(1, len(route) // 3)
    first, last = paths.radii[route[:third]].mean(), paths.radii[route[-third:]].mean()
    return _inside_end(solid, paths, route if first > last else route[::-1])


def _inside_end(solid: Solid, paths: Paths, route: Ints) -> int:
    """Return the voxel in the middle of the solid near the beginning of a path from a tip."""
    if len(route) < 2:
        return int(route[0])
    lengths = arc_lengths(solid.centers(solid.voxels)[route])
    radius = float(np.median(paths.radii[route]))
    near = lengths <= max(2.0 * radius, solid.spacing)
    return int(route[int(np.where(near, paths.radii[route], -1.0).argmax())])


# Joints along chains.


def joint_lengths(chain: Chain, spacing: float, factor: float) -> tuple[Floats, bool]:
    """Return the lengths (N,) along a chain of its joints, the end included.

    Also returns whether they are where it bends or where its parts meet.
    """
    width = chain.half_width
    # A part that does not bend moves with the joint at its base: the last one is at its very end.
    is_bending = chain.end < 0 and not (chain.stiff and chain.stiff[-1])
    stop = chain.length - (_END * width if is_bending else 0.0)
    start = min(chain.begin, stop)
    # A short limb, too, begins with a joint at its base: one at its tip would not move it.
    first = [start] if start > 0.0 and stop - start >= _END * width else []
    near = _HINGE * width
    seams = [length for length in chain.seams if start - near <= length <= stop - width]
    if seams and seams[0] <= start + near:
        start = max(start, seams.pop(0))
        first = [start]
    if not seams and not _is_stiff(chain, start, stop):
        inner, jointed = _inner_joints(chain, start, stop, spacing, factor)
        return np.array([*first, *inner, stop]), jointed
    found = first
    for begin, end in pairwise([start, *seams, stop]):
        if end - begin > _RIGID * width and not _is_stiff(chain, begin, end):
            found = [*found, *_inner_joints(chain, begin, end, spacing, factor)[0]]
        found = [*found, end]
    return np.array(found), True


def bones_inside(chain: Chain, lengths: Floats, solid: Solid) -> Floats:
    """Return the lengths (N,) of a chain's joints, with more where bones would leave the solid.

    A bone that takes a short cut, as across a frame or the inside of a mug, would bind what it
    passes to the wrong joint.
    """
    found, todo = [], [*pairwise([chain.begin, *lengths.tolist()])]
    while todo:
        begin, end = todo.pop()
        found.append(end)
        if end - begin <= max(chain.half_width, 2.0 * solid.spacing):
            continue
        count = 2 + int((end - begin) / solid.spacing)
        way = at_lengths(chain.points, np.linspace(begin, end, count))
        if not _is_inside(solid, way[0], way[-1]):
            apart = np.linalg.norm(way - _nearest_on(way, way[0], way[-1]), axis=1)
            if apart.max() <= _STRAIGHT * (end - begin):
                continue  # the path itself is outside, and another joint would be, too
            middle = begin + (end - begin) * float(apart.argmax()) / (count - 1)
            todo += [(begin, middle), (middle, end)]
            found.pop()
    return np.array(sorted(found))


def _is_inside(solid: Solid, start: Floats, end: Floats) -> bool:
    """Return whether a bone between two points (3,) stays in the solid."""
    count = 2 + int(np.linalg.norm(end - start) / solid.spacing)
    return bool(solid.gaps(np.linspace(start, end, count)).max() <= NEAR * solid.spacing)


def _is_stiff(chain: Chain, begin: float, end: float) -> bool:
    """Return whether the part around the middle of a piece of a chain does not bend."""
    part = int(np.searchsorted(chain.seams, 0.5 * (begin + end)))
    return part < len(chain.stiff) and chain.stiff[part]


def _inner_joints(
    chain: Chain, start: float, stop: float, spacing: float, factor: float
) -> tuple[Floats, bool]:
    """Return the lengths of joints between two of a chain (N,), and whether it bends there."""
    width, length = chain.half_width, stop - start
    path = at_lengths(chain.points, np.linspace(start, stop, max(2, int(length / spacing) + 1)))
    closest = max(_CLOSEST * width, _CLOSEST_PART * length)
    bends = _bends(path, max(_TOLERANCE * width, _ROUGH * spacing), closest)
    jointed = _is_jointed(path, bends, _AROUND * max(width, 2.0 * spacing))
    if jointed:
        inner = start + arc_lengths(path)[bends] * length / max(arc_lengths(path)[-1], 1e-300)
    else:
        # The trunk has a joint where limbs begin, and more only between hubs far apart.
        count = (length / width) ** _DENSITY / factor
        bones = max(1, int(count) if chain.end >= 0 else round(count))
        inner = start + length * np.arange(1, bones) / bones
    return inner, jointed


def _seams(
    lengths: Floats, owners: Ints, hinge: float
) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Return where the parts of a path (K,) meet, and the parts before, between and behind.

    A part up to ``hinge`` long between two others is one meeting place, its middle.
    """
    firsts = np.flatnonzero(np.diff(owners, prepend=-1))
    starts = [float(lengths[first]) for first in firsts]
    labels = owners[firsts].tolist()
    while len(labels) > 1:
        sizes = np.diff([*starts, float(lengths[-1])])
        short = int(sizes.argmin())
        if sizes[short] > hinge:
            break
        if 0 < short < len(labels) - 1:
            middle = starts[short] + 0.5 * float(sizes[short])
            del labels[short], starts[short]
            starts[short] = middle
            if labels[short - 1] == labels[short]:  # a ring or a bump
                del labels[short], starts[short]
        else:
            del labels[short], starts[max(short, 1)]
    return tuple(starts[1:]), tuple(labels)


def _bends(path: Floats, tolerance: float, closest: float) -> list[int]:
    """Return the points at which a path bends: those of a polyline within the tolerance."""
    found = []
    todo = [(0, len(path) - 1)]
    while todo:
        first, last = todo.pop()
        inner = path[first + 1 : last]
        if len(inner) == 0:
            continue
        gaps = np.linalg.norm(inner - _nearest_on(inner, path[first], path[last]), axis=1)
        if gaps.max() > tolerance:
            middle = first + 1 + int(gaps.argmax())
            found.append(middle)
            todo += [(first, middle), (middle, last)]
    found = sorted(found)
    lengths = arc_lengths(path)
    while found:
        places = np.array([0, *found, len(path) - 1])
        gaps = np.diff(lengths[places])
        near = int(gaps.argmin())
        if gaps[near] < closest:
            # A smoothed knee is two bends, which count as one; one at an end is none.
            if 0 < near < len(found):
                middle = 0.5 * (lengths[places[near]] + lengths[places[near + 1]])
                found[near - 1] = int(np.abs(lengths - middle).argmin())
                near = min(near, len(found) - 1)
            del found[min(near, len(found) - 1)]
            continue
        angles = _angles(path[places])
        weak = int(angles.argmin())
        if angles[weak] >= _BENT:
            break
        del found[weak]
    return found


def _nearest_on(points: Floats, start: Floats, end: Floats) -> Floats:
    """Return the points of a line from ``start`` to ``end`` that are nearest to others (N, 3)."""
    chord = end - start
    along = np.clip((points - start) @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
    nearest: Floats = start + along[:, None] * chord
    return nearest


def _is_jointed(path: Floats, bends: list[int], around: float) -> bool:
    """Return whether a path consists of straight parts, and not of a curve."""
    corners = [0, *bends, len(path) - 1]
    angles = _angles(path[corners])
    if angles.max(initial=0.0) < _SHARP:
        return False
    lengths = arc_lengths(path)
    sharp = 0.0
    for before, bend, after, angle in zip(
        corners, bends, corners[2:], angles.tolist(), strict=False
    ):
        # Directions on both sides, without what is near the bend.
        here = lengths[bend]
        reach = [min(around, 0.5 * abs(here - lengths[end])) for end in (before, after)]
        places = [here - 2.0 * reach[0], here - reach[0], here + reach[1], here + 2.0 * reach[1]]
        near = at_lengths(path, np.array(places))
        ways = np.stack([near[1] - near[0], near[3] - near[2]])
        turned = _angles(np.concatenate([np.zeros((1, 3)), np.cumsum(ways, axis=0)]))
        if float(turned[0]) >= _MOST * angle:
            sharp += angle**2
    return bool(sharp >= _MOST * (angles**2).sum())


def _angles(corners: Floats) -> Floats:
    """Return the changes of direction at the inner corners of a polyline (K, 3): (K - 2,)."""
    steps = np.diff(corners, axis=0)
    ways = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300)
    angles: Floats = np.arccos(np.clip((ways[:-1] * ways[1:]).sum(axis=1), -1.0, 1.0))
    return angles


def _parted(chain: Chain, solid: Solid, owners: Ints, stiff: Bools) -> Chain:
    """Return a chain with the places where separate parts of the mesh meet.

    ``owners``: the part around each voxel, -1 where there is none; ``stiff`` (P,): of all parts.
    """
    path = at_lengths(chain.points, np.arange(0.0, chain.length, 0.5 * solid.spacing))
    around, lengths = owners[solid.nearest(path)], arc_lengths(path)
    known = around >= 0
    seams, labels = _seams(lengths[known], around[known], _HINGE * chain.half_width)
    return replace(chain, seams=seams, stiff=tuple(bool(stiff[each]) for each in labels))


# Symmetry and names.


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """A plane of symmetry, and the figure's directions."""

    lateral: Floats
    """(3,). Normal, to the figure's left."""
    offset: float
    up: Floats

    def sides(self, points: Floats) -> Floats:
        """Return the distances of points (..., 3) from the plane, positive on the left."""
        found: Floats = points @ self.lateral - self.offset
        return found

    def mirrored(self, points: Floats) -> Floats:
        """Return the mirror images of points (..., 3)."""
        found: Floats = points - 2.0 * self.sides(points)[..., None] * self.lateral
        return found


def paired_chains(tree: Tree, plane: _Plane, spacing: float, size: float) -> dict[int, int]:
    """Return the chain on the other side of each chain that has one, both ways."""
    partner: dict[int, int] = {}
    central = {0}
    for number, chain in enumerate(tree.chains):
        if chain.end >= 0 and chain.start in central and _is_central(tree, number, plane, spacing):
            central.add(chain.end)
    todo = [(central, central)]
    while todo:
        ours, theirs = todo.pop()
        near = {}
        for number, chain in enumerate(tree.chains):
            is_side = not _is_central(tree, number, plane, spacing)
            if number not in partner and is_side and chain.start in ours | theirs:
                near[number] = _as_limb(chain, plane)
        positive = np.array(
            [plane.sides(limb.points[0]) > 0.0 for limb in near.values()], dtype=np.bool_
        )
        if ours is not theirs:
            # Beyond a pair of limbs, those of the left one belong to the left.
            positive = np.array([tree.chains[number].start in ours for number in near])
        number_of = {id(limb): number for number, limb in near.items()}
        for pair in paired(list(near.values()), positive, plane.lateral, plane.offset, size):
            left, right = (number_of[id(limb)] for limb in pair.limbs)
            partner[left], partner[right] = right, left
            a, b = tree.chains[left].end, tree.chains[right].end
            if a >= 0 and b >= 0:
                todo.append(({a}, {b}))
    return partner


def _is_central(tree: Tree, number: int, plane: _Plane, spacing: float) -> bool:
    chain = tree.chains[number]
    points = at_lengths(chain.points, np.linspace(chain.begin, chain.length, _SAMPLES))
    apart = float(np.abs(plane.sides(points)).max())
    if apart > _CENTRAL * max(chain.half_width, spacing):
        return False
    # The front legs of a cow are near the plane, but each is the mirror image of the other.
    end = chain.points[-1]
    others = [other.points[-1] for other in tree.chains if other is not chain]
    gaps = np.linalg.norm(np.array(others).reshape(-1, 3) - plane.mirrored(end), axis=1)
    return bool(abs(float(plane.sides(end))) <= gaps.min(initial=np.inf))


def _as_limb(chain: Chain, plane: _Plane) -> Limb:
    """Return a chain as a limb from its tip to the trunk, attached in the plane of symmetry."""
    points = chain.points[::-1]
    start = at_lengths(chain.points, np.array([chain.begin]))[0]
    attachment = start - plane.sides(start) * plane.lateral
    radii = np.full(len(points), chain.half_width)
    return Limb(points, radii, attachment, chain.length - chain.begin)


@dataclass(frozen=True, slots=True, eq=False)
class CurveSkeleton:
    """A skeleton found in a mesh."""

    figure: Figure
    """The skeleton, without a mesh."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user."""


def find_skeleton(
    source: Figure, target: Mesh, how: SkeletonSettings, alignment: AlignmentSettings
) -> CurveSkeleton:
    """Return the skeleton of a figure's mesh; ``RigError`` if it is no single solid.

    ``alignment``: up axis and front, if they are known. ``target``: the mesh in the current pose.
    """
    require_target(target)
    named = alignment.up or source.up
    # Any axis beside the up axis is a front; the usual ones are those of figures.
    usual = "x" if named[-1] == "z" else "z"
    front = alignment.facing or usual
    axis_rotations(source.up, named, front)  # checks the names
    with part_of_work(span=(0.0, 0.4)):
        solid = solid_within(target.positions, target.triangles, _FINEST, fills_hollows=True)
    n_stray = _check_one(target, solid)
    parts = parts_of(target, solid)
    where = "" if parts.contact is None else listed([rounded(x) for x in parts.contact.tolist()])
    if parts.touching >= _OBJECT:
        raise RigError(
            f"expected one object, found separate ones that only touch, the largest at {where}; "
            "rig each object alone"
        )
    with part_of_work(span=(0.4, 1.0)):
        found = joints_in(
            solid,
            axis_direction(named),
            axis_direction(front),
            how,
            parts,
            is_facing_known=alignment.facing is not None,
        )
    names, parents, places = found.names, found.parents, found.positions
    figure = Figure(
        name=source.name,
        skeleton=ball_skeleton(names, parents, places),
        up="z" if named == "z" else "y" if named == "y" else source.up,
        unit=source.unit,
    )
    lines = [*_lines(found, alignment.facing is None)]
    if parts.count > 1:
        n = counted(parts.count, "separate part", "is", "are")
        lines.append(note("R015.parts: {n} rigged as one object", n=n))
    if parts.count > MOST_PARTS:
        lines.append(
            note(
                "R016.many-parts: only the {most} largest parts were searched for hinges and for "
                "separate objects that touch",
                most=MOST_PARTS,
            )
        )
    if parts.touching >= _PART:
        lines.append(
            note(
                "R016.touching: a part only touches the others at {place}: a separate object "
                "should be rigged alone",
                place=where,
            )
        )
    if n_stray:
        n = counted(n_stray, "vertex", "is", "are")
        lines.append(note("R016.stray: {n} far from the largest part, which has all joints", n=n))
    return CurveSkeleton(figure, tuple(lines))


def _check_one(target: Mesh, solid: Solid) -> int:
    """Return the number of vertices far from the largest part; ``RigError`` if they are many."""
    used = np.unique(target.triangles)
    apart = solid.gaps(target.positions[used]) > _APART * solid.spacing
    if apart.mean() > _FEW:
        raise RigError(
            f"expected one object, found parts far from the largest one: {int(apart.sum())} of "
            f"{counted(len(used), 'vertex')}; rig each object alone"
        )
    return int(apart.sum())


def _lines(found: Joints, is_assumed: bool) -> Iterator[Diagnostic]:
    """Return messages about the joints, their symmetry and the front."""
    if len(found.names) == 1:
        yield note("R016.no-limbs: no limbs found: one joint moves the whole mesh")
        return
    limbs = counted(found.limbs, "limb") if found.limbs else Phrase("the trunk only")
    yield note(
        "R015.skeleton: skeleton found in the mesh: {n}, {limbs}, {pairs} mirrored",
        n=counted(len(found.names), "joint"),
        limbs=limbs,
        pairs=counted(found.pairs, "pair"),
    )
    for place in found.cuts:
        yield note(
            "R016.loop-cut: a loop is cut at {place}: bones cannot form one, so both sides move "
            "apart there",
            place=listed([rounded(value) for value in place.tolist()]),
        )
    if found.has_loops:
        yield note(
            "R016.more-loops: some loops are not cut: one side of each has no joints; "
            "--skeleton takes a skeleton that has them"
        )
    if found.missed > _MISSED:
        yield note(
            "R016.loops: {missed:.0%} of the mesh is far from the skeleton, as wide sheets are, "
            "and has no joints of its own",
            missed=found.missed,
        )
    if len(found.thin):
        yield note(
            "R016.thin: without joints: {n}, {share:.0%} of the surface, the largest at {place}; "
            "--skeleton takes a skeleton that has them",
            n=counted(len(found.thin), "thin part"),
            share=float(found.thin.sum()),
            place=listed([rounded(value) for value in found.thin_at[0].tolist()]),
        )
    if found.pairs and is_assumed:
        yield note(
            "R015.front: left and right, and numbers from front to back: assuming that the front "
            "is {front}",
            front=_axis_name(found.front),
        )


def _axis_name(way: Floats) -> str:
    """Return the axis next to a direction (3,), with its sign."""
    axis = int(np.abs(way).argmax())
    return f"{'+' if way[axis] > 0.0 else '-'}{'xyz'[axis]}"


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Joints found in a solid."""

    names: tuple[str, ...]
    parents: Ints
    """(J,). -1 for the root, which is the first."""
    positions: Floats
    """(J, 3)."""
    limbs: int
    """Number of limbs that begin at the trunk."""
    pairs: int
    """Number of pairs of them that mirror each other."""
    missed: float
    """Fraction of the solid that is far from the skeleton."""
    thin: Floats
    """(T,). Fractions of the surface in thin parts without joints, the largest first."""
    thin_at: Floats
    """(T, 3). Their middles."""
    cuts: Floats
    """(C, 3). Places where loops were cut."""
    has_loops: bool
    """Whether there are more loops than were cut."""
    front: Floats
    """(3,). The direction that was taken as the front."""


def joints_in(
    solid: Solid,
    up: Floats,
    front: Floats,
    how: SkeletonSettings,
    parts: Parts,
    is_facing_known: bool,
) -> Joints:
    """Return the joints of a solid; ``up``, ``front``: (3,), its directions."""
    report_fraction(0.0, "looking for limbs")
    paths = Paths(solid)
    tree = _completed(solid, paths, rooted_tree(solid, paths, up), up, front, how.symmetry)
    if len(tree.chains) == 0 and float(paths.radii.max()) <= _THIN * solid.spacing:
        raise RigError(
            "expected a solid with limbs, found a sheet without thickness; "
            f"{Remedy('place its joints by Edit skeleton', 'give it joints by --skeleton')}"
        )
    report_fraction(0.8, "placing joints")
    if parts.count > 1:
        owners = parts.around(tree.levels)[tree.levels]
        chains = tuple(_parted(chain, solid, owners, parts.stiff) for chain in tree.chains)
        tree = replace(tree, chains=chains)
    plane, partner = _symmetry_of(solid, tree, up, front, how.symmetry)
    if plane is not None and not is_facing_known:
        # The front is in the plane of symmetry: a figure along x does not face along z.
        front = np.cross(plane.lateral, up)
    points = _joint_points(solid, tree, plane, partner, how.joint_spacing)
    heights = solid.centers(solid.voxels) @ up
    low = float(heights.min()) + _ON_GROUND * float(np.ptp(heights))
    labels = _Names(tree, plane, partner, front if is_facing_known else None)
    chain_names = labels.of_chains(up, low, front)
    names, parents, places = ["root"], [-1], [_on(plane, tree.hubs[0])]
    joint_of, counts = {0: 0}, dict[str, int]()
    for chain, name, own in zip(tree.chains, chain_names, points, strict=True):
        above = joint_of[chain.start]
        for index, place in enumerate(own):
            if name.startswith(_TRUNK):
                side = name.removeprefix(_TRUNK)
                joint = f"{_TRUNK}_{counts.setdefault(side, 1)}{side}"
                counts[side] += 1
            elif chain.end < 0 and index and index + 1 == len(own):
                joint = name + "_end"
            else:
                joint = f"{name}_{index + 1}" if index else name
            names.append(joint)
            parents.append(above)
            places.append(place)
            above = len(names) - 1
        if chain.end >= 0:
            joint_of[chain.end] = above
    thin, thin_at = _thin_parts(solid, parts, np.array(parents), np.array(places))
    return Joints(
        tuple(names),
        np.array(parents, dtype=np.int32),
        np.array(places),
        labels.limbs,
        labels.pairs,
        _missed(solid, tree),
        thin,
        thin_at,
        distinct_places(tree.cuts, _SAME * solid.spacing),
        tree.has_loops,
        front,
    )


def distinct_places(places: Floats, least: float) -> Floats:
    """Return the places (N, 3) that are farther than ``least`` from all returned before."""
    found = np.zeros((0, 3))
    for place in places:
        if (np.linalg.norm(found - place, axis=1) > least).all():
            found = np.concatenate([found, place[None]])
    return found


def _missed(solid: Solid, tree: Tree) -> float:
    """Return the fraction of a solid that is far from all chains, as a wide sheet is."""
    from scipy import spatial

    if len(tree.chains) == 0:
        return 0.0
    points = [tree.hubs, *(chain.points for chain in tree.chains)]
    widths = [2.0 * tree.radii]
    for chain in tree.chains:
        # The trunk reaches to where the limb begins: the top of a table needs no joints.
        is_trunk = arc_lengths(chain.points) < chain.begin
        widths.append(np.where(is_trunk, max(chain.begin, chain.half_width), chain.half_width))
    centers = solid.centers(solid.voxels)
    gaps, nearest = spatial.cKDTree(np.concatenate(points)).query(centers)
    # Inside the trunk, the nearest point may be that of a thin limb.
    wide = np.maximum(_FAR * np.concatenate(widths)[nearest], _FAR * float(solid.radii().max()))
    return float((gaps > wide).mean())


def _thin_parts(solid: Solid, parts: Parts, parents: Ints, joints: Floats) -> tuple[Floats, Floats]:
    """Return the parts of a solid that are thin and have no bone, as fins and the brims of hats.

    ``joints`` (J, 3). Returns fractions of the surface (T,), the largest first, and middles (T, 3).
    """
    from scipy import ndimage

    # A ball of half the radius of the trunk does not fit into them: they are not in the opening of
    # the solid by it, which also lacks the edges of a box.
    ball = _SLIM * float(solid.radii().max())
    core = solid.distance >= ball
    beyond = solid.spacing * ndimage.distance_transform_edt(~core) - ball
    labels, count = ndimage.label(solid.inside & (beyond > solid.spacing), np.ones((3, 3, 3)))
    numbers = np.arange(1, count + 1)
    sticks_out = np.array(ndimage.maximum(beyond, labels, numbers)) >= ball
    starts, ends = joints[np.maximum(parents, 0)], joints
    steps = 2 + int(np.linalg.norm(ends - starts, axis=1).max() / solid.spacing)
    bones = np.linspace(starts, ends, steps).reshape(-1, 3)
    own = labels[tuple(solid.voxel_of(bones).T)]
    of_surface = labels[tuple(solid.voxels[parts.rows].T)]
    shares = np.bincount(of_surface, parts.areas, count + 1)[1:] / parts.areas.sum()
    found = np.flatnonzero(sticks_out & ~np.isin(numbers, own) & (shares >= _SEEN))
    found = largest_first(found, shares)
    middles = ndimage.center_of_mass(labels > 0, labels, numbers[found])
    return shares[found], solid.centers(np.array(middles).reshape(-1, 3))


def _symmetry_of(
    solid: Solid, tree: Tree, up: Floats, front: Floats, symmetry: str
) -> tuple[_Plane | None, dict[int, int]]:
    """Return the plane of symmetry, None without one, and the pairs of chains."""
    plane, fraction = _plane_of(solid, up, front, symmetry)
    apart = _CENTRAL * max(float(tree.radii[0]), solid.spacing)
    # The root may be anywhere around the middle of a plate.
    begins = [chain.begin for chain in tree.chains if chain.start == 0]
    apart = max(apart, _AROUND_MIDDLE * min(begins, default=0.0))
    if plane is None or abs(float(plane.sides(tree.hubs[0]))) > apart:
        # A plane across the skeleton, as in the middle of a tube, has its root on one side.
        return None, {}
    size = solid.spacing * max(solid.inside.shape)
    partner = paired_chains(tree, plane, solid.spacing, size)
    if symmetry == "auto" and fraction < _SYMMETRIC:
        ends = [number for number, chain in enumerate(tree.chains) if chain.end < 0]
        if 2 * sum(number in partner for number in ends) < len(ends):
            return None, {}
    return plane, partner


def _completed(
    solid: Solid, paths: Paths, tree: Tree, up: Floats, front: Floats, symmetry: str
) -> Tree:
    """Return a tree with the limbs of one side on the other, too, where they are nearly limbs.

    On both sides of a short or wide limb, small differences decide whether it is one.
    """
    plane, partner = _symmetry_of(solid, tree, up, front, symmetry)
    if plane is None:
        return tree
    ends = []
    for number, chain in enumerate(tree.chains):
        # The tail of a bird ends at a corner of its fan, but is in the middle.
        middle = at_lengths(chain.points, np.array([0.5 * (chain.begin + chain.length)]))[0]
        is_beside = abs(float(plane.sides(middle))) > chain.half_width
        if chain.end < 0 and number not in partner and is_beside:
            ends.append(chain.points[-1])
    wanted = plane.mirrored(np.array(ends).reshape(-1, 3))
    wanted = wanted[solid.gaps(wanted) <= _least(solid)]
    if len(wanted) == 0:
        return tree
    wanted = solid.centers(solid.voxels[solid.nearest(wanted)])
    found = tree_of(solid, paths, int(tree.rows[0]), wanted)
    pairs = _symmetry_of(solid, found, up, front, symmetry)[1]
    more = replace(found, cuts=np.concatenate([tree.cuts, found.cuts]))
    return more if len(pairs) > len(partner) else tree


def _plane_of(
    solid: Solid, up: Floats, front: Floats, symmetry: str
) -> tuple[_Plane | None, float]:
    """Return the plane of symmetry, None without one, and the fraction that it mirrors."""
    if symmetry == "none":
        return None, 0.0
    given = None if symmetry == "auto" else np.eye(3)["xyz".index(symmetry)]
    lateral, offset, fraction = sagittal_plane(solid, up, given)
    if given is None and fraction < _POSED:
        return None, fraction
    left = np.cross(up, front)
    if abs(float(lateral @ left)) < _ASKEW:
        # The figure faces along the other horizontal axis: +x where y is up, -y where z is up, as
        # most programs have it. Their left is -z and +x.
        left = lateral if float(lateral @ [1.0, 1.0, -1.0]) >= 0.0 else -lateral
    if float(lateral @ left) < 0.0:
        lateral, offset = -lateral, -offset
    return _Plane(lateral, offset, up), fraction


def _on(plane: _Plane | None, points: Floats) -> Floats:
    """Return points (..., 3) moved to the plane of symmetry, if there is one."""
    if plane is None:
        return points
    found: Floats = points - plane.sides(points)[..., None] * plane.lateral
    return found


def _joint_points(
    solid: Solid, tree: Tree, plane: _Plane | None, partner: dict[int, int], factor: float
) -> list[Floats]:
    """Return the joints of each chain, without the first hub and with the last one: (N, 3)."""
    voxel = solid.spacing
    found = [np.zeros((0, 3))] * len(tree.chains)
    for number, chain in enumerate(tree.chains):
        other = partner.get(number)
        if other is not None and other < number:
            continue
        fractions, bends = _fractions(chain, solid, factor)
        path = at_lengths(chain.points, np.linspace(chain.begin, chain.length, _SAMPLES))
        if other is None:
            if plane is not None and _is_central(tree, number, plane, voxel):
                path = _on(plane, path)
            found[number] = at_lengths(path, fractions * arc_lengths(path)[-1])
            continue
        assert plane is not None  # only a plane of symmetry has two sides
        twin = tree.chains[other]
        theirs, they_bend = _fractions(twin, solid, factor)
        there = at_lengths(twin.points, np.linspace(twin.begin, twin.length, _SAMPLES))
        gap = float(np.linalg.norm(path - plane.mirrored(there), axis=1).max())
        is_mirrored = gap <= _MIRRORED * max(chain.half_width, twin.half_width, voxel)
        if len(fractions) != len(theirs):
            # Bends that are seen on one side only are bends of both.
            if bends == they_bend:
                bends = len(fractions) > len(theirs)
            fractions = theirs = fractions if bends else theirs
        elif is_mirrored:
            fractions = theirs = 0.5 * (fractions + theirs)
        if is_mirrored:
            path = 0.5 * (path + plane.mirrored(there))
            there = plane.mirrored(path)
        found[number] = at_lengths(path, fractions * arc_lengths(path)[-1])
        found[other] = at_lengths(there, theirs * arc_lengths(there)[-1])
    return found


def _fractions(chain: Chain, solid: Solid, factor: float) -> tuple[Floats, bool]:
    """Return the joints' lengths from 0 where a chain leaves its hub to 1 at its end.

    Also returns whether they are where it bends or where its parts meet.
    """
    lengths, bends = joint_lengths(chain, solid.spacing, factor)
    inside = bones_inside(chain, lengths, solid)
    bends |= len(inside) > len(lengths)
    lengths = inside
    lengths = np.maximum(lengths - chain.begin, 0.0)
    return lengths / max(chain.length - chain.begin, 1e-300), bends


class _Names:
    """Names of chains: trunk, leg, limb, head and tail, with numbers and sides.

    ``leg_1_left`` mirrors ``leg_1_right``; ``leg_1_a_left`` is the first branch at its end.
    """

    def __init__(
        self, tree: Tree, plane: _Plane | None, partner: dict[int, int], front: Floats | None
    ) -> None:
        self._chains, self._plane, self._partner, self._front = tree.chains, plane, partner, front
        self._radii = tree.radii
        self._names: dict[int, str] = {}
        self.limbs = self.pairs = 0

    def of_chains(self, up: Floats, low: float, front: Floats) -> list[str]:
        """Return the names; tips of legs are below the height ``low``."""
        hubs, top = {0}, []
        for number, chain in enumerate(self._chains):
            if chain.start not in hubs:
                continue
            if self._is_trunk(number):
                self._names[number] = _TRUNK + self._side(number)
                hubs.add(chain.end)
            else:
                top.append(number)
        units = self._units(top, front)
        words = [self._word(unit, up, low) for unit in units]
        counts = {word: words.count(word) for word in words}
        used: dict[str, int] = {}
        for unit, word in zip(units, words, strict=True):
            used[word] = used.get(word, 0) + 1
            # Numbers of equal width, so that no name is another one with a digit appended.
            place = f"{used[word]:0{len(str(counts[word]))}}"
            self._assign(unit, word if word in ("head", "tail") else f"{word}_{place}", front)
            self.limbs += len(unit)
            self.pairs += len(unit) == 2
        return [self._names[number] for number in range(len(self._chains))]

    def _is_trunk(self, number: int) -> bool:
        """Return whether a chain from the trunk belongs to it, too.

        Those on both sides do if their hubs are parts of the same body, as of a wide crab, and not
        the ends of limbs: the balls inside them overlap.
        """
        chain = self._chains[number]
        if chain.end < 0 or chain.begin > 0.0:
            return False
        reach = float(self._radii[chain.start] + self._radii[chain.end])
        return number not in self._partner or chain.length <= reach

    def _side(self, number: int) -> str:
        """Return the ending of a chain's name; none if it has no counterpart."""
        if number not in self._partner:
            return ""
        return "_left" if self._is_left(number, self._partner[number]) else "_right"

    def _units(self, numbers: list[int], front: Floats) -> list[tuple[int, ...]]:
        """Return pairs (left, right) and single chains, from front to back."""
        found: list[tuple[int, ...]] = []
        for number in numbers:
            other = self._partner.get(number)
            if other is None or other not in numbers:
                found.append((number,))
            elif self._is_left(number, other):
                found.append((number, other))

        def place(unit: tuple[int, ...]) -> tuple[bool, float]:
            middles = [self._chains[number].points.mean(axis=0) for number in unit]
            return len(unit) == 1, -float(np.mean(middles, axis=0) @ front)

        return sorted(found, key=place)

    def _is_left(self, number: int, other: int) -> bool:
        assert self._plane is not None  # only a plane of symmetry has two sides
        sides = [float(self._plane.sides(self._chains[k].points).mean()) for k in (number, other)]
        return sides[0] > sides[1]

    def _word(self, unit: tuple[int, ...], up: Floats, low: float) -> str:
        tips = [self._chains[number].points[-1] for number in unit]
        if len(unit) == 2:
            return "leg" if all(float(tip @ up) <= low for tip in tips) else "limb"
        chain = self._chains[unit[0]]
        if self._front is None or self._plane is None or not self.pairs_exist:
            return "limb"
        # With a known front, what is ahead of the trunk or behind it has a name.
        ahead = chain.points[-1] - chain.points[0]
        along = float(ahead @ self._front) / max(float(np.linalg.norm(ahead)), 1e-300)
        is_single = sum(
            1
            for number, other in enumerate(self._chains)
            if number not in self._partner
            and other.end < 0
            and float((other.points[-1] - other.points[0]) @ self._front) * along > 0.0
        )
        if abs(along) < _ASKEW or is_single != 1:
            return "limb"
        return "head" if along > 0.0 else "tail"

    @property
    def pairs_exist(self) -> bool:
        """Whether any limbs are paired."""
        return len(self._partner) > 0

    def _assign(self, unit: tuple[int, ...], stem: str, front: Floats) -> None:
        """Name a chain or a pair, and the branches at its end."""
        sides = ("_left", "_right") if len(unit) == 2 else ("",)
        for number, side in zip(unit, sides, strict=True):
            self._names[number] = stem + side
        ends = {self._chains[number].end for number in unit} - {-1}
        below = [number for number, chain in enumerate(self._chains) if chain.start in ends]
        for index, branch in enumerate(self._units(below, front)):
            letter = chr(ord("a") + index) if index < 26 else str(index)
            if len(unit) == 2 and len(branch) == 1:
                # A branch on one side only still belongs to that side.
                side = sides[
                    [self._chains[k].end for k in unit].index(self._chains[branch[0]].start)
                ]
                self._assign_one_sided(branch[0], f"{stem}_{letter}", side, front)
            else:
                self._assign(branch, f"{stem}_{letter}", front)

    def _assign_one_sided(self, number: int, stem: str, side: str, front: Floats) -> None:
        """Name a chain without a counterpart on a paired limb, and its branches."""
        self._names[number] = stem + side
        below = [
            k for k, chain in enumerate(self._chains) if chain.start == self._chains[number].end
        ]
        for index, branch in enumerate(below):
            self._assign_one_sided(branch, f"{stem}_{index + 1}", side, front)
