"""Hand poses as principal components (Romero et al. 2017, MANO)."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, frozen


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Hand:
    """The finger joints of one hand and the principal components of their rotations."""

    side: str
    """``"left"``, ``"right"``, or empty for a model of a single hand."""
    joints: Ints
    """(H,) int32. Finger joints, in the order of the components."""
    components: Floats
    """(C, 3 H). Concatenated rotation vectors, radians per unit of a coefficient."""
    mean: Floats
    """(3 H,). Rotation vectors of the mean hand; zeros are the flat hand."""

    def __post_init__(self) -> None:
        size = 3 * len(self.joints)
        put = object.__setattr__
        put(self, "joints", frozen("joints", self.joints, (None,), np.int32))
        put(self, "components", frozen("hands_components", self.components, (None, size)))
        put(self, "mean", frozen("hands_mean", self.mean, (size,)))


def hand_vectors(hand: Hand, coefficients: Floats, flat: bool) -> Floats:
    """Return the finger joints' rotation vectors (H, 3): mean + sum_i c_i component_i, radians."""
    if len(coefficients) > len(hand.components):
        raise RigError(
            f"expected at most {len(hand.components)} hand coefficients, found {len(coefficients)}"
        )
    vectors = coefficients @ hand.components[: len(coefficients)]
    return (vectors if flat else vectors + hand.mean).reshape(-1, 3)


def hand_coefficients(hand: Hand, vectors: Floats, flat: bool, count: int) -> Floats:
    """Return the first ``count`` coefficients that best fit vectors (H, 3), by least squares."""
    wanted = vectors.ravel() - (0.0 if flat else hand.mean)
    found = np.linalg.lstsq(hand.components[:count].T, wanted, rcond=None)[0]
    return np.asarray(found, dtype=np.float64)
