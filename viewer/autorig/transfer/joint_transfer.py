"""Transfer of joints to another mesh: each joint moves with the surface around it."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.blendshapes import JointRegressor
from viewer.rigs.geometry.closest_point import Surface
from viewer.rigs.geometry.samples import triangle_normals
from viewer.rigs.skin import Skin, owners

_ENOUGH = 0.5  # minimum fraction of a joint's weights that are matched
_SAME_WAY = 0.5  # minimum cosine of the angle between the surfaces, 60 degrees
_INSIDE = 0.5  # winding number that separates outside from inside
_BLOCK = 1 << 20  # point-triangle pairs per batch, about 200 bytes each


@dataclass(frozen=True, slots=True, eq=False)
class TransferredJoints:
    """Joint positions in the target's frame."""

    positions: Floats
    """(J, 3). Positions in the pose of the target."""
    transferred: Bools
    """(J,) bool. Joints moved by the surface around them; the others moved with their parents."""
    measurable: Bools
    """(J,) bool. Joints with a non-empty row in the regressor."""


def surface_shifts(
    positions: Floats,
    normals: Floats,
    target_positions: Floats,
    target_triangles: Ints,
    max_distance: float,
) -> tuple[Floats, Bools]:
    """Return vectors (V, 3) to the closest points of a target, and which are reliable (V,)."""
    found = Surface(target_positions, target_triangles).closest(positions)
    facing = triangle_normals(target_positions, target_triangles)[found.triangles]
    cosines = np.abs(np.einsum("va,va->v", facing, normals))
    matched = (found.distances <= max_distance) & (cosines >= _SAME_WAY)
    return found.positions - positions, matched


def boundary_weights(skin: Skin, parents: Ints) -> JointRegressor:
    """Return a regressor b_v = w_vj w_v,parent of vertices with both joints; rows may be empty."""
    # A root uses the boundary with its children. Rows are not normalised.
    count = skin.n_joints
    keys = owners(skin).astype(np.int64) * count + skin.joints
    unique, inverse = np.unique(keys, return_inverse=True)
    weights = np.bincount(inverse.reshape(-1), skin.weights, minlength=len(unique))
    vertices, joints = unique // count, unique % count
    above = parents[joints]
    wanted = vertices * count + np.maximum(above, 0)
    place = np.minimum(np.searchsorted(unique, wanted), max(len(unique) - 1, 0))
    shared = (above >= 0) & (unique[place] == wanted) if len(unique) else np.zeros(0, np.bool_)
    product = weights[shared] * weights[place[shared]]
    rows, columns = joints[shared], vertices[shared]
    # The boundary with a child also marks the end of the root's region.
    at_root = parents[above[shared]] < 0
    return JointRegressor(
        count,
        np.concatenate([rows, above[shared][at_root]]).astype(np.int32),
        np.concatenate([columns, columns[at_root]]).astype(np.int32),
        np.concatenate([product, product[at_root]]),
    )


def transfer_joints(
    joints: Floats, parents: Ints, regressor: JointRegressor, shifts: Floats, matched: Bools
) -> TransferredJoints:
    """Move joints by the displacement of the surface around them."""
    rows, columns, weights = regressor.joints, regressor.vertices, regressor.weights
    count = len(joints)
    used = np.where(matched[columns], weights, 0.0)
    whole = np.bincount(rows, np.abs(weights), minlength=count)
    present = np.bincount(rows, np.abs(used), minlength=count)
    total = np.bincount(rows, used, minlength=count)
    # Weights of both signs in a row may nearly cancel out, which makes the row unreliable.
    transferred = (present >= _ENOUGH * whole) & (total >= _ENOUGH * present) & (whole > 0.0)
    # J'_j = J_j + sum_v k_jv d_v / sum_v k_jv over matched vertices v, with the vector d_v to the
    # target and the rows k_j of a regressor. As only displacements are regressed, the error of the
    # regressor in a posed mesh cancels out. If less than half of a row is matched, the joint moves
    # with its parent.
    sums = [np.bincount(rows, used * shifts[columns, axis], minlength=count) for axis in range(3)]
    moves = np.stack(sums, axis=1) / np.where(transferred, total, 1.0)[:, None]
    for joint in np.flatnonzero(~transferred).tolist():
        # Parents come first, so the parent's shift is already final.
        moves[joint] = moves[parents[joint]] if parents[joint] >= 0 else 0.0
    return TransferredJoints(joints + moves, transferred, whole > 0.0)


def outside(positions: Floats, triangles: Ints, joints: Floats) -> Bools:
    """Return whether joints lie outside a mesh: (J,) bool, also for a mesh that is inside out."""
    outer: Bools = np.abs(winding_numbers(positions, triangles, joints)) < _INSIDE
    return outer


def winding_numbers(positions: Floats, triangles: Ints, points: Floats) -> Floats:
    """Return the solid angle of a mesh seen from points (N,), over 4 pi; negative if inside out."""
    total = np.zeros(len(points))
    step = max(1, _BLOCK // max(1, len(points)))
    for first in range(0, len(triangles), step):
        corners = positions[triangles[first : first + step]]
        a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        # A triangle a, b, c seen from the origin covers the angle W with tan(W / 2) = a . (b x c) /
        # (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|) (Van Oosterom and Strackee 1983). Holes
        # make the sum a fraction (Jacobson, Kavan, Sorkine-Hornung 2013): one half separates inside
        # and outside.
        above = np.einsum("nta,nta->nt", a, np.cross(b, c))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        total += np.arctan2(above, below).sum(axis=1)
    return total / (2.0 * np.pi)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("nta,nta->nt", a, b)
