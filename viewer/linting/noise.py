"""Check of weights for noise: differences from vertex to vertex that follow no shape."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.linting._mirror import mirror_of
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import FEWEST, LEAST, Support, Surface, support_of, surface_of
from viewer.phrases import counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.skeleton import joint_labels

_RIGID = 0.99  # weight of a vertex that one joint moves
# A smooth weight has no peaks except at its largest values: it is between those of its neighbours.
# In 40 rigs of artists, at most 2.5 % of the weights that blend, and 13 % of those of one joint,
# are outside by this much.
_PEAK = 0.05
_NOISY, _NOISY_JOINT = 0.04, 0.15  # fractions above which weights are noisy
_FEWEST = 30  # minimum number of vertices that blend with such a joint
# Mild noise makes no such peaks where the weights themselves are steep. The difference r of a
# weight from the mean of its neighbours is that of a smooth function, plus noise. On a mesh of
# triangles, white noise of variance s^2 has a variance of r of 7/6 s^2, and between neighbours,
# which share two others, a covariance of (-2/6 + 2/36) s^2: a correlation of -0.24. Those of smooth
# functions are positive. Coarse rigs of artists reach -0.11 with a joint that has this many
# vertices, and -0.03 in all.
_ALTERNATES, _ALTERNATES_IN_ALL = -0.15, -0.08
_DENSE, _DENSE_IN_ALL = 100, 500
# What artists mirror is equal on both sides, and what they then paint on one side is smooth: the
# differences of the sides correlate between neighbours by 0.15 (few, hard ones) to 1.0. Those of
# noise correlate by 0, however small they are.
_WHITE = 0.12
_UNEQUAL = 0.02  # smallest difference that counts
_MOST = 0.4  # minimum fraction of the weights of a joint that differ
_FEWEST_OF_SIDE = 20  # minimum number of its vertices
_SEVERAL = 2  # minimum number of such joints: noise on one side is that of both

_sides: Memo[Figure, _Sides | None] = Memo()


def check(subject: Subject) -> Iterator[Finding]:
    """Check the weights of an attached figure; the first kind of noise that is found is named."""
    figure = subject.actor.figure
    if figure.skin is None or figure.mesh is None or figure.skeleton is None:
        return
    if subject.lacks("weights") or figure.mesh.n_triangles == 0:
        return
    found, surface = support_of(figure), surface_of(figure)
    if figure.mesh.n_vertices < FEWEST or len(found.vertices) == 0:
        return
    finding = _peaks(subject, figure, found, surface)
    finding = finding or _alternating(subject, figure, found, surface)
    if finding is None and not subject.lacks("positions", "bindings", "joints"):
        finding = _unequal(subject, figure, found)
    if finding is not None:
        yield finding


def noisy_sides(figure: Figure) -> Bools:
    """Return the joints of a mirrored, attached figure whose sides differ by noise: (J,)."""
    sides = _sides.get(figure, (), lambda: _compared(figure))
    return np.zeros(figure.require_skeleton().n_joints, np.bool_) if sides is None else sides.noisy


def _peaks(subject: Subject, figure: Figure, found: Support, surface: Surface) -> Finding | None:
    """Return weights outside the range of those of their neighbours."""
    count, size = len(surface.place), len(found.places)
    n_around = np.bincount(surface.edges[:, 0], minlength=count)[found.places]
    n_shared = np.bincount(found.links[:, 0], minlength=size)
    highest, lowest = np.zeros(size), np.ones(size)
    np.maximum.at(highest, found.links[:, 0], found.place_weights[found.links[:, 1]])
    np.minimum.at(lowest, found.links[:, 0], found.place_weights[found.links[:, 1]])
    lowest[n_shared < n_around] = 0.0
    outside = np.maximum(found.place_weights - highest, lowest - found.place_weights)
    outside[n_around == 0] = 0.0
    blends = _blends(found)
    peaks = (outside > _PEAK) & blends
    n_joints = figure.require_skeleton().n_joints
    n_blending = np.bincount(found.place_joints[blends], minlength=n_joints)
    n_peaks = np.bincount(found.place_joints[peaks], minlength=n_joints)
    joints = np.flatnonzero((n_blending >= _FEWEST) & (n_peaks > _NOISY_JOINT * n_blending))
    n_blends = int(blends.sum())
    if len(joints) == 0 and (int(peaks.sum()) <= _NOISY * n_blends or n_blends < _FEWEST):
        return None
    rows = np.flatnonzero(peaks & np.isin(found.place_joints, joints) if len(joints) else peaks)
    rows = largest_first(rows, outside)
    first, labels = int(rows[0]), joint_labels(figure.require_skeleton())
    return subject.found(
        "W016.noise: {n} above or below those of all neighbours (worst: {weight} of {joint} at "
        "vertex {vertex}, by {outside})",
        n=counted(len(rows), "weight", "is", "are", of=n_blends),
        all=n_blends,
        weight=rounded(float(found.place_weights[first]), 2),
        joint=labels[int(found.place_joints[first])],
        vertex=int(found.places[first]),
        outside=rounded(float(outside[first]), 2),
        vertices=found.places[rows],
        joints=joints if len(joints) else np.unique(found.place_joints[rows]),
        at=("weights", int(found.places[first])),
    )


def _blends(found: Support) -> Bools:
    result: Bools = (found.place_weights > LEAST) & (found.place_weights < _RIGID)
    return result


def _correlations(values: Floats, links: Indices, joints: Indices, count: int) -> Floats:
    """Return the correlation of values (N,) at both ends of the links of each joint: (J,)."""
    one, other = values[links].T
    owner = joints[links[:, 0]]
    products = np.bincount(owner, one * other, minlength=count)
    squares = np.bincount(owner, 0.5 * (one**2 + other**2), minlength=count)
    return np.divide(products, squares, out=np.zeros(count), where=squares > 0.0)


def _alternating(
    subject: Subject, figure: Figure, found: Support, surface: Surface
) -> Finding | None:
    """Return joints whose weights alternate between neighbours."""
    size, n_joints = len(found.places), figure.require_skeleton().n_joints
    degree = np.bincount(surface.edges[:, 0], minlength=len(surface.place))[found.places]
    one, other = found.links.T
    sums = np.bincount(one, found.place_weights[other], minlength=size)
    rest = np.where(degree >= 3, found.place_weights - sums / np.maximum(degree, 1), 0.0)
    blends = _blends(found) & (degree >= 3)
    count = np.bincount(found.place_joints[blends], minlength=n_joints)
    each = _correlations(rest, found.links, found.place_joints, n_joints)
    joints = np.flatnonzero((count >= _DENSE) & (each < _ALTERNATES))
    squares = 0.5 * (rest[one] ** 2 + rest[other] ** 2).sum()
    total = float((rest[one] * rest[other]).sum() / squares) if squares > 0.0 else 0.0
    if len(joints) == 0 and (count.sum() < _DENSE_IN_ALL or total > _ALTERNATES_IN_ALL):
        return None
    if len(joints) == 0:
        joints = np.flatnonzero(count)
    joints = joints[np.argsort(each[joints], kind="stable")]
    rows = np.flatnonzero(blends & np.isin(found.place_joints, joints) & (np.abs(rest) > _UNEQUAL))
    if len(rows) == 0:
        return None  # rounding of the file alternates, too
    rows = rows[np.argsort(-np.abs(rest[rows]), kind="stable")]
    labels = joint_labels(figure.require_skeleton())
    return subject.found(
        "W016.alternating: weights of {n} alternate from vertex to vertex: {names} (typically by "
        "{size}, most at vertex {vertex})",
        n=counted(len(joints), "joint"),
        names=listed([labels[joint] for joint in joints]),
        size=rounded(float(np.median(np.abs(rest[rows]))), 2),
        vertex=int(found.places[rows[0]]),
        vertices=found.places[rows],
        joints=joints,
        at=("weights", int(found.places[rows[0]])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """Differences between the weights of both sides of a mirrored figure."""

    differences: Floats
    """(M,): of each influence of a place from that at the mirrored place."""
    noisy: Bools
    """(J,): joints whose sides differ by noise."""


def _compared(figure: Figure) -> _Sides | None:
    """Compare each influence of a place with that at the mirrored place."""
    mirror = mirror_of(figure)
    if mirror is None:
        return None
    found, place, n_joints = support_of(figure), surface_of(figure).place, len(mirror.joints)
    partners = np.where(mirror.joints >= 0, mirror.joints, np.arange(n_joints))
    # Influences of places are sorted by these keys.
    keys = found.places * n_joints + found.place_joints
    wanted = place[mirror.vertices[found.places]] * n_joints + partners[found.place_joints]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    opposite = np.where(keys[at] == wanted, found.place_weights[at], 0.0)
    known = mirror.known[found.places]
    differences = np.where(known, found.place_weights - opposite, 0.0)
    links = found.links[known[found.links].all(axis=1)]
    each = _correlations(differences, links, found.place_joints, n_joints)
    blends = known & _blends(found)
    total = np.bincount(found.place_joints[blends], minlength=n_joints)
    unequal = blends & (np.abs(differences) > _UNEQUAL)
    n_unequal = np.bincount(found.place_joints[unequal], minlength=n_joints)
    noisy = (total >= _FEWEST_OF_SIDE) & (n_unequal > _MOST * total) & (each < _WHITE)
    if noisy.sum() < _SEVERAL:
        noisy[:] = False
    return _Sides(differences, noisy)


def _unequal(subject: Subject, figure: Figure, found: Support) -> Finding | None:
    """Return joints whose weights differ between the sides by noise."""
    joints = np.flatnonzero(noisy_sides(figure))
    sides = _sides.get(figure, (), lambda: _compared(figure))
    if len(joints) == 0 or sides is None:
        return None
    sizes = np.abs(sides.differences)
    rows = np.flatnonzero(np.isin(found.place_joints, joints) & (sizes > _UNEQUAL))
    rows = largest_first(rows, sizes)
    labels = joint_labels(figure.require_skeleton())
    return subject.found(
        "W016.sides: weights of {n} differ irregularly between left and right: {names} "
        "(median difference {size}, largest at vertex {vertex})",
        n=counted(len(joints), "joint"),
        names=listed([labels[joint] for joint in joints]),
        size=rounded(float(np.median(sizes[rows])), 2),
        vertex=int(found.places[rows[0]]),
        vertices=found.places[rows],
        joints=joints,
        at=("weights", int(found.places[rows[0]])),
    )
