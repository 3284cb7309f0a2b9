"""Checks of how weights blend along the surface: torn seams and hard borders."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._mirror import name_partners
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import FEWEST, Support, Surface, support_of, surface_of
from viewer.phrases import counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import edges_of, sides_of
from viewer.rigs.mesh import Mesh
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import Skin, merged, normalized, owners, row_norms, skin_rows, stated_weights

_TORN = 0.05  # total difference of weights beyond rounding: a gap of 5 % of what the joints move
_ALL_TORN = 0.5  # fraction of seam vertices above which the parts are separate by design
_RIGID = 0.99  # weight of a vertex that one joint moves
_RING = 8  # minimum number of edges around a limb
# Where two joints change without blending, a third one may still blend in, as the hip at a knee.
_HARD = 0.5  # minimum fraction of hard edges between two joints
# Of 40 rigs of artists, at most 38 % of the borders are hard, and where single ones are, as between
# the joints of fingers or a tail, so are others.
_ALL_HARD = 0.6  # fraction of all border edges above which the whole figure is hard
_OTHERS = 0.01  # fraction of the other border edges up to which a hard border is an exception
_SOFT = 0.3  # fraction of hard edges below which the border of the other side blends
_FEW_BORDERS = 2  # more hard borders are made so, as those of all toes of a spider


def check(subject: Subject) -> Iterator[Finding]:
    """Check the weights of an attached figure on its surface."""
    figure = subject.actor.figure
    if figure.skin is None or figure.mesh is None or figure.skeleton is None:
        return
    if subject.lacks("weights") or figure.mesh.n_triangles == 0:
        return
    surface = surface_of(figure)
    yield from _seams(subject, figure.mesh, figure.skin, surface)
    found = support_of(figure)
    if figure.mesh.n_vertices >= FEWEST and len(found.vertices):
        yield from _hard(subject, figure, found, surface)


def _seams(subject: Subject, mesh: Mesh, skin: Skin, surface: Surface) -> Iterator[Finding]:
    """Report vertices at one place whose weights differ, where the surface goes on across them."""
    copies = np.flatnonzero(surface.place != np.arange(mesh.n_vertices))
    if len(copies) == 0:
        return
    copies = copies[_on_seams(mesh, surface)[copies]]
    whole = normalized(merged(stated_weights(skin)))
    vertices = owners(whole)
    twins = np.zeros(mesh.n_vertices, dtype=np.bool_)
    twins[copies] = True
    rows = np.flatnonzero(twins[vertices])
    # The influences of each copy, and those of its original with a minus sign.
    originals = surface.place[copies]
    twin = skin_rows(whole, originals.astype(np.int32))
    differences = row_norms(
        mesh.n_vertices,
        np.concatenate([vertices[rows], copies[owners(twin)]]),
        np.concatenate([whole.joints[rows], twin.joints]),
        np.concatenate([whole.weights[rows], -twin.weights]),
    )
    # Rigid parts that touch, such as a shield and its badge, move apart by design.
    top = np.zeros(mesh.n_vertices)
    np.maximum.at(top, vertices, whole.weights)
    rigid = (top[copies] > _RIGID) & (top[originals] > _RIGID)
    torn = copies[(differences[copies] > _TORN) & ~rigid]
    if len(torn) == 0 or len(torn) > _ALL_TORN * len(copies):
        return
    torn = largest_first(torn, differences)
    first = int(torn[0])
    yield subject.found(
        "W014.seams: {n} weights that differ from those of a vertex at the same position, so the "
        "seam opens (worst: vertices {vertex} and {other}, a total difference of {difference})",
        n=counted(len(torn), "vertex", "has", "have", of=len(copies)),
        all=len(copies),
        vertex=first,
        other=int(surface.place[first]),
        difference=rounded(float(differences[first]), 2),
        vertices=torn,
        at=("weights", first),
    )


def _on_seams(mesh: Mesh, surface: Surface) -> Bools:
    """Return which vertices end a border edge that continues across coincident vertices: (V,)."""
    corners = mesh.triangles
    is_border = edges_of(corners).counts == 1
    is_seam = is_border & (edges_of(surface.place[corners]).counts == 2)
    result = np.zeros(mesh.n_vertices, dtype=np.bool_)
    result[sides_of(corners).reshape(-1, 2)[is_seam]] = True
    return result


def _hard(subject: Subject, figure: Figure, found: Support, surface: Surface) -> Iterator[Finding]:
    """Report borders between joints at which no weight is blended."""
    count = len(surface.place)
    top, joint = np.zeros(count), np.full(count, -1)
    np.maximum.at(top, found.places, found.place_weights)
    is_top = found.place_weights >= top[found.places]
    joint[found.places[is_top]] = found.place_joints[is_top]
    edges = surface.edges[surface.edges[:, 0] < surface.edges[:, 1]]
    one, other = joint[edges].T
    edges = edges[(one != other) & (one >= 0) & (other >= 0)]
    if len(edges) < _RING:
        return
    pairs = np.sort(joint[edges], axis=1)
    is_hard = (top[edges] > _RIGID).all(axis=1)
    distinct, pair = np.unique(pairs, axis=0, return_inverse=True)
    pair = pair.ravel()
    n_edges, n_hard = np.bincount(pair), np.bincount(pair, is_hard)
    labels = joint_labels(figure.require_skeleton())
    if is_hard.sum() > _ALL_HARD * len(edges):
        yield subject.found(
            "W015.everywhere: weights change from joint to joint without blending at {n}: each "
            "vertex moves with one joint",
            n=counted(int(is_hard.sum()), "edge", of=len(edges)),
            all=len(edges),
            vertices=np.unique(edges[is_hard]),
            at=("weights", int(edges[is_hard][0, 0])),
        )
        return
    parents = figure.require_skeleton().parents
    is_limb = (parents[distinct[:, 0]] == distinct[:, 1]) | (
        parents[distinct[:, 1]] == distinct[:, 0]
    )
    are_hard = is_limb & (n_edges >= _RING) & (n_hard > _HARD * n_edges)
    borders = np.flatnonzero(are_hard)
    others = is_hard.sum() - n_hard[borders].sum()
    if others > _OTHERS * len(edges) or len(borders) > _FEW_BORDERS:
        # Where hard borders are usual, those of one side are not meant if the other side blends.
        borders = np.flatnonzero(are_hard & _blends_opposite(figure, distinct, n_hard / n_edges))
    if len(borders) == 0:
        return
    names = [Phrase("{a} and {b}", a=labels[a], b=labels[b]) for a, b in distinct[borders]]
    on = np.isin(pair, borders) & is_hard
    yield subject.found(
        "W015.border: weights change from one joint to the other without blending between {names}",
        names=listed(names),
        vertices=np.unique(edges[on]),
        joints=np.unique(distinct[borders]),
        at=("weights", int(edges[on][0, 0])),
    )


def _blends_opposite(figure: Figure, pairs: Indices, fractions: Floats) -> Bools:
    """Return which pairs of joints (P, 2) have counterparts with few hard edges: (P,).

    ``fractions``: (P,), of the edges between the joints that are hard.
    """
    partners = name_partners(figure.require_skeleton())
    known = {(a, b): float(part) for (a, b), part in zip(pairs.tolist(), fractions, strict=True)}
    result = np.zeros(len(pairs), dtype=np.bool_)
    for row, pair in enumerate(pairs.tolist()):
        a, b = sorted(int(partners[joint]) for joint in pair)
        result[row] = a >= 0 and (a, b) != tuple(pair) and known.get((a, b), 1.0) < _SOFT
    return result
