"""End sites of leaf joints, estimated from vertices, boxes, or the parent bone."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.units import METRES

_MOSTLY = 0.5  # minimum weight of a vertex that belongs to a joint
_FEW = 4  # minimum number of vertices for measuring a joint's extent
_TOO_SHORT = 0.1  # fraction of the parent bone: shorter ends are implausible
_HALF = 0.5  # fraction of the parent bone: length of an end without another estimate
_NO_SIZE = 0.1  # metres: length of an end in a skeleton without bones
_DEFAULT_END = 1.0  # length of such an end if the unit is unknown


def end_offsets(figure: Figure, rest: Floats, leaves: Ints) -> Floats:
    """Return the offsets of end sites at rest; none is zero.

    ``figure``: figure with its shape applied.
    ``rest`` (J, 4, 4): joint space to figure space in the rest pose.
    ``leaves`` (L,): joints without children.
    Returns (L, 3): offsets from the joint in figure space.
    """
    skeleton = figure.require_skeleton()
    ends = np.zeros((len(leaves), 3))
    size = float(np.ptp(rest[:, :3, 3], axis=0).max())
    for row, leaf in enumerate(leaves):
        bone = _last_bone(skeleton.parents, rest, int(leaf))
        length = float(np.linalg.norm(bone)) or size or _bare_end(figure.unit)
        if not bone.any():
            bone = np.eye(3)["xyz".index(figure.up)] * length
        ends[row] = _HALF * bone
        known = _by_vertices(figure, rest, int(leaf), bone)
        if known is None and skeleton.boxes is not None:
            known = rest[leaf, :3, :3] @ skeleton.boxes[leaf].sum(axis=0)
        if known is not None and np.linalg.norm(known) > _TOO_SHORT * length:
            ends[row] = known
    return ends


def _bare_end(unit: str) -> float:
    return _NO_SIZE / METRES[unit] if unit in METRES else _DEFAULT_END


def _last_bone(parents: Ints, rest: Floats, joint: int) -> Floats:
    """Return the vector to a joint from its nearest ancestor at a different position."""
    above = int(parents[joint])
    while above >= 0:
        bone = rest[joint, :3, 3] - rest[above, :3, 3]
        if bone.any():
            return bone
        above = int(parents[above])
    return np.zeros(3)


def _by_vertices(figure: Figure, rest: Floats, joint: int, bone: Floats) -> Floats | None:
    """Return the extent of the joint's vertices along the bone."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None:
        return None
    mine = np.flatnonzero((skin.joints == joint) & (skin.weights > _MOSTLY))
    vertices = np.searchsorted(skin.starts, mine, side="right") - 1
    if len(vertices) < _FEW:
        return None
    within = rest[joint] @ skin.inverse_bind[joint]
    places = mesh.positions[vertices] @ within[:3, :3].T + within[:3, 3] - rest[joint, :3, 3]
    direction = bone / np.linalg.norm(bone)
    return direction * max(float((places @ direction).max()), 0.0)
