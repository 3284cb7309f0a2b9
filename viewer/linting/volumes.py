"""Checks of weights around a joint: volume lost in a test pose (candy wrappers), equal weights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import FEWEST
from viewer.phrases import agree, counted, listed
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import lengths_of, unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import Mesh, area_vectors
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import Skin, bind_positions, merged, normalized, owners

_LIMBS = ("elbow", "wrist", "knee", "ankle")
_ANGLE = np.radians(90.0)  # about the bone that ends at the joint: a forearm twists by as much
# Twisted by t, the cross-section with a weight w of the joint shrinks to the square of
# |1 - w + w e^it|: it loses 2 w (1 - w) (1 - cos t). At 90 degrees, weights that change evenly lose
# a third of the volume in which they blend, and equal weights half; 152 limbs of artists lose 32 %
# in the median and 47 % at most.
_LOST = 0.48
_BLENDS = 0.02  # smallest weight, and distance from 1, of a vertex that blends
_FEWEST = 24  # minimum number of triangles
# Weights that change from 1 to 0 are equal at a single ring at most. In 40 rigs of artists, a joint
# has the same weight as its parent at one vertex, or at none.
_SAME = 1e-3  # maximum difference of equal weights
_EQUAL, _FEWEST_EQUAL = 0.5, 12  # minimum fraction of the joint's vertices, and their number
_BOTH = 0.9, 0.5  # minimum sums of both weights: where they are equal, and where the joint counts


def check(subject: Subject) -> Iterator[Finding]:
    """Check elbows, wrists, knees and ankles in a twist, and all joints for equal weights."""
    figure = subject.actor.figure
    if figure.skin is None or figure.mesh is None or not figure.is_attached:
        return
    if figure.mesh.n_vertices < FEWEST or figure.mesh.n_triangles == 0:
        return
    if subject.lacks("weights", "positions", "triangles", "bindings", "joints"):
        return
    skeleton, whole = figure.require_skeleton(), normalized(merged(figure.skin))
    places = bind_positions(figure.skin)
    lost: list[tuple[float, int]] = []
    blending: list[Indices] = []
    equal = _equal(figure.mesh, whole, skeleton.parents)
    for joint, meaning in enumerate(joint_meanings(skeleton)):
        parent = int(skeleton.parents[joint])
        if parent < 0:
            continue
        if meaning.endswith(_LIMBS):
            axis = places[joint] - places[parent]
            fraction, vertices = _twisted(figure, whole, joint, places[joint], axis)
            if fraction > _LOST:
                equal.pop(joint, None)
                lost.append((fraction, joint))
                blending.append(vertices)
    labels = joint_labels(skeleton)
    if equal:
        vertices = np.concatenate([*equal.values()])
        yield subject.found(
            "W017.equal: {n} equal weights for a joint and its parent, without a "
            "transition: {names}",
            n=counted(len(vertices), "vertex", "has", "have"),
            names=listed([labels[joint] for joint in equal]),
            vertices=vertices,
            joints=[*equal],
            at=("weights", int(vertices[0])),
        )
    if not lost:
        return
    order = np.argsort([-each for each, _ in lost])
    names = [
        Phrase("{joint} {percent} %", joint=labels[lost[k][1]], percent=round(100.0 * lost[k][0]))
        for k in order
    ]
    yield subject.found(
        "W017.twist: twisted by 90°, {n} much of the volume around {them}: {names}; weights that "
        "change evenly lose 33 %",
        n=counted(len(lost), "joint", "loses", "lose"),
        them=agree(len(lost), "it", "them"),
        names=listed(names),
        vertices=np.concatenate([blending[k] for k in order]),
        joints=[lost[k][1] for k in order],
        at=("bindings", lost[int(order[0])][1]),
    )


def _equal(mesh: Mesh, skin: Skin, parents: Ints) -> dict[int, Ints]:
    """Return the vertices with equal weights of a joint and its parent, of which most are so.

    ``skin``: merged.
    """
    vertices, joints, own = owners(skin).astype(np.int64), skin.joints, skin.weights
    keys = vertices * skin.n_joints + joints
    order = np.argsort(keys, kind="stable")
    # The weight of the parent at the same vertex; 0 if it has none there.
    wanted = vertices * skin.n_joints + parents[joints]
    at = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), max(len(keys) - 1, 0))]
    is_there = (keys[at] == wanted) & (parents[joints] >= 0)
    other = np.where(is_there, own[at], 0.0)
    is_equal = is_there & (np.abs(own - other) < _SAME) & (own + other > _BOTH[0])
    counts = (own > _BLENDS) & (own + other > _BOTH[1])
    n_own = np.bincount(joints[counts], minlength=len(parents))
    n_equal = np.bincount(joints[is_equal], minlength=len(parents))
    result: dict[int, Ints] = {}
    fewest = np.maximum(_FEWEST_EQUAL, _EQUAL * n_own)
    for joint in np.flatnonzero(n_equal >= fewest).tolist():
        halves = np.zeros(mesh.n_vertices, dtype=np.bool_)
        halves[vertices[is_equal & (joints == joint)]] = True
        # A single ring, of which no triangle has all corners, is the middle of a transition.
        found = np.unique(mesh.triangles[halves[mesh.triangles].all(axis=1)])
        if len(found) >= fewest[joint]:
            result[joint] = found
    return result


def _twisted(
    figure: Figure, skin: Skin, joint: int, centre: Floats, axis: Floats
) -> tuple[float, Indices]:
    """Return the fraction of the volume that is lost where a joint blends, and the vertices."""
    mesh, below = figure.require_mesh(), descendants(figure.require_skeleton().parents, joint)
    moved = below[skin.joints]
    weights = np.bincount(owners(skin)[moved], skin.weights[moved], minlength=mesh.n_vertices)
    blends = (weights > _BLENDS) & (weights < 1.0 - _BLENDS)
    triangles = mesh.triangles[blends[mesh.triangles].all(axis=1)]
    vertices = np.flatnonzero(blends)
    if len(triangles) < _FEWEST or not axis.any():
        return 0.0, vertices
    # A strip of surface at the distance r from the axis bounds a volume of area r / 2.
    corners = mesh.positions[triangles] - centre
    along = unit(axis)
    middles = corners.mean(axis=1)
    away = lengths_of(middles - np.outer(middles @ along, along))
    volumes = away * lengths_of(area_vectors(mesh.positions, triangles))
    parts = weights[triangles].mean(axis=1)
    lost = 2.0 * parts * (1.0 - parts) * (1.0 - np.cos(_ANGLE))
    total = float(volumes.sum())
    return (float((lost * volumes).sum()) / total if total > 0.0 else 0.0), vertices
