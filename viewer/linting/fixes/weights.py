"""Fixes of weights: sums, signs, strays, exchanged joints, torn seams, noise and hard borders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.linting._finding import Finding
from viewer.linting._mirror import mirror_of
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import Surface, surface_of
from viewer.linting.stray_weights import misplaced_weights
from viewer.phrases import counted, rounded
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.topology import components
from viewer.rigs.skin import (
    Skin,
    has_influence,
    merged,
    normalized,
    owners,
    row_norms,
    skin_from_entries,
    skin_rows,
)

# Steps towards the mean of the neighbours in one round; more would blur what is not noise. A step
# back of about the same size (Taubin 1995) leaves smooth weights alone: noise that
# alternates is halved and grows to 0.77, but what differs by a tenth of that from the mean of its
# neighbours changes by 0.95 and 1.05, so not at all.
_BLUR, _DENOISE = (0.5,), (0.5, -0.53)
_RINGS = 3  # edges from a hard border within which it is smoothed
_SMALL = 1e-3  # weights below which smoothing ends, so that influences do not spread everywhere
_CHANGED = 1e-6  # smallest change of a vertex's weights that counts
_TOGETHER = 256  # vertices whose distances from others are computed together


def fix(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Replace the skin of the actor's figure; None if nothing changes."""
    figure = subject.actor.figure
    old = figure.skin
    if old is None or figure.mesh is None:
        return None
    new = _repaired(subject, old, finding)
    if new is None:
        return None
    if finding.code == "W009":
        subject.actor.figure = replace(figure, skin=new)
        return note(
            "X007.duplicates: {figure}: W009 fixed: duplicate influences of {n} merged",
            figure=subject.actor.name,
            n=counted(len(finding.vertices), "vertex"),
        )
    # Sums that the file rounded are no change of the others' weights.
    before, new = (old, new) if finding.code == "W001" else (normalized(old), normalized(new))
    changes = row_norms(
        old.n_vertices,
        np.concatenate([owners(before), owners(new)]),
        np.concatenate([before.joints, new.joints]),
        np.concatenate([before.weights, -new.weights]),
    )
    is_changed = changes > _CHANGED
    changed = np.flatnonzero(is_changed)
    if len(changed) == 0:
        return None
    subject.actor.figure = replace(figure, skin=_spliced(old, new, is_changed))
    return note(
        "X007.weights: {figure}: {code} fixed: weights of {n} changed by up to {most} in total "
        "(vertex {vertex})",
        figure=subject.actor.name,
        code=finding.code,
        n=counted(len(changed), "vertex"),
        most=rounded(float(changes.max()), 2),
        vertex=int(changes.argmax()),
    )


def _spliced(old: Skin, new: Skin, is_changed: Bools) -> Skin:
    """Return a skin with the new weights of some vertices (V,) and the old ones of all others."""
    parts = [(old, ~is_changed[owners(old)]), (new, is_changed[owners(new)])]
    found = skin_from_entries(
        old.n_vertices,
        np.concatenate([owners(skin)[rows] for skin, rows in parts]),
        np.concatenate([skin.joints[rows] for skin, rows in parts]),
        np.concatenate([skin.weights[rows] for skin, rows in parts]),
        old.inverse_bind,
    )
    return replace(found, dqs_fractions=old.dqs_fractions, unweighted=new.unweighted)


