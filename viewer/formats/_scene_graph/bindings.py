"""Inverse bind matrices: one per joint, for all skins and rigid meshes of a figure.

A figure has one inverse bind matrix per joint, but each skin of a file has separate ones, and
meshes attached to a node have none. Their vertices are transformed into one binding space by a
matrix A with IBM_s[j] = IBM[j] A for all joints j of skin s. Joints without such an A are bound a
second time, through an auxiliary joint. Binding space is the space of the scene: A of the first
skin undoes quantisation, and the units and axes of the mesh.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.content import NodeSkin
from viewer.formats._scene_graph.joints import Joints
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.transform import affine_matrices

# float32 rounding of the entries of a product of two matrices, relative to the largest
_SAME = 1e-6

# Matrices with a worse condition are not inverted, because baking would lose too many digits.
_WORST_CONDITION = 1e5
_MOST_CANDIDATES = 8

# If the first A is closer to the identity, the vertices keep the file's coordinates.
_NEARLY_SCENE = 1e-3


@dataclass(slots=True, eq=False)
class Bindings:
    """The bindings of a figure so far."""

    joints: Joints
    """The figure's joints; auxiliary ones are appended."""
    worlds: Floats
    """Rest transforms of the nodes' joints: (J, 4, 4)."""
    matrices: dict[int, Floats] = field(default_factory=dict)
    """Inverse bind matrix of each bound joint: (4, 4)."""
    slots: dict[int, Ints] = field(default_factory=dict)
    """Joint of each slot of a skin: (M,) int32."""
    baked: dict[int, Floats] = field(default_factory=dict)
    """A of each skin, (4, 4): mesh space to binding space."""
    rigid: dict[int, tuple[int, Floats]] = field(default_factory=dict)
    """Joint of each node with an attached mesh, and its A."""


def bind_skins(joints: Joints, worlds: Floats, skins: dict[int, NodeSkin]) -> Bindings:
    """Bind skins in the space of the first; joints are added where the skins disagree."""
    bindings = Bindings(joints, worlds)
    for index, skin in skins.items():
        slots = np.array([joints.carrier[node] for node in skin.joints.tolist()], dtype=np.int32)
        baked, reach = _baked(bindings, skin.inverse_bind, slots), _reach(skin.inverse_bind)
        wanted = skin.inverse_bind
        if not np.array_equal(baked, np.eye(4)):
            wanted = wanted @ _inverse(baked)
        for place, joint in enumerate(slots.tolist()):
            known = bindings.matrices.get(joint)
            if known is None:
                bindings.matrices[joint] = wanted[place]
            elif not _agree(known @ baked, skin.inverse_bind[place], reach):
                slots[place] = extra = joints.add_auxiliary(joint)
                bindings.matrices[extra] = wanted[place]
        bindings.slots[index], bindings.baked[index] = slots, baked
    return bindings


