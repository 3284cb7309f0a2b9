"""One round of fitting a template: what its joints turn, and its limbs grow, to meet the target.

With x a vertex as it is laid onto the target, m the middle of all, c_j a joint, w_vj the weight of
vertex v, s_vj its share that hangs on joint j or below it, and P_j the projection onto the limb's
axis::

    e_j = w_vj (x - c_j) + sum over joints k right below j of s_vk (c_k - c_j)
    x'  = x + w x (x - m) + t + u (x - m) + sum_j s_vj w_j x (x - c_j)
            + sum_j (l_j P_j + g_j (1 - P_j)) e_j

The turns w_j, growths l_j along and g_j across the limbs, and w, t and u of the whole, minimise
the mean of

    (n . (x' - q))^2    over pairs of a vertex and a point q of the target with the normal n
    h |x' - q|^2        over vertices and the target's points closest to them, whatever faces where

The second sum knows where limbs end, which planes do not tell. All lengths are over the target's
size. Small prices on what is turned and grown, now and in all, leave what the surface does not
tell, such as the turn of a limb about itself, as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.autorig.alignment.proportions import Limbs
from viewer.rig.arrays import Floats, Ints

__all__ = ["Laid", "Pairs", "PoseStep", "solve_step"]

_HOLD = 0.2  # h: distances between points beside those to planes
_TURNED, _GROWN = 3e-6, 3e-5  # prices of a radian, and of a growth by e, squared, in all
_NOW = 1e-5  # the same in one round, of both
_WHOLE = 1e-7  # price of moving the whole: a surface may slide along itself
_MOST = 0.3  # radians that a joint turns in one round: more is no longer linear
_GROWTH = 0.2  # and logarithms that the whole or a limb grows by
_FIXED = 1e6  # price of what may not change


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """A template as it stands in the target's frame.

    Attributes
    ----------
    positions, normals : (V, 3)
        Its vertices.
    joints, axes : (J, 3)
        Its joints, and unit vectors along their limbs.
    """

    positions: Floats
    normals: Floats
    joints: Floats
    axes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """What goes together: vertices and points of the target.

    Attributes
    ----------
    vertices : (N,)
        Of the template, partners that face the same way.
    targets, normals : (N, 3)
        Points of the target and the normals there.
    ends : (M,)
        Vertices of the template, whichever way they face.
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
    """What a round changes, in the target's frame.

    Attributes
    ----------
    middle : (3,)
        What the whole turns and grows about.
    turn, shift : (3,)
        Rotation vector and shift of the whole; the shift in the target's unit.
    growth : float
        Logarithm of the whole's factor.
    joint_turns : (J, 3)
        Rotation vectors of the joints, 0 for roots, which turn with the whole.
    limb_growths : (2, J)
        Logarithms of the limbs' factors: along, across.
    """

    middle: Floats
    turn: Floats
    shift: Floats
    growth: float
    joint_turns: Floats
    limb_growths: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """What the columns of the linear problem are made of."""

    middle: Floats
    size: float
    laid: Laid
    limbs: Limbs
    parents: Ints


def solve_step(
    laid: Laid,
    limbs: Limbs,
    parents: Ints,
    pairs: Pairs,
    size: float,
    turned: Floats,
    grown: Floats,
    scales: bool,
) -> PoseStep:
    """Solve the linear problem above.

    Parameters
    ----------
    laid : Laid
        The template.
    limbs : Limbs
        Weights and shares of its joints.
    parents : (J,)
        -1 for roots.
    pairs : Pairs
        One pair at least.
    size : float
        Of the target.
    turned : (J, 3)
        Sum of the turns of former rounds, radians.
    grown : (2, J)
        Sum of the limbs' growths.
    scales : bool
        Whether the whole and limbs may grow.

    Returns
    -------
    PoseStep
        No joint turns by more than 0.3 radians, nothing grows by more than a fifth.
    """
    middle = laid.positions[pairs.vertices].mean(axis=0)
    frame = _Frame(middle, size, laid, limbs, parents)
    matrix, right = _equations(frame, pairs.vertices, pairs.targets, pairs.normals)
    for axis in np.eye(3):
        normals = np.broadcast_to(axis, pairs.end_targets.shape)
        more, values = _equations(frame, pairs.ends, pairs.end_targets, normals)
        matrix += _HOLD * more
        right += _HOLD * values
    count, n_joints = len(pairs.vertices), len(parents)
    below = np.flatnonzero(parents >= 0)
    matrix, right = matrix / count, right / count
    price = _prices(len(below), n_joints)
    right[7:] -= price @ np.concatenate([turned[below].ravel(), grown.ravel()])
    matrix[7:, 7:] += price
    now = np.full(len(right), _NOW)
    now[:7] = _WHOLE
    if not scales:
        now[6], now[-2 * n_joints :] = _FIXED, _FIXED
    solved = np.asarray(np.linalg.solve(matrix + np.diag(now), right), dtype=np.float64)
    turns = np.zeros((n_joints, 3))
    turns[below] = solved[7 : 7 + 3 * len(below)].reshape(-1, 3)
    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    turns = turns * (_MOST / np.maximum(angles, _MOST))
    growths = np.clip(solved[-2 * n_joints :].reshape(2, -1), -_GROWTH, _GROWTH)
    growth = min(max(float(solved[6]), -_GROWTH), _GROWTH)
    return PoseStep(middle, solved[:3], size * solved[3:6], growth, turns, growths)


def _prices(n_turning: int, n_joints: int) -> Floats:
    """Return the prices of all turns and growths as a quadratic form.

    That all limbs are thicker, as in clothes, costs nothing: only differences do. Without that
    the whole would grow instead, and reach beyond the target.
    """
    prices = np.diag(np.repeat([_TURNED, _GROWN], [3 * n_turning, 2 * n_joints]))
    prices[-n_joints:, -n_joints:] -= _GROWN / n_joints
    return prices


def _equations(
    frame: _Frame, vertices: Ints, targets: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """Return the normal equations of n . (x' - q) = 0; columns as they are named above."""
    x = frame.laid.positions[vertices]
    count = len(x)
    arms = (x - frame.middle) / frame.size
    spokes = (x[:, None] - frame.laid.joints) / frame.size
    below = np.flatnonzero(frame.parents >= 0)
    # n . (w x a) = w . (a x n)
    turning = _cross(spokes[:, below], normals[:, None])
    turning *= frame.limbs.shares[vertices][:, below, None]
    reach = _reach(frame, vertices, spokes)
    across = np.einsum("na,nja->nj", normals, reach)
    along = np.einsum("nja,ja->nj", reach, frame.laid.axes) * (normals @ frame.laid.axes.T)
    grow = np.einsum("na,na->n", normals, arms)[:, None]
    rows = np.concatenate(
        [_cross(arms, normals), normals, grow, turning.reshape(count, -1), along, across - along],
        axis=1,
    )
    gaps = np.einsum("na,na->n", normals, targets - x) / frame.size
    return rows.T @ rows, rows.T @ gaps


def _reach(frame: _Frame, vertices: Ints, spokes: Floats) -> Floats:
    """Return e_j above, over the size: (N, J, 3)."""
    reach = frame.limbs.weights[vertices][:, :, None] * spokes
    shares, joints = frame.limbs.shares[vertices], frame.laid.joints
    for joint in np.flatnonzero(frame.parents >= 0).tolist():
        parent = frame.parents[joint]
        step = (joints[joint] - joints[parent]) / frame.size
        reach[:, parent] += shares[:, joint, None] * step
    return reach


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a x b (..., 3); ``numpy.cross`` takes three times as long on so many."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        result[..., axis] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
