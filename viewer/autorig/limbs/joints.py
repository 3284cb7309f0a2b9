"""Joints along limbs: where parts of the mesh meet, where limbs bend, or evenly spaced.

Joints are where separate parts of a limb meet, as those of a robot's arm. Otherwise, they are where
the path bends (Douglas and Peucker 1973) if it bends sharply a few times, as a leg does. A straight
or smoothly curved limb gets joints at even distances, whose number grows with its length relative
to its width: tails, tentacles, snakes, fingers. Where a bone would leave the solid, it gets another
joint. Limbs that mirror each other get as many joints, and mirrored positions in mirrored poses.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from viewer.autorig.anatomy import arc_lengths
from viewer.autorig.limbs.sides import Plane, is_central, on_plane
from viewer.autorig.limbs.tree import HINGE, Chain, Tree, at_lengths, is_bone_inside
from viewer.autorig.solid import Solid
from viewer.rigs.arrays import Bools, Floats, Ints

_TOLERANCE = 0.5  # of the polyline, relative to the half width
_ROUGH = 1.0  # of the polyline, in voxels: paths are known to half a voxel
_BENT = np.radians(20.0)  # least change of direction at a joint
_SHARP = np.radians(30.0)  # norm of the changes of direction of a jointed limb
# A bend is sharp if most of its change of direction is within this length on both sides, relative
# to the half width; a limb is jointed if most of its bends are sharp, weighted by their
# squared angles.
_AROUND, _MOST = 1.0, 0.6
# Exponent in the number of bones of a smooth limb, (length / half width)^k. It gives a finger (8) 3
# bones, a tentacle (30) 8, a snake (50) 10; joints as dense as in a finger would give a snake 20.
_DENSITY = 0.6
# Length of a part of a chain, relative to the half width, beyond which it has joints of its own.
_RIGID = 10.0
# Least distance of bends, relative to the half width and to the length: a rounded knee is one bend.
_CLOSEST, _CLOSEST_PART = 3.0, 0.1
_END = 0.5  # distance of the last joint from the tip, relative to the half width
_STRAIGHT = 1e-6  # distance from a bone up to which a path is straight, relative to its length
# Distance of a limb's path from the mirrored one of its pair, in half widths or voxels, up to which
# both are in mirrored poses.
_MIRRORED = 1.5
# Ratios of lengths and of widths up to which limbs are of a kind.
_AS_LONG, _AS_WIDE = 1.25, 1.25
_SOME = 1.0 / 3.0  # fraction of the limbs of a kind of which all get the joints


def joint_points(
    solid: Solid, tree: Tree, plane: Plane | None, partner: dict[int, int], factor: float
) -> list[Floats]:
    """Return the joints of each chain, without the first hub and with the last one: (N, 3)."""
    voxel = solid.spacing
    found = [np.zeros((0, 3))] * len(tree.chains)
    plans = _plans(tree.chains, solid, factor)
    for number, chain in enumerate(tree.chains):
        other = partner.get(number)
        if other is not None and other < number:
            continue
        fractions, bends = plans[number]
        path = chain.outer
        if other is None:
            if plane is not None and is_central(tree, number, plane, voxel):
                path = on_plane(plane, path)
            found[number] = at_lengths(path, fractions * arc_lengths(path)[-1])
            continue
        assert plane is not None  # only a plane of symmetry has two sides
        twin = tree.chains[other]
        theirs, they_bend = plans[other]
        there = twin.outer
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


def _plans(chains: tuple[Chain, ...], solid: Solid, factor: float) -> list[tuple[Floats, bool]]:
    """Return the joints of each chain, as in ``_fractions``.

    Chains of a kind, as the arms of an octopus, bend alike and have as many joints: small
    differences decide for a single one.
    """
    alone = [joint_lengths(chain, solid.spacing, factor) for chain in chains]
    found = [lengths for lengths, _ in alone]
    bend = [score >= 1.0 for _, score in alone]
    for kind in _kinds(chains):
        jointed = bool(np.mean([alone[number][1] for number in kind]) >= 1.0)
        for number in kind:
            if bend[number] != jointed:
                found[number] = joint_lengths(chains[number], solid.spacing, factor, jointed)[0]
                bend[number] = jointed
        counts = [len(found[number]) for number in kind]
        usual = max(count for count in counts if counts.count(count) >= _SOME * len(counts))
        outer = [max(chains[number].length - chains[number].begin, 1e-300) for number in kind]
        shares = np.mean(
            [
                (found[number] - chains[number].begin) / length
                for number, length in zip(kind, outer, strict=True)
                if len(found[number]) == usual
            ],
            axis=0,
        )
        for number, length in zip(kind, outer, strict=True):
            # A bend that is missing may be where another joint keeps the bone inside.
            inside = bones_inside(chains[number], found[number], solid)
            if usual not in (len(found[number]), len(inside)):
                found[number] = chains[number].begin + length * shares
    return [
        _fractions(chain, lengths, bends, solid)
        for chain, lengths, bends in zip(chains, found, bend, strict=True)
    ]


def _kinds(chains: tuple[Chain, ...]) -> list[list[int]]:
    """Return the chains that are about as long and as wide as others, with as many parts."""
    found: list[list[int]] = []
    for number, chain in enumerate(chains):
        for kind in found:
            first = chains[kind[0]]
            alike = (
                _ratio(chain.length - chain.begin, first.length - first.begin) <= _AS_LONG
                and _ratio(chain.half_width, first.half_width) <= _AS_WIDE
            )
            if alike and (chain.end < 0, chain.stiff) == (first.end < 0, first.stiff):
                kind.append(number)
                break
        else:
            found.append([number])
    return [kind for kind in found if len(kind) > 1]


def _ratio(a: float, b: float) -> float:
    return max(a, b) / max(min(a, b), 1e-300)


def _fractions(chain: Chain, lengths: Floats, bends: bool, solid: Solid) -> tuple[Floats, bool]:
    """Return the joints' lengths from 0 where a chain leaves its hub to 1 at its end.

    Also returns whether they are where it bends or where its parts meet.
    """
    inside = bones_inside(chain, lengths, solid)
    bends |= len(inside) > len(lengths)
    lengths = np.maximum(inside - chain.begin, 0.0)
    return lengths / max(chain.length - chain.begin, 1e-300), bends


def joint_lengths(
    chain: Chain, spacing: float, factor: float, jointed: bool | None = None
) -> tuple[Floats, float]:
    """Return the lengths (N,) along a chain of its joints, the end included.

    Also returns how clearly they are where it bends or where its parts meet, from 1. ``jointed``:
    whether it is a limb of straight parts, None if its shape tells.
    """
    width = chain.half_width
    # A part that does not bend moves with the joint at its base: the last one is at its very end.
    is_bending = chain.end < 0 and not (chain.stiff and chain.stiff[-1])
    stop = chain.length - (_END * width if is_bending else 0.0)
    start = min(chain.begin, stop)
    # A short limb, too, begins with a joint at its base: one at its tip would not move it.
    first = [start] if start > 0.0 and stop - start >= _END * width else []
    near = HINGE * width
    seams = [length for length in chain.seams if start - near <= length <= stop - width]
    if seams and seams[0] <= start + near:
        start = max(start, seams.pop(0))
        first = [start]
    if not seams and not _is_stiff(chain, start, stop):
        inner, score = _inner_joints(chain, start, stop, spacing, factor, jointed)
        return np.array([*first, *inner, stop]), score
    found = first
    for begin, end in pairwise([start, *seams, stop]):
        if end - begin > _RIGID * width and not _is_stiff(chain, begin, end):
            found = [*found, *_inner_joints(chain, begin, end, spacing, factor, jointed)[0]]
        found = [*found, end]
    return np.array(found), np.inf


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
        if not is_bone_inside(solid, way[0], way[-1]):
            apart = np.linalg.norm(way - _nearest_on(way, way[0], way[-1]), axis=1)
            if apart.max() <= _STRAIGHT * (end - begin):
                continue  # the path itself is outside, and another joint would be, too
            middle = begin + (end - begin) * float(apart.argmax()) / (count - 1)
            todo += [(begin, middle), (middle, end)]
            found.pop()
    return np.array(sorted(found))


def _is_stiff(chain: Chain, begin: float, end: float) -> bool:
    """Return whether the part around the middle of a piece of a chain does not bend."""
    part = int(np.searchsorted(chain.seams, 0.5 * (begin + end)))
    return part < len(chain.stiff) and chain.stiff[part]


def _inner_joints(
    chain: Chain,
    start: float,
    stop: float,
    spacing: float,
    factor: float,
    jointed: bool | None,
) -> tuple[Floats, float]:
    """Return the lengths of joints between two of a chain (N,), and how clearly it bends there."""
    width, length = chain.half_width, stop - start
    path = at_lengths(chain.points, np.linspace(start, stop, max(2, int(length / spacing) + 1)))
    closest = max(_CLOSEST * width, _CLOSEST_PART * length)
    bends = _bends(path, max(_TOLERANCE * width, _ROUGH * spacing), closest)
    score = _jointedness(path, bends, _AROUND * max(width, 2.0 * spacing))
    if score >= 1.0 if jointed is None else jointed:
        inner = start + arc_lengths(path)[bends] * length / max(arc_lengths(path)[-1], 1e-300)
    else:
        # The trunk has a joint where limbs begin, and more only between hubs far apart.
        count = (length / width) ** _DENSITY / factor
        bones = max(1, int(count) if chain.end >= 0 else round(count))
        inner = start + length * np.arange(1, bones) / bones
    return inner, score


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


def _jointedness(path: Floats, bends: list[int], around: float) -> float:
    """Return how clearly a path consists of straight parts, and not of a curve: from 1."""
    corners = [0, *bends, len(path) - 1]
    angles = _angles(path[corners])
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
    # The norm is nearly the same for two bends as for one that is found in their place.
    squares = float((angles**2).sum())
    return min(float(np.sqrt(squares)) / _SHARP, sharp / max(_MOST * squares, 1e-300))


def _angles(corners: Floats) -> Floats:
    """Return the changes of direction at the inner corners of a polyline (K, 3): (K - 2,)."""
    steps = np.diff(corners, axis=0)
    ways = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300)
    angles: Floats = np.arccos(np.clip((ways[:-1] * ways[1:]).sum(axis=1), -1.0, 1.0))
    return angles


def parted(chain: Chain, solid: Solid, owners: Ints, stiff: Bools) -> Chain:
    """Return a chain with the places where separate parts of the mesh meet.

    ``owners``: the part around each voxel, -1 where there is none; ``stiff`` (P,): of all parts.
    """
    path = at_lengths(chain.points, np.arange(0.0, chain.length, 0.5 * solid.spacing))
    around, lengths = owners[solid.nearest(path)], arc_lengths(path)
    known = around >= 0
    seams, labels = _seams(lengths[known], around[known], HINGE * chain.half_width)
    return replace(chain, seams=seams, stiff=tuple(bool(stiff[each]) for each in labels))
