"""Proportions of a figure: limbs scaled by one factor along their axes and one across them.

A joint's limb is the part of the body after it. Its vertices are moved, in the bind pose, by
S_j (x - c_j) + c'_j, blended with the skin's weights; S_j = g_j I + (l_j - g_j) d_j d_j^T with
the length l_j along the limb's axis d_j and the girth g_j across it. The joints below follow:
c'_k = c'_j + S_j (c_k - c_j).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.retargeting.mirror import joint_partners
from viewer.rigs.skin import Skin, owners, weight_sums
from viewer.rigs.skinning.lbs import move


@dataclass(frozen=True, slots=True, eq=False)
class Limbs:
    """The part of the mesh that each joint moves."""

    weights: Floats
    """(V, J). Weights of the skin, normalised to a sum of 1 per vertex."""
    fractions: Floats
    """(V, J). Sums of the weights of a joint and all below it."""
    axes: Floats
    """(J, 3). Unit vectors along the limbs, in the bind pose; 0 for a joint without influence."""
    partners: Ints
    """(J,). Mirror counterpart of each joint, or the joint itself."""


def limbs_of(figure: Figure) -> Limbs:
    """Return a figure's limbs."""
    mesh, skeleton, skin = figure.attached()
    parents = skeleton.parents
    weights = np.zeros((skin.n_vertices, skin.n_joints))
    np.add.at(weights, (owners(skin), skin.joints), skin.weights)
    sums = weight_sums(skin)
    weights /= np.where(sums > 0.0, sums, 1.0)[:, None]
    fractions = weights.copy()
    for joint in range(len(parents) - 1, -1, -1):
        # Children come after their parents, so this joint's own sum is already final.
        if parents[joint] >= 0:
            fractions[:, parents[joint]] += fractions[:, joint]
    # An axis points from the joint to those below it, each weighted by its fraction of the mesh,
    # or, for a leaf joint, to the mean of its vertices.
    joints = _bound_joints(skin)
    ways = np.zeros_like(joints)
    below = np.flatnonzero(parents >= 0)
    transferred = fractions.sum(axis=0)
    steps = transferred[below, None] * (joints[below] - joints[parents[below]])
    np.add.at(ways, parents[below], steps)
    last = np.setdiff1d(np.arange(len(parents)), parents[below])
    ways[last] = weights[:, last].T @ mesh.positions - transferred[last, None] * joints[last]
    try:
        partners = joint_partners(figure)
    except RigError:
        # The figure is not symmetric, so there is no symmetry to preserve.
        partners = np.arange(len(parents), dtype=np.int32)
    return Limbs(weights, fractions, unit(ways), partners)


def resized(figure: Figure, limbs: Limbs, lengths: Floats, girths: Floats) -> Figure:
    """Return a figure with limbs (J,) scaled along and across: mesh, bind pose, rest skeleton."""
    mesh, skeleton, skin = figure.attached()
    scales = girths[:, None, None] * np.eye(3) + (lengths - girths)[:, None, None] * np.einsum(
        "ja,jb->jab", limbs.axes, limbs.axes
    )
    joints, parents = _bound_joints(skin), skeleton.parents
    below = np.flatnonzero(parents >= 0)
    moved = joints.copy()
    for joint in below.tolist():
        # Parents come first, so the parent's position is already final.
        parent = parents[joint]
        moved[joint] = moved[parent] + scales[parent] @ (joints[joint] - joints[parent])
    palette = np.tile(np.eye(4), (len(parents), 1, 1))
    palette[:, :3, :3] = scales
    palette[:, :3, 3] = moved - np.einsum("jab,jb->ja", scales, joints)
    positions = move(mesh.positions, skin, palette)[0]
    bind = np.asarray(np.linalg.inv(skin.inverse_bind), dtype=np.float64)
    bind[:, :3, 3] = moved
    longer = (moved - joints)[below] - (moved - joints)[parents[below]]
    rest = skeleton.rest_translations.copy()
    rest[below] += np.linalg.solve(bind[parents[below], :3, :3], longer[..., None])[..., 0]
    inverse_bind = np.asarray(np.linalg.inv(bind), dtype=np.float64)
    return replace(
        figure,
        mesh=replace(mesh, positions=positions, normals=vertex_normals(positions, mesh.triangles)),
        skeleton=replace(skeleton, rest_translations=rest),
        skin=replace(skin, inverse_bind=inverse_bind),
    )


def _bound_joints(skin: Skin) -> Floats:
    joints: Floats = np.asarray(np.linalg.inv(skin.inverse_bind), dtype=np.float64)[:, :3, 3]
    return joints
