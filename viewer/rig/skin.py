"""Skin: which joints move which vertices, how strongly, and where the joints were bound."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints, frozen

__all__ = ["Skin", "has_influence", "influence_counts", "skin_from_lists", "weight_sums"]


@dataclass(frozen=True, slots=True, eq=False)
class Skin:
    """Influences of all vertices, one after the other, as the files list them.

    A padded (V, K) table would cost V times the largest K: one vertex with a thousand
    influences would multiply the memory of all others. A flat list holds any count exactly.

    Attributes
    ----------
    starts : (V + 1,) int32
        Vertex v owns influences ``starts[v]`` up to ``starts[v + 1]``.
    joints : (N,) int32
        Joint of each influence; a joint may occur twice in a vertex, weights then add up.
    weights : (N,)
        As stored: not sorted, not normalised, may be 0.
    inverse_bind : (J, 4, 4)
        Bind-space-to-joint matrices.
    """

    starts: Ints
    joints: Ints
    weights: Floats
    inverse_bind: Floats

    def __post_init__(self) -> None:
        def put(name: str, shape: tuple[int | None, ...], dtype: type = np.float64) -> None:
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape, dtype))

        put("starts", (None,), np.int32)
        put("joints", (None,), np.int32)
        put("weights", (len(self.joints),))
        put("inverse_bind", (None, 4, 4))
        counts = np.diff(self.starts)
        if len(self.starts) == 0 or self.starts[0] != 0 or (counts < 0).any():
            raise RigError("starts: expected indices that begin at 0 and never fall")
        if self.starts[-1] != len(self.joints):
            raise RigError(
                f"starts: expected to end at {len(self.joints)}, found {self.starts[-1]}"
            )
        if len(self.joints) and not (
            self.joints.min() >= 0 and self.joints.max() < len(self.inverse_bind)
        ):
            raise RigError(
                f"joints: expected indices 0 to {len(self.inverse_bind) - 1}, "
                f"found {self.joints.min()} to {self.joints.max()}"
            )

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return len(self.starts) - 1

    @property
    def n_joints(self) -> int:
        """Number of joints that were bound, J."""
        return len(self.inverse_bind)


def skin_from_lists(
    influences: Iterable[Iterable[tuple[int, float]]], inverse_bind: Floats
) -> Skin:
    """Build a skin from (joint, weight) pairs per vertex; meant for small, hand-made figures.

    Parameters
    ----------
    influences : V lists of pairs
        In vertex order.
    inverse_bind : (J, 4, 4)
        Bind-space-to-joint matrices.

    Returns
    -------
    Skin
        With the same pairs in the same order.

    >>> skin_from_lists([[(0, 1.0)], []], np.eye(4)[None]).starts.tolist()
    [0, 1, 1]
    """
    rows = [list(row) for row in influences]
    pairs = [pair for row in rows for pair in row]
    return Skin(
        starts=np.cumsum([0, *map(len, rows)]).astype(np.int32),
        joints=np.array([joint for joint, _ in pairs], dtype=np.int32),
        weights=np.array([weight for _, weight in pairs], dtype=np.float64),
        inverse_bind=inverse_bind,
    )


def influence_counts(skin: Skin) -> Ints:
    """Return how many influences each vertex lists: (V,) int32."""
    return np.diff(skin.starts)


def weight_sums(skin: Skin) -> Floats:
    """Return the sum of each vertex's weights: (V,), 0 where it lists none."""
    owners = np.repeat(np.arange(skin.n_vertices), influence_counts(skin))
    sums = np.bincount(owners, weights=skin.weights, minlength=skin.n_vertices)
    return sums.astype(np.float64, copy=False)


def has_influence(skin: Skin) -> Bools:
    """Return which vertices any joint moves: at least one weight that is not 0. (V,) bool.

    The others stay where they were bound; summing nothing would send them to the origin.
    """
    counts = influence_counts(skin)
    zero = skin.weights == 0.0
    if not zero.any():
        return counts > 0
    owners = np.repeat(np.arange(skin.n_vertices), counts)
    return np.bincount(owners, weights=~zero, minlength=skin.n_vertices) > 0
