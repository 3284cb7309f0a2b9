"""Checks of weights for joints that are far away: stray weights, wrong islands, swapped sides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._mirror import name_partners
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import (
    FEWEST,
    LEAST,
    Support,
    Surface,
    bone_distances,
    support_of,
    surface_of,
)
from viewer.phrases import agree, counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import components
from viewer.rigs.hierarchy import descendants, with_ancestors
from viewer.rigs.inspection.faults import distinct
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import bind_positions

# A joint's reach is the distance from its bones to the farthest vertex that it mostly moves. On 40
# rigs of artists, weights of 0.01 and more end within 0.12 sizes beyond it, and parts of the
# surface that are apart from the rest of the joint's vertices begin within 0.06. Lengths are
# fractions of the figure's size.
_MOSTLY = 0.5  # fraction of a joint's largest weight
_APART = 0.06  # maximum distance beyond the reach of a part that is apart
_BEYOND = 0.16  # maximum distance beyond the reach of a vertex that is not
_TWICE = 2.0  # maximum distance relative to the reach: weights of long bones end softly
# Weights that fade out over single vertices hardly move them.
_STRONG = 0.05  # smallest weight of a stray that is seen at once
# Number of vertices, and their fraction of the mesh, whose smaller weights are seen together
_MANY, _PATCH = 8, 1e-3
_TOGETHER = 256  # vertices whose distances from others are computed together
# In the same rigs, weights below this one of a joint are at no more than 13 % of all places, mostly
# fewer than its larger ones: a joint leaks to the whole body if they are at many more.
_SMALL, _EVERYWHERE = 0.1, 0.25
# Of the same rigs, one has a group of up to three places with this much of a joint's weight that is
# apart from all others of the joint, and blends with another one that is no neighbour of it.
_ALONE, _ALONE_WEIGHT = 3, 0.2
_ELSEWHERE = 20  # minimum number of the joint's other places
_NEAR = 0.02  # distance from the bones within which all parts are near
_OTHER_LIMB = 0.03  # minimum distance of a joint from the middle of what it moves by mistake
_NEARER = 0.35  # maximum distance from the bones of the right joint, relative to the wrong one
# Of a pair of joints, the middle of what one moves is beside it. Counted from the one (-0.5) to the
# other (0.5), the middles of both are at least here, on the wrong sides, if they are exchanged.
_ACROSS = 0.25
_PAIR = 0.02  # minimum distance of such a pair
_TAKEN = 8  # minimum number of vertices around a joint without weights that another one moves


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """Vertices around one joint that a distant one moves."""

    joint: int
    """The joint, which has no weights."""
    taker: int
    """The one that moves the vertices, and others around itself."""
    rows: Indices
    """Rows of its influences in ``found``."""


@dataclass(frozen=True, slots=True, eq=False)
class _Misplaced:
    """Influences of joints that are far away."""

    found: Support
    distances: Floats
    """(N,): of each influence's vertex from the joint's bones, as fractions of the size."""
    strays: Indices
    islands: Indices
    """Rows of ``found``: of single vertices, and of whole parts of the mesh."""
    taken: tuple[Taken, ...]
    """Vertices around joints that move nothing."""
    swapped: Indices
    """(P, 2): joints, each with the one whose vertices it moves, and which moves its own."""


def check(subject: Subject) -> Iterator[Finding]:
    """Compare where joints have weights with where they are."""
    misplaced = misplaced_weights(subject)
    if misplaced is None:
        return
    figure, found = subject.actor.figure, misplaced.found
    if len(misplaced.swapped):
        yield _swapped_finding(subject, figure, misplaced.swapped[:, 0])
    yield from _taken_findings(subject, figure, misplaced)
    yield from _islands(subject, figure, found, misplaced.islands, misplaced.distances)
    yield from _strays(subject, figure, found, misplaced.strays, misplaced.distances)


def misplaced_weights(subject: Subject) -> _Misplaced | None:
    """Return the influences of joints that are far away; None if they cannot be judged."""
    figure = subject.actor.figure
    size = subject.size()
    if figure.skin is None or figure.mesh is None or not figure.is_attached or not size > 0.0:
        return None
    if subject.lacks("weights", "positions", "bindings", "joints"):
        return None  # places and weights that are missing cannot be compared
    found = support_of(figure)
    if figure.mesh.n_vertices < FEWEST or len(found.vertices) == 0:
        return None
    places, parents = bind_positions(figure.skin), figure.require_skeleton().parents
    points = figure.mesh.positions[found.vertices]
    pairs = name_partners(figure.require_skeleton())
    swapped = _swapped(found, points, places, parents, pairs, size)
    distances = bone_distances(places, parents, points, found.joints) / size
    taken = _taken(found, points, places, parents, distances, size)
    largest, reach = np.zeros((2, figure.skin.n_joints))
    np.maximum.at(largest, found.joints, found.weights)
    mostly = found.weights >= _MOSTLY * largest[found.joints]
    surface = surface_of(figure)
    place_parts = components(len(found.places), found.links)
    parts = place_parts[found.node]
    is_minor = _are_minor(found, parts, distances)
    # A vertex that is far away must not extend the reach by which it is judged.
    own = np.flatnonzero(mostly & ~is_minor)
    np.maximum.at(reach, found.joints[own], distances[own])
    beyond = distances - reach[found.joints]
    nearest = np.full(len(parts), np.inf)
    np.minimum.at(nearest, parts, beyond)
    stray = (nearest[parts] > _APART) & is_minor
    stray &= _are_far(found, parts, points, np.flatnonzero(stray), own, _APART * size)
    # A weight on much of the body is connected with the joint's own vertices, and outnumbers them.
    leaks = (beyond > _BEYOND) & (distances > _TWICE * reach[found.joints])
    n_far, n_own = (np.bincount(found.joints[k], minlength=len(reach)) for k in (leaks, mostly))
    stray |= leaks & (n_far > n_own)[found.joints]
    stray |= _are_everywhere(found, len(np.unique(surface.place)))
    stray |= _are_alone(found, surface, place_parts, parents) & is_minor & (distances > _NEAR)
    stray &= ~np.isin(found.joints, swapped[:, 0]) & ~_are_adjacent(found, parents)
    for one in taken:
        stray[one.rows] = False
    if len(np.unique(found.joints)) == 1:
        stray[:] = False  # as of a mesh below a node: no other joint could move a part
    whole = stray & _are_islands(surface, found, parts) if stray.any() else stray
    strays, islands = np.flatnonzero(stray & ~whole), np.flatnonzero(whole)
    return _Misplaced(found, distances, strays, islands, taken, swapped)


def _taken(
    found: Support, points: Floats, places: Floats, parents: Ints, distances: Floats, size: float
) -> tuple[Taken, ...]:
    """Return what is moved around joints without weights by joints of another limb."""
    result: list[tuple[int, int]] = []
    far = np.flatnonzero(distances > _OTHER_LIMB)
    used = np.zeros(len(parents), dtype=np.bool_)
    used[found.joints] = True
    # Controls and helpers are below others without weights.
    for joint in np.flatnonzero(~used & (parents >= 0) & used[parents]).tolist():
        near = bone_distances(places, parents, points[far], np.full(len(far), joint)) / size
        rows = far[near < _NEARER * distances[far]]
        # Hands without weights of their own move with the arm, and fingers with the hand.
        above, below = with_ancestors(parents.tolist(), [joint]), descendants(parents, joint)
        rows = rows[~np.isin(found.joints[rows], [*above]) & ~below[found.joints[rows]]]
        if len(rows) == 0:
            continue
        taker = int(np.bincount(found.joints[rows], found.weights[rows]).argmax())
        if (found.weights[rows[found.joints[rows] == taker]] > _MOSTLY).sum() >= _TAKEN:
            result.append((joint, taker))
    taken: list[Taken] = []
    for taker in {taker for _, taker in result}:
        own = np.flatnonzero(found.joints == taker)
        joints = [joint for joint, other in result if other == taker]
        nearby = [
            bone_distances(places, parents, points[own], np.full(len(own), joint)) / size
            for joint in joints
        ]
        # Of several joints, each gets back what is nearest to it.
        nearest = np.min([distances[own], *nearby], axis=0)
        taken += [
            Taken(joint, taker, own[(each < distances[own]) & (each <= nearest)])
            for joint, each in zip(joints, nearby, strict=True)
        ]
    return tuple(sorted(taken, key=lambda one: one.joint))


def _are_minor(found: Support, parts: Indices, distances: Floats) -> Bools:
    """Return which influences are apart from their joint's own part of the surface: (N,)."""
    # The own part is heavy and near: a large island on a small hand, one end of which happens to be
    # near, is not the hand.
    mass = np.bincount(parts, found.weights, minlength=len(parts))
    means = np.bincount(parts, found.weights * distances, minlength=len(parts))
    means = np.divide(means, mass, out=np.full(len(parts), np.inf), where=mass > 0.0)
    score = mass / (means + _NEAR) ** 2
    most = np.zeros(int(found.joints.max()) + 1)
    np.maximum.at(most, found.joints, score[parts])
    minor: Bools = score[parts] < most[found.joints]
    return minor