def _repaired(subject: Subject, skin: Skin, finding: Finding) -> Skin | None:
    code, surface = finding.code, surface_of(subject.actor.figure)
    vertices = finding.vertices.astype(np.int64)
    if code == "W001":
        return normalized(skin)
    if code == "W002":
        return normalized(replace(skin, weights=np.maximum(skin.weights, 0.0)))
    if code == "W009":
        return merged(skin)
    if code == "W004":
        return _from_neighbours(subject, skin, surface, vertices)
    if code == "W014":
        return _rejoined(skin, surface, vertices)
    if code == "W016":
        return _smoothed(_mirrored(subject, skin, surface, vertices), surface, vertices, _DENOISE)
    if code == "W015":
        if finding.diagnostic.key != "W015.border":
            return None  # a rig whose parts are all rigid is made so
        return _smoothed(skin, surface, _around(surface, vertices), _BLUR)
    misplaced = misplaced_weights(subject)
    if misplaced is None:
        return None
    if code == "W013":
        other = np.arange(skin.n_joints)
        other[misplaced.swapped[:, 0]] = misplaced.swapped[:, 1]
        return replace(skin, joints=other[skin.joints].astype(np.int32))
    if finding.diagnostic.key == "W012.taken":
        joints = skin.joints.astype(np.int64)
        keys = owners(skin).astype(np.int64) * skin.n_joints + joints
        for one in misplaced.taken:
            taken = misplaced.found.vertices[one.rows] * skin.n_joints + one.taker
            joints[np.isin(keys, taken)] = one.joint
        return replace(skin, joints=joints.astype(np.int32))
    if code == "W012":
        islands = components(len(surface.place), surface.edges)[surface.place]
        vertices = np.unique(misplaced.found.vertices[misplaced.islands])
        return _from_nearest(subject, skin, vertices, islands[vertices])
    # Stray weights are removed; what is left is normalised.
    rows, found = misplaced.strays, misplaced.found
    keys = owners(skin).astype(np.int64) * skin.n_joints + skin.joints
    strays = np.isin(keys, found.vertices[rows] * skin.n_joints + found.joints[rows])
    kept = replace(skin, weights=np.where(strays, 0.0, skin.weights))
    bare = np.flatnonzero(~has_influence(kept) & has_influence(skin))
    return _from_neighbours(subject, normalized(kept), surface, bare)


def _from_neighbours(subject: Subject, skin: Skin, surface: Surface, vertices: Indices) -> Skin:
    """Give vertices the mean weights of their neighbours, or those of the nearest vertex."""
    given = has_influence(skin)
    given[vertices] = False
    wanted = np.zeros(len(surface.place), dtype=np.bool_)
    wanted[surface.place[vertices]] = True
    edges = surface.edges[wanted[surface.edges[:, 0]]]
    edges = edges[given[edges[:, 1]]]
    if len(edges):
        rows = skin_rows(skin, edges[:, 1].astype(np.int32))
        has_some = np.zeros(len(surface.place), dtype=np.bool_)
        has_some[edges[:, 0]] = True
        moving = has_some[surface.place]
        skin = _with_rows(skin, surface, moving, edges[owners(rows), 0], rows.joints, rows.weights)
        vertices = vertices[~has_some[surface.place[vertices]]]
    return _from_nearest(subject, skin, vertices)


def _from_nearest(
    subject: Subject, skin: Skin, vertices: Indices, groups: Indices | None = None
) -> Skin:
    """Give vertices the weights of the nearest vertex that has some and is not one of them.

    ``groups``: (N,), numbers of those that move together, with the vertex nearest to any of them.
    """
    if len(vertices) == 0:
        return skin
    points = subject.actor.figure.require_mesh().positions
    given = has_influence(skin)
    given[vertices] = False
    # Vertices at the same positions must not tear: they take the weights of the same vertex.
    sources, rows = np.flatnonzero(given), np.arange(skin.n_vertices)
    if len(sources) == 0:
        return skin
    nearest = np.empty(len(vertices))
    for start in range(0, len(vertices), _TOGETHER):
        some = vertices[start : start + _TOGETHER]
        squares = (points[sources] ** 2).sum(axis=1) - 2.0 * points[some] @ points[sources].T
        rows[some] = sources[squares.argmin(axis=1)]
        nearest[start : start + _TOGETHER] = squares.min(axis=1) + (points[some] ** 2).sum(axis=1)
    if groups is not None:  # a rigid part stays rigid
        order = np.lexsort((nearest, groups))
        _, first, part = np.unique(groups[order], return_index=True, return_inverse=True)
        rows[vertices[order]] = rows[vertices[order[first]]][part]
    return skin_rows(skin, rows.astype(np.int32))


def _rejoined(skin: Skin, surface: Surface, vertices: Indices) -> Skin:
    """Give all vertices at a place the weights of that which differs least from its neighbours."""
    places = np.unique(surface.place[vertices])
    copies = np.flatnonzero(np.isin(surface.place, places))
    edges = surface.edges[np.isin(surface.edges[:, 0], places)]
    used = np.unique(np.concatenate([copies, edges[:, 1]]))
    rows = skin_rows(normalized(skin), used.astype(np.int32))
    table = np.zeros((len(used), skin.n_joints))
    np.add.at(table, (owners(rows), rows.joints), rows.weights)
    start, place = (np.searchsorted(places, k) for k in (edges[:, 0], surface.place[copies]))
    means = np.zeros((len(places), skin.n_joints))
    np.add.at(means, start, table[np.searchsorted(used, edges[:, 1])])
    means /= np.maximum(np.bincount(start, minlength=len(places)), 1)[:, None]
    errors = np.abs(table[np.searchsorted(used, copies)] - means[place]).sum(axis=1)
    order = np.lexsort((errors, place))
    _, first = np.unique(place[order], return_index=True)
    sources = np.arange(skin.n_vertices, dtype=np.int32)
    sources[copies] = copies[order[first]][place]
    return skin_rows(skin, sources)


