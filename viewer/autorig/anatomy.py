"""Anatomy of a standing figure: the plane of symmetry, pairs of limbs, trunk, neck and head.

Found in the voxels of its solid, given only the up axis:

- The sagittal plane is the vertical plane in which the solid mirrors itself best. Unless it is a
  nearly exact mirror image there, the best plane in another direction is a second candidate: the
  front and the back of a person who holds a staff are more alike than the sides.
- Limbs are protrusions from that plane: tips are maxima of the geodesic distance from it, as long
  as the protrusion is longer than others that it merges with (persistence; Edelsbrunner et al.
  2002). Hands and feet are found so in any pose in which they do not touch other parts, whatever
  the proportions; fingers and toes merge into one tip.
- The tips of both sides are paired by length, place of attachment and mirrored position. Where a
  hand touches a thigh, either the hand or the elbow is the farthest place from the plane: if the
  mirror image of the longer arm is inside the solid, it is the other arm. With a hand at the hip,
  the elbow is the farthest place, and another way leads from there to the trunk: the forearm.
- A limb's axis is the path from its tip to the plane that prefers voxels far from the surface. Its
  junction with the trunk is where the radius exceeds the smallest one of the upper limb by half.
- Legs that touch each other seem to part far below the crotch: they go on upwards as long as there
  is a groove between them.
- The neck is where the radius along the path to the top of the head is smallest between two wider
  parts; the head is the widest place beyond it.

The points of the same anatomy in a template and in a target correspond to each other; see
``body_points``. Errors common to both, such as a junction a little too far inside, cancel out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from viewer.autorig.medial import LevelSets, Paths, Protrusion
from viewer.autorig.solid import Solid, solid_within
from viewer.data_classes import dataclass
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.memo import Memo

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_ANGLES = 36  # directions of the sagittal plane that are tried, every 5 degrees
_FINE = np.radians([-2.5, -1.25, 1.25, 2.5])  # around the best of them
_TILTED = 0.02  # gain of symmetry for which an oblique plane is preferred to a coordinate plane
_BOTH_WAYS = 0.01  # difference of symmetries that is within the accuracy of voxels
# Symmetry from which a plane is certain, and the cosine of the least angle to another one.
_SYMMETRIC, _ELSEWHERE = 0.97, np.cos(np.radians(50.0))
_MIRRORED = 4000  # voxels that are mirrored
_SHIFT = 4  # largest distance of the plane from the median of the voxels, in voxels
_TRUNK_PART = 0.1  # smallest part of trunk or head in the plane, as a fraction of the largest

_PROMINENT = 0.06  # shortest persistence of a limb, as a fraction of the size
_OWN = 0.4  # shortest persistence of a limb, as a fraction of its length: fingers have less
# Length of a limb over the radius of what it is attached to. The half of a sphere has 1, sides of
# heads 1.1 to 1.55; arms and legs, also of toys with big heads, have 1.75 to 15.
_BUMP = 1.6
# Largest difference of two limbs of a pair, as a fraction of the size; and that of two arms, as one
# may be raised.
_PAIRED, _POSED = 0.3, 0.45
_ARM_OF_ALL = 0.3  # length of an arm over that with what it holds, such as a staff
_PROP = 0.2  # cost of what one limb of a pair holds, over its length
# A limb that is a loop: what it lacks, as a fraction of its length to the farthest place; the part
# of that length at which the loop shows two sides, outside the trunk and below fingers; thickness
# of that section in voxels; part of what it lacks that its other side must have.
_HIDDEN, _FORK, _RIM, _REACHES = 0.3, 0.7, 2.0, 0.75
_BENT = 0.25  # part of the length from the elbow at which its radius is that of the limb
_MOST_PAIRS = 4  # longest pairs that are considered

_UPPER = (0.45, 0.95)  # part of a limb's path with the smallest radius of the upper limb
_WIDER = 1.5  # ratio of radii at the junction with the trunk
# Part of an arm, from the tip to the junction, that is upper arm and not yet near the armpit.
_STRAIGHT = (0.6, 0.8)
_BENDS = np.cos(np.radians(35.0))  # a path that bends more behind that part has left the arm
_DEEP = 0.75  # depth of a shoulder joint as a fraction of the upper arm's radius
# Depth of a section of touching legs between them over that in their middle: round legs that just
# touch have 0, a trunk has about 1; the cleft of buttocks is hardly a tenth of their depth.
_GROOVE = 0.75
_ON_GROUND = 0.12  # height of the tip of a leg, as a fraction of the figure's height

_ARM = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0)  # fractions of the path from tip to junction
_LEG = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)  # fractions of the height of the attachment
# Rise of a leg over its length, with a foot: legs of characters have 0.4 to 0.85, what lies on the
# ground has 0.
_UPWARDS = 0.2
_AS_LONG = 0.5  # length of arms relative to the longest limbs above the legs
_MOST_ARMS = 2  # pairs that may be arms: ears of a rabbit are as long
_LEANING = np.tan(np.radians(65.0))  # of a trunk that is upright: people bend, animals have 80
_TAIL = 0.12  # shortest tail, as a fraction of the size
# Length over mean radius of a trunk, and the part of the greatest radius on the way to its tip that
# is thicker. The muzzle of a horse has 7; necks may have 20, but heads are wider, or not below.
_SLENDER, _HALF = 10.0, 0.5
_HEAD = (0.3, 0.95)  # part of the path from chest to top that contains the widest place of a head
# Part of a leg's height to which a sole reaches, at which the shin is, and longest foot.
_SOLE, _SHIN, _FOOT = 0.12, 0.3, 0.6
_TRUNK = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Limb:
    """One limb: its path from the tip to the sagittal plane."""

    points: Floats
    """(K, 3). Voxel centres along the path."""
    radii: Floats
    """(K,). Distances from the surface there."""
    attachment: Floats
    """(3,). The point of the plane that is closest to the tip along the inside."""
    length: float
    """Geodesic distance of the tip from the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class LimbPair:
    """Limbs on both sides of the sagittal plane."""

    limbs: tuple[Limb, Limb]
    """On the positive and on the negative side of ``Anatomy.lateral``."""

    @property
    def length(self) -> float:
        """Length of the shorter one: what a hand holds makes the other longer."""
        return min(limb.length for limb in self.limbs)

    @property
    def attachment(self) -> Floats:
        """Mean place of attachment: (3,)."""
        return 0.5 * (self.limbs[0].attachment + self.limbs[1].attachment)

    @property
    def is_bump(self) -> bool:
        """Whether it only bulges from the part to which it belongs, as the sides of a head."""
        return min(limb.length / max(float(limb.radii.max()), 1e-12) for limb in self.limbs) < _BUMP


