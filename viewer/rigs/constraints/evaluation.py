"""Evaluation of constraints: rotations of joints that follow other joints.

With the rest rotations r and current rotations q of source s and joint j, as quaternions relative
to their parents, a constraint of weight w sets ``q_j = slerp(r_j, target, w)``, where ``target`` is

- rotation: ``r_j r_s^-1 q_s``;
- roll: ``r_j twist(d, axis)``, where ``d = r_j^-1 q_s r_s^-1 r_j`` is the source's rotation from
its rest pose in the joint's axes, and its twist is the part about the axis (swing-twist
decomposition);
- aim: ``p^-1 arc(p r_j axis, direction) p r_j``, where p is the world rotation of the parent, and
  the arc is the smallest rotation from the axis to the direction of the source.

Source: ``VRMC_node_constraint`` 1.0, github.com/vrm-c/vrm-specification.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.quaternion import between, conjugate, multiply, slerp
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.skeleton import Skeleton

if TYPE_CHECKING:
    from viewer.rigs.constraints.constraint import Constraint

_NONE = np.array([0.0, 0.0, 0.0, 1.0])
_SHORT = 1e-12


def constrained_matrices(
    skeleton: Skeleton, rotations: Floats, translations: Floats, scales: Floats
) -> Floats:
    """Return ``constrained`` for rotation matrices: (J, ..., 3, 3)."""
    if not skeleton.constraints:
        return rotations
    joints = [constraint.joint for constraint in skeleton.constraints]
    quaternions = matrix_to_quaternion(rotations)
    found = constrained(skeleton, quaternions, translations, scales)
    result = rotations.copy()
    result[joints] = quaternion_to_matrix(found[joints])
    return result


def constrained(
    skeleton: Skeleton, rotations: Floats, translations: Floats, scales: Floats
) -> Floats:
    """Return local rotations (J, ..., 4) with all constraints applied, idempotently."""
    if not skeleton.constraints:
        return rotations
    result = rotations.copy()
    rest = skeleton.rest_rotations
    rest = rest / np.linalg.norm(rest, axis=-1, keepdims=True)
    for each in skeleton.constraints:
        own = rest[each.joint]
        if each.kind == "aim":
            target = _aimed(skeleton, each, own, (result, translations, scales))
        else:
            back = conjugate(rest[each.source])
            if each.kind == "rotation":
                turn = multiply(back, result[each.source])
            else:
                moved = multiply(result[each.source], back)
                turn = _twist(multiply(multiply(conjugate(own), moved), own), np.array(each.axis))
            target = multiply(own, turn)
        result[each.joint] = slerp(np.broadcast_to(own, target.shape), target, each.weight)
    return result


def _aimed(
    skeleton: Skeleton, each: Constraint, own: Floats, local: tuple[Floats, Floats, Floats]
) -> Floats:
    """Return the rotation that points an axis at the source: (..., 4)."""
    above = int(skeleton.parents[each.joint])
    parent, linear, place = _world(skeleton, above, local)
    place = place + np.einsum("...ab,...b->...a", linear, local[1][each.joint])
    there = _world(skeleton, each.source, local)[2]
    direction, length = _unit(there - place)
    start = quaternion_to_matrix(multiply(parent, own)) @ np.array(each.axis)
    arc = np.where(length > _SHORT, between(start, direction), _NONE)
    return multiply(multiply(multiply(conjugate(parent), arc), parent), own)


def _world(
    skeleton: Skeleton, joint: int, local: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Return a joint's rotation (..., 4), linear part (..., 3, 3) and position (..., 3)."""
    rotations, translations, scales = local
    shape = rotations.shape[1:-1]
    rotation = np.broadcast_to(_NONE, (*shape, 4))
    linear, place = np.broadcast_to(np.eye(3), (*shape, 3, 3)), np.zeros((*shape, 3))
    for each in path_to_root(skeleton.parents, joint)[::-1]:
        place = place + np.einsum("...ab,...b->...a", linear, translations[each])
        linear = linear @ (quaternion_to_matrix(rotations[each]) * scales[each][..., None, :])
        rotation = multiply(rotation, rotations[each])
    return rotation, linear, place


def _twist(rotation: Floats, axis: Floats) -> Floats:
    """Return the twist of a rotation about an axis; the identity if it is undefined."""
    along = (rotation[..., :3] @ axis)[..., None] * axis
    found, length = _unit(np.concatenate([along, rotation[..., 3:]], axis=-1))
    return np.where(length > _SHORT, found, _NONE)


def _unit(vectors: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors, and lengths with a last axis of size 1."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, _SHORT), length
