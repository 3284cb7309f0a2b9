"""One round of fitting a posed template: the turn of every joint that brings pairs nearest.

With s_vj the share of vertex v that hangs on joint j or below it, c_j the joint's place, x the
vertex as it is laid onto the target, and m the middle of all x::

    x' = x + w x (x - m) + t + u (x - m) + sum_j s_vj w_j x (x - c_j)

The turns w_j, and w, t and u of the whole, minimise the mean of

    (n . (x' - q))^2    over pairs of a vertex and a point q of the target with the normal n
    h |x' - q|^2        over vertices and the target's points closest to them, whatever faces where

The second sum knows where limbs end, which planes do not tell. All lengths are over the target's
size. Small prices on what joints turn, now and in all, leave what the surface does not tell, such
as the turn of a limb about itself, as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Floats, Ints

__all__ = ["Pairs", "PoseStep", "solve_step"]

_HOLD = 0.2  # h: distances between points beside those to planes
_TOTAL, _NOW = 1e-6, 1e-5  # prices of a radian squared, in all and in one round
_WHOLE = 1e-7  # price of moving the whole: a surface may slide along itself
_MOST = 0.3  # radians that a joint turns in one round: more is no longer linear
_GROWTH = 1.25  # and what the whole grows or shrinks by


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
        Factor of the whole.
    joint_turns : (J, 3)
        Rotation vectors of the joints, 0 for roots, which turn with the whole.
    """

    middle: Floats
    turn: Floats
    shift: Floats
    growth: float
    joint_turns: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """What the columns of the linear problem are made of."""

    middle: Floats
    size: float
    joints: Floats  # (K, 3) places of the joints that turn
    shares: Floats  # (V, K)


def solve_step(
    laid: Floats,
    joints: Floats,
    shares: Floats,
    parents: Ints,
    turned: Floats,
    pairs: Pairs,
    size: float,
    scales: bool,
) -> PoseStep:
    """Solve the linear problem above.

    Parameters
    ----------
    laid : (V, 3)
        The template's vertices, laid onto the target.
    joints : (J, 3)
        Its joints there.
    shares : (V, J)
        How much of each vertex hangs on a joint or below it.
    parents : (J,)
        -1 for roots.
    turned : (J, 3)
        Sum of the turns of former rounds, radians.
    pairs : Pairs
        One pair at least.
    size : float
        Of the target.
    scales : bool
        Whether the whole may grow.

    Returns
    -------
    PoseStep
        A joint turns by 0.3 radians at most.
    """
    below = np.flatnonzero(parents >= 0)
    frame = _Frame(laid[pairs.vertices].mean(axis=0), size, joints[below], shares[:, below])
    matrix, right = _equations(frame, laid, pairs.vertices, pairs.targets, pairs.normals)
    for axis in np.eye(3):
        normals = np.broadcast_to(axis, pairs.end_targets.shape)
        more, values = _equations(frame, laid, pairs.ends, pairs.end_targets, normals)
        matrix += _HOLD * more
        right += _HOLD * values
    count = len(pairs.vertices)
    prices = np.full(len(right), _TOTAL + _NOW)
    prices[:7] = _WHOLE
    matrix = matrix / count + np.diag(prices)
    right = right / count
    right[7:] -= _TOTAL * turned[below].ravel()
    if not scales:
        matrix[6], matrix[:, 6], right[6] = 0.0, 0.0, 0.0
        matrix[6, 6] = 1.0
    solved = np.linalg.solve(matrix, right)
    turns = np.zeros_like(joints)
    turns[below] = solved[7:].reshape(-1, 3)
    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    turns *= _MOST / np.maximum(angles, _MOST)
    growth = min(max(1.0 + float(solved[6]), 1.0 / _GROWTH), _GROWTH)
    return PoseStep(frame.middle, solved[:3], size * solved[3:6], growth, turns)


def _equations(
    frame: _Frame, laid: Floats, vertices: Ints, targets: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """Return the normal equations of n . (x' - q) = 0; columns are w, t, u, then the joints."""
    x = laid[vertices]
    arms = (x - frame.middle) / frame.size
    # n . (w x a) = w . (a x n)
    turning = _cross((x[:, None] - frame.joints) / frame.size, normals[:, None])
    turning *= frame.shares[vertices][:, :, None]
    along = np.einsum("na,na->n", normals, arms)[:, None]
    rows = np.concatenate(
        [_cross(arms, normals), normals, along, turning.reshape(len(x), -1)], axis=1
    )
    gaps = np.einsum("na,na->n", normals, targets - x) / frame.size
    return rows.T @ rows, rows.T @ gaps


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a x b (..., 3); ``numpy.cross`` takes three times as long on so many."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        result[..., axis] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
