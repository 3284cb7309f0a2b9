"""Skins: the influences of joints on vertices, and the inverse bind matrices."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields
from viewer.rigs.checked_fields import checked
from viewer.rigs.skeleton import Skeleton, shown_joint_of, shown_joints

_NO_SUM = 1e-12  # minimum sum of weights that can be scaled to 1


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Skin:
    """The influences of all vertices in one flat list, as stored in the file.

    A padded (V, K) table would need V times the largest K: one vertex with a thousand
    influences would multiply the memory of all others. A flat list represents any number of
    influences exactly.
    """

    starts: Ints
    """(V + 1,) int32. Vertex v has the influences from ``starts[v]`` up to, but not including,
    ``starts[v + 1]``."""
    joints: Ints
    """(N,) int32. Joint of each influence; if a vertex lists a joint twice, the weights are
    summed."""
    weights: Floats
    """(N,). Weights as stored: not sorted, not normalised, possibly 0."""
    inverse_bind: Floats
    """(J, 4, 4). Bind-space-to-joint matrices."""
    dqs_fractions: Floats | None = None
    """(V,) or None. The fraction of dual quaternion skinning that the file asks for at each vertex,
    the rest is linear; None for linear blend skinning."""
    unweighted: Bools | None = None
    """(V,) or None. Vertices to which the file gives no weights: the reader attached them to a
    joint, as other programs do."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, starts=(None,), joints=(None,))
        freeze_fields(self, weights=(len(self.joints),), inverse_bind=(None, 4, 4))
        freeze_fields(self, dqs_fractions=(len(self.starts) - 1,))
        freeze_fields(self, np.bool_, unweighted=(len(self.starts) - 1,))
        counts = np.diff(self.starts)
        if len(self.starts) == 0 or self.starts[0] != 0 or (counts < 0).any():
            raise RigError("starts: expected indices that begin at 0 and never decrease")
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
        """Number of bound joints, J."""
        return len(self.inverse_bind)


def skin_from_lists(
    influences: Iterable[Iterable[tuple[int, float]]], inverse_bind: Floats
) -> Skin:
    """Build a skin from (joint, weight) pairs per vertex; meant for small, hand-made figures."""
    rows = [list(row) for row in influences]
    pairs = [pair for row in rows for pair in row]
    return Skin(
        starts=np.cumsum([0, *map(len, rows)]).astype(np.int32),
        joints=np.array([joint for joint, _ in pairs], dtype=np.int32),
        weights=np.array([weight for _, weight in pairs], dtype=np.float64),
        inverse_bind=inverse_bind,
    )


def bind_positions(skin: Skin) -> Floats:
    """Return the positions of the joints in the bind pose: (J, 3); the origin if there is none."""
    singular = np.linalg.det(skin.inverse_bind) == 0.0
    matrices = np.where(singular[:, None, None], np.eye(4), skin.inverse_bind)
    positions: Floats = np.linalg.inv(matrices)[:, :3, 3].astype(np.float64, copy=False)
    return positions


def influence_counts(skin: Skin) -> Ints:
    """Return the number of influences of each vertex: (V,) int32."""
    return np.diff(skin.starts)


def weight_sums(skin: Skin) -> Floats:
    """Return the sum of each vertex's weights: (V,), 0 without influences."""
    sums = np.bincount(owners(skin), weights=skin.weights, minlength=skin.n_vertices)
    return sums.astype(np.float64, copy=False)


def has_influence(skin: Skin) -> Bools:
    """Return a mask (V,) of vertices with a non-zero weight; others stay where bound."""
    counts = influence_counts(skin)
    zero = skin.weights == 0.0
    if not zero.any():
        return counts > 0
    return np.bincount(owners(skin), weights=~zero, minlength=skin.n_vertices) > 0


def joint_fractions(skin: Skin) -> Floats:
    """Return each joint's fraction of the sum of all weights: (J,), for a figure's mean motion."""
    sums = np.bincount(skin.joints, np.abs(skin.weights), minlength=skin.n_joints)
    fractions: Floats = sums / (sums.sum() or 1.0)
    return fractions


def moves_vertices(skin: Skin) -> Bools:
    """Return a mask (J,) of joints with a positive weight."""
    return np.bincount(skin.joints[skin.weights > 0.0], minlength=skin.n_joints) > 0


def stated_weights(skin: Skin) -> Skin:
    """Return the skin with weights of 0 at vertices to which the file gives none."""
    if skin.unweighted is None:
        return skin
    return replace(skin, weights=np.where(skin.unweighted[owners(skin)], 0.0, skin.weights))