@dataclass(frozen=True, slots=True, eq=False)
class Anatomy:
    """What was found in a solid."""

    solid: Solid
    up: Floats
    lateral: Floats
    """(3,), (3,). Unit vectors; the lateral one is normal to the sagittal plane."""
    offset: float
    """The plane: points with ``lateral . p = offset``."""
    symmetry: float
    """Fraction of the voxels whose mirror images are inside, 0 to 1."""
    pairs: tuple[LimbPair, ...]
    """The longest first."""
    paths: Paths
    """Medial paths in the solid."""

    @property
    def is_symmetric(self) -> bool:
        """Whether the figure is certainly its own mirror image, and stands like that."""
        return self.symmetry >= _SYMMETRIC

    @property
    def size(self) -> float:
        """Longest side of the solid's box."""
        extents = np.ptp(self.solid.voxels, axis=0)
        return float(self.solid.spacing * extents.max())

    @property
    def ground(self) -> float:
        """Height down to which both sides reach: a staff or a gun in one hand may reach deeper."""
        centers = self.solid.centers(self.solid.voxels)
        heights, sides = centers @ self.up, centers @ self.lateral - self.offset
        return max(float(heights[side].min()) for side in (sides >= 0.0, sides <= 0.0))

    @property
    def height(self) -> float:
        """Height of the highest voxel above the lowest."""
        return float(np.ptp(self.solid.centers(self.solid.voxels) @ self.up))

    def rise(self, pair: LimbPair) -> float:
        """Return how much higher a pair begins than its tips are, over its length."""
        tips = np.array([limb.points[0] for limb in pair.limbs]) @ self.up
        return float(pair.attachment @ self.up - tips.mean()) / pair.length

    def stands(self, pair: LimbPair) -> bool:
        """Return whether both tips of a pair are on the ground."""
        tips = np.array([limb.points[0] for limb in pair.limbs]) @ self.up
        return bool((tips - self.ground <= _ON_GROUND * self.height).all())


def anatomy_of(
    positions: Floats, triangles: Ints, up: Floats, lateral: Floats | None = None
) -> Anatomy:
    """Find the anatomy of a mesh with a known up axis; ``lateral`` if it is known, too."""
    return anatomies_of(positions, triangles, up, lateral)[0]


def anatomies_of(
    positions: Floats, triangles: Ints, up: Floats, lateral: Floats | None = None
) -> list[Anatomy]:
    """Find the anatomy of a mesh for each plane that may be the sagittal one, the best first."""
    with part_of_work(span=(0.0, 0.3)):
        solid = solid_within(positions, triangles)
    report_fraction(0.3, "finding limbs")
    planes = sagittal_planes(solid, up, lateral)
    paths, found = Paths(solid), []
    for number, plane in enumerate(planes):
        span = (0.3 + 0.7 * number / len(planes), 0.3 + 0.7 * (number + 1) / len(planes))
        with part_of_work(span=span):
            found.append(_divided(solid, paths, up, *plane))
    return found


