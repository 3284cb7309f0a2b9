"""Small rigged figures for tests of rig transfer."""

from itertools import pairwise

import numpy as np

from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import skin_from_entries

HALF_TURN = np.pi


def turn(axis, angle):
    """Return a rotation about an axis of any length, by Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def mesh_of(positions, triangles) -> Mesh:
    """Return a mesh with the normals of its surface."""
    triangles = np.asarray(triangles, dtype=np.int32)
    return Mesh(positions, vertex_normals(positions, triangles), triangles)


def tube(around=16, along=21, length=2.0):
    """Return a closed tube along y with an asymmetric cross-section that widens upwards."""
    angles = np.arange(around) * 2 * np.pi / around
    heights = np.linspace(0.0, length, along)
    section = np.stack([0.3 * np.cos(angles) + 0.08 * np.cos(2 * angles), 0.2 * np.sin(angles)], 1)
    rings = [[(1 + 0.2 * y) * x, y, (1 + 0.2 * y) * z + 0.05 * y * y] for y in heights
             for x, z in section]  # fmt: skip
    positions = np.array([*rings, [0.0, -0.1, 0.0], [0.0, length + 0.2, 0.05 * length**2]])
    ring = np.arange(around * along).reshape(along, around)
    a, b = ring[:-1], np.roll(ring, -1, axis=1)[:-1]
    c, d = np.roll(ring, -1, axis=1)[1:], ring[1:]
    sides = np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)
    low, high = len(positions) - 2, len(positions) - 1
    first, last = ring[0], ring[-1]
    caps = [*[(first[k], first[(k + 1) % around], low) for k in range(around)],
            *[(last[(k + 1) % around], last[k], high) for k in range(around)]]  # fmt: skip
    return positions, np.concatenate([sides, np.array(caps)]).astype(np.int32)


def arm(root_moves=True, limit=np.inf) -> Figure:
    """Return a tube with joints at y = 0 and y = 1 and weights blended linearly from 0.8 to 1.2."""
    positions, triangles = tube()
    fraction = np.clip((positions[:, 1] - 0.8) / 0.4, 0.0, 1.0)
    vertices = np.tile(np.arange(len(positions)), 2)
    joints = np.repeat([0, 1], len(positions))
    weights = np.concatenate([1 - fraction, fraction])
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -1.0
    kept = weights > 0
    moves = 3 if root_moves else 0
    skeleton = Skeleton(
        names=("base", "tip"),
        parents=np.array([-1, 0]),
        rest_translations=np.array([[0.0, 0, 0], [0, 1, 0]]),
        rest_rotations=np.tile([0.0, 0, 0, 1], (2, 1)),
        rest_scales=np.ones((2, 3)),
        dof_joints=np.array([0] * moves + [0] * 3 + [1] * 3),
        dof_kinds=np.array([*range(moves), 3, 4, 5, 3, 4, 5]),
        rest_dofs=np.zeros(moves + 6),
        dof_limits=np.tile([-limit, limit], (moves + 6, 1)),
    )
    skin = skin_from_entries(len(positions), vertices[kept], joints[kept], weights[kept], bind)
    return Figure("arm", mesh_of(positions, triangles), skeleton, skin)


def pipe(corners, radius, around=8, end_radius=None):
    """Return a closed tube along a polyline, its ends tapered to points: positions, triangles."""
    corners = np.asarray(corners, dtype=float)
    points = np.concatenate([np.linspace(a, b, 6)[:-1] for a, b in pairwise(corners)])
    points = np.concatenate([points, corners[-1:]])
    radii = np.linspace(radius, radius if end_radius is None else end_radius, len(points))
    ways = np.gradient(points, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    across = np.cross(ways, np.eye(3)[np.abs(ways).max(axis=0).argmin()])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angles = np.arange(around) * 2 * np.pi / around
    rings = [
        p + r * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * np.cross(w, u))
        for p, r, u, w in zip(points, radii, across, ways, strict=True)
    ]
    ends = [points[0] - radii[0] * ways[0], points[-1] + radii[-1] * ways[-1]]
    ring = np.arange(around * len(points)).reshape(len(points), around)
    a, b = ring[:-1], np.roll(ring, -1, axis=1)[:-1]
    c, d = np.roll(ring, -1, axis=1)[1:], ring[1:]
    sides = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    low = ring.size
    following = np.roll(np.arange(around), -1)
    caps = [
        *[(low, ring[0, after], ring[0, k]) for k, after in enumerate(following)],
        *[(low + 1, ring[-1, k], ring[-1, after]) for k, after in enumerate(following)],
    ]
    return np.concatenate([*rings, ends]), np.concatenate([sides, caps]).astype(np.int32)


def united(*parts):
    """Return one mesh of several parts: positions, triangles."""
    starts = np.cumsum([0, *(len(part[0]) for part in parts)])
    triangles = [part[1] + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part[0] for part in parts]), np.concatenate(triangles)


KNEES = {"leg_1": [(0.2, 0.5, 0.25), (0.8, 0.9, 0.7), (1.1, 0.02, 1.0)],
         "leg_2": [(0.2, 0.5, -0.25), (0.9, 0.9, -0.6), (1.3, 0.02, -0.9)]}  # fmt: skip
TRUNK = pipe([(0, 0.5, -0.45), (0, 0.5, 0.45)], 0.25)


def beast(left=KNEES, right=KNEES):
    """Return a trunk along z with two pairs of legs that bend once."""
    legs = [pipe(corners, 0.05) for corners in left.values()]
    legs += [pipe(np.multiply(corners, [-1, 1, 1]), 0.05) for corners in right.values()]
    return united(TRUNK, *legs)
