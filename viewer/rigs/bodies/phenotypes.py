"""Phenotypes of Anny: age, gender, height and others, as blends of MakeHuman's targets.

Brégier et al., Human Mesh Modeling for Anny Body. A target belongs to one variation of several
phenotypes (``female``, ``young``, ``maxmuscle`` ...). A value between two anchors of a phenotype
assigns weights to two variations; a target's coefficient is the product of the weights of its
variations::

    c_t = prod_{v in t} w_v        w_v: piecewise linear in the phenotype, sums to 1

The values of the origins are normalised to a sum of 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Lock

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.blendshapes import JointRegressor, regress_joints
from viewer.rigs.memo import Memo

VARIATIONS = {
    "gender": ("male", "female"),
    "age": ("newborn", "baby", "child", "young", "old"),
    "muscle": ("minmuscle", "averagemuscle", "maxmuscle"),
    "weight": ("minweight", "averageweight", "maxweight"),
    "height": ("minheight", "maxheight"),
    "proportions": ("idealproportions", "uncommonproportions"),
    "cupsize": ("mincup", "averagecup", "maxcup"),
    "firmness": ("minfirmness", "averagefirmness", "maxfirmness"),
}
"""Variations of each phenotype, at equal distances from the lowest value to 1."""
ORIGINS = ("african", "asian", "caucasian")
"""Phenotypes that are variations themselves."""
PHENOTYPES = (*VARIATIONS, *ORIGINS)
"""Names of the phenotypes, in the order of Anny's sliders."""
TYPICAL = 0.5
"""Value of every phenotype of the mean body."""
_NEWBORN = -1.0 / 3.0  # age value of the first anchor; a baby has the value 0
_ALL = tuple(name for names in VARIATIONS.values() for name in names) + ORIGINS


def phenotype_range(name: str) -> tuple[float, float]:
    """Return the smallest and largest value of a phenotype."""
    return (_NEWBORN if name == "age" else 0.0), 1.0


def target_masks(targets: Sequence[Sequence[str]]) -> Bools:
    """Return which of the N variations (rows: R) each target belongs to: (R, N) bool."""
    mask = np.zeros((len(targets), len(_ALL)), dtype=np.bool_)
    for row, names in enumerate(targets):
        mask[row, [_ALL.index(name) for name in names]] = True
    return mask


def weights_of(values: Floats, masks: Bools) -> Floats:
    """Return coefficients (R,): products of the weights of the variations (R, N) of each target."""
    parts = [
        _anchored(float(value), len(names), phenotype_range(name)[0])
        for value, (name, names) in zip(values[: len(VARIATIONS)], VARIATIONS.items(), strict=True)
    ]
    weights = np.concatenate([*parts, _fractions(values[len(VARIATIONS) :])])
    return np.where(masks, weights, 1.0).prod(axis=1)


def _anchored(value: float, count: int, low: float) -> Floats:
    """Return the weights of ``count`` anchors at equal distances from ``low`` to 1."""
    anchors = np.linspace(low, 1.0, count)
    return np.array([np.interp(value, anchors, row) for row in np.eye(count)])


def _fractions(values: Floats) -> Floats:
    """Return the fractions of the origins; equal ones if all values are 0."""
    total = float(values.sum())
    return values / total if total else np.full(len(values), 1.0 / len(values))


class TargetRows:
    """Offsets by target, each read on first use: its vertices (N,) and their offsets (N, 3)."""

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
    """

    targets: TargetRows
    """Targets of the phenotypes, then of the facial actions, then pairs for the local changes."""
    masks: Bools
    """(R, N) bool. Variations of the targets of the phenotypes, from
    ``phenotypes.target_masks``."""
    n_actions: int
    """Number of facial actions."""
    vertices: Ints
    """(V,). Vertices of the base mesh that the figure has."""
    regressor: JointRegressor
    """Joints as means of vertices of the base mesh."""
    matrix: Floats
    """(3, 3). Transform from the base mesh to the figure."""

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
