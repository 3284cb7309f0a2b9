"""Influences in glTF form: sets of four with unique joints and positive weights that sum to 1."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.morph_target import MORPH_GROUP
from viewer.rigs.shape import shaped
from viewer.rigs.skin import (
    Skin,
    has_influence,
    influence_counts,
    limit_influences,
    owners,
    skin_from_entries,
    weight_sums,
)

PER_SET = 4
_SUM = 1e-6  # smaller deviations of weight sums from 1 are rounding errors of the original file
_MOST_JOINTS = 65536  # maximum number of joints, as indices have 16 bits
# Maximum number of targets: each takes 12 bytes per vertex, and programs support few.
_MOST_TARGETS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Influences:
    """A skin in the form that a file can store."""

    skin: Skin
    """Skin with unique joints per vertex, strongest first, and positive weights that sum to 1."""
    n_scaled: int
    """Number of vertices whose weights did not sum to 1."""
    n_negative: int
    """Number of vertices with negative weights, which glTF forbids."""
    n_fixed: int
    """Number of vertices without influence."""
    most: int
    """Largest number of influences of a vertex."""

    @property
    def n_joints(self) -> int:
        """Number of joints that the file's skin lists: one more if some vertices are fixed."""
        return self.skin.n_joints + bool(self.n_fixed)


def influences_of(skin: Skin) -> Influences:
    """Return a skin in the form that glTF can store."""
    merged = limit_influences(skin, max(1, int(influence_counts(skin).max(initial=0))))
    vertices = owners(merged)
    positive = np.maximum(merged.weights, 0.0)
    sums = np.bincount(vertices, positive, skin.n_vertices)[vertices]
    weights = np.divide(positive, sums, out=np.zeros_like(positive), where=sums > 0.0)
    kept = weights.astype(np.float32) > 0.0
    written = skin_from_entries(
        skin.n_vertices, vertices[kept], merged.joints[kept], weights[kept], skin.inverse_bind
    )
    counts = influence_counts(written)
    scaled = has_influence(skin) & (np.abs(weight_sums(skin) - 1.0) > _SUM)
    found = Influences(
        written,
        int(scaled.sum()),
        len(np.unique(vertices[merged.weights < 0.0])),
        int((counts == 0).sum()),
        int(counts.max(initial=0)),
    )
    if found.n_joints > _MOST_JOINTS:
        raise RigError(f"glTF supports at most {_MOST_JOINTS} joints, found {found.n_joints}")
    return found


def influence_sets(
    influences: Influences, sources: Ints
) -> Iterator[tuple[NDArray[np.unsignedinteger], Floats]]:
    """Yield JOINTS_n and WEIGHTS_n (R, 4) of vertices ``sources`` (R,); unused slots are 0."""
    skin = influences.skin
    counts, starts = influence_counts(skin)[sources], skin.starts[sources]
    dtype = np.uint8 if influences.n_joints <= 256 else np.uint16
    for first in range(0, max(influences.most, 1), PER_SET):
        rank = first + np.arange(PER_SET)
        used = rank < counts[:, None]
        place = (starts[:, None] + rank)[used]
        joints, weights = np.zeros(used.shape, dtype), np.zeros(used.shape)
        joints[used], weights[used] = skin.joints[place], skin.weights[place]
        if first == 0:
            # The last joint of the list is the node of vertices without influence.
            fixed = counts == 0
            joints[fixed, 0], weights[fixed, 0] = influences.n_joints - 1, 1.0
        yield joints, weights


def inverse_bind_matrices(influences: Influences, inverse_bind: Floats, decoding: Floats) -> Floats:
    """Return the matrices of all joints that the skin lists, in column-major order (N, 16)."""
    matrices = np.concatenate([inverse_bind, np.eye(4)[None]])[: influences.n_joints]
    if not np.array_equal(decoding, np.eye(4)):
        matrices = matrices @ decoding
    matrices[:, 3] = 0.0, 0.0, 0.0, 1.0  # set exactly, as readers expect
    return matrices.transpose(0, 2, 1).reshape(-1, 16)


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The written form of a figure's shape."""

    figure: Figure
    """Figure whose mesh, skeleton and skin are written."""
    targets: NDArray[np.intp]
    """(M,): blend shapes that become morph targets."""
    weights: Floats
    """(F, M) or (1, M): weights of the targets over time."""
    baked: Floats | None = None
    """(S,): the shape baked into the mesh instead; None if there is none."""


def shape_of(figure: Figure, weights: Floats, reference: int = 0) -> Shape:
    """Return the written form of a figure's shape; row ``reference`` of weights can be baked."""
    shapes, is_used = figure.blend_shapes, np.asarray(weights.any(axis=0))
    is_own = np.zeros(len(is_used), dtype=np.bool_)
    if shapes is not None and figure.record is not None:
        groups = enumerate(shapes.groups[: len(is_used)])
        is_own[:] = [group == MORPH_GROUP and not shapes.is_expression(s) for s, group in groups]
    used = np.flatnonzero(is_used | is_own)
    if figure.mesh is None or shapes is None or len(used) == 0:
        return Shape(figure, used[:0], np.zeros((1, 0)))
    if (
        figure.joint_regressor is None
        and shapes.is_linear
        and np.sum(is_used & ~is_own) <= _MOST_TARGETS
    ):
        return Shape(figure, used, weights[:, used])
    row = weights[min(reference, len(weights) - 1)]
    whole = replace(shaped(figure, row), blend_shapes=None)
    return Shape(whole, used[:0], np.zeros((1, 0)), row)
