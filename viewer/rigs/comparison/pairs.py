"""Pairs of joints with the same name, and the difference of their rotations and weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.closest_point import SurfacePoints
from viewer.rigs.skeleton import Skeleton, joint_labels
from viewer.rigs.skin import Skin, owners, row_norms, skin_rows

_KEYS = {
    "joint": (
        "D001.joints: {n} only in the {side}: {names}",
        "D002.joints-by-index: no joint names in common: compared by index",
    ),
    "DOF": (
        "D001.dofs: {n} only in the {side}: {names}",
        "D002.dofs-by-index: no DOF names in common: compared by index",
    ),
    "point": (
        "D001.points: {n} only in the {side}: {names}",
        "D002.points-by-index: no point names in common: compared by index",
    ),
}
"""Messages about each kind of item: unmatched names, and no names in common."""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Matched names."""

    first: Ints
    second: Ints
    """(N,) int32. Indices into both lists, in the order of the first list."""
    names: tuple[str, ...]
    """Names in the first list."""
    mismatches: tuple[Diagnostic, ...] = ()
    notes: tuple[Diagnostic, ...] = ()
    """Unmatched names; notes on items that were not matched by name."""


def pair_joints(first: Skeleton, second: Skeleton) -> Pairs:
    """Match joints by name, or all by index if no name matches; note what does not match."""
    pairs = pair_names(_unique_labels(first), _unique_labels(second), "joint")
    parents = [
        np.append(np.arange(len(pairs.first)), -1)[_places(found, skeleton.n_joints)[above]]
        for found, skeleton in ((pairs.first, first), (pairs.second, second))
        for above in (skeleton.parents[found],)
    ]
    other = np.flatnonzero(parents[0] != parents[1])
    values = {"names": listed([pairs.names[place] for place in other])}
    moved = [note("D001.parents: different parents: {names}", **values)] if len(other) else []
    return replace(
        pairs,
        mismatches=(*pairs.mismatches, *moved),
        notes=(*pairs.notes, *_order_notes(pairs, second)),
    )


def _unique_labels(skeleton: Skeleton) -> tuple[str, ...]:
    """Return unique labels of the joints for messages; unnamed joints are labelled by index."""
    return tuple(
        label if name else f"joint {joint} (no name)"
        for joint, (name, label) in enumerate(
            zip(skeleton.names, joint_labels(skeleton), strict=True)
        )
    )


def _order_notes(pairs: Pairs, second: Skeleton) -> list[Diagnostic]:
    order = np.argsort(pairs.second)
    other = np.flatnonzero(order != np.arange(len(order)))
    if not len(other):
        return []
    place = int(other[0])
    here, there = pairs.names[place], _unique_labels(second)[int(pairs.second[order[place]])]
    return [
        note(
            "D002.order: joints are in a different order, which matters for .skin and .anim "
            "files: where the first has {first}, the second has {second}",
            first=here,
            second=there,
        )
    ]


def _places(found: Ints, count: int) -> Ints:
    """Return each joint's position in a list, -1 if absent; an extra last entry maps -1 to -1."""
    places = np.full(count + 1, -1, dtype=np.int32)
    places[found] = np.arange(len(found))
    return places


def pair_names(first: Sequence[str], second: Sequence[str], what: str) -> Pairs:
    """Match unique names; if none matches and the counts are equal, match by index with a note."""
    numbers = {name: number for number, name in enumerate(second)}
    shared = [(number, numbers[name]) for number, name in enumerate(first) if name in numbers]
    if not shared and len(first) == len(second) > 0:
        same = np.arange(len(first), dtype=np.int32)
        return Pairs(same, same, tuple(first), notes=(Diagnostic(_KEYS[what][1]),))
    both = np.array(shared, dtype=np.int32).reshape(-1, 2)
    mismatches = []
    for ordinal, names, others in (("first", first, second), ("second", second, first)):
        known = set(others)
        lone = [name for name in names if name not in known]
        if lone:
            values = {"n": counted(len(lone), what), "side": ordinal, "names": listed(lone)}
            mismatches.append(note(_KEYS[what][0], **values))
    names = tuple(first[number] for number in both[:, 0])
    return Pairs(both[:, 0], both[:, 1], names, tuple(mismatches))


def row_distances(first: Skin, second: Skin, pairs: Pairs) -> Floats:
    """Return each vertex's sum over joints of |w - w'| (V,): 2 if no joint has weight in both."""
    # The difference of two rows is one row with the weights of both, the second ones negative: its
    # L1 norm adds up what each joint has in one and not in the other. Unmatched joints of the
    # second skin get indices that the first skin does not use.
    names = np.arange(second.n_joints, dtype=np.int32) + first.n_joints
    names[pairs.second] = pairs.first
    return row_norms(
        first.n_vertices,
        np.concatenate([owners(first), owners(second)]),
        np.concatenate([first.joints, names[second.joints]]),
        np.concatenate([first.weights, -second.weights]),
    )


def skin_at(skin: Skin, triangles: Ints, found: SurfacePoints) -> Skin:
    """Interpolate weights (barycentric) at points of the surface; a row may repeat a joint."""
    corners = skin_rows(skin, triangles[found.triangles].ravel())
    factors = np.repeat(found.barycentric.ravel(), np.diff(corners.starts))
    return replace(corners, starts=corners.starts[::3], weights=factors * corners.weights)
