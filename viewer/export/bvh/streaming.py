"""Part-by-part export of long motions to ``.bvh``, with memory use independent of their length.

The file and the notes are those of ``viewer.export.bvh.export``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.export._losses.lines import JointLosses
from viewer.export._options import ExportOptions
from viewer.export.bvh import (
    Writer,
    check_finite,
    check_options,
    ends_of,
    one_root,
    remarks,
    space_of,
)
from viewer.export.bvh.angles import Unroller
from viewer.export.bvh.body import Body, Conversion, shape_at
from viewer.export.bvh.reading import BvhFile, read_back
from viewer.export.bvh.text import frame_texts
from viewer.formats import Source, bvh
from viewer.formats.bvh.hierarchy import read_hierarchy
from viewer.formats.bvh.motion import Table, table_of
from viewer.formats.bvh.streaming import clip_of, parsed_rows
from viewer.media.saving import save_parts
from viewer.progress import report, silent
from viewer.rig.arrays import Floats
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.skeleton_motion import SkeletonMotion


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """An animation of a figure without a mesh, as consecutive parts."""

    parts: Callable[[], Iterator[SampledAnimation]]
    """Yields the parts, in which the figure is always present; may be called repeatedly. Scales and
    shape are the same in all frames."""
    n_frames: int
    """Number of all frames, N."""
    may_move_inner_joints: bool
    """Whether a joint with a parent may be translated in the file; several roots get a common
    parent."""


def export_parts(animation: Parts, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion part by part; see ``viewer.export.bvh.export``.

    The parts are read once, or twice if joints with a parent are translated, since a file has
    position channels only for joints that move.

    ``options``: as for ``export``. Raises ``RigError, OutputError``: as for
    ``export``.
    """
    check_options(options)
    stream = _Stream(animation, options)
    save_parts(path, stream.texts(), reports=False)
    first, writer = stream.first, stream.writer
    lost = stream.losses.notes(path, first.figure, first.first_frame)
    notes = [writer.summary(path, 0, animation.n_frames), *lost]
    return notes + remarks(writer, 0)


class _Stream:
    """Text of a file, and its comparison with the motion."""

    def __init__(self, animation: Parts, options: ExportOptions) -> None:
        self._animation, self._options = animation, options
        self.first = next(animation.parts())
        figure, rigged = one_root(self.first.figure, self.first.frames, 0)
        space = space_of(figure, options)
        order = options.rotation_order
        self._conversion = Conversion(figure, rigged, 0, order, space)
        self._measure(rigged.n_frames)
        offsets, moves = self._conversion.bones()
        check_finite(self.first, offsets)
        empty = np.zeros((0, *offsets.shape))
        body = Body(offsets, empty, empty, moves)
        ends = ends_of(self.first, figure, space, 0)
        self.writer = Writer(self.first, figure, body, ends, space, options)
        self._read: SkeletonMotion | None = None  # joints read back from the file
        self.losses = JointLosses(options.skinning, animation.n_frames)

    def _measure(self, n_first: int) -> None:
        """Convert the frames that determine which joints are translated."""
        done = 0
        for part in self._animation.parts():
            report(done, self._animation.n_frames, "frames", "finding joints that move")
            with np.errstate(invalid="ignore", over="ignore"):
                self._channels(part)
            done += part.frames.n_frames
            if not self._animation.may_move_inner_joints:
                return

    def _channels(self, part: SampledAnimation) -> tuple[Floats, Floats]:
        return self._conversion.channels(one_root(part.figure, part.frames, 0)[1])

    def texts(self) -> Iterator[bytes]:
        """Yield the text of the file; each part of it is read back and compared."""
        count, options, writer = self._animation.n_frames, self._options, self.writer
        head = writer.head(count + options.rest_frame)
        yield head
        source = Source("written.bvh", head)
        table = table_of(source, read_hierarchy(source).joints)
        offsets, moves, parents = writer.body.offsets, writer.body.moves, writer.parents
        if options.rest_frame:
            still = offsets[None]
            yield from frame_texts(parents, moves, still, np.zeros_like(still), options.digits)
        unroller, done = Unroller(options.rotation_order), 0
        for part in self._animation.parts():
            report(done, count, "frames", "converting")
            with silent():
                angles, positions = self._channels(part)
                check_finite(part, angles, positions)
                angles = unroller.following(angles)
                lines = frame_texts(parents, moves, positions, angles, options.digits)
                text = b"".join(lines)
                self._compare(table, text, part)
            done += part.frames.n_frames
            yield text

    def _compare(self, table: Table, text: bytes, part: SampledAnimation) -> None:
        """Read a part of the text back and compare it with the frames that it was written from."""
        values = parsed_rows(text, table.n_channels)
        clip = clip_of(table, values, part.name, part.frame_rate)
        if self._read is None:
            self._read = bvh.skeleton_motion(table, clip)
        motion = replace(self._read, clip=clip)
        file = BvhFile(motion, self.writer.order, self.writer.space, 0, 0)
        times = np.arange(part.frames.n_frames) / part.frame_rate
        frames = replace(part.frames, times=times)
        written = read_back(file, part.figure, frames, self._options.skinning)
        self.losses.look(part, written, shape_at(frames, 0)[0])
