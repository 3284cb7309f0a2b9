"""A sampled animation in BVH form: offsets of an unrotated rest pose, and joint channels.

W is the world rotation of a joint at rest and P its rest position, x maps world axes to file axes
and e figure axes to file axes, R is the local rotation in a frame and R_0 the one at rest::

    offset    o_j = e (P_j - P_parent)                       no rotations at rest
    rotation  Q_j = e W_parent R R_0^-1 W_parent^-1 e^-1     at the root, x replaces the first e
    position  p_j = D_parent^-1 (place_j - place_parent)     D: product of Q down from the root

A joint with p = o in every frame needs no position channels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.exporters._options import RotationOrder
from viewer.exporters.bvh.angles import euler_angles
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.hierarchy import roots_of
from viewer.rigs.kinematics import joint_worlds, world_matrices
from viewer.rigs.motion.evaluation import Frames, rest_translations_of, world_frames
from viewer.rigs.pose import zero_pose
from viewer.rigs.skeleton import Skeleton

BLOCK = 128  # frames per block, whose matrices fit into the processor's cache
_NOISE = 1e-9  # fraction of the skeleton's size: smaller motions are ignored


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """Transform from a figure's space to the file's."""

    rest: Floats
    """(3, 3): matrix from figure axes to file axes, e."""
    world: Floats
    """(3, 3): matrix from world axes to file axes, x."""
    factor: float
    """Scale factor from the figure's unit to the file's."""


def rest_matrices(figure: Figure, offsets: Floats) -> Floats:
    """Return joint-to-figure matrices (J, 4, 4) with all DOFs at 0 and without constraints."""
    skeleton = replace(figure.require_skeleton(), rest_translations=offsets, constraints=())
    return world_matrices(skeleton, zero_pose(skeleton))


class Conversion:
    """Conversion of a figure's frames to channels; one frame gives the shape of all bones."""

    def __init__(
        self, figure: Figure, frames: Frames, reference: int, order: RotationOrder, space: Space
    ) -> None:
        self._figure, self._order, self._space = figure, order, space
        skeleton = figure.require_skeleton()
        self._weights = shape_at(frames, reference)
        self._scale = float(frames.figure_scales[reference])
        rest = rest_matrices(figure, rest_translations_of(figure, self._weights)[0])
        points = self._scale * space.factor * rest[:, :3, 3] @ space.rest.T
        self._inner = skeleton.parents >= 0
        self._offsets = points - np.where(self._inner[:, None], points[skeleton.parents], 0.0)
        self._size = float(np.ptp(points, axis=0).max())
        self._is_plain = _is_plain(figure, frames, self._scale)
        self._farthest = 0.0
        self._low, self._high = np.full_like(points, np.inf), np.full_like(points, -np.inf)

    def channels(self, frames: Frames) -> tuple[Floats, Floats]:
        """Return angles in channel order, and positions with the offsets: (F, J, 3), (F, J, 3)."""
        figure, space = self._figure, self._space
        rotations = _rotations(figure, frames, space)
        angles = euler_angles(rotations, self._order)
        if self._is_plain:
            positions = _still_positions(figure, frames, self._weights, self._scale, space)
        else:
            positions = _positions(figure, frames, self._weights, self._scale, space, rotations)
        if len(positions):
            self._low = np.minimum(self._low, positions.min(axis=0))
            self._high = np.maximum(self._high, positions.max(axis=0))
        roots = positions[:, ~self._inner]
        self._farthest = max(self._farthest, float(np.abs(roots).max(initial=0.0)))
        return angles, positions

    def bones(self) -> tuple[Floats, Bools]:
        """Return offsets and which joints move, (J, 3), (J,), after all frames are converted."""
        # Positions far from the origin are rounded more coarsely than the skeleton's size suggests.
        noise = _NOISE * (self._size + 1e-3 * self._farthest)
        is_moved = ((self._high - self._low) > noise).any(axis=1)
        moves = self._inner & is_moved
        is_off = (np.abs(self._low - self._offsets) > noise).any(axis=1)
        shifted = self._inner & ~moves & is_off
        return np.where(shifted[:, None], self._low, self._offsets), moves


