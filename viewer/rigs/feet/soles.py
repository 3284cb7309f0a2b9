"""Soles of the feet: mesh points that may touch the ground, for any foot rotation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import mean_scale
from viewer.rigs.hierarchy import descendants
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import zero_pose
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.shape import rest_joints
from viewer.rigs.skin import Skin, owners, strongest_influences
from viewer.rigs.skinning import deform

_STRAYS = 0.001  # fraction of vertices at either end that is excluded from the height
# Tilts of a foot, from walking to lying on its instep.
_TILTS = np.radians([20.0, 45.0, 70.0, 95.0, 125.0, 155.0])
# Difference of skinning matrices from the identity at which a figure is bound at rest, relative to
# its size.
_BOUND = 1e-4
_N_SIDES = 8  # number of horizontal directions of tilts

_soles: Memo[Figure, Soles | None] = Memo(kept=2)


@dataclass(frozen=True, slots=True, eq=False)
class Soles:
    """Points that move with the joints of the feet."""

    joints: Ints
    """(N,) int32. For each of N feet, the joint nearest to the ground: the ball of the foot, or the
    ankle."""
    feet: Ints
    """(P,). The foot to which each point belongs."""
    movers: Ints
    """(P,) int32. The joint with which each point moves."""
    places: Floats
    """(P, 3). Positions of the points in that joint's space."""
    above: Floats
    """(P,). Height of each point above the sole at rest: 0 on a mesh."""
    ankles: Ints
    """(N,) int32. The ankle of each foot, or its ball if the ankle is unknown."""
    heels: Floats
    """(N, 4). The point of the sole below each ankle at rest, in the ankle's space, homogeneous."""

    def heights(self, world: Floats, axis: Floats, scale: float) -> Floats:
        """Return each foot's lowest height (F, N); ``axis`` (4,): placement's row that gives it."""
        points = np.append(self.places, np.ones((len(self.places), 1)), axis=1)
        result = np.full((len(world), len(self.joints)), np.inf)
        for mover in set(self.movers.tolist()):
            row = np.einsum("a,fab->fb", axis[:3], world[:, mover, :3])
            for foot in range(len(self.joints)):
                own = (self.movers == mover) & (self.feet == foot)
                if own.any():
                    heights = row @ points[own].T + (axis[3] - scale * self.above[own])
                    result[:, foot] = np.minimum(result[:, foot], heights.min(axis=1))
        return result

    def scene_heights(self, world: Floats, placement: Floats, up: str) -> Floats:
        """Return the heights (F, N) along the scene's up axis of an actor's feet."""
        return self.heights(world, placement["xyz".index(up)], mean_scale(placement))


def extent(figure: Figure) -> tuple[float, float]:
    """Return the height of the sole along the up axis at rest, and the figure's height."""
    axis = _axis(figure)
    values = rest_joints(figure)[:, axis]
    if figure.mesh is not None:
        ends = (_STRAYS, 1.0 - _STRAYS)
        values = np.quantile(_resting(figure, figure.mesh)[:, axis], ends, method="nearest")
    return float(values.min()), float(np.ptp(values))


def _resting(figure: Figure, mesh: Mesh) -> Floats:
    """Return the vertices (V, 3) at rest, which may be bound in another pose."""
    skeleton, skin = figure.skeleton, figure.skin
    if skeleton is None or skin is None:
        return mesh.positions
    palette = world_matrices(skeleton, zero_pose(skeleton)) @ skin.inverse_bind
    # Most figures are bound at rest: their vertices need no skinning.
    moved = np.abs(palette - np.eye(4)).max(axis=0)[:3]
    moved[:, 3] /= max(float(np.ptp(mesh.positions)), 1e-300)
    if moved.max() < _BOUND:
        return mesh.positions
    return deform(figure, zero_pose(skeleton))[0]


def _axis(figure: Figure) -> int:
    return 2 if figure.up == "z" else 1


def soles_of(figure: Figure, is_bound: bool) -> Soles | None:
    """Return the soles if names identify two feet; of joints, not the mesh, unless ``is_bound``."""
    return _soles.get(figure, is_bound, lambda: _named_soles(figure, is_bound))


def _named_soles(figure: Figure, is_bound: bool) -> Soles | None:
    skeleton = figure.skeleton
    if skeleton is None:
        return None
    names = joint_meanings(skeleton)
    feet = []
    for side in ("left", "right"):
        found = [names.index(name) for name in (f"{side}_foot", f"{side}_ankle") if name in names]
        feet.append(found)
    return soles_of_feet(figure, feet, is_bound) if all(feet) else None


def soles_of_feet(figure: Figure, feet: Sequence[Sequence[int]], is_bound: bool) -> Soles:
    """Return the soles of given feet; of joints, not the mesh, unless ``is_bound``."""
    skeleton = figure.require_skeleton()
    sole, _ = extent(figure)
    parts = []
    for number, found in enumerate(feet):
        mover, place = np.array([found[0]]), np.zeros((1, 3))
        above = rest_joints(figure)[mover, _axis(figure)] - sole
        if is_bound and figure.mesh is not None and figure.skin is not None:
            whole = np.any([descendants(skeleton.parents, joint) for joint in found], axis=0)
            points = _points(figure.mesh, figure.skin, whole, _axis(figure))
            if points is not None:
                (mover, place), above = points, np.zeros(len(points[0]))
        parts.append((np.full(len(mover), number), mover, place, above))
    every, movers, places, above = (np.concatenate(column) for column in zip(*parts, strict=True))
    nearest = np.array([found[0] for found in feet], dtype=np.int32)
    ankles = np.array([found[-1] for found in feet], dtype=np.int32)
    rest = world_matrices(skeleton, zero_pose(skeleton))[ankles]
    below = rest[:, :, 3].copy()
    below[:, _axis(figure)] = sole
    # The pseudoinverse also exists for joints with a scale of 0.
    heels = np.einsum("nab,nb->na", np.linalg.pinv(rest), below)
    every, movers = every.astype(np.int32), movers.astype(np.int32)
    return Soles(nearest, every, movers, places, above, ankles, heels)


def _points(mesh: Mesh, skin: Skin, is_foot: Bools, axis: int) -> tuple[Ints, Floats] | None:
    """Return vertices of a foot's hull that can be lowest: joints (P,) and positions (P, 3)."""
    vertices = owners(skin)
    strongest = strongest_influences(skin)
    strongest = strongest[is_foot[skin.joints[strongest]] & (skin.weights[strongest] > 0.0)]
    if len(strongest) == 0:
        return None
    positions = mesh.positions[vertices[strongest]]
    lowest = strongest[np.unique((positions @ _directions(axis).T).argmax(axis=0))]
    joints, points = skin.joints[lowest], mesh.positions[vertices[lowest]]
    bind = skin.inverse_bind[joints]
    return joints, np.einsum("pab,pb->pa", bind[:, :3, :3], points) + bind[:, :3, 3]


def _directions(axis: int) -> Floats:
    """Return the downward direction, and directions tilted from it to all sides: (D, 3)."""
    angles = np.arange(_N_SIDES) * 2.0 * np.pi / _N_SIDES
    sides = np.zeros((_N_SIDES, 3))
    flat = [index for index in range(3) if index != axis]
    sides[:, flat] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    down = -np.eye(3)[axis]
    tilted = [np.cos(tilt) * down + np.sin(tilt) * sides for tilt in _TILTS]
    return np.concatenate([down[None], *tilted])