def _divided(
    solid: Solid, paths: Paths, up: Floats, lateral: Floats, offset: float, symmetry: float
) -> Anatomy:
    """Find the anatomy on both sides of a plane."""
    from scipy.sparse import csgraph

    centers = solid.centers(solid.voxels)
    sides = centers @ lateral - offset
    steps = paths.steps
    distant = np.abs(sides)
    # Nothing is in the plane between two separate parts, or of a mesh as thin as a triangle.
    middle = _middle(steps, distant <= max(1.01 * solid.spacing, float(distant.min())))
    distances, _, sources = csgraph.dijkstra(
        steps, indices=middle, min_only=True, return_predecessors=True
    )
    report_fraction(0.3, "finding limbs")
    size = float(solid.spacing * np.ptp(solid.voxels, axis=0).max())
    known = np.where(np.isfinite(distances), distances, 0.0)
    tips = LevelSets(steps, known, solid.spacing).tips(_is_limb).rows
    tips = tips[distances[tips] >= _PROMINENT * size]
    report_fraction(0.7, "finding limbs")
    limbs = [
        Limb(
            centers[path],
            paths.radii[path],
            centers[sources[tip]],
            float(distances[tip]),
        )
        for tip, path in zip(tips.tolist(), paths.to(middle, tips), strict=True)
    ]
    found = paired(limbs, sides[tips] > 0.0, lateral, offset, size, _POSED)[:_MOST_PAIRS]
    whole = [_both_whole(solid, paths, pair, lateral, offset, size) for pair in found]
    pairs = tuple(_with_loop(solid, paths, pair, distances, middle) for pair in whole)
    report_fraction(1.0, "finding limbs")
    return Anatomy(solid, up, lateral, offset, symmetry, pairs, paths)


def _both_whole(
    solid: Solid, paths: Paths, pair: LimbPair, lateral: Floats, offset: float, size: float
) -> LimbPair:
    """Replace a limb by the mirror image of a much longer one if that is inside the solid, too."""
    lengths = [float(arc_lengths(limb.points)[-1]) for limb in pair.limbs]
    if abs(lengths[0] - lengths[1]) < _PROMINENT * size:
        return pair
    longer = pair.limbs[int(np.argmax(lengths))]
    places = np.concatenate([longer.points, longer.attachment[None]])
    mirrored = places - 2.0 * (places @ lateral - offset)[:, None] * lateral
    # Within one voxel, the mirror image of the boundary is inside or outside by chance.
    if solid.gaps(mirrored).max() > 1.5 * solid.spacing:
        return pair
    rows = solid.nearest(mirrored)
    centers = solid.centers(solid.voxels[rows])
    other = Limb(centers[:-1], paths.radii[rows[:-1]], centers[-1], longer.length)
    return LimbPair((longer, other) if longer is pair.limbs[0] else (other, longer))


def _with_loop(
    solid: Solid, paths: Paths, pair: LimbPair, distances: Floats, middle: Ints
) -> LimbPair:
    """Continue a limb whose end touches the body, as a hand at the hip, up to the length of both.

    Arm and trunk are a loop then, and the elbow is farthest from the plane. What is held makes the
    other limb longer, too, but the shorter one ends at its tip, without a second way to the trunk.

    ``distances``: (N,), those of the voxels from the plane; ``middle``: the voxels in the plane.
    """
    from scipy.sparse import csgraph

    arcs = [arc_lengths(limb.points) for limb in pair.limbs]
    side = int(np.argmin([float(arc[-1]) for arc in arcs]))
    limb, arc = pair.limbs[side], arcs[side]
    missing = float(arcs[1 - side][-1] - arc[-1])
    if missing < _HIDDEN * float(arc[-1]):
        return pair
    own = solid.nearest(limb.points)
    least = _FORK * limb.length
    rows = np.flatnonzero(distances >= least)
    labels = csgraph.connected_components(paths.steps[rows][:, rows], directed=False)[1]
    around = rows[labels == labels[int(np.searchsorted(rows, own[0]))]]
    # Sections of both sides of the loop; a hand with fingers has only one.
    rim = around[distances[around] < least + _RIM * solid.spacing]
    labels = csgraph.connected_components(paths.steps[rim][:, rim], directed=False)[1]
    mine = np.isin(labels, labels[np.isin(rim, own)])
    if mine.all():
        return pair
    (way,) = paths.to(middle, own[:1], without=rim[mine])
    beyond = solid.centers(solid.voxels[way])
    lengths = arc_lengths(beyond)
    if lengths[-1] < _REACHES * missing:
        return pair
    # At the elbow, both ways lead to the skin and back.
    bent = float(limb.radii[int(np.searchsorted(arc, _BENT * arc[-1]))])
    there, here = np.flatnonzero(lengths >= bent)[::-1], arc >= min(bent, arc[-1])
    points = np.concatenate([beyond[there], limb.points[here]])
    radii = np.concatenate([paths.radii[way[there]], limb.radii[here]])
    reached = arc_lengths(points)
    kept = reached >= reached[-1] - arcs[1 - side][-1]
    points, radii = points[kept], radii[kept]
    if np.linalg.norm(limb.points - points[0], axis=1).min() <= 2.0 * bent:
        return pair  # the way is beside the limb
    longer = replace(limb, points=points, radii=radii, length=pair.limbs[1 - side].length)
    return LimbPair((longer, pair.limbs[1]) if side == 0 else (pair.limbs[0], longer))


def sagittal_plane(
    solid: Solid, up: Floats, lateral: Floats | None = None
) -> tuple[Floats, float, float]:
    """Return normal and offset of the vertical plane of best mirror symmetry, and the symmetry."""
    return sagittal_planes(solid, up, lateral)[0]


_planes: Memo[Solid, list[tuple[Floats, float, float]]] = Memo()


