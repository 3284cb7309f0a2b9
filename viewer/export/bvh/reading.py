"""Poses of the original figure, read back from a written ``.bvh`` file.

D is the product of a file's rotations down to a joint, p its position in the file, s the scale, and
x and e are as in ``body``. A joint with the rest matrix P then has::

    linear part  s x^-1 D e P        position  x^-1 p / factor

A file has no mesh. Its vertices are those of the figure's skin in the shape of the file's bones,
skinned with LBS, with pose correctives from the file's rotations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.export._losses.skinned import (
    Poses,
    Side,
    anchored,
    bare_poses,
    figure_side,
    linear_as_opened,
)
from viewer.export.bvh.body import Space, rest_matrices
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import affine_matrices
from viewer.rig.motion.evaluation import (
    Frames,
    frames_between,
    frames_of,
    joint_positions,
    rest_translations_of,
    world_frames,
)
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.shape import joint_shifts
from viewer.rig.skinning import Skinning

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class BvhFile:
    """A written file."""

    motion: SkeletonMotion
    """Contents, or some of the frames."""
    order: Ints
    """(J,): place of each of the figure's joints among the joints of the file."""
    space: Space
    """Transform from the figure's space to the file's."""
    reference: int
    """Frame that defines the shape and scale of the file's bones."""
    ahead: int
    """Index of the animation's first frame in this motion; negative if the motion begins later."""


def read_back(file: BvhFile, figure: Figure, frames: Frames, how: Skinning) -> Side:
    """Return the contents of a file as poses of a figure.

    ``file``: the written file.
    ``figure``: original figure without its shape applied.
    ``frames``: the written frames. They define the placement of the whole figure, which is applied
      after skinning, without weights.
    ``how``: skinning; its correctives are applied if enabled.
    """
    space = file.space
    motion = file.motion
    clip = motion.clip
    order = file.order
    weights = frames.shape_weights
    still = weights[min(file.reference, len(weights) - 1)]
    scale = float(frames.figure_scales[file.reference])
    rest = rest_matrices(figure, rest_translations_of(figure, still[None])[0])[:, :3, :3]
    own = space.rest @ rest * scale
    held = replace(frames, shape_weights=still[None])
    body = figure_side(figure, held, linear_as_opened(how), still).body
    bound = _bound(figure, still)

    def poses(rows: Rows) -> Poses:
        times = (rows + file.ahead) / clip.timing.frame_rate
        read = frames_of(motion.figure, clip, times)
        if body is None:
            places = joint_positions(motion.figure, read)[:, order] @ space.world / space.factor
            return bare_poses(places, frames_between(frames, rows))
        found = world_frames(motion.figure, read)[:, order]
        world = affine_matrices(
            space.world.T @ found[..., :3, :3] @ own,
            found[..., :3, 3] @ space.world / space.factor,
        )
        places = world[..., :3, 3].copy()
        shifts = frames_between(frames, rows).figure_translations
        world[..., :3, 3] -= shifts[:, None]
        corrective_rotations = np.zeros((len(rows), 0))
        if body.correctives is not None:
            corrective_rotations = _corrective_rotations(figure, world / scale)
        palette = anchored(world @ bound, np.full(len(rows), scale))
        return Poses(places, palette, shifts, np.zeros((1, 0)), corrective_rotations)

    return Side(body, poses)


def _bound(figure: Figure, weights: Floats) -> Floats:
    """Return the inverse bind matrices of a shape; identity matrices if there is no skin."""
    if figure.skin is None or not figure.is_attached:
        return np.tile(np.eye(4), (figure.require_skeleton().n_joints, 1, 1))
    bound = figure.skin.inverse_bind.copy()
    moved = joint_shifts(figure, weights[None])[0]
    bound[:, :3, 3] -= np.einsum("jab,jb->ja", bound[:, :3, :3], moved)
    return bound


def _corrective_rotations(figure: Figure, world: Floats) -> Floats:
    """Return the corrective weights: R - I of every joint relative to its parent, (F, P)."""
    linear = world[:, 1:, :3, :3]
    above = world[:, figure.require_skeleton().parents[1:], :3, :3]
    local = np.swapaxes(above, -1, -2) @ linear - np.eye(3)
    return local.reshape(len(world), -1)
