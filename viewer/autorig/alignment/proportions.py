"""Proportions of a figure: limbs scaled along their axes and in two directions across them.

A joint's limb is the part of the body after it. Its vertices are moved, in the bind pose, by
S_j (x - c_j) + c'_j, blended with the skin's weights; S_j = h_j I + (l_j - h_j) d_j d_j^T +
(g_j - h_j) s_j s_j^T with the length l_j along the limb's axis d_j, the girth g_j along an axis s_j
across it, and the girth h_j along the third axis: chests are wide or deep. The joints below follow:
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
    sides: Floats
    """(J, 3). Unit vectors across the limbs, near an axis of the figure; 0 where ``axes`` are."""
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
    axes = unit(ways)
    return Limbs(weights, fractions, axes, _sides(axes, partners), partners)


def _sides(axes: Floats, partners: Ints) -> Floats:
    """Return a unit vector across each limb, mirrored for mirrored limbs: (J, 3)."""
    # Figures are built along the axes of their frame, so trunks are wide and deep along these. The
    # one most across both limbs of a pair serves both, whatever rounding made of their symmetry.
    chosen = np.eye(3)[(np.abs(axes) + np.abs(axes[partners])).argmin(axis=1)]
    across = chosen - np.einsum("ja,ja->j", chosen, axes)[:, None] * axes
    return unit(np.where(axes.any(axis=1, keepdims=True), across, 0.0))


def resized(
    figure: Figure, limbs: Limbs, lengths: Floats, girths: Floats, others: Floats | None = None
) -> Figure:
    """Return a figure with limbs (J,) scaled along and across: mesh, bind pose, rest skeleton.

    ``others``: the girths along the third axes, by default those along ``Limbs.sides``.
    """
    mesh, skeleton, skin = figure.attached()
    third = girths if others is None else others
    scales = third[:, None, None] * np.eye(3)
    for factors, axes in ((lengths, limbs.axes), (girths, limbs.sides)):
        scales += (factors - third)[:, None, None] * np.einsum("ja,jb->jab", axes, axes)
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