def sagittal_planes(
    solid: Solid, up: Floats, lateral: Floats | None = None
) -> list[tuple[Floats, float, float]]:
    """Return normal, offset and symmetry of the vertical plane of best mirror symmetry.

    Unless the solid is symmetric, also those of the best plane in another direction: front and back
    of a person differ less than the sides if one hand holds a staff or a shield.
    """
    # A skeleton is completed, named and placed with the same planes.
    key = up.tobytes(), None if lateral is None else lateral.tobytes()
    return _planes.get(solid, key, lambda: _found_planes(solid, up, lateral))


def _found_planes(
    solid: Solid, up: Floats, lateral: Floats | None
) -> list[tuple[Floats, float, float]]:
    from scipy import ndimage

    # Within one voxel, the mirror image of the boundary is inside or outside by chance.
    around = ndimage.binary_dilation(solid.inside, np.ones((3, 3, 3)))
    centers = solid.centers(solid.voxels)
    some = centers[:: max(1, len(centers) // _MIRRORED)]
    if lateral is not None:
        return [(lateral, *_symmetry(solid, around, some, lateral))]
    # Two horizontal vectors, along coordinate axes if up is one.
    first = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    first = first / np.linalg.norm(first)
    second = np.cross(up, first)

    def tried(angle: float) -> tuple[float, float, Floats, float]:
        normal = np.cos(angle) * first + np.sin(angle) * second
        offset, symmetry = _symmetry(solid, around, some, normal)
        return symmetry, float(np.ptp(some @ normal)), normal, offset

    angles = np.arange(_ANGLES) * np.pi / _ANGLES
    found = [tried(angle) for angle in angles.tolist()]

    def refined(rows: list[int]) -> tuple[Floats, float, float]:
        """Return the best plane at some of the angles, or between them."""
        best = max(rows, key=lambda row: found[row][0])
        plains = [found[row] for row in (0, _ANGLES // 2) if row in rows]
        plains.sort(key=lambda each: -each[0])
        # A figure that is symmetric both ways, as without feet, is wider from side to side.
        if len(plains) == 2 and plains[1][0] >= plains[0][0] - _BOTH_WAYS:
            plains.sort(key=lambda each: -each[1])
        if plains and found[best][0] < plains[0][0] + _TILTED:
            return plains[0][2], plains[0][3], plains[0][0]
        near = [found[best], *(tried(float(angles[best] + step)) for step in _FINE)]
        symmetry, _, normal, offset = max(near, key=lambda each: each[0])
        return normal, offset, symmetry

    planes = [refined(list(range(_ANGLES)))]
    normal, _, symmetry = planes[0]
    if symmetry < _SYMMETRIC:
        cosines = np.cos(angles) * float(normal @ first) + np.sin(angles) * float(normal @ second)
        planes.append(refined(np.flatnonzero(np.abs(cosines) <= _ELSEWHERE).tolist()))
    return planes


def _symmetry(solid: Solid, around: Bools, points: Floats, normal: Floats) -> tuple[float, float]:
    """Return the offset of the best plane with this normal, and the fraction mirrored inside."""
    along = points @ normal
    # The plane halves a symmetric solid; props on one side move the halving plane a little.
    offsets = float(np.median(along)) + solid.spacing * np.linspace(-_SHIFT, _SHIFT, 4 * _SHIFT + 1)
    fractions = []
    columns, inside = np.ascontiguousarray(points.T), around.ravel()
    for offset in offsets.tolist():
        arms = along - offset
        # The voxels of the mirror images, as ``Solid.voxel_of`` returns them, but by columns, which
        # takes a third of the time.
        rows = np.zeros(len(arms))
        for column, part, start, count in zip(
            columns, normal.tolist(), solid.origin.tolist(), around.shape, strict=True
        ):
            mirrored = column - 2.0 * arms * part
            voxel = np.rint((mirrored - start) / solid.spacing)
            rows = rows * count + np.minimum(np.maximum(voxel, 0), count - 1)
        # Every section near the middle is symmetric: what is far from the plane counts more.
        weights = np.abs(arms)
        found = inside[rows.astype(np.intp)]
        fractions.append(float(weights @ found) / max(float(weights.sum()), 1e-12))
    # The middle one of equally good planes.
    best = np.flatnonzero(np.array(fractions) >= max(fractions) - 1e-3)
    chosen = int(best[len(best) // 2])
    return float(offsets[chosen]), fractions[chosen]


def _middle(steps: csr_array, is_near: Bools) -> Ints:
    """Return the voxels of trunk and head in the sagittal plane, as rows of the solid."""
    from scipy.sparse import csgraph

    rows = np.flatnonzero(is_near)
    labels = csgraph.connected_components(steps[rows][:, rows], directed=False)[1]
    # Feet and thighs that touch each other in the plane are limbs nevertheless.
    sizes = np.bincount(labels)
    found: Ints = rows[sizes[labels] >= _TRUNK_PART * sizes.max()].astype(np.int32)
    return found


def _is_limb(found: Protrusion) -> bool:
    """Return whether most of a protrusion is its own."""
    return found.tip - found.junction >= _OWN * found.tip


def paired(
    limbs: list[Limb],
    positive: Bools,
    lateral: Floats,
    offset: float,
    size: float,
    most: float = _PAIRED,
) -> tuple[LimbPair, ...]:
    """Pair the limbs of both sides, the most similar ones first; the longest pair is the first."""
    ours = [limb for limb, side in zip(limbs, positive.tolist(), strict=True) if side]
    others = [limb for limb, side in zip(limbs, positive.tolist(), strict=True) if not side]
    costs = []
    for i, one in enumerate(ours):
        for j, other in enumerate(others):
            tip = other.points[0]
            mirrored = tip - 2.0 * (float(tip @ lateral) - offset) * lateral
            # A limb in another pose has the same length and root, but another tip.
            cost = abs(one.length - other.length)
            cost += float(np.linalg.norm(one.attachment - other.attachment))
            cost += 0.25 * float(np.linalg.norm(one.points[0] - mirrored))
            costs.append((min(cost, _held(one, other, lateral, offset)), i, j))
    pairs: list[LimbPair] = []
    left, right = set(range(len(ours))), set(range(len(others)))
    for cost, i, j in sorted(costs):
        if cost <= most * size and i in left and j in right:
            left.remove(i)
            right.remove(j)
            pairs.append(LimbPair((ours[i], others[j])))
    return tuple(sorted(pairs, key=lambda pair: -pair.length))


def _held(one: Limb, other: Limb, lateral: Floats, offset: float) -> float:
    """Return the difference of two limbs if the longer one holds something, infinite for much."""
    arcs = {id(limb): arc_lengths(limb.points) for limb in (one, other)}
    shorter, longer = sorted((one, other), key=lambda limb: float(arcs[id(limb)][-1]))
    arc, length = arcs[id(longer)], float(arcs[id(shorter)][-1])
    if length < _ARM_OF_ALL * float(arc[-1]):
        return np.inf
    # The hand is as far from the plane as that of the other arm; the rest is not part of the limb.
    hand = longer.points[int(np.searchsorted(arc, arc[-1] - length))]
    tip = shorter.points[0]
    mirrored = tip - 2.0 * (float(tip @ lateral) - offset) * lateral
    gaps = np.linalg.norm(hand - mirrored) + np.linalg.norm(one.attachment - other.attachment)
    return float(gaps) + _PROP * float(arc[-1] - length)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Which pairs are legs and which are arms or forelegs, and where the front is."""

    lower: LimbPair
    upper: LimbPair
    left: Floats
    """(3,). Unit vector to the figure's left."""

    def ground(self, up: Floats) -> float:
        """Return the height of the lower tip of the legs: props may reach deeper."""
        return min(float(limb.points[0] @ up) for limb in self.lower.limbs)


@dataclass(frozen=True, slots=True, eq=False)
class BodyPoints:
    """Points along limbs, trunk, neck and head, in an order that depends on no figure."""

    positions: Floats
    """(P, 3). NaN for those that the figure lacks."""
    radii: Floats
    """(P,). Distances from the surface there."""
    weights: Floats
    """(P,). How well each is determined, 0 to 1."""


def plans_of(anatomy: Anatomy, is_quadruped: bool, front: Floats | None = None) -> list[Plan]:
    """Return the likely plans of a figure, both facings of each unless ``front`` is known."""
    pairs = anatomy.pairs
    if not pairs:
        return []
    standing = [pair for pair in pairs if anatomy.stands(pair)]
    if not (standing or is_quadruped) and (touching := _touching_legs(anatomy)) is not None:
        pairs, standing = (*pairs, touching), [touching]
    if len(pairs) < 2:
        return []
    heights = {id(pair): float(pair.attachment @ anatomy.up) for pair in pairs}
    found = []
    if is_quadruped:
        for hind, fore in ((a, b) for a in standing[:2] for b in standing[:2] if a is not b):
            ahead = fore.attachment - hind.attachment
            ahead = ahead - (ahead @ anatomy.up) * anatomy.up
            left = _signed(anatomy.lateral, np.cross(anatomy.up, ahead))
            if front is None or float(ahead @ front) > 0.0:
                found.append(Plan(hind, fore, left))
        return found
    # The corners of a cape or a coat that reach the ground lead sideways, not up.
    lowest = [pair for pair in standing if anatomy.rise(pair) >= _UPWARDS] or pairs
    legs = min(lowest, key=lambda pair: heights[id(pair)])
    lower = _up_to_crotch(anatomy, legs)
    above = [pair for pair in pairs if _rises(anatomy, legs, pair) and not pair.is_bump]
    longest = max((pair.length for pair in above), default=0.0)
    # Ears, horns and capes are shorter than arms, or are attached above them.
    arms = [pair for pair in above if pair.length >= _AS_LONG * longest]
    # What else stands on the ground is a leg, so this is an animal whose ears are no arms.
    others = {id(pair) for pair in standing if pair.length >= _AS_LONG * legs.length} - {id(legs)}
    arms = [pair for pair in arms if others <= {id(pair)}]
    for pair in sorted(arms, key=lambda pair: heights[id(pair)])[:_MOST_ARMS]:
        for left in (anatomy.lateral, -anatomy.lateral):
            if front is None or float(np.cross(left, anatomy.up) @ front) > 0.0:
                found.append(Plan(lower, pair, left))
    return found


def _up_to_crotch(anatomy: Anatomy, pair: LimbPair) -> LimbPair:
    """Return legs, those that touch each other above their fork up to where the groove ends.

    Wide trousers and thick legs leave a gap only above the feet.
    """
    up, fork = anatomy.up, float(pair.attachment @ anatomy.up)
    apart = [np.abs(limb.points @ anatomy.lateral - anatomy.offset) for limb in pair.limbs]
    axis = float(np.mean([np.median(each) for each in apart]))
    above = _touching(anatomy, fork, axis)
    if above is None:
        return pair
    limbs = []
    for limb, more in zip(pair.limbs, above.limbs, strict=True):
        # The path turns to the plane below the fork; the leg goes on.
        kept = limb.points @ up <= fork - axis
        points = np.concatenate([limb.points[kept], more.points])
        radii = np.concatenate([limb.radii[kept], more.radii])
        limbs.append(Limb(points, radii, more.attachment, limb.length + more.length))
    return LimbPair((limbs[0], limbs[1]))


def _touching_legs(anatomy: Anatomy) -> LimbPair | None:
    """Return legs that touch each other down to the soles."""
    solid = anatomy.solid
    centers = solid.centers(solid.voxels)
    soles = centers @ anatomy.up - anatomy.ground <= _ON_GROUND * anatomy.height
    axis = float(np.abs(centers[soles] @ anatomy.lateral - anatomy.offset).mean())
    return _touching(anatomy, anatomy.ground, axis)


def _touching(anatomy: Anatomy, low: float, axis: float) -> LimbPair | None:
    """Return the parts of legs from a height to the crotch; None if they do not touch there.

    Sections above the fork of such legs are those of two legs: between them, they are less deep
    than in the middle of each. ``axis``: about the distance of the legs' axes from the plane.
    """
    from scipy import ndimage

    solid, up, step = anatomy.solid, anatomy.up, anatomy.solid.spacing
    centers = solid.centers(solid.voxels)
    heights, sides = centers @ up, centers @ anatomy.lateral - anatomy.offset
    near = (np.abs(sides) <= 2.0 * axis) & (heights >= low)
    if not near.any():
        return None
    # Layers and columns of voxels, counted from one of them: it is in the middle of its own.
    levels = np.rint((heights - heights[near].min()) / step).astype(np.int64)
    columns = np.rint((sides - sides[near].min()) / step).astype(np.int64)
    depths = np.zeros((levels[near].max() + 1, max(int(columns[near].max()) + 1, 3)))
    np.add.at(depths, (levels[near], columns[near]), 1.0)
    depths = ndimage.uniform_filter1d(depths, 3, axis=1, mode="constant")
    middle = int(np.clip(np.rint(-sides[near].min() / step), 1, depths.shape[1] - 2))
    each = np.minimum(depths[:, :middle].max(axis=1), depths[:, middle + 1 :].max(axis=1))
    merged = np.flatnonzero((depths[:, middle] > 0.0) & (depths[:, middle] >= _GROOVE * each))
    top = int(merged[0]) if len(merged) else 0
    # The arch of a crotch is as high as half of the distance of its legs.
    if top * step <= axis:
        return None
    crotch = centers[near & (levels == top) & (np.abs(sides) <= 2.0 * step)].mean(axis=0)
    limbs = []
    for is_own in (near & (sides > 0.0), near & (sides < 0.0)):
        middles = [centers[is_own & (levels == level)].mean(axis=0) for level in range(top)]
        rows = solid.nearest(np.stack([*middles, crotch]))
        limbs.append(Limb(centers[rows], anatomy.paths.radii[rows], crotch, top * step))
    return LimbPair((limbs[0], limbs[1]))


def _rises(anatomy: Anatomy, legs: LimbPair, pair: LimbPair) -> bool:
    """Return whether a trunk from the legs to a pair above them is upright, not an animal's."""
    trunk = pair.attachment - legs.attachment
    up = float(trunk @ anatomy.up)
    return up > 0.0 and float(np.linalg.norm(trunk - up * anatomy.up)) <= _LEANING * up


def feet_ahead(anatomy: Anatomy, plan: Plan, is_quadruped: bool) -> float:
    """Return how much farther feet reach to the front of the shins than to their back.

    A fraction of the figure's height; negative if the plan faces backwards, near 0 for stumps.
    """
    front = np.cross(plan.left, anatomy.up)
    centers = anatomy.solid.centers(anatomy.solid.voxels)
    ground = plan.ground(anatomy.up)
    heights = centers @ anatomy.up - ground
    sides = centers @ anatomy.lateral - anatomy.offset
    pairs = [plan.lower, plan.upper] if is_quadruped else [plan.lower]
    found = []
    for limb in (limb for pair in pairs for limb in pair.limbs):
        top = max(float(limb.attachment @ anatomy.up) - ground, anatomy.solid.spacing)
        tip = limb.points[0]
        side = float(tip @ anatomy.lateral) - anatomy.offset
        near = (heights <= _SOLE * top + anatomy.solid.spacing) & (sides * side > 0.0)
        near &= np.linalg.norm(centers - tip, axis=1) <= _FOOT * top
        if not near.any():
            continue
        reached = np.maximum.accumulate(limb.points @ anatomy.up - ground)
        row = min(int(np.searchsorted(reached, _SHIN * top)), len(reached) - 1)
        shin, sole = float(limb.points[row] @ front), centers[near] @ front
        found.append(float(sole.max()) + float(sole.min()) - 2.0 * shin)
    return float(np.mean(found)) / anatomy.height if found else 0.0


def _signed(vector: Floats, like: Floats) -> Floats:
    return vector if float(vector @ like) >= 0.0 else -vector


def body_points(anatomy: Anatomy, plan: Plan, is_quadruped: bool) -> BodyPoints:
    """Return the points of a figure that correspond to those of another one."""
    order = (0, 1) if float(anatomy.lateral @ plan.left) > 0.0 else (1, 0)
    legs = [plan.lower.limbs[side] for side in order]
    arms = [plan.upper.limbs[side] for side in order]
    ground = plan.ground(anatomy.up)
    rows = [_leg_points(anatomy, limb, ground) for limb in legs]
    if is_quadruped:
        rows += [_leg_points(anatomy, limb, ground) for limb in arms]
    else:
        rows += _arm_points(anatomy, arms)
    # The root of each limb is its last point; the middle of both is in the trunk.
    pelvis = 0.5 * (rows[0][-1, :3] + rows[1][-1, :3])
    chest = 0.5 * (rows[2][-1, :3] + rows[3][-1, :3])
    solid, paths = anatomy.solid, anatomy.paths
    ends = solid.nearest(np.stack([pelvis, chest]))
    spine = paths.to(ends[:1], ends[1:])[0][::-1]
    rows.append(_along(anatomy, spine, _TRUNK, 0.5))
    rows += [_head_points(anatomy, ends, is_quadruped), _tail_points(anatomy, ends, is_quadruped)]
    table = np.concatenate(rows)
    return BodyPoints(table[:, :3], table[:, 3], table[:, 4])


def _along(anatomy: Anatomy, path: Ints, fractions: tuple[float, ...], weight: float) -> Floats:
    """Return points at fractions of a path, with radius and weight: (N, 5)."""
    points = anatomy.solid.centers(anatomy.solid.voxels[path])
    return _sampled(points, anatomy.paths.radii[path], np.array(fractions), weight)


def _sampled(points: Floats, radii: Floats, fractions: Floats, weight: float) -> Floats:
    lengths = arc_lengths(points)
    at = fractions * lengths[-1]
    columns = [np.interp(at, lengths, column) for column in (*points.T, radii)]
    return np.stack([*columns, np.full(len(at), weight)], axis=1)


def arc_lengths(points: Floats) -> Floats:
    """Return the length of a polyline up to each of its points (K, 3): (K,)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _arm_points(anatomy: Anatomy, limbs: list[Limb]) -> list[Floats]:
    """Return points from the tips of two arms to their junctions with the trunk: (N, 5) each."""
    arcs = [arc_lengths(limb.points) for limb in limbs]
    # Both arms are equally long: what one of them is longer, it holds in its hand. If only its path
    # is longer, one of the arms touches the body. Weapons and shields also have narrow and wide
    # places, so the junction nearer to the plane is that of both.
    least, shortest = min(limb.length for limb in limbs), min(float(arc[-1]) for arc in arcs)
    held = [
        min(limb.length - least, float(arc[-1]) - shortest)
        for limb, arc in zip(limbs, arcs, strict=True)
    ]
    starts = [int(np.searchsorted(arc, length)) for arc, length in zip(arcs, held, strict=True)]
    junctions = [
        arc[-1] - arc[row]
        for limb, arc, start in zip(limbs, arcs, starts, strict=True)
        if (row := _junction(anatomy, limb, arc, start)) is not None
    ]
    inside = min(junctions, default=0.0)
    found = []
    for limb, arc, start in zip(limbs, arcs, starts, strict=True):
        last = max(int(np.searchsorted(arc, arc[-1] - inside)), start + 1)
        kept = slice(start, last + 1)
        points, radii = _to_shoulder(anatomy, limb.points[kept], limb.radii[kept])
        found.append(_sampled(points, radii, np.array(_ARM), 1.0))
    return found


def _junction(anatomy: Anatomy, limb: Limb, arc: Floats, start: int) -> int | None:
    """Return the row of an arm's path at which it enters the trunk; None if it never widens."""
    whole = max(float(arc[-1] - arc[start]), anatomy.solid.spacing)
    fractions = (arc - arc[start]) / whole
    rows = np.flatnonzero((fractions >= _UPPER[0]) & (fractions <= _UPPER[1]))
    if len(rows) == 0:
        return None
    narrow = int(rows[limb.radii[rows].argmin()])
    # Half a voxel's uncertainty must not make the thinnest arms end early.
    least = max(float(limb.radii[narrow]), anatomy.solid.spacing)
    wide = np.flatnonzero(limb.radii[narrow:] >= _WIDER * least)
    return narrow + int(wide[0]) if len(wide) else None


def _to_shoulder(anatomy: Anatomy, points: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Return an arm's path (N, 3) with its radii (N,), extended to the shoulder along the arm.

    Paths to the plane leave a lowered arm at the armpit, where arm and trunk merge. From there, the
    axis of the upper arm leads to the shoulder: until it is as close to the plane as the path's
    end, or about to leave the solid.
    """
    arc = arc_lengths(points)
    rows = [int(np.searchsorted(arc, part * arc[-1])) for part in _STRAIGHT]
    upper, rest = points[rows[1]] - points[rows[0]], points[-1] - points[rows[1]]
    lengths = float(np.linalg.norm(upper)), float(np.linalg.norm(rest))
    if min(lengths) == 0.0 or float(upper @ rest) >= _BENDS * lengths[0] * lengths[1]:
        return points, radii
    solid, axis = anatomy.solid, upper / lengths[0]
    side = np.sign(float(points[-1] @ anatomy.lateral) - anatomy.offset)
    count = int(arc[-1] / solid.spacing) + 1
    line = points[rows[1]] + solid.spacing * np.arange(1, count + 1)[:, None] * axis
    depths = solid.distance[tuple(solid.voxel_of(line).T)]
    nearer = side * (line - points[-1]) @ anatomy.lateral <= 0.0
    ends = np.flatnonzero(nearer | (depths < _DEEP * radii[rows[1]]))
    stop = int(ends[0]) if len(ends) else count
    kept = rows[1] + 1
    return (
        np.concatenate([points[:kept], line[:stop]]),
        np.concatenate([radii[:kept], depths[:stop]]),
    )


def _leg_points(anatomy: Anatomy, limb: Limb, ground: float) -> Floats:
    """Return points of a standing leg at fractions of its height, and its tip first: (N, 5)."""
    heights = limb.points @ anatomy.up - ground
    top = float(limb.attachment @ anatomy.up) - ground
    # The path may bend; the first point at each height is that of the leg.
    reached = np.maximum.accumulate(heights)
    at = [int(np.searchsorted(reached, fraction * top)) for fraction in _LEG]
    rows = np.array([0, *np.minimum(at, len(heights) - 1)])
    weights = np.ones(len(rows))
    weights[0] = 0.5  # toes and shoes differ in length
    return np.column_stack([limb.points[rows], limb.radii[rows], weights])


def _head_points(anatomy: Anatomy, ends: Ints, is_quadruped: bool) -> Floats:
    """Return neck, middle, centre of the head, and its tip: (4, 5)."""
    path = _end_path(anatomy, ends[1], ends[0])
    if len(path) < 5:
        return np.full((4, 5), np.nan)
    if is_quadruped:
        return _along(anatomy, _without_trunk(anatomy, path), (0.25, 0.5, 0.75, 1.0), 0.7)
    points, radii = anatomy.solid.centers(anatomy.solid.voxels[path]), anatomy.paths.radii[path]
    fractions = arc_lengths(points)
    fractions = fractions / fractions[-1]
    low, high = np.searchsorted(fractions, _HEAD)
    head = int(low) + int(radii[low : high + 1].argmax())
    neck = int(radii[: head + 1].argmin())
    rows = np.array([neck, (neck + head) // 2, head, len(path) - 1])
    # Hats and hair move the tip, but not the centre.
    return np.column_stack([points[rows], radii[rows], [0.7, 0.3, 1.0, 0.1]])


def _without_trunk(anatomy: Anatomy, path: Ints) -> Ints:
    """Return the path to the tip of an animal's head without the trunk of an elephant.

    A trunk is slender, hangs down, and does not widen to a head.
    """
    points, radii = anatomy.solid.centers(anatomy.solid.voxels[path]), anatomy.paths.radii[path]
    start = int(np.flatnonzero(radii >= _HALF * radii.max())[-1]) + 1
    arc = arc_lengths(points[start:])
    middle = start + int(np.searchsorted(arc, 0.5 * arc[-1])) if len(arc) > 1 else start
    if middle == start or start < 2:
        return path
    fall = float((points[start] - points[-1]) @ anatomy.up)
    is_slender = float(arc[-1]) >= _SLENDER * float(radii[start:].mean())
    widens = float(radii[middle:].max()) > float(radii[start:middle].mean())
    return path[:start] if is_slender and fall >= 0.5 * float(arc[-1]) and not widens else path


def _tail_points(anatomy: Anatomy, ends: Ints, is_quadruped: bool) -> Floats:
    """Return points of a tail (4, 5), NaN without one."""
    missing = np.full((4, 5), np.nan)
    if not is_quadruped:
        return missing
    path = _end_path(anatomy, ends[0], ends[1])
    points = anatomy.solid.centers(anatomy.solid.voxels[path])
    if len(path) < 5 or arc_lengths(points)[-1] < _TAIL * anatomy.size:
        return missing
    return _along(anatomy, path, (0.4, 0.6, 0.8, 1.0), 0.5)


def _end_path(anatomy: Anatomy, start: int, other: int) -> Ints:
    """Return the path from a place in the trunk to the farthest voxel of the plane beyond it.

    ``other``: the other end of the trunk, from which the way there leads through ``start``.
    """
    from scipy.sparse import csgraph

    solid = anatomy.solid
    own, others = csgraph.dijkstra(anatomy.paths.steps, indices=[start, other])
    sides = solid.centers(solid.voxels) @ anatomy.lateral - anatomy.offset
    beyond = (others >= own + 0.5 * others[start]) & (np.abs(sides) <= 1.01 * solid.spacing)
    beyond &= np.isfinite(own)
    if not beyond.any():
        return np.zeros(0, dtype=np.int32)
    rows = np.flatnonzero(beyond)
    tip = rows[own[rows].argmax() : own[rows].argmax() + 1].astype(np.int32)
    return anatomy.paths.to(np.array([start]), tip)[0][::-1]
