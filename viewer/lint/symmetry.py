"""Checks of left-right symmetry, for figures with a symmetry map: positions and weights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.errors import RigError
from viewer.lint._finding import Finding
from viewer.lint._subject import Subject
from viewer.phrases import agree, counted, rounded
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh, bounding_box, box_size
from viewer.rig.retargeting.mirror import asymmetry, joint_partners
from viewer.rig.skin import Skin, normalized, owners, row_norms

_MOVED = 1e-3  # minimum displacement that is reported as a note, as a fraction of the figure's size
_ASKEW = 1e-2  # minimum visible displacement, as a fraction of the figure's size
_SHIFTED = 0.02  # minimum total difference of a vertex's weights
_UNEQUAL = 0.2


def check(subject: Subject) -> Iterator[Finding]:
    """Compare both sides of a figure with a symmetry map."""
    figure = subject.actor.figure
    if figure.symmetry is None or figure.mesh is None:
        return
    yield from _positions(subject, figure, figure.mesh)
    if figure.skin is None or figure.skeleton is None:
        return
    try:
        partners = joint_partners(figure)
    except RigError:
        return  # without joint pairs, weights cannot be compared
    known = _known(subject, figure, "weights")
    yield from _weights(subject, figure.skin, figure.symmetry, partners, known)


def _known(subject: Subject, figure: Figure, part: str) -> Bools:
    """Return the vertices that can be compared, which are valid with their counterparts: (V,)."""
    assert figure.symmetry is not None  # checked by the caller
    valid = subject.valid(part, len(figure.symmetry))
    known: Bools = valid & valid[figure.symmetry]
    return known


def _positions(subject: Subject, figure: Figure, mesh: Mesh) -> Iterator[Finding]:
    distances = np.where(_known(subject, figure, "positions"), asymmetry(figure), 0.0)
    size = box_size(bounding_box(mesh.positions))
    off = np.flatnonzero(distances > _MOVED * size)
    if len(off) == 0:
        return
    off = off[np.argsort(-distances[off], kind="stable")]
    worst = int(off[0])
    yield subject.found(
        "Y001.positions: {n} (worst: {distance} at vertex {vertex})",
        n=counted(
            len(off),
            "vertex",
            "is not at the mirrored position of its counterpart",
            "are not at the mirrored positions of their counterparts",
        ),
        distance=subject.length(float(distances[worst])),
        vertex=worst,
        severity="warning" if distances[worst] > _ASKEW * size else "note",
        vertices=off,
        at=("positions", worst),
    )


def _weights(
    subject: Subject, skin: Skin, symmetry: Ints, partners: Ints, known: Bools
) -> Iterator[Finding]:
    differences = np.where(known, weight_differences(skin, symmetry, partners), 0.0)
    off = np.flatnonzero(differences > _SHIFTED)
    if len(off) == 0:
        return
    off = off[np.argsort(-differences[off], kind="stable")]
    worst = int(off[0])
    yield subject.found(
        "Y002.weights: weights of {n} differ from those of {their} (worst: total "
        "difference {difference} at vertex {vertex})",
        n=counted(len(off), "vertex"),
        difference=rounded(float(differences[worst])),
        vertex=worst,
        severity="warning" if differences[worst] > _UNEQUAL else "note",
        vertices=off,
        at=("weights", worst),
        their=agree(len(off), "its mirror counterpart", "their mirror counterparts"),
    )


def weight_differences(skin: Skin, symmetry: Ints, partners: Ints) -> Floats:
    """Return sum over joints of |w(v, j) - w(v', j')| for mirror counterparts v', j': (V,)."""
    whole = normalized(skin)
    vertices, joints = owners(whole), whole.joints
    # Each influence, and the reflected influence of the counterpart with a minus sign.
    return row_norms(
        skin.n_vertices,
        np.concatenate([vertices, symmetry[vertices]]),
        np.concatenate([joints, partners[joints]]),
        np.concatenate([whole.weights, -whole.weights]),
    )
