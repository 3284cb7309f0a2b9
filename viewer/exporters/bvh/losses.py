"""Errors of a written ``.bvh`` file: it is read back as poses of the original figure.

D is the product of a file's rotations down to a joint, p its position in the file, s the scale, and
x and e are as in ``body``. A joint with the rest matrix P then has::

    linear part  s x^-1 D e P        position  x^-1 p / factor

A file has no mesh. Its vertices are those of the figure's skin in the shape of the file's bones,
skinned with LBS, with pose correctives from the file's rotations.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Diagnostic
from viewer.exporters._losses.motion_errors import PartLosses
from viewer.exporters._losses.posed_bodies import (
    Poses,
    Side,
    anchored,
    bare_poses,
    figure_side,
    linear_as_opened,
)
from viewer.exporters.bvh.body import Space, rest_matrices
from viewer.formats import Source, bvh
from viewer.formats.bvh.motion import (
    Irregular,
    check_reach,
    frame_parts,
    offsets_of,
    read_head,
)
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.motion.evaluation import (
    Frames,
    frames_between,
    frames_of,
    rest_translations_of,
    world_frames,
)
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.shape import joint_shifts
from viewer.rigs.skinning import Skinning

Rows = NDArray[np.intp]


class FileLosses:
    """Errors of a file that is read back while it is written.

    ``head``: text of the file before the frames of the motion. ``order`` (J,): place of each of the
    figure's joints among the joints of the file. ``space``: transform from the figure's space to
    the file's. ``still`` (S,), ``scale``: shape and scale of the file's bones.
    """

    def __init__(
        self,
        head: bytes,
        order: Ints,
        space: Space,
        still: Floats,
        scale: float,
        how: Skinning,
        n_frames: int,
    ) -> None:
        self._head, self._table = head, read_head(Source("written.bvh", head)).table
        self._order, self._space, self._still, self._scale = order, space, still, scale
        self._figure: Figure | None = None  # the joints that were read back
        self._first_frame = 0
        self._losses = PartLosses(how, n_frames)
        self._how = how

    def look(self, path: Path, text: bytes, part: SampledAnimation) -> None:
        """Read a part of the text back and compare it with the frames that it was written from."""
        try:
            (rows,) = frame_parts([text], self._table.n_channels)
            check_reach(self._table, rows)
        except Irregular:
            bvh.read(Source(path, self._head + text))  # raises the error, with its line
            raise
        base = offsets_of(self._table)
        clip = bvh.clip_of(self._table, rows, base, part.name, part.frame_rate)
        del rows  # as large as the text
        if self._figure is None:
            self._figure = bvh.skeleton_motion(self._table, clip).figure
            self._first_frame = part.first_frame
        written = self._side(self._figure, clip, part.figure, part.frames)
        self._losses.look(part, written, self._still)

    def notes(self, path: Path, figure: Figure) -> list[Diagnostic]:
        """Return a note with the largest errors, if there are any."""
        return self._losses.notes(path, figure, self._first_frame)

    def _side(self, read: Figure, clip: SampledClip, figure: Figure, frames: Frames) -> Side:
        """Return the frames that were read back as poses; those written place the whole figure."""
        space, scale, still, order = self._space, self._scale, self._still, self._order
        rest = rest_matrices(figure, rest_translations_of(figure, still[None])[0])[:, :3, :3]
        own = space.rest @ rest * scale
        held = replace(frames, shape_weights=still[None])
        body = figure_side(figure, held, linear_as_opened(self._how), still).body
        bound = _bound(figure, still)

        def poses(rows: Rows) -> Poses:
            again = frames_of(read, clip, rows / clip.timing.frame_rate)
            found = world_frames(read, again)[:, order]
            places = found[..., :3, 3] @ space.world / space.factor
            if body is None:
                return bare_poses(places, frames_between(frames, rows))
            world = affine_matrices(space.world.T @ found[..., :3, :3] @ own, places)
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