def _with_rows(
    skin: Skin,
    surface: Surface,
    changed: Bools,
    places: Indices,
    joints: Indices | Ints,
    weights: Floats,
) -> Skin:
    """Replace the weights of vertices (V,) by sums of entries (N,) of their places, normalised."""
    entries = places.astype(np.int32), joints.astype(np.int32), weights
    sums = merged(skin_from_entries(skin.n_vertices, *entries, skin.inverse_bind))
    where = np.flatnonzero(changed)
    rows = skin_rows(sums, surface.place[where].astype(np.int32))
    kept = ~changed[owners(skin)]
    found = skin_from_entries(
        skin.n_vertices,
        np.concatenate([owners(skin)[kept], where[owners(rows)]]),
        np.concatenate([skin.joints[kept], rows.joints]),
        np.concatenate([skin.weights[kept], rows.weights]),
        skin.inverse_bind,
    )
    unweighted = None if skin.unweighted is None else skin.unweighted & ~changed
    return normalized(replace(found, dqs_fractions=skin.dqs_fractions, unweighted=unweighted))


def _around(surface: Surface, vertices: Indices) -> Indices:
    """Return the places within a few edges of some vertices."""
    near = np.zeros(len(surface.place), dtype=np.bool_)
    near[surface.place[vertices]] = True
    for _ in range(_RINGS):
        near[surface.edges[near[surface.edges[:, 0]], 1]] = True
    return np.flatnonzero(near)


def _mirrored(subject: Subject, skin: Skin, surface: Surface, vertices: Indices) -> Skin:
    """Average the weights of places with those at the mirrored places of a symmetric mesh."""
    # Otherwise the noise, smoothed, would remain as a difference of the sides.
    mirror = mirror_of(subject.actor.figure)
    if mirror is None:
        return skin
    whole = normalized(merged(skin))
    places = np.unique(surface.place[vertices])
    places = np.unique(np.concatenate([places, surface.place[mirror.vertices[places]]]))
    places = places[mirror.known[places]]
    partners = np.where(mirror.joints >= 0, mirror.joints, np.arange(skin.n_joints))
    own = skin_rows(whole, places.astype(np.int32))
    other = skin_rows(whole, mirror.vertices[places].astype(np.int32))
    moving = np.zeros(len(surface.place), dtype=np.bool_)
    moving[places] = True
    return _with_rows(
        whole,
        surface,
        moving[surface.place],
        np.concatenate([places[owners(own)], places[owners(other)]]),
        np.concatenate([own.joints, partners[other.joints]]),
        np.concatenate([own.weights, other.weights]),
    )


def _smoothed(skin: Skin, surface: Surface, vertices: Indices, factors: tuple[float, ...]) -> Skin:
    """Move the weights of places towards the mean of their neighbours, w <- w + f (mean - w)."""
    whole = normalized(merged(skin))
    is_place = np.zeros(len(surface.place), dtype=np.bool_)
    is_place[surface.place[vertices]] = True
    moving = is_place[surface.place]
    edges = surface.edges[is_place[surface.edges[:, 0]]]
    near = np.unique(np.concatenate([np.flatnonzero(is_place), edges[:, 1]]))
    first = surface.place[near] == near
    near = near[first]
    # Only the joints that move these places need columns.
    index = np.full(len(surface.place), -1)
    index[near] = np.arange(len(near))
    rows = index[owners(whole)]
    used, column = np.unique(whole.joints[rows >= 0], return_inverse=True)
    weights = np.zeros((len(near), len(used)))
    weights[rows[rows >= 0], column] = whole.weights[rows >= 0]
    start, end = index[edges[:, 0]], index[edges[:, 1]]
    degree = np.bincount(start, minlength=len(near))
    inner = np.flatnonzero(degree > 0)
    for factor in factors:
        sums = np.zeros_like(weights)
        np.add.at(sums, start, weights[end])
        weights[inner] += factor * (sums[inner] / degree[inner, None] - weights[inner])
    weights[weights < _SMALL] = 0.0
    place, joint = np.nonzero(weights)
    found = near[place], used[joint].astype(np.int64), weights[place, joint]
    return _with_rows(whole, surface, moving, *found)
