"""One iteration of fitting a template: the linear problem for joint rotations and limb scales.

With x a vertex aligned with the target, m the mean of all x, c_j a joint, w_vj the weight of
vertex v, s_vj the sum of its weights for joint j and all below it, and P_j the projection onto
the limb's axis::

    e_j = w_vj (x - c_j) + sum over joints k directly below j of s_vk (c_k - c_j)
    x'  = x + w x (x - m) + t + u (x - m) + sum_j s_vj w_j x (x - c_j)
            + sum_j (l_j P_j + g_j (1 - P_j)) e_j

The rotations w_j, the growths l_j along and g_j across the limbs, and w, t and u of the whole
figure minimise the mean of

    (n . (x' - q))^2    over pairs of a vertex and a point q of the target with the normal n
    h |x' - q|^2        over vertices and the target's points closest to them, in any direction

The second sum constrains the ends of limbs, which planes do not. All lengths are divided by the
target's size. Small penalties on rotations and growths, per step and in total, preserve what the
surface does not determine, such as the rotation of a limb about its own axis.
"""

from __future__ import annotations

import numpy as np

from viewer.autorig.alignment.proportions import Limbs
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints

__all__ = ["AlignedTemplate", "Pairs", "PoseStep", "solve_step"]

_HOLD = 0.2  # h: weight of point-to-point relative to point-to-plane distances
# Penalties on the squares of total rotations (radians) and total growths (logarithms).
_ROTATED, _GROWN = 3e-6, 3e-5
_NOW = 1e-5  # penalty on rotations and growths within one iteration
_WHOLE = 1e-7  # penalty on moving the whole figure, as a surface may slide along itself
# Maximum rotation of a joint per iteration for which the linearisation is valid, radians.
_MOST = 0.3
_GROWTH = 0.2  # maximum growth (logarithm) of the whole figure or a limb per iteration
_FIXED = 1e6  # penalty on fixed unknowns