def _baked(bindings: Bindings, inverse_bind: Floats, slots: Ints) -> Floats:
    """Return the matrix A on which most of a skin's joints agree, or the identity."""
    known = bindings.matrices
    if not known:
        order = np.argsort(slots)
        return _rest_space((bindings.worlds[slots] @ inverse_bind)[order])
    pairs = [
        (known[joint], inverse_bind[place])
        for place, joint in enumerate(slots.tolist())
        if joint in known
    ]
    if not pairs:
        return _baked_at_rest(bindings, inverse_bind, slots)
    # A few candidates are enough: skins differ by one matrix, or only in a few joints.
    some = pairs[:: max(1, len(pairs) // _MOST_CANDIDATES)]
    candidates = [quotient for pair in some if (quotient := _quotient(*pair)) is not None]
    candidates = [np.eye(4), *(each for each in candidates if _is_regular(each))]
    reach = _reach(inverse_bind)
    counts = [sum(_agree(one @ each, other, reach) for one, other in pairs) for each in candidates]
    return candidates[int(np.argmax(counts))]


def _rest_space(rests: Floats) -> Floats:
    """Return the matrix (4, 4) with which the first skin places its meshes at rest."""
    # The skinning matrices (M, 4, 4) are equal if the rest pose is the bind pose. Otherwise the
    # first that equals another one is the space, as helpers above the hips may have any matrix.
    regular = rests[_is_regular(rests)]
    if not len(regular):
        return np.eye(4)
    some = regular[:_MOST_CANDIDATES]
    limits = _SAME * np.abs(some).max(axis=(1, 2))[:, None] + np.zeros(len(regular))
    equal = np.abs(some[:, None] - regular[None]).max(axis=(2, 3)) <= limits
    found: Floats = some[int((equal.sum(axis=1) > 1).argmax())]
    is_near = np.abs(found - np.eye(4)).max() <= _NEARLY_SCENE
    return np.eye(4) if is_near else found


def _baked_at_rest(bindings: Bindings, inverse_bind: Floats, slots: Ints) -> Floats:
    """Return A of a skin that shares no bound joint: the skins are compared in the rest pose."""
    first = next(iter(bindings.matrices))
    space = _inverse_or_none(bindings.worlds[first] @ bindings.matrices[first])
    rests = bindings.worlds[slots] @ inverse_bind
    reach = _reach(rests)
    if space is None or not all(_agree(rests[0], rest, reach) for rest in rests):
        return np.eye(4)
    baked = space @ rests[0]
    is_usable = _is_regular(baked) and not _agree(baked, np.eye(4), reach)
    return baked if is_usable else np.eye(4)


def _quotient(known: Floats, wanted: Floats) -> Floats | None:
    """Return A with IBM[j] A = IBM_s[j]; None if IBM[j] is singular."""
    inverse = _inverse_or_none(known)
    return None if inverse is None else inverse @ wanted


def bind_rigid(bindings: Bindings, nodes: list[int]) -> None:
    """Bind the meshes attached to nodes, in binding space if the matrices can be inverted."""
    if not nodes:
        return
    above = _bound_ancestors(bindings)
    for node in nodes:
        joint = bindings.joints.carrier[node]
        baked = _rigid_matrix(bindings, joint, above[joint])
        if baked is None:
            joint, baked = bindings.joints.add_auxiliary(joint), np.eye(4)
            bindings.matrices[joint] = np.eye(4)
        bindings.rigid[node] = joint, baked


def _rigid_matrix(bindings: Bindings, joint: int, above: int) -> Floats | None:
    """Bind the joint of a rigid mesh and return its A; None if a matrix is singular."""
    known = bindings.matrices.get(joint)
    if known is not None:
        return _inverse_or_none(known)
    # In the rest pose, the nearest bound ancestor places the mesh.
    baked = bindings.worlds[joint]
    if above >= 0:
        space = _inverse_or_none(bindings.worlds[above] @ bindings.matrices[above])
        baked = baked if space is None else space @ baked
    matrix = _inverse_or_none(baked)
    if matrix is None:
        return None
    bindings.matrices[joint] = matrix
    return baked


def _bound_ancestors(bindings: Bindings) -> list[int]:
    """Return the nearest bound ancestor of each joint, or the first bound joint, or -1."""
    first = next(iter(bindings.matrices), -1)
    above: list[int] = []
    for joint, parent in enumerate(bindings.joints.parents):
        inherited = above[parent] if parent >= 0 else first
        above.append(joint if joint in bindings.matrices else inherited)
    return above


def inverse_binds(bindings: Bindings) -> Floats:
    """Return every inverse bind matrix (J, 4, 4); joints without influence are bound at rest."""
    # Auxiliary joints coincide with their parents.
    parents = list(range(len(bindings.worlds)))
    for parent in bindings.joints.parents[len(parents) :]:
        parents.append(parents[parent])
    worlds = bindings.worlds[parents]
    above = np.array(_bound_ancestors(bindings))
    result = np.tile(np.eye(4), (len(worlds), 1, 1))
    for joint, matrix in bindings.matrices.items():
        result[joint] = matrix
    spaces = np.where(above[:, None, None] >= 0, worlds[above] @ result[above], np.eye(4))
    free = np.ones(len(worlds), dtype=np.bool_)
    free[list(bindings.matrices)] = False
    # A joint whose rest matrix is singular keeps the identity.
    free &= _is_regular(worlds)
    result[free] = _inverse(worlds[free]) @ spaces[free]
    return result


def _agree(one: Floats, other: Floats, reach: float) -> bool:
    """Return whether two matrices agree within float32 rounding of translations up to ``reach``."""
    linear, moved = np.abs(one - other)[:3, :3].max(), np.abs(one - other)[:3, 3].max()
    return bool(linear <= _SAME * np.abs(one[:3, :3]).max() and moved <= _SAME * reach)


def _reach(matrices: Floats) -> float:
    """Return the largest component of the translations of some matrices."""
    return float(np.abs(matrices[:, :3, 3]).max(initial=0.0))


def _inverse(matrices: Floats) -> Floats:
    """Return the inverses of affine matrices, with exact last rows: (..., 4, 4)."""
    linear = np.asarray(np.linalg.inv(matrices[..., :3, :3]), dtype=np.float64)
    return affine_matrices(linear, (-linear @ matrices[..., :3, 3:])[..., 0])


def _is_regular(matrices: Floats) -> Bools:
    """Return whether affine matrices can be inverted without losing many digits."""
    scales = np.linalg.svd(matrices[..., :3, :3], compute_uv=False)
    regular: Bools = scales[..., 0] < _WORST_CONDITION * scales[..., 2]
    return regular


def _inverse_or_none(matrix: Floats) -> Floats | None:
    """Return the inverse of an affine matrix; None if it is singular or nearly so."""
    return _inverse(matrix) if _is_regular(matrix) else None