def _are_everywhere(found: Support, n_places: int) -> Bools:
    """Return which influences are small ones of joints that leak to the whole body: (N,)."""
    is_small = found.place_weights < _SMALL
    n_small, n_other = (
        np.bincount(found.place_joints[some], minlength=int(found.joints.max()) + 1)
        for some in (is_small, ~is_small)
    )
    leaks = (n_small > _EVERYWHERE * n_places) & (n_small > n_other)
    result: Bools = leaks[found.joints] & (found.weights < _SMALL)
    return result


def _are_alone(found: Support, surface: Surface, part: Indices, parents: Ints) -> Bools:
    """Return which influences are of single places inside the region of another joint: (N,).

    ``part``: (M,), of the influences of places that are connected.
    """
    count = len(found.places)
    largest = np.zeros(count)
    np.maximum.at(largest, part, found.place_weights)
    n_places = np.bincount(part, minlength=count)
    alone = (n_places <= _ALONE) & (largest > _ALONE_WEIGHT)
    others = np.bincount(found.place_joints)[found.place_joints] >= _ELSEWHERE
    n_edges = np.bincount(surface.edges[:, 0], minlength=len(surface.place))
    rows = np.flatnonzero(alone[part] & others & (n_edges[found.places] >= 3))
    # The joint that moves each place most; those of the surroundings must not be neighbours.
    strongest = np.full(len(surface.place), -1)
    order = np.argsort(found.place_weights, kind="stable")
    strongest[found.places[order]] = found.place_joints[order]
    starts, ends = surface.edges.T
    is_alone = np.zeros(count, dtype=np.bool_)
    for row in rows.tolist():
        joint = int(found.place_joints[row])
        first, last = np.searchsorted(starts, [found.places[row], found.places[row] + 1])
        around = strongest[ends[first:last]]
        is_alone[row] = not ((parents[around] == joint) | (around == parents[joint])).any()
    result: Bools = is_alone[found.node]
    return result