def _is_plain(figure: Figure, frames: Frames, scale: float) -> bool:
    """Return whether joints only rotate and translate, with bones of a fixed shape."""
    is_fixed = len(frames.shape_weights) == 1 and (frames.figure_scales == scale).all()
    return bool(
        is_fixed and (frames.scales == 1.0).all() and not figure.require_skeleton().constraints
    )


def _still_positions(
    figure: Figure, frames: Frames, weights: Floats, scale: float, space: Space
) -> Floats:
    """Return the positions of joints that only rotate and translate: (F, J, 3)."""
    # With place_j - place_parent = W t_j, W being the rotation of the parent in this frame, and
    # D = x W W_parent^-1 e^-1, the positions D_parent^-1 (x W t_j) are e W_parent t_j.
    skeleton = figure.require_skeleton()
    inner = skeleton.parents >= 0
    axes = _parent_axes(skeleton, space)
    axes[~inner] = space.world
    moved = scale * (rest_translations_of(figure, weights) + frames.translations)
    moved[:, ~inner] += frames.figure_translations[:, None]
    if not (axes == np.eye(3)).all():
        moved = np.einsum("jab,fjb->fja", axes, moved)
    return moved * space.factor


def _positions(
    figure: Figure, frames: Frames, weights: Floats, scale: float, space: Space, rotations: Floats
) -> Floats:
    """Return the positions of joints relative to their parents, from those in the world."""
    parents = figure.require_skeleton().parents
    inner = (parents >= 0)[:, None]
    # Bones have a fixed shape and scale; only the roots follow those of each frame.
    fixed = replace(frames, shape_weights=weights, figure_scales=np.full(frames.n_frames, scale))
    places = world_frames(figure, fixed)[..., :3, 3]
    if len(frames.shape_weights) > 1 or (frames.figure_scales != scale).any():
        roots = roots_of(parents)
        rest = rest_translations_of(figure, frames.shape_weights)
        own = rest[:, roots] + frames.translations[:, roots]
        own = own * frames.figure_scales[:, None, None] + frames.figure_translations[:, None]
        places = places + own - places[:, roots]
    places = places @ space.world.T * space.factor
    # D, the product of the file's rotations down from the root; p_j = D_parent^-1 (x_j - x_parent).
    world = joint_worlds(parents, rotations, np.zeros(3))[..., :3, :3]
    from_parent = places - np.where(inner, places[:, parents], 0.0)
    within = np.einsum("njba,njb->nja", world[:, parents], from_parent)
    return np.where(inner, within, from_parent)


def _parent_axes(skeleton: Skeleton, space: Space) -> Floats:
    """Return the rotation from the axes of each joint's parent at rest to those of the file."""
    parents = skeleton.parents
    rest = quaternion_to_matrix(skeleton.rest_rotations)
    above = joint_worlds(parents, rest, np.zeros(3))[parents, :3, :3]
    above[parents < 0] = np.eye(3)
    return space.rest @ above


def shape_at(frames: Frames, frame: int) -> Floats:
    """Return the shape weights of one frame: (1, S)."""
    weights = frames.shape_weights
    return weights if len(weights) == 1 else weights[frame : frame + 1]


def _rotations(figure: Figure, frames: Frames, space: Space) -> Floats:
    """Return the file's local rotations: (F, J, 3, 3)."""
    skeleton = figure.require_skeleton()
    parents = skeleton.parents
    rest = quaternion_to_matrix(skeleton.rest_rotations)
    # Q_j = e W_parent R R_0^-1 W_parent^-1 e^-1; x replaces the first e at the root.
    before = _parent_axes(skeleton, space)
    after = np.swapaxes(rest, -1, -2) @ np.swapaxes(before, -1, -2)
    before[parents < 0] = space.world
    rotations = quaternion_to_matrix(frames.rotations)
    if not (before == np.eye(3)).all():
        rotations = before @ rotations
    return rotations if (after == np.eye(3)).all() else rotations @ after