@dataclass(frozen=True, slots=True, eq=False)
class AlignedTemplate:
    """A template's vertices and joints in the target's frame.

    Attributes
    ----------
    positions, normals : (V, 3)
        Vertices of the template.
    joints, axes : (J, 3)
        Joints of the template, and unit vectors along their limbs.
    """

    positions: Floats
    normals: Floats
    joints: Floats
    axes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Corresponding vertices of the template and points of the target.

    Attributes
    ----------
    vertices : (N,)
        Vertices of the template, matched with points that face the same way.
    targets, normals : (N, 3)
        Points of the target and the normals there.
    ends : (M,)
        Vertices of the template, regardless of their orientation.
    end_targets : (M, 3)
        The points of the target closest to them.
    """

    vertices: Ints
    targets: Floats
    normals: Floats
    ends: Ints
    end_targets: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PoseStep:
    """Result of an iteration, in the target's frame.

    Attributes
    ----------
    middle : (3,)
        Centre of the whole figure's rotation and scaling.
    rotation, shift : (3,)
        Rotation vector and shift of the whole figure; the shift in the target's unit.
    growth : float
        Logarithm of the whole figure's scale.
    rotation_vectors : (J, 3)
        Rotation vectors of the joints; 0 for roots, which rotate with the whole figure.
    limb_growths : (2, J)
        Logarithms of the limbs' scales: along, across.
    """

    middle: Floats
    rotation: Floats
    shift: Floats
    growth: float
    rotation_vectors: Floats
    limb_growths: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """Quantities from which the columns of the linear problem are built."""

    middle: Floats
    size: float
    aligned: AlignedTemplate
    limbs: Limbs
    parents: Ints


def solve_step(
    aligned: AlignedTemplate,
    limbs: Limbs,
    parents: Ints,
    pairs: Pairs,
    size: float,
    rotated: Floats,
    grown: Floats,
    scales: bool,
) -> PoseStep:
    """Solve the linear problem above.

    Parameters
    ----------
    aligned : AlignedTemplate
        The template.
    limbs : Limbs
        Weights and fractions of its joints.
    parents : (J,)
        -1 for roots.
    pairs : Pairs
        At least one pair.
    size : float
        Size of the target.
    rotated : (J, 3)
        Sum of the rotations of previous iterations, radians.
    grown : (2, J)
        Sum of the limbs' growths in previous iterations.
    scales : bool
        Whether the figure and its limbs may be scaled.

    Returns
    -------
    PoseStep
        Step in which no joint rotates by more than 0.3 radians and nothing grows by more than a
        fifth.
    """
    middle = aligned.positions[pairs.vertices].mean(axis=0)
    frame = _Frame(middle, size, aligned, limbs, parents)
    matrix, right = _equations(frame, pairs.vertices, pairs.targets, pairs.normals)
    for axis in np.eye(3):
        normals = np.broadcast_to(axis, pairs.end_targets.shape)
        more, values = _equations(frame, pairs.ends, pairs.end_targets, normals)
        matrix += _HOLD * more
        right += _HOLD * values
    count, n_joints = len(pairs.vertices), len(parents)
    below = np.flatnonzero(parents >= 0)
    matrix, right = matrix / count, right / count
    penalty = _penalties(len(below), n_joints)
    right[7:] -= penalty @ np.concatenate([rotated[below].ravel(), grown.ravel()])
    matrix[7:, 7:] += penalty
    now = np.full(len(right), _NOW)
    now[:7] = _WHOLE
    if not scales:
        now[6], now[-2 * n_joints :] = _FIXED, _FIXED
    solved = np.asarray(np.linalg.solve(matrix + np.diag(now), right), dtype=np.float64)
    rotations = np.zeros((n_joints, 3))
    rotations[below] = solved[7 : 7 + 3 * len(below)].reshape(-1, 3)
    angles = np.linalg.norm(rotations, axis=1, keepdims=True)
    rotations = rotations * (_MOST / np.maximum(angles, _MOST))
    growths = np.clip(solved[-2 * n_joints :].reshape(2, -1), -_GROWTH, _GROWTH)
    growth = min(max(float(solved[6]), -_GROWTH), _GROWTH)
    return PoseStep(middle, solved[:3], size * solved[3:6], growth, rotations, growths)


def _penalties(n_rotating: int, n_joints: int) -> Floats:
    """Return the penalties on all rotations and growths as a quadratic form.

    Making all limbs thicker, as clothes do, is not penalised, only differences between limbs are.
    Otherwise the figure as a whole would grow and extend beyond the target.
    """
    penalties = np.diag(np.repeat([_ROTATED, _GROWN], [3 * n_rotating, 2 * n_joints]))
    # sum_j g_j^2 - (sum_j g_j)^2 / J: only deviations from the mean girth are penalised.
    penalties[-n_joints:, -n_joints:] -= _GROWN / n_joints
    return penalties


def _equations(
    frame: _Frame, vertices: Ints, targets: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """Return the normal equations of n . (x' - q) = 0, with columns in the above order."""
    x = frame.aligned.positions[vertices]
    count = len(x)
    arms = (x - frame.middle) / frame.size
    spokes = (x[:, None] - frame.aligned.joints) / frame.size
    below = np.flatnonzero(frame.parents >= 0)
    # n . (w x a) = w . (a x n)
    rotating = _cross(spokes[:, below], normals[:, None])
    rotating *= frame.limbs.fractions[vertices][:, below, None]
    reach = _reach(frame, vertices, spokes)
    across = np.einsum("na,nja->nj", normals, reach)
    along = np.einsum("nja,ja->nj", reach, frame.aligned.axes) * (normals @ frame.aligned.axes.T)
    grow = np.einsum("na,na->n", normals, arms)[:, None]
    rows = np.concatenate(
        [_cross(arms, normals), normals, grow, rotating.reshape(count, -1), along, across - along],
        axis=1,
    )
    gaps = np.einsum("na,na->n", normals, targets - x) / frame.size
    return rows.T @ rows, rows.T @ gaps


def _reach(frame: _Frame, vertices: Ints, spokes: Floats) -> Floats:
    """Return e_j above, over the size: (N, J, 3)."""
    reach = frame.limbs.weights[vertices][:, :, None] * spokes
    fractions, joints = frame.limbs.fractions[vertices], frame.aligned.joints
    for joint in np.flatnonzero(frame.parents >= 0).tolist():
        parent = frame.parents[joint]
        step = (joints[joint] - joints[parent]) / frame.size
        reach[:, parent] += fractions[:, joint, None] * step
    return reach


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a x b (..., 3); ``numpy.cross`` takes three times as long on arrays this large."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        result[..., axis] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