def idle_joints(skin: Skin, skeleton: Skeleton | None = None) -> Ints:
    """Return joints (N,) without influence; influences of auxiliary ones count for those shown."""
    used, shown = skin.joints[skin.weights != 0.0], np.arange(skin.n_joints, dtype=np.int32)
    if skeleton is not None and skeleton.n_joints == skin.n_joints:
        used, shown = shown_joint_of(skeleton)[used], shown_joints(skeleton)
    return np.setdiff1d(shown, used)


def skin_from_entries(
    n_vertices: int, vertices: Ints, joints: Ints, weights: Floats, inverse_bind: Floats
) -> Skin:
    """Build a skin from entries (N,) of a sparse matrix; their order within a vertex is kept."""
    order = np.argsort(vertices, kind="stable")
    counts = np.bincount(vertices, minlength=n_vertices)
    return Skin(
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.asarray(joints)[order].astype(np.int32),
        weights=np.asarray(weights, dtype=np.float64)[order],
        inverse_bind=inverse_bind,
    )


def skin_rows(skin: Skin, vertices: Ints) -> Skin:
    """Return the skin of some vertices, or of copies of them, in the order given."""
    counts = np.diff(skin.starts)[vertices]
    starts = np.concatenate([[0], np.cumsum(counts)])
    index = np.repeat(skin.starts[vertices] - starts[:-1], counts) + np.arange(starts[-1])
    return replace(
        skin,
        starts=starts.astype(np.int32),
        joints=skin.joints[index],
        weights=skin.weights[index],
        dqs_fractions=None if skin.dqs_fractions is None else skin.dqs_fractions[vertices],
        unweighted=None if skin.unweighted is None else skin.unweighted[vertices],
    )


def row_norms(n_vertices: int, vertices: Ints, joints: Ints, weights: Floats) -> Floats:
    """Return each vertex's sum over joints of |weight| (V,), entries of the same joint added first.

    For the entries of one skin and the negated entries of another, this is the L1 distance of their
    rows, regardless of the order of influences and of duplicate joints.
    """
    n_joints = int(joints.max(initial=0)) + 1
    entries, places = np.unique(vertices.astype(np.int64) * n_joints + joints, return_inverse=True)
    sums = np.abs(np.bincount(places, weights, minlength=len(entries)))
    rows = np.bincount(entries // n_joints, sums, minlength=n_vertices)
    return rows.astype(np.float64, copy=False)


def strongest_first(skin: Skin) -> Skin:
    """Return the skin with each vertex's influences stably sorted by decreasing weight."""
    order = np.lexsort((-skin.weights, owners(skin)))
    return replace(skin, joints=skin.joints[order], weights=skin.weights[order])


def strongest_influences(skin: Skin) -> Ints:
    """Return the strongest influence of each vertex that has influences, as indices: (M,)."""
    vertices = owners(skin)
    order = np.lexsort((skin.weights, vertices))
    last = np.flatnonzero(np.diff(vertices[order], append=-1))
    return order[last].astype(np.int32)


def limit_influences(skin: Skin, count: int) -> Skin:
    """Merge, prune to the ``count`` largest and normalise each vertex's influences."""
    ordered = strongest_first(merged(skin))
    rank = np.arange(len(ordered.joints)) - np.repeat(
        ordered.starts[:-1], influence_counts(ordered)
    )
    kept = rank < count
    counts = np.bincount(owners(ordered)[kept], minlength=skin.n_vertices)
    pruned = replace(
        skin,
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=ordered.joints[kept],
        weights=ordered.weights[kept],
    )
    return normalized(pruned)


def normalized(skin: Skin) -> Skin:
    """Return the skin with each vertex's weights scaled to a sum of 1; sums of 0 are unchanged."""
    sums = weight_sums(skin)
    factors = np.divide(1.0, sums, out=np.ones_like(sums), where=np.abs(sums) > _NO_SUM)
    return replace(skin, weights=skin.weights * factors[owners(skin)])


def merged(skin: Skin) -> Skin:
    """Return the skin with duplicate influences of a joint on a vertex merged."""
    keys = owners(skin).astype(np.int64) * skin.n_joints + skin.joints
    unique, inverse = np.unique(keys, return_inverse=True)
    if len(unique) == len(keys):
        return skin
    weights = np.bincount(inverse, skin.weights).astype(np.float64, copy=False)
    joints = (unique % skin.n_joints).astype(np.int32)
    found = skin_from_entries(
        skin.n_vertices, unique // skin.n_joints, joints, weights, skin.inverse_bind
    )
    return replace(found, dqs_fractions=skin.dqs_fractions, unweighted=skin.unweighted)


def owners(skin: Skin) -> Ints:
    """Return the vertex of each influence: (N,) int32."""
    return np.repeat(np.arange(skin.n_vertices, dtype=np.int32), influence_counts(skin))
