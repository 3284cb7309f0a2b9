"""The shape space of Anny: phenotypes, facial actions and local changes of one base mesh."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.blendshapes import JointRegressor, regress_joints
from viewer.rig.bodies.phenotypes import PHENOTYPES, TYPICAL, weights_of
from viewer.rig.memo import Memo

__all__ = ["TargetRows", "TargetSpace"]


class TargetRows:
    """Offsets of the base mesh by target, each read on first use and stored without zeros.

    Parameters
    ----------
    count : int
        Number of targets, R.
    n_points : int
        Number of vertices of the base mesh, B.
    load : callable
        Returns the vertices (N,) that a target moves and their offsets (N, 3); may raise a
        ``FormatError``.
    """

    def __init__(
        self, count: int, n_points: int, load: Callable[[int], tuple[Ints, Floats]]
    ) -> None:
        self.count, self.n_points, self._load = count, n_points, load
        self._rows: dict[int, tuple[Ints, Floats]] = {}
        self._lock = Lock()

    def row(self, index: int) -> tuple[Ints, Floats]:
        """Return the vertices that a target moves, and their offsets."""
        with self._lock:
            if index not in self._rows:
                self._rows[index] = self._load(index)
            return self._rows[index]

    def weighted(self, coefficients: Floats) -> Floats:
        """Return the weighted sum of the targets: (B, 3) for coefficients (R,)."""
        total = np.zeros((self.n_points, 3))
        for index in np.flatnonzero(coefficients).tolist():
            points, offsets = self.row(index)
            total[points] += coefficients[index] * offsets
        return total


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class TargetSpace:
    """Blend shapes of Anny; weights are phenotypes, then facial actions, then local changes.

    A weight is the difference from the mean body. A local change has two targets, one for positive
    and one for negative weights.

    Attributes
    ----------
    targets : TargetRows
        Targets of the phenotypes, then of the facial actions, then pairs for the local changes.
    masks : (R, N) bool
        Variations of the targets of the phenotypes, from ``phenotypes.target_masks``.
    n_actions : int
        Number of facial actions.
    vertices : (V,)
        Vertices of the base mesh that the figure has.
    regressor : JointRegressor
        Joints as means of vertices of the base mesh.
    matrix : (3, 3)
        Transform from the base mesh to the figure.
    """

    targets: TargetRows
    masks: Bools
    n_actions: int
    vertices: Ints
    regressor: JointRegressor
    matrix: Floats

    @property
    def n_weights(self) -> int:
        """Number of weights, S."""
        changes = (self.targets.count - len(self.masks) - self.n_actions) // 2
        return len(PHENOTYPES) + self.n_actions + changes

    def coefficients(self, weights: Floats) -> Floats:
        """Return the coefficients of all targets: (R,) for weights (S,)."""
        n_kinds = len(PHENOTYPES)
        changes = weights[n_kinds + self.n_actions :]
        pairs = np.stack([np.maximum(changes, 0.0), np.maximum(-changes, 0.0)], axis=1)
        phenotypes = weights_of(weights[:n_kinds] + TYPICAL, self.masks)
        actions = weights[n_kinds : n_kinds + self.n_actions]
        return np.concatenate([phenotypes, actions, pairs.reshape(-1)])

    def base_offsets(self, weights: Floats) -> Floats:
        """Return the displacement of the base mesh from the mean body: (B, 3)."""
        whole = np.zeros(self.n_weights)
        whole[: len(weights)] = weights
        change = self.coefficients(whole) - self.coefficients(np.zeros(self.n_weights))

        def make() -> Floats:
            return self.targets.weighted(change) @ self.matrix.T

        # Vertices and joints need the same sum.
        return _moved.get(self, change.tobytes(), make)

    def displacement(self, weights: Floats) -> Floats:
        """Return the displacement of the rest vertices: (V, 3), figure units."""
        return self.base_offsets(weights)[self.vertices]

    def joint_displacement(self, weights: Floats) -> Floats:
        """Return the displacement of the rest joints: (J, 3), figure units."""
        return regress_joints(self.regressor, self.base_offsets(weights))

    def mean_offsets(self) -> Floats:
        """Return the offsets of the mean body from the base mesh: (B, 3)."""
        mean = self.coefficients(np.zeros(self.n_weights))
        return self.targets.weighted(mean) @ self.matrix.T

    def directions(self) -> Floats:
        """Return the displacement by each weight of 1 alone: (S, V, 3)."""
        return np.stack([self.displacement(row) for row in np.eye(self.n_weights)])


_moved: Memo[TargetSpace, Floats] = Memo(kept=2)
