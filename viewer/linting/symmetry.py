"""Checks of left-right symmetry: positions, weights, joints, names and limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.errors import RigError
from viewer.linting._finding import Finding
from viewer.linting._mirror import Mirror, mirror_of, name_partners
from viewer.linting._subject import Subject
from viewer.linting.noise import noisy_sides
from viewer.phrases import agree, counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import reflected
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.retargeting.joint_names import sided_words
from viewer.rigs.retargeting.mirror import asymmetry, joint_partners
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, joint_labels
from viewer.rigs.skin import (
    Skin,
    bind_positions,
    moves_vertices,
    normalized,
    owners,
    row_norms,
    stated_weights,
)

_MOVED = 1e-3  # minimum displacement that is reported as a note, as a fraction of the figure's size
_ASKEW = 1e-2  # minimum visible displacement, as a fraction of the figure's size
_SHIFTED = 0.02  # minimum total difference of a vertex's weights
_UNEQUAL = 0.2
# Without a map, counterparts are found by position. Sides that artists made by mirroring differ at
# single vertices; what they painted differs everywhere.
_APART = 0.1  # minimum difference that counts
_EVERYWHERE = 0.25  # fraction of the vertices above which the sides differ by design
_MOST = 0.6  # minimum fraction of a joint's vertices that differ
_FEW_OFF = 0.4  # maximum fraction of the joints that are off: else the pose is asymmetric
_BLENDS = 0.45  # maximum distance of a weight that blends from 0.5
_FEWEST = 12  # minimum number of vertices of such a joint
_UNLIKE = 0.04  # minimum distance of a joint from the image of its counterpart: ears reach 0.036
_ALIKE = 0.002  # maximum median of these distances: an asymmetric pose has larger ones
_PAIRS = 6  # minimum number of joints with a counterpart
_FEWER = 0.34  # maximum fraction of joints with the wrong name, or with other limits
_SAME_LIMIT = 1e-3  # tolerance of limits, radians
_SIDES = {"left": 1.0, "right": -1.0, "": 0.0}


def check(subject: Subject) -> Iterator[Finding]:
    """Compare both sides of a figure, by its symmetry map or by its shape and names."""
    figure = subject.actor.figure
    if figure.skeleton is not None:
        yield from _limits(subject, figure.skeleton)
    is_whole = not subject.lacks("positions", "weights", "bindings", "joints")
    if figure.mesh is not None and figure.is_attached and is_whole:
        plane = _plane(figure)
        if plane is not None:
            yield from _joints(subject, figure, plane)
            yield from _names(subject, figure, plane)
        mirror = mirror_of(figure)
        if mirror is not None and figure.symmetry is None:
            yield from _sides(subject, figure, mirror)
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
    off = largest_first(off, distances)
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
    off = largest_first(off, differences)
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
    whole = normalized(stated_weights(skin))
    vertices, joints = owners(whole), whole.joints
    # Each influence, and the reflected influence of the counterpart with a minus sign.
    return row_norms(
        skin.n_vertices,
        np.concatenate([vertices, symmetry[vertices]]),
        np.concatenate([joints, partners[joints]]),
        np.concatenate([whole.weights, -whole.weights]),
    )


def _sides(subject: Subject, figure: Figure, mirror: Mirror) -> Iterator[Finding]:
    """Report pairs of joints whose weights differ between the sides of a symmetric mesh."""
    skin, skeleton = figure.require_skin(), figure.require_skeleton()
    own = np.arange(skeleton.n_joints)
    partners = np.where(mirror.joints >= 0, mirror.joints, own).astype(np.int32)
    is_sided = partners != own
    differences = np.where(
        mirror.known, weight_differences(skin, mirror.vertices.astype(np.int32), partners), 0.0
    )
    off = differences > _APART
    # Artists also paint by hand, and paint one side of clothes: what differs everywhere is meant.
    if not off.any() or off.sum() > _EVERYWHERE * mirror.known.sum():
        return
    vertices = owners(skin)
    # Where a joint blends with others: elsewhere both sides have a weight of 1.
    counts = mirror.known[vertices] & (np.abs(skin.weights - 0.5) < _BLENDS)
    total = np.bincount(skin.joints[counts], minlength=skeleton.n_joints)
    changed = np.bincount(skin.joints[counts & off[vertices]], minlength=skeleton.n_joints)
    joints = np.flatnonzero(
        (total >= _FEWEST) & (changed > _MOST * total) & is_sided & ~noisy_sides(figure)
    )
    if len(joints) == 0:
        return
    joints = joints[np.argsort(-changed[joints] / total[joints], kind="stable")]
    moved = np.unique(vertices[counts & off[vertices] & np.isin(skin.joints, joints)])
    moved = largest_first(moved, differences)
    labels = joint_labels(skeleton)
    yield subject.found(
        "Y002.joints: weights of {n} differ from those at the mirrored positions, most for {names} "
        "(worst: total difference {difference} at vertex {vertex})",
        n=counted(len(moved), "vertex"),
        names=listed([labels[joint] for joint in joints]),
        difference=rounded(float(differences[moved[0]])),
        vertex=int(moved[0]),
        vertices=moved,
        joints=joints,
        at=("weights", int(moved[0])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """Plane between the joints of most pairs, whatever the mesh is like."""

    axis: int
    centre: float
    """The axis along which they are apart, and the middle between them."""
    places: Floats
    """(J, 3): the joints in the bind pose."""
    partners: Ints
    """(J,): counterpart of each joint by name."""
    pairs: Bools
    """(J,): joints that have another one as counterpart, if both move vertices."""


def _plane(figure: Figure) -> _Plane | None:
    skin, partners = figure.require_skin(), name_partners(figure.require_skeleton())
    moves = moves_vertices(skin)
    pairs = (partners >= 0) & (partners != np.arange(len(partners))) & moves & moves[partners]
    if pairs.sum() < _PAIRS:
        return None
    places = bind_positions(skin)
    axis = int(np.median(np.abs(places - places[partners])[pairs], axis=0).argmax())
    centre = float(np.median(0.5 * (places + places[partners])[pairs, axis]))
    return _Plane(axis, centre, places, partners, pairs)


def _joints(subject: Subject, figure: Figure, plane: _Plane) -> Iterator[Finding]:
    """Report joints that are not at the mirrored position of their counterpart."""
    size, skeleton, pairs = subject.size(), figure.require_skeleton(), plane.pairs
    images = reflected(plane.places, plane.axis, plane.centre)
    errors = np.linalg.norm(images - plane.places[plane.partners], axis=1)
    off = np.flatnonzero(pairs & (errors > _UNLIKE * size))
    if len(off) == 0 or np.median(errors[pairs]) > _ALIKE * size:
        return
    if len(off) > _FEW_OFF * pairs.sum():
        return  # the skeleton is in another pose than the mesh suggests
    # Of both joints, the one below a parent that is in its place is named.
    off = largest_first(off, errors)
    labels = joint_labels(skeleton)
    yield subject.found(
        "Y003.joints: {n} not at the mirrored position of {their}: {names} (worst: {joint} by "
        "{distance})",
        n=counted(len(off), "joint", "is", "are"),
        their=agree(len(off), "its counterpart", "their counterparts"),
        names=listed([labels[joint] for joint in off]),
        joint=labels[off[0]],
        distance=subject.length(float(errors[off[0]])),
        joints=off,
        at=("bindings", int(off[0])),
    )


def _names(subject: Subject, figure: Figure, plane: _Plane) -> Iterator[Finding]:
    """Report joints named after the other side than most."""
    skeleton = figure.require_skeleton()
    places = plane.places[:, plane.axis] - plane.centre
    sides = np.array([_SIDES[side] for side, _ in sided_words(skeleton.names)])
    signs = np.where(np.abs(places) > _ASKEW * subject.size(), np.sign(places), 0.0) * sides
    usual = np.sign(signs.sum())
    is_beyond = signs * usual < 0.0
    # Hands of crossed arms are beyond the plane, but their parents are named after the same side.
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0 and sides[joint] == sides[parent] and not is_beyond[parent]:
            is_beyond[joint] = False
    wrong = np.flatnonzero(is_beyond)
    if len(wrong) == 0 or len(wrong) > _FEWER * np.count_nonzero(signs):
        return
    labels = joint_labels(skeleton)
    yield subject.found(
        "Y004.names: {n} not on the side that {their}: {names}",
        n=counted(len(wrong), "joint", "is", "are"),
        their=agree(len(wrong), "its name says", "their names say"),
        names=listed([labels[joint] for joint in wrong]),
        joints=wrong,
        part="skeleton",
        at=("joints", int(wrong[0])),
    )


def _limits(subject: Subject, skeleton: Skeleton) -> Iterator[Finding]:
    """Report joints whose rotation limits differ from those of their counterpart."""
    # The axes of both sides may have opposite directions, which swaps and negates the limits, so
    # the larger and the smaller bound of each rotation are compared by their sizes.
    partners = name_partners(skeleton)
    rotations: dict[tuple[int, int], tuple[float, ...]] = {}
    for dof, (joint, kind) in enumerate(
        zip(skeleton.dof_joints.tolist(), skeleton.dof_kinds.tolist(), strict=True)
    ):
        if kind >= FIRST_ROTATION:
            rotations[joint, kind] = tuple(sorted(np.abs(skeleton.dof_limits[dof]).tolist()))
    pairs = [
        (joint, other)
        for joint, other in enumerate(partners.tolist())
        if joint < other and any(key[0] == joint for key in rotations)
    ]
    unlike = []
    for joint, other in pairs:
        mine, theirs = (
            sorted(value for key, value in rotations.items() if key[0] == each)
            for each in (joint, other)
        )
        if len(mine) != len(theirs) or not all(
            np.allclose(a, b, atol=_SAME_LIMIT) for a, b in zip(mine, theirs, strict=True)
        ):
            unlike.append((joint, other))
    if not unlike or len(unlike) > _FEWER * len(pairs):
        return
    labels = joint_labels(skeleton)
    names = [Phrase("{a} and {b}", a=labels[a], b=labels[b]) for a, b in unlike]
    yield subject.found(
        "Y005.limits: limits of {n} differ between the sides: {names}",
        n=counted(len(unlike), "joint pair"),
        names=listed(names),
        part="skeleton",
        joints=np.unique(unlike),
        at=("joints", unlike[0][0]),
    )