def _are_adjacent(found: Support, parents: Ints) -> Bools:
    """Return which influences are of a parent or child of their vertex's strongest joint: (N,)."""
    # The hair that moves with joints of its own keeps some weight of the head.
    strongest = np.zeros(int(found.vertices.max()) + 1, dtype=np.int64)
    order = np.argsort(found.weights, kind="stable")
    strongest[found.vertices[order]] = found.joints[order]
    main = strongest[found.vertices]
    result: Bools = (parents[main] == found.joints) | (parents[found.joints] == main)
    return result


def _are_far(
    found: Support,
    parts: Indices,
    points: Floats,
    rows: Indices,
    own: Indices,
    least: float,
) -> Bools:
    """Return which parts, given by all their rows, are apart in space from ``own`` rows: (N,)."""
    # The blade of a sword and the hem of a cape are parts far from their joint, but next to others
    # that it moves.
    far = np.zeros(len(parts), dtype=np.bool_)
    if len(rows) == 0:
        return far
    joints = found.joints[own]
    near = {joint: points[own[joints == joint]] for joint in np.unique(found.joints[rows]).tolist()}
    rows = rows[np.argsort(parts[rows], kind="stable")]
    for members in np.split(rows, np.flatnonzero(np.diff(parts[rows])) + 1):
        others = near[int(found.joints[members[0]])]
        gap = np.inf
        for start in range(0, len(members), _TOGETHER):
            some = points[members[start : start + _TOGETHER], None]
            gap = min(gap, float(np.linalg.norm(some - others, axis=2).min(initial=gap)))
        far[members] = gap > least
    return far


def _are_islands(surface: Surface, found: Support, parts: Indices) -> Bools:
    """Return which influences are of a joint that moves a whole island of the mesh alone: (N,)."""
    count = len(surface.place)
    island = components(count, surface.edges)[surface.place]
    n_places = np.bincount(island, minlength=count)
    alone = found.weights > 1.0 - LEAST
    own = np.bincount(parts, alone, minlength=len(parts))
    result: Bools = own[parts] == n_places[island[found.vertices]]
    return result


def _taken_findings(subject: Subject, figure: Figure, misplaced: _Misplaced) -> Iterator[Finding]:
    if not misplaced.taken:
        return
    labels, found = joint_labels(figure.require_skeleton()), misplaced.found
    rows = np.concatenate([one.rows for one in misplaced.taken])
    vertices = distinct(found.vertices[rows])
    names = [
        Phrase("{joint} (by {other})", joint=labels[one.joint], other=labels[one.taker])
        for one in misplaced.taken
    ]
    yield subject.found(
        "W012.taken: {n} around {them} without weights {are} moved by another limb: {names}, up to "
        "{distance} away",
        n=counted(len(vertices), "vertex"),
        them=agree(len(misplaced.taken), "a joint", "joints"),
        are=agree(len(vertices), "is", "are"),
        names=listed(names),
        distance=subject.length(float(misplaced.distances[rows].max() * subject.size())),
        vertices=vertices,
        joints=[one.joint for one in misplaced.taken],
        at=("weights", int(vertices[0])),
    )


