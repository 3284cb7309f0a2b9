"""Checks of where joints are: on their parent, outside the limb, upside down, or lying."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._mirror import name_partners
from viewer.linting._subject import Subject, track_of
from viewer.linting._surface import FEWEST, support_of
from viewer.phrases import agree, counted, listed
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.retargeting.joint_names import joint_meanings, sided_words
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import bind_positions, moves_vertices

_ZERO = 1e-3  # length of a bone without a length, relative to the figure's size
# The vertices at which a joint and its parent blend lie around a joint in the middle of a limb, so
# that the directions to them cancel out: their mean is at most 0.45 long for elbows and knees of
# artists. From outside, all vertices are in one direction.
_OUTSIDE = 0.75
_RING = 8  # minimum number of these vertices
_BLENDS = 0.05  # minimum geometric mean of both weights
_INSIDE = ("elbow", "wrist", "knee", "ankle")  # joints in the middle of a limb
_FEET = ("left_ankle", "right_ankle", "left_foot", "right_foot")
_PAWS = ("foot", "paw", "hoof", "toe", "toes")
_NEARLY_ALL = 0.9  # fraction of the frames: nobody stands on the hands for longer
# If axes were exchanged, a line from the feet to the head is level. Infants are modelled lying, but
# with bent legs.
_LONG, _LEVEL = 0.3, 0.15  # minimum length of that line, in sizes, and its maximum slope
_BELOW = 0.05  # minimum depth of a head below the feet, relative to the size


def check(subject: Subject) -> Iterator[Finding]:
    """Check the joints of an attached figure at the bind pose."""
    figure = subject.actor.figure
    size = subject.size()
    if figure.mesh is None and figure.skeleton is not None and not subject.lacks("joints"):
        yield from _moves_upside_down(subject, figure)
    if figure.skin is None or figure.mesh is None or not figure.is_attached or not size > 0.0:
        return
    if subject.lacks("weights", "positions", "bindings", "joints"):
        return
    places = bind_positions(figure.skin)
    meanings = joint_meanings(figure.require_skeleton())
    if figure.mesh.n_vertices >= FEWEST:
        yield from _zero_lengths(subject, figure, places, size)
        yield from _outside(subject, figure, places, meanings)
    inverted = [*_upside_down(subject, figure, places, meanings, size)]
    yield from inverted or _lies(subject, figure, places, meanings, size)


def _zero_lengths(
    subject: Subject, figure: Figure, places: Floats, size: float
) -> Iterator[Finding]:
    """Report joints at the position of their parent, although both move vertices."""
    skeleton, skin = figure.require_skeleton(), figure.require_skin()
    parents = skeleton.parents
    moves = moves_vertices(skin)
    above = np.maximum(parents, 0)
    lengths = np.where(parents >= 0, np.linalg.norm(places - places[above], axis=1), np.inf)
    flat = (lengths < _ZERO * size) & moves & moves[above]
    joints = np.flatnonzero(flat)
    if len(joints) == 0:
        return
    # Helpers that twist a limb, and the first joint of a tail, are made so; on both sides.
    partners = name_partners(skeleton)
    is_single = (partners >= 0) & (partners != np.arange(len(partners))) & ~flat[partners]
    single = joints[is_single[joints]]
    named = single if len(single) else joints
    labels = joint_labels(skeleton)
    yield subject.found(
        "S011.joints: {n} at the position of {their}: {names}",
        n=counted(len(named), "joint", "is", "are"),
        their=agree(len(named), "its parent", "their parents"),
        names=listed([labels[joint] for joint in named]),
        severity="warning" if len(single) else "note",
        part="skeleton",
        joints=named,
        at=("joints", int(named[0])),
    )


def _outside(
    subject: Subject, figure: Figure, places: Floats, meanings: tuple[str, ...]
) -> Iterator[Finding]:
    """Report elbows, wrists, knees and ankles beside the vertices that bend around them."""
    found, mesh = support_of(figure), figure.require_mesh()
    parents, n_joints = figure.require_skeleton().parents, len(places)
    own = found.joints * mesh.n_vertices + found.vertices
    order = np.argsort(own)
    outside: list[tuple[float, int]] = []
    for joint in range(n_joints):
        if not meanings[joint].endswith(_INSIDE) or parents[joint] < 0:
            continue
        rows = np.flatnonzero(found.joints == joint)
        wanted = int(parents[joint]) * mesh.n_vertices + found.vertices[rows]
        at = np.minimum(np.searchsorted(own[order], wanted), len(own) - 1)
        other = order[at]
        both = np.where(own[other] == wanted, found.weights[rows] * found.weights[other], 0.0)
        means = np.sqrt(both)
        ring = means > _BLENDS
        if ring.sum() < _RING:
            continue
        to = unit(mesh.positions[found.vertices[rows[ring]]] - places[joint])
        mean = np.einsum("n,na->a", means[ring], to) / means[ring].sum()
        if np.linalg.norm(mean) > _OUTSIDE:
            outside.append((float(np.linalg.norm(mean)), joint))
    if not outside:
        return
    joints = [joint for _, joint in sorted(outside, reverse=True)]
    labels = joint_labels(figure.require_skeleton())
    yield subject.found(
        "S012.joints: {n} outside {limb} there: {names}",
        n=counted(len(joints), "joint", "is", "are"),
        limb=agree(len(joints), "the limb that bends", "the limbs that bend"),
        names=listed([labels[joint] for joint in joints]),
        part="skeleton",
        joints=joints,
        at=("joints", joints[0]),
    )


def _heads_and_feet(figure: Figure, meanings: tuple[str, ...]) -> tuple[list[int], list[int]]:
    """Return the joints of head and feet, of a person or an animal."""
    heads = [meanings.index(name) for name in ("head", "neck") if name in meanings]
    feet = [meanings.index(name) for name in _FEET if name in meanings]
    if not heads or not feet:  # an animal
        words = [word for _, word in sided_words(figure.require_skeleton().names)]
        heads = [joint for joint, word in enumerate(words) if word == "head"]
        feet = [joint for joint, word in enumerate(words) if word.endswith(_PAWS)]
    return (heads, feet) if len(feet) >= 2 else ([], [])


def _upside_down(
    subject: Subject, figure: Figure, places: Floats, meanings: tuple[str, ...], size: float
) -> Iterator[Finding]:
    """Report a head below both feet along the up axis."""
    heights = places[:, "xyz".index(figure.up)]
    heads, feet = _heads_and_feet(figure, meanings)
    if not heads:
        return
    depth = float(heights[feet].min() - heights[heads].max())
    if depth > _BELOW * size:
        yield subject.found(
            "S013.head: the head is {depth} below the feet at rest, along {up}",
            depth=subject.length(depth),
            up=figure.up,
            part="skeleton",
            joints=[*heads[:1], *feet[:2]],
            at=("joints", heads[0]),
        )


def _lies(
    subject: Subject, figure: Figure, places: Floats, meanings: tuple[str, ...], size: float
) -> Iterator[Finding]:
    """Report a person whose head and feet are far apart across the up axis only."""
    wanted = ("head", "left_ankle", "right_ankle")
    if not all(name in meanings for name in wanted):
        return  # animals have their heads before their feet
    joints = [meanings.index(name) for name in wanted]
    along = places[joints[0]] - places[joints[1:]].mean(axis=0)
    height = float(along["xyz".index(figure.up)])
    length = float(np.linalg.norm(along))
    if length > _LONG * size and abs(height) < _LEVEL * length:
        yield subject.found(
            "S013.lies: the figure lies at rest: its head is {length} from its feet, across {up}",
            length=subject.length(length),
            up=figure.up,
            part="skeleton",
            joints=joints,
            at=("joints", joints[0]),
        )


def _moves_upside_down(subject: Subject, figure: Figure) -> Iterator[Finding]:
    """Report a skeleton without a mesh whose head is below its feet in nearly all frames."""
    # Its rest pose may be any, such as all bones along one axis: the motion shows how it stands.
    track = track_of(subject)
    heads, feet = _heads_and_feet(figure, joint_meanings(figure.require_skeleton()))
    if track is None or not heads or not track.present.any() or not track.size > 0.0:
        return
    heights = track.positions[track.present][..., "xyz".index(subject.up)]
    depths = heights[:, feet].min(axis=1) - heights[:, heads].max(axis=1)
    depth = float(np.quantile(depths, 1.0 - _NEARLY_ALL))
    if depth > _BELOW * track.size:
        yield subject.found(
            "S013.motion: the head is {depth} or more below the feet in {percent} % of the frames, "
            "along {up}",
            depth=subject.length(depth / track.scale),
            percent=round(100.0 * _NEARLY_ALL),
            up=subject.up,
            part="skeleton",
            joints=[*heads[:1], *feet[:2]],
            at=("joints", heads[0]),
        )
