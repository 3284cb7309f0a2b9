"""Small rigs for tests of the maths, and a simple reference implementation of skinning."""

import math

import numpy as np

from viewer.rigs.mesh import Mesh
from viewer.rigs.skeleton import Skeleton

KINDS = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}


def skeleton(parents, dofs=(), names=None, offsets=None, boxes=None) -> Skeleton:
    """Build a skeleton from parents and DOFs, each (joint, kind, rest value, low, high)."""
    n_joints = len(parents)
    rows = [(*row, -np.inf, np.inf)[:5] if len(row) == 3 else row for row in dofs]
    return Skeleton(
        names=tuple(names or (f"j{joint}" for joint in range(n_joints))),
        parents=parents,
        rest_translations=np.zeros((n_joints, 3)) if offsets is None else offsets,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (n_joints, 1)),
        rest_scales=np.ones((n_joints, 3)),
        dof_joints=np.array([row[0] for row in rows], dtype=np.int32),
        dof_kinds=np.array([KINDS[row[1]] for row in rows], dtype=np.int32),
        rest_dofs=np.array([row[2] for row in rows], dtype=float),
        dof_limits=np.array([row[3:5] for row in rows], dtype=float).reshape(-1, 2),
        boxes=boxes,
    )


def mesh(positions, normals=None, triangles=((0, 0, 0),)) -> Mesh:
    """Build a mesh; normals default to +z."""
    positions = np.array(positions, dtype=float).reshape(-1, 3)
    normals = np.tile([0.0, 0.0, 1.0], (len(positions), 1)) if normals is None else normals
    return Mesh(positions, normals, np.array(triangles, dtype=np.int32).reshape(-1, 3))


def matrix(turn=None, move=(0.0, 0.0, 0.0)):
    """Return a 4 x 4 matrix that rotates, then translates."""
    result = np.eye(4)
    if turn is not None:
        result[:3, :3] = turn
    result[:3, 3] = move
    return result


def turn_x(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]], dtype=float)


def turn_y(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]], dtype=float)


def turn_z(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=float)


def plain_kinematics(parents, local):
    """Multiply the matrices of each joint's chain separately, from the joint up to its root."""
    world = []
    for joint in range(len(parents)):
        product = np.eye(4)
        while joint >= 0:
            product = local[joint] @ product
            joint = parents[joint]
        world.append(product)
    return np.array(world)


def plain_skinning(positions, normals, influences, palette):
    """Skin vertex by vertex and influence by influence, following the formula literally."""
    out_positions, out_normals = [], []
    for position, normal, pairs in zip(positions, normals, influences, strict=True):
        if not any(weight != 0.0 for _, weight in pairs):
            pairs, matrices = [(0, 1.0)], [np.eye(4)]
        else:
            matrices = palette
        moved = sum(w * (matrices[j] @ [*position, 1.0]) for j, w in pairs)
        turned = sum(w * (matrices[j] @ [*normal, 0.0]) for j, w in pairs)[:3]
        out_positions.append(moved[:3])
        out_normals.append(turned / np.linalg.norm(turned))
    return np.array(out_positions), np.array(out_normals)
