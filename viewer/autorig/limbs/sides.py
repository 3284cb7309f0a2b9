"""Limbs on both sides of a plane of symmetry: their pairs, and the names of all limbs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.anatomy import Limb, paired, sagittal_plane
from viewer.autorig.limbs.tree import Chain, Tree, at_lengths, least_limb, tree_of
from viewer.autorig.medial import Paths
from viewer.autorig.solid import Solid
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats

# Fraction of the voxels whose mirror images are inside: without a doubt; and of a figure in an
# asymmetric pose, if at least half of its tips are those of pairs.
_SYMMETRIC, _POSED = 0.85, 0.5
_CENTRAL = 1.5  # distance from the plane, in voxels or half widths, up to which a limb is central
_AROUND_MIDDLE = 0.25  # the same of the root, relative to where the first limb begins
_ASKEW = 0.5  # cosine of the angle between directions that are different ones
TRUNK = "trunk"
"""Name of the joints between the hubs of a trunk."""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
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


def paired_chains(tree: Tree, plane: Plane, spacing: float, size: float) -> dict[int, int]:
    """Return the chain on the other side of each chain that has one, both ways."""
    partner: dict[int, int] = {}
    central = {0}
    for number, chain in enumerate(tree.chains):
        if chain.end >= 0 and chain.start in central and is_central(tree, number, plane, spacing):
            central.add(chain.end)
    todo = [(central, central)]
    while todo:
        ours, theirs = todo.pop()
        near = {}
        for number, chain in enumerate(tree.chains):
            is_side = not is_central(tree, number, plane, spacing)
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


def is_central(tree: Tree, number: int, plane: Plane, spacing: float) -> bool:
    """Return whether a chain is in the plane of symmetry and not one of a pair beside it."""
    chain = tree.chains[number]
    apart = float(np.abs(plane.sides(chain.outer)).max())
    if apart > _CENTRAL * max(chain.half_width, spacing):
        return False
    # The front legs of a cow are near the plane, but each is the mirror image of the other.
    end = chain.points[-1]
    others = [other.points[-1] for other in tree.chains if other is not chain]
    gaps = np.linalg.norm(np.array(others).reshape(-1, 3) - plane.mirrored(end), axis=1)
    return bool(abs(float(plane.sides(end))) <= gaps.min(initial=np.inf))


def _as_limb(chain: Chain, plane: Plane) -> Limb:
    """Return a chain as a limb from its tip to the trunk, attached in the plane of symmetry."""
    points = chain.points[::-1]
    start = at_lengths(chain.points, np.array([chain.begin]))[0]
    attachment = start - plane.sides(start) * plane.lateral
    radii = np.full(len(points), chain.half_width)
    return Limb(points, radii, attachment, chain.length - chain.begin)


def symmetry_of(
    solid: Solid, tree: Tree, up: Floats, front: Floats, symmetry: str
) -> tuple[Plane | None, dict[int, int]]:
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


def completed(
    solid: Solid, paths: Paths, tree: Tree, up: Floats, front: Floats, symmetry: str
) -> Tree:
    """Return a tree with the limbs of one side on the other, too, where they are nearly limbs.

    On both sides of a short or wide limb, small differences decide whether it is one.
    """
    plane, partner = symmetry_of(solid, tree, up, front, symmetry)
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
    wanted = wanted[solid.gaps(wanted) <= least_limb(solid)]
    if len(wanted) == 0:
        return tree
    wanted = solid.centers(solid.voxels[solid.nearest(wanted)])
    found = tree_of(solid, paths, int(tree.rows[0]), wanted)
    pairs = symmetry_of(solid, found, up, front, symmetry)[1]
    more = replace(found, cuts=np.concatenate([tree.cuts, found.cuts]))
    return more if len(pairs) > len(partner) else tree


def _plane_of(solid: Solid, up: Floats, front: Floats, symmetry: str) -> tuple[Plane | None, float]:
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
    return Plane(lateral, offset, up), fraction


def on_plane(plane: Plane | None, points: Floats) -> Floats:
    """Return points (..., 3) moved to the plane of symmetry, if there is one."""
    if plane is None:
        return points
    found: Floats = points - plane.sides(points)[..., None] * plane.lateral
    return found


class Names:
    """Names of chains: trunk, leg, limb, head and tail, with numbers and sides.

    ``leg_1_left`` mirrors ``leg_1_right``; ``leg_1_a_left`` is the first branch at its end.
    """

    def __init__(
        self, tree: Tree, plane: Plane | None, partner: dict[int, int], front: Floats | None
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
                self._names[number] = TRUNK + self._side(number)
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
