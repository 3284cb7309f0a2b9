"""What a motion sets at some times: curves, keys, frames and captured points alike."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton


def _no_indices() -> Ints:
    return np.zeros(0, dtype=np.int32)


def _no_values() -> Floats:
    return np.zeros((0, 0))


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Values that a motion sets at T times, undefined unless ``present``; poses keep all others."""

    present: Bools
    """(T,). Whether the actor is present."""
    targets: Ints = field(default_factory=_no_indices)
    dofs: Floats = field(default_factory=_no_values)
    """(C,), (T, C). Rows of the DOF table, and their values before they are clamped."""
    rotated: Ints = field(default_factory=_no_indices)
    rotations: Floats = field(default_factory=_no_values)
    """(R,), (T, R, 4). Joints, and their complete rotations relative to the parent: unit
    quaternions (x, y, z, w)."""
    translated: Ints = field(default_factory=_no_indices)
    translations: Floats = field(default_factory=_no_values)
    """(N,), (T, N, 3). Joints, and their offsets from rest, translation DOFs included."""
    scaled: Ints = field(default_factory=_no_indices)
    scales: Floats = field(default_factory=_no_values)
    """(M,), (T, M, 3). Joints, and their local scale factors."""
    weighted: Ints = field(default_factory=_no_indices)
    shape_weights: Floats = field(default_factory=_no_values)
    """(W,), (T, W). Blend shapes, and their weights."""
    figure_translations: Floats | None = None
    figure_scales: Floats | None = None
    """(T, 3), (T,). Placement of the whole figure, after skinning."""
    points: Floats | None = None
    """(T, K, 4). Captured points: x, y, z and confidence."""


def joint_samples(
    skeleton: Skeleton | None,
    present: Bools,
    rotations: Floats,
    translations: Floats | None = None,
    figure_translations: Floats | None = None,
    figure_scales: Floats | None = None,
    shape_weights: Floats | None = None,
    scales: Floats | None = None,
) -> Samples:
    """Return samples of all joints; translation DOFs stay as near to 0 as limits allow."""
    count, n_joints = rotations.shape[:2]
    joints = np.arange(n_joints, dtype=np.int32)
    moves, held = _no_indices(), np.zeros(0)
    if skeleton is not None:
        moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION).astype(np.int32)
        held = np.clip(0.0, *skeleton.dof_limits[moves].T)
    n_shapes = 0 if shape_weights is None else shape_weights.shape[1]
    return Samples(
        present,
        moves,
        np.broadcast_to(held, (count, len(moves))),
        joints,
        rotations,
        joints,
        np.zeros((count, n_joints, 3)) if translations is None else translations,
        _no_indices() if scales is None else joints,
        _no_values() if scales is None else scales,
        np.arange(n_shapes, dtype=np.int32),
        _no_values() if shape_weights is None else shape_weights,
        figure_translations,
        figure_scales,
    )
