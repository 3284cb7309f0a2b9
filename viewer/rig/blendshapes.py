"""Blend shapes, pose correctives and the joint regressor: weighted sums over rest vertices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Deferred, Floats, Ints, frozen
from viewer.rig.expressions import ExpressionRules

__all__ = [
    "BlendShapes",
    "Correctives",
    "JointRegressor",
    "SummedOffsets",
    "corrective_weights",
    "regress_joints",
]


class SummedOffsets(Deferred):
    """Offsets of blend shapes whose weighted sum does not need the whole array.

    Parameters
    ----------
    shape : (int, int, int)
        S, V, 3.
    load : callable
        Returns the array; see ``Deferred``.
    total : callable
        Returns sum_s w_s d_s, (V, 3), for weights (S,).
    """

    __slots__ = ("total",)

    def __init__(
        self,
        shape: tuple[int, int, int],
        load: Callable[[], Floats],
        total: Callable[[Floats], Floats],
    ) -> None:
        super().__init__(shape, np.float64, load)
        self.total = total


@dataclass(frozen=True, slots=True, eq=False)
class BlendShapes:
    """Per-vertex offsets of the rest mesh, scaled by weights: v = v_rest + sum_s w_s d_s.

    Attributes
    ----------
    names : tuple of S str
        Labels, which may repeat: blend shapes are identified by index.
    offsets : (S, V, 3), or Deferred
        Figure units per unit of weight; read from the file when a weight first becomes non-zero.
    groups : tuple of S str
        Group of each blend shape: ``"shape"`` (a weight of 1 is one standard deviation),
        ``"expression"``, or ``"morph"`` (a weight of 1 is the target itself).
    normal_offsets : (S, V, 3), or Deferred, or None
        Offsets of the rest normals per unit of weight; None if the normals are recomputed from
        the changed surface.
    rest_weights : (S,) or None
        Weights of the file's own pose; None if all are 0.
    rules : ExpressionRules or None
        How weights of expressions change each other; None if they do not.
    """

    names: tuple[str, ...]
    offsets: Floats | Deferred
    groups: tuple[str, ...] = ()
    normal_offsets: Floats | Deferred | None = None
    rest_weights: Floats | None = None
    rules: ExpressionRules | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.offsets, Deferred):
            offsets = frozen("offsets", self.offsets, (len(self.names), None, 3))
            object.__setattr__(self, "offsets", offsets)
        given = self.normal_offsets
        if given is not None and not isinstance(given, Deferred):
            given = frozen("normal_offsets", given, (None, None, 3))
            object.__setattr__(self, "normal_offsets", given)
        if not self.groups:
            object.__setattr__(self, "groups", ("shape",) * len(self.names))
        _check_shape("offsets", self.offsets.shape, (len(self.names), self.n_vertices, 3))
        if given is not None:
            _check_shape("normal_offsets", given.shape, self.offsets.shape)
        if self.rest_weights is not None:
            weights = frozen("rest_weights", self.rest_weights, (len(self.names),))
            object.__setattr__(self, "rest_weights", weights if weights.any() else None)
        if len(self.groups) != len(self.names):
            raise RigError(f"groups: expected {len(self.names)}, found {len(self.groups)}")

    @property
    def n_shapes(self) -> int:
        """Number of blend shapes, S."""
        return len(self.names)

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return self.offsets.shape[1]

    def is_expression(self, row: int) -> bool:
        """Return whether a blend shape is a combination of others, governed by ``rules``."""
        return self.rules is not None and bool((self.rules.rows == row).any())

    def displacement(self, weights: Floats) -> Floats:
        """Return sum_s w_s d_s.

        Parameters
        ----------
        weights : (N,)
            N <= S; missing weights count as 0.

        Returns
        -------
        (V, 3)
            Figure units.

        Raises
        ------
        RigError
            If there are more weights than blend shapes.
        """
        return self._weighted(self.offsets, weights)

    def normal_displacement(self, weights: Floats) -> Floats | None:
        """Return the offsets of the rest normals, sum_s w_s n_s.

        Parameters
        ----------
        weights : (N,)
            N <= S; missing weights count as 0.

        Returns
        -------
        (V, 3) or None
            None if the normals have to be recomputed from the changed surface.

        Raises
        ------
        RigError
            If there are more weights than blend shapes.
        """
        offsets = self.normal_offsets
        return None if offsets is None else self._weighted(offsets, weights)

    def _weighted(self, offsets: Floats | Deferred, weights: Floats) -> Floats:
        """Return the weighted sum of offsets; if all weights are 0, nothing is read."""
        if len(weights) > self.n_shapes:
            raise RigError(f"expected at most {self.n_shapes} shape weights, found {len(weights)}")
        weights = weights if self.rules is None else self.rules.shown(weights)
        active = np.flatnonzero(weights)
        if len(active) == 0:
            return np.zeros((self.n_vertices, 3))
        if isinstance(offsets, SummedOffsets):
            whole = np.zeros(self.n_shapes)
            whole[: len(weights)] = weights
            return offsets.total(whole)
        return np.einsum("s,sva->va", weights[active], _values(offsets)[active])

    def direction_values(self) -> Floats:
        """Return the offsets, read from the file on first use: (S, V, 3)."""
        return _values(self.offsets)

    def normal_values(self) -> Floats:
        """Return the offsets of the normals, zeros if there are none: (S, V, 3)."""
        offsets = self.normal_offsets
        return np.zeros(self.offsets.shape) if offsets is None else _values(offsets)


@dataclass(frozen=True, slots=True, eq=False)
class Correctives:
    """Pose-dependent offsets of the SMPL family: v = v_rest + sum_p c_p d_p (Loper 2015, eq. 9).

    Attributes
    ----------
    offsets : (9 (J - 1), V, 3), or Deferred
        Figure units per unit of ``corrective_weights``.
    """

    offsets: Floats | Deferred

    def __post_init__(self) -> None:
        if not isinstance(self.offsets, Deferred):
            object.__setattr__(self, "offsets", frozen("offsets", self.offsets, (None, None, 3)))
        count = self.offsets.shape[0]
        if len(self.offsets.shape) != 3 or count % 9:
            raise RigError(f"offsets: expected nine for each joint except the root, found {count}")

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return self.offsets.shape[1]

    def values(self) -> Floats:
        """Return the offsets, read from the file on first use."""
        return _values(self.offsets)

    def displacement(self, weights: Floats) -> Floats:
        """Return sum_p c_p d_p, skipping joints without rotation.

        Parameters
        ----------
        weights : (9 (J - 1),)
            From ``corrective_weights``.

        Returns
        -------
        (V, 3)
            Figure units.
        """
        total = np.zeros(3 * self.n_vertices)
        for rows in active_rows(weights):
            total += weights[rows] @ self.values()[rows].reshape(rows.stop - rows.start, -1)
        return total.reshape(-1, 3)


def active_rows(weights: Floats) -> list[slice]:
    """Return the row ranges of consecutive joints, nine rows each, whose weights are not all 0."""
    active = weights.reshape(-1, 9).any(axis=1)
    edges = np.flatnonzero(np.diff(active, prepend=False, append=False))
    return [slice(9 * int(a), 9 * int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def corrective_weights(rotations: Floats) -> Floats:
    """Return the weights of the correctives: the nine entries of R - I of each non-root joint.

    Parameters
    ----------
    rotations : (J, 3, 3)
        Rotation of each joint relative to its parent.

    Returns
    -------
    (9 (J - 1),)
        Nine entries per joint, row by row.
    """
    return (rotations[1:] - np.eye(3)).reshape(-1)


@dataclass(frozen=True, slots=True, eq=False)
class JointRegressor:
    """Rest joints as weighted sums of rest vertices, J_j = sum_v r_jv v.

    Attributes
    ----------
    n_joints : int
        J.
    joints, vertices : (N,) int32
        Row and column of each entry of the sparse (J, V) matrix.
    weights : (N,)
        Value of each entry.
    """

    n_joints: int
    joints: Ints
    vertices: Ints
    weights: Floats

    def __post_init__(self) -> None:
        for name, dtype in (("joints", np.int32), ("vertices", np.int32), ("weights", np.float64)):
            values = frozen(name, getattr(self, name), (len(self.joints),), dtype)
            object.__setattr__(self, name, values)
        if len(self.joints) and not 0 <= self.joints.min() <= self.joints.max() < self.n_joints:
            raise RigError(f"joints: expected indices 0 to {self.n_joints - 1}")
        if len(self.vertices) and self.vertices.min() < 0:
            raise RigError("vertices: expected indices from 0 on")


def regress_joints(regressor: JointRegressor, positions: Floats) -> Floats:
    """Return the joints of a rest mesh.

    Parameters
    ----------
    regressor : JointRegressor
        Joint regressor with J rows.
    positions : (V, 3)
        Rest vertices, figure units.

    Returns
    -------
    (J, 3)
        Figure units.
    """
    terms = positions[regressor.vertices] * regressor.weights[:, None]
    columns = [
        np.bincount(regressor.joints, terms[:, axis], minlength=regressor.n_joints)
        for axis in range(3)
    ]
    return np.stack(columns, axis=1)


def _values(offsets: Floats | Deferred) -> Floats:
    return offsets.values() if isinstance(offsets, Deferred) else offsets


def _check_shape(name: str, found: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    if found != wanted:
        raise RigError(f"{name}: expected shape {wanted}, found {found}")
