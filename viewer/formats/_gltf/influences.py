"""Influences of the vertices of a primitive: all sets of joints and weights in one table."""

from __future__ import annotations

import numpy as np

from viewer.formats._gltf.attributes import Attributes
from viewer.rig.arrays import Floats, Ints

__all__ = ["read_influences"]


def read_influences(attributes: Attributes) -> tuple[Ints, Floats] | tuple[None, None]:
    """Return joints (V, K) int32 and weights (V, K), as stored; None if there are none.

    Joint indices of weight 0 are set to 0, because files may contain any number in these slots.

    Raises
    ------
    FormatError
        If an attribute is malformed, or a weight is not finite.
    """
    numbers = attributes.sets("JOINTS")
    without = sorted(set(numbers) ^ set(attributes.sets("WEIGHTS")))
    if without:
        attributes.element.warn("G004.influence-sets", sets=without)
    joints, weights = [], []
    for number in numbers:
        if number in without:
            continue
        joint_set = attributes.integers(f"JOINTS_{number}", "VEC4")
        weight_set = attributes.fractions(f"WEIGHTS_{number}", "VEC4")
        if joint_set is not None and weight_set is not None:
            joints.append(joint_set)
            weights.append(_finite(attributes, number, weight_set))
    if not joints:
        return None, None
    all_weights = np.concatenate(weights, axis=1)
    all_joints = np.where(all_weights == 0.0, 0, np.concatenate(joints, axis=1))
    # Indices are at most 65535 in valid files; larger ones are reported with the skin.
    return np.minimum(all_joints, np.iinfo(np.int32).max).astype(np.int32), all_weights


def _finite(attributes: Attributes, number: int, weights: Floats) -> Floats:
    """Return weights; non-finite ones are errors, and become 0 if errors are only recorded."""
    bad = ~np.isfinite(weights)
    if bad.any():
        row, column = (int(axis[0]) for axis in np.nonzero(bad))
        source, pointer = attributes.element.source, attributes.element.at(f"WEIGHTS_{number}")
        vertex, found = attributes.vertex(row), float(weights[row, column])
        n = int(bad.sum())
        source.refuse("W003.gltf-weights", pointer, n=n, vertex=vertex, found=found)
        weights = np.where(bad, 0.0, weights)
    return weights