def _islands(
    subject: Subject, figure: Figure, found: Support, rows: Indices, distances: Floats
) -> Iterator[Finding]:
    if len(rows) == 0:
        return
    rows = largest_first(rows, distances)
    vertices, first = found.vertices[rows], int(found.vertices[rows[0]])
    joints = distinct(found.joints[rows])
    yield subject.found(
        "W012.islands: {n} of whole parts of the mesh {move} with {names}, {distance} away "
        "(first: vertex {vertex})",
        n=counted(len(vertices), "vertex"),
        move=agree(len(vertices), "moves", "move"),
        names=listed([joint_labels(figure.require_skeleton())[joint] for joint in joints]),
        distance=subject.length(float(distances[rows[0]] * subject.size())),
        vertex=first,
        vertices=distinct(vertices),
        joints=joints,
        at=("weights", first),
    )


def _strays(
    subject: Subject, figure: Figure, found: Support, rows: Indices, distances: Floats
) -> Iterator[Finding]:
    if len(rows) == 0:
        return
    moved = found.weights[rows] * distances[rows]
    rows = rows[np.argsort(-moved, kind="stable")]
    worst = int(rows[0])
    vertices, joints = distinct(found.vertices[rows]), distinct(found.joints[rows])
    labels = joint_labels(figure.require_skeleton())
    many = max(_MANY, _PATCH * figure.require_mesh().n_vertices)
    is_seen = found.weights[rows].max() > _STRONG or len(vertices) >= many
    yield subject.found(
        "W011.strays: {n} influenced by joints far away: {names} (worst: vertex {vertex}, by "
        "{weight} of {joint}, {distance} away)",
        n=counted(len(vertices), "vertex", "is", "are"),
        names=listed([labels[joint] for joint in joints]),
        vertex=int(found.vertices[worst]),
        weight=rounded(float(found.weights[worst]), 2),
        joint=labels[int(found.joints[worst])],
        distance=subject.length(float(distances[worst] * subject.size())),
        severity="warning" if is_seen else "note",
        vertices=vertices,
        joints=joints,
        at=("weights", int(found.vertices[worst])),
    )


def _swapped(
    found: Support, points: Floats, places: Floats, parents: Ints, partners: Ints, size: float
) -> Indices:
    """Return joints, each with one that moves the vertices around it, and conversely: (N, 2)."""
    count = len(places)
    total = np.bincount(found.joints, found.weights, minlength=count)
    sums = [
        np.bincount(found.joints, found.weights * points[:, axis], minlength=count)
        for axis in range(3)
    ]
    used = np.flatnonzero(total > 0.0)
    middles = np.stack(sums, axis=1)[used] / total[used, None]
    # Distance of the middle of each joint's vertices from the bones of every joint.
    across = np.zeros((len(used), len(used)))
    for column, joint in enumerate(used):
        across[:, column] = bone_distances(places, parents, middles, np.full(len(used), joint))
    own = np.diag(across)
    elsewhere = (own[:, None] > _OTHER_LIMB * size) & (across < _NEARER * own[:, None])
    first, second = np.nonzero(elsewhere & elsewhere.T)
    # Of several joints there, the pair is the nearest one.
    near = [int(across[one][second[first == one]].argmin()) for one in np.unique(first)]
    pairs = {one: second[first == one][k] for one, k in zip(np.unique(first), near, strict=True)}
    mutual = {(one, other) for one, other in pairs.items() if pairs.get(other) == one}
    # Feet that are close together may be nearer to the middle of the right one than that is far.
    index = {int(joint): row for row, joint in enumerate(used)}
    for left, right in enumerate(partners.tolist()):
        if left == right or left not in index or right not in index:
            continue
        pair, along = (index[left], index[right]), places[right] - places[left]
        is_apart = float(np.linalg.norm(along)) > _PAIR * size
        if is_apart and _wrong_side(middles[pair[0]], places[left], along) > _ACROSS:
            back = _wrong_side(middles[pair[1]], places[right], -along)
            mutual |= {pair} if back > _ACROSS else set()
    return used[np.array(sorted(mutual), dtype=np.int64).reshape(-1, 2)]


def _wrong_side(middle: Floats, start: Floats, along: Floats) -> float:
    """Return where a point is along a line: -0.5 at its start, 0.5 at its end."""
    return float((middle - start) @ along / (along @ along)) - 0.5


def _swapped_finding(subject: Subject, figure: Figure, joints: Indices) -> Finding:
    labels = joint_labels(figure.require_skeleton())
    return subject.found(
        "W013.swapped: weights of {n} are exchanged in pairs: {names}; each of a pair moves the "
        "vertices around the other",
        n=counted(len(joints), "joint"),
        names=listed([labels[joint] for joint in joints]),
        joints=joints,
        at=("bindings", int(joints[0])),
    )
