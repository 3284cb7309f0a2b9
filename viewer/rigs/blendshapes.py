"""Blend shapes, pose correctives and the joint regressor: weighted sums over rest vertices."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import (
    Bools,
    Deferred,
    Floats,
    Ints,
    deferred,
    freeze_fields,
    frozen,
    require_shape,
    runs_of,
)
from viewer.rigs.bodies.pose_features import Feature
from viewer.rigs.checked_fields import checked
from viewer.rigs.expressions import ExpressionRules, MaterialBinds

_BLOCK = 9  # number of correctives per joint in SMPL
_LONGEST = 252  # maximum number of rows in one range of correctives; a multiple of _BLOCK


class ShapeSpace(Protocol):
    """Displacement of the rest mesh and joints by weights; 0 for weights of 0. Immutable."""

    def displacement(self, weights: Floats) -> Floats:
        """Return the displacement (V, 3) of the rest vertices for the first N <= S weights."""

    def joint_displacement(self, weights: Floats) -> Floats | None:
        """Return the displacement of the rest joints, (J, 3); None if a regressor moves them."""


@checked
@dataclass(frozen=True, slots=True, eq=False)
class BlendShapes:
    """Per-vertex offsets of the rest mesh, scaled by weights: v = v_rest + sum_s w_s d_s."""

    names: tuple[str, ...]
    """Labels, which may repeat: blend shapes are identified by index."""
    offsets: Floats | Deferred
    """(S, V, 3), or Deferred. Figure units per unit of weight; read from the file when a weight
    first becomes non-zero."""
    groups: tuple[str, ...] = ()
    """Group of each blend shape: ``"shape"`` (a weight of 1 is one standard deviation),
    ``"expression"``, or ``"morph"`` (a weight of 1 is the target itself)."""
    normal_offsets: Floats | Deferred | None = None
    """(S, V, 3), or Deferred, or None. Offsets of the rest normals per unit of weight; None if the
    normals are recomputed from the changed surface."""
    rest_weights: Floats | None = None
    """(S,) or None. Weights of the pose stored in the file; None if all are 0."""
    rules: ExpressionRules | None = None
    """Rules by which expressions modify each other's weights; None if they do not."""
    space: ShapeSpace | None = None
    """Computes the displacement if it is not the sum of the offsets; the offsets are then the
    displacements by each weight of 1 alone."""
    origins: Floats | None = None
    """(S,) or None. Value that a slider shows at weight 0; None if all are 0."""
    ranges: Floats | None = None
    """(S, 2) or None. Smallest and largest value of each slider; None for the default range of its
    group."""
    material_binds: MaterialBinds | None = None
    """Properties of materials that the weights change; None if there are none."""

    def __post_init__(self) -> None:
        count = len(self.names)
        freeze_fields(self, origins=(count,), ranges=(count, 2), offsets=(count, None, 3))
        freeze_fields(self, normal_offsets=self.offsets.shape, rest_weights=(count,))
        if self.rest_weights is not None and not self.rest_weights.any():
            object.__setattr__(self, "rest_weights", None)
        if not self.groups:
            object.__setattr__(self, "groups", ("shape",) * count)
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

    @property
    def is_linear(self) -> bool:
        """Whether the displacement is the weighted sum of the offsets."""
        return self.space is None

    def origin(self, row: int) -> float:
        """Return the value that the slider of a blend shape shows at weight 0."""
        return 0.0 if self.origins is None else float(self.origins[row])

    def is_expression(self, row: int) -> bool:
        """Return whether a blend shape is a combination of others controlled by ``rules``."""
        return self.rules is not None and bool((self.rules.rows == row).any())

    def shown(self, weights: Floats) -> Floats:
        """Return the displayed weights, by the rules of expressions: (N,)."""
        return weights if self.rules is None else self.rules.shown(weights)

    def displacement(self, weights: ArrayLike) -> Floats:
        """Return sum_s w_s d_s, or the displacement of the shape space.

        Parameters
        ----------
        weights : (N,)
            N <= S; missing weights are treated as 0.

        Returns
        -------
        (V, 3)
            Figure units.

        Raises
        ------
        RigError
            If there are more weights than blend shapes.
        """
        if self.space is not None:
            return self.space.displacement(self._checked(weights))
        return self._weighted(self.offsets, weights)

    def normal_displacement(self, weights: ArrayLike) -> Floats | None:
        """Return the offsets of the rest normals, sum_s w_s n_s.

        Parameters
        ----------
        weights : (N,)
            N <= S; missing weights are treated as 0.

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

    def _weighted(self, offsets: Floats | Deferred, given: ArrayLike) -> Floats:
        """Return the weighted sum of offsets; if all weights are 0, nothing is read."""
        weights = self.shown(self._checked(given))
        active = np.flatnonzero(weights)
        if len(active) == 0:
            return np.zeros((self.n_vertices, 3))
        whole = np.zeros(self.n_shapes)
        whole[: len(weights)] = weights
        total = deferred(offsets).total(whole)
        if total is not None:
            return total
        return np.einsum("s,sva->va", weights[active], deferred(offsets).values()[active])

    def _checked(self, given: ArrayLike) -> Floats:
        weights = frozen("weights", given, (None,))
        if len(weights) > self.n_shapes:
            raise RigError(f"expected at most {self.n_shapes} shape weights, found {len(weights)}")
        return weights

    def direction_values(self) -> Floats:
        """Return the offsets, read from the file on first use: (S, V, 3)."""
        return deferred(self.offsets).values()

    def normal_values(self) -> Floats:
        """Return the offsets of the normals, zeros if there are none: (S, V, 3)."""
        offsets = self.normal_offsets
        return np.zeros(self.offsets.shape) if offsets is None else deferred(offsets).values()


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Correctives:
    """Pose-dependent offsets of body models: v = v_rest + sum_p c_p d_p (Loper 2015, eq. 9)."""

    offsets: Floats | Deferred
    """(P, V, 3), or Deferred. Figure units per unit of weight."""
    feature: Feature | None = None
    """Computes the weights of a pose; None for SMPL's weights, ``corrective_weights``, which are
    nine for each joint except the root."""

    def __post_init__(self) -> None:
        freeze_fields(self, offsets=(None, None, 3))
        count = self.offsets.shape[0]
        if self.feature is not None:
            require_shape("offsets", self.offsets.shape, (self.feature.n_weights, None, 3))
        elif count % _BLOCK:
            raise RigError(f"offsets: expected nine for each joint except the root, found {count}")

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return self.offsets.shape[1]

    @property
    def block(self) -> int:
        """Number of weights that are skipped together if all of them are 0."""
        return _BLOCK if self.feature is None else 1

    @property
    def is_sparse(self) -> bool:
        """Whether the offsets are expected to be mostly zero."""
        return deferred(self.offsets).is_sparse

    def values(self) -> Floats:
        """Return the offsets, read from the file on first use."""
        return deferred(self.offsets).values()

    def of_vertices(self, vertices: Ints, weights: Floats) -> Floats:
        """Return sum_p c_p d_p at some vertices only: (N, 3) for weights (P,)."""
        active = np.flatnonzero(weights)
        offsets = deferred(self.offsets).columns(vertices)[active]
        return np.einsum("p,pva->va", weights[active], offsets)

    def check_values(self) -> None:
        """Read the offsets; raises FormatError if they are damaged."""
        deferred(self.offsets).check()

    def displacement(self, weights: Floats) -> Floats:
        """Return sum_p c_p d_p, (V, 3), for weights (P,), skipping joints without rotation."""
        found = deferred(self.offsets).total(weights) if weights.any() else None
        if found is not None:
            return found
        total = np.zeros(3 * self.n_vertices)
        for rows in active_rows(weights, self.block):
            total += weights[rows] @ self.values()[rows].reshape(rows.stop - rows.start, -1)
        return total.reshape(-1, 3)


def active_rows(weights: Floats, block: int = _BLOCK) -> list[slice]:
    """Return ranges of rows whose weights are not all 0, split so that products stay small."""
    active: Bools = np.asarray(weights.reshape(-1, block).any(axis=1))
    return [
        slice(start, min(start + _LONGEST, stop * block))
        for first, stop in runs_of(active)
        for start in range(first * block, stop * block, _LONGEST)
    ]


def corrective_weights(rotations: Floats) -> Floats:
    """Return the nine entries of R - I of each non-root joint, from rotations (J, 3, 3)."""
    return (rotations[1:] - np.eye(3)).reshape(-1)


@checked
@dataclass(frozen=True, slots=True, eq=False)
class JointRegressor:
    """Rest joints as weighted sums of rest vertices, J_j = b_j + sum_v r_jv v."""

    n_joints: int
    """J."""
    joints: Ints
    vertices: Ints
    """(N,) int32. Row and column of each entry of the sparse (J, V) matrix."""
    weights: Floats
    """(N,). Value of each entry."""
    axes: Ints | None = None
    """(N, 2) int32 or None. Coordinates (0 to 2) of the joint and of the vertex that an entry
    connects; None if each entry applies to all three coordinates."""
    bias: Floats | None = None
    """(J, 3) or None. Constants b; None if all are 0."""

    def __post_init__(self) -> None:
        count = len(self.joints)
        freeze_fields(self, np.int32, axes=(count, 2), joints=(count,), vertices=(count,))
        freeze_fields(self, bias=(self.n_joints, 3), weights=(count,))
        if len(self.joints) and not 0 <= self.joints.min() <= self.joints.max() < self.n_joints:
            raise RigError(f"joints: expected indices 0 to {self.n_joints - 1}")
        if len(self.vertices) and self.vertices.min() < 0:
            raise RigError("vertices: expected indices from 0 on")


def regress_joints(regressor: JointRegressor, positions: Floats) -> Floats:
    """Return the joints (J, 3) of rest vertices (V, 3)."""
    bias = np.zeros(3) if regressor.bias is None else regressor.bias
    if regressor.axes is not None:
        to, of = regressor.axes.T
        terms = positions[regressor.vertices, of] * regressor.weights
        sums = np.bincount(3 * regressor.joints + to, terms, minlength=3 * regressor.n_joints)
        return bias + sums.reshape(-1, 3)
    terms = positions[regressor.vertices] * regressor.weights[:, None]
    columns = [
        np.bincount(regressor.joints, terms[:, axis], minlength=regressor.n_joints)
        for axis in range(3)
    ]
    return bias + np.stack(columns, axis=1)
