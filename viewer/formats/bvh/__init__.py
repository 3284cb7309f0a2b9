r"""Reader of ``.bvh``: a skeleton and its motion (BioVision; the format has no standard).

::

    bvh       = "HIERARCHY" root+ "MOTION" "Frames:" N "Frame Time:" seconds number*
    root      = "ROOT" name "{" item* "}"
    item      = "OFFSET" x y z | "CHANNELS" n channel*n | "JOINT" name "{" item* "}"
              | "End" "Site" name? "{" item* "}"
    channel   = Xposition | Yposition | Zposition | Xrotation | Yrotation | Zrotation
    name      = word*

Words are separated by any white space, including line ends, and keywords are case-insensitive. A
frame has one number per channel, with joints in the order of the file. Angles are degrees; a
joint's rotation channels multiply from left to right: ``Zrotation Yrotation Xrotation`` is R = Rz
Ry Rx. Position channels replace the joint's OFFSET. Unit and up axis are not in the file: both are
estimated, unless the user specifies them, and the motion records the method.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._source import LongText, Source, line_parts
from viewer.formats.bvh.guess import examined_frames, frame_rate, guess_unit, guess_up
from viewer.formats.bvh.motion import (
    PART,
    Irregular,
    Table,
    check_reach,
    frame_parts,
    inner_moves,
    moves_inner,
    placed,
    read_head,
    read_motion,
    replaced_offsets,
    rotations_of,
    shifts_of,
    translations_of,
)
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import DEFAULT_RATE, Timing
from viewer.rigs.skeleton import ball_skeleton

_LARGEST_RATIO = 8  # maximum ratio of rotations to numbers in the file
_SMALL_CLIP = 1 << 24  # number of rotations up to which any ratio is accepted
_HEAD = 1 << 20  # maximum number of bytes up to the frames of a file that stays on disk
_THICKNESS = 0.1  # thickness of a joint's box, relative to the length of the bone

# Limits of the thickness, relative to the length of a typical bone.
_THINNEST, _THICKEST = 0.05, 0.3


def read(source: Source) -> SkeletonMotion:
    """Read a skeleton of ball joints and its motion; lengths are those of the file."""
    head = read_head(source)
    table = head.table
    values, lost = read_motion(source, head)
    has_frames = len(values) > 0
    if not has_frames:
        values = np.zeros((1, table.n_channels))
    _check_channels(source, table, len(values))
    rate = frame_rate(source, head.frame_time) if head.has_motion else DEFAULT_RATE
    rows = np.arange(len(values), dtype=np.int32)
    if lost is not None:
        rows[lost] = -1
    clip = SampledClip(
        source.path.stem,
        Timing(rate, rows),
        rotations_of(table, values),
        # Position channels replace the OFFSETs, so zeros would not be the rest pose.
        translations_of(source, table, values) if has_frames else None,
    )
    return skeleton_motion(table, clip)


def _check_channels(source: Source, table: Table, n_frames: int) -> None:
    """Refuse a file that could exhaust memory: many frames for many joints without channels."""
    rotations = n_frames * len(table.names)
    if rotations > max(_SMALL_CLIP, _LARGEST_RATIO * n_frames * table.n_channels):
        raise source.fault(
            "F002.bvh-few-channels: expected channels for most joints, found {channels} for "
            "{joints} joints in {frames} frames",
            channels=table.n_channels,
            joints=len(table.names),
            frames=n_frames,
        )


@dataclass(frozen=True, slots=True, eq=False)
class LongMotion:
    """A motion that stays in its file, from which parts of it are read."""

    path: Path
    """The file."""
    table: Table
    """Its joints."""
    start: int
    """Offset of the first frame in the file."""
    base: Floats
    """(M,). Part of the OFFSET that each position channel replaces."""
    motion: SkeletonMotion
    """The skeleton, with the few frames that the estimates need. The timing of its clip has all
    frames, each of which refers to the row of one of these few."""

    @property
    def may_move_inner_joints(self) -> bool:
        """Whether a joint other than a single root has position channels."""
        if self.table.parents.count(-1) > 1:
            return bool(self.table.moves)
        return bool(inner_moves(self.table))

    def clips(self, first: int, stop: int) -> Iterator[SampledClip]:
        """Yield a range of frames as clips of consecutive parts, each starting at 0 seconds.

        Raises Irregular if the file has changed, even if parts have already been yielded.
        """
        clip, count = self.motion.clip, 0
        for values in _parts(self.path, self.start, self.table.n_channels):
            chosen = values[max(first - count, 0) : max(stop - count, 0)]
            count += len(values)
            if len(chosen):
                yield clip_of(self.table, chosen, self.base, clip.name, clip.timing.frame_rate)
        if count != clip.timing.n_frames:
            raise Irregular


def _parts(path: Path, start: int, width: int) -> Iterator[Floats]:
    """Yield the frames of a file part by part, (N, width) each."""
    return frame_parts(line_parts(LongText(path, path.stat().st_size), PART, start), width)


def open_long(source: Source) -> LongMotion | None:
    """Return a motion that stays in its file, or None if the file must be read as a whole."""
    # Only the whole file tells what is wrong with its frames, and which frames replace wrong ones.
    start = Source(source.path, source.peek(_HEAD))
    try:
        head = read_head(start)
        count, table = head.declared, head.table
        first = start.next_word(head.start)
        is_cut = first is None or first.end() == len(start.data)
        if is_cut or not (count and head.frame_time and table.n_channels):
            return None
        _check_channels(start, table, count)
        rate = frame_rate(start, head.frame_time)
        examined = examined_frames(count).astype(np.int64)
        rows, n_frames, moves = np.zeros((len(examined), table.n_channels)), 0, False
        for values in _parts(source.path, head.start, table.n_channels):
            found = (examined >= n_frames) & (examined < n_frames + len(values))
            rows[found] = values[examined[found] - n_frames]
            check_reach(table, values)
            moves = moves or moves_inner(table, values)
            n_frames += len(values)
        if n_frames != count:
            return None
    except (FormatError, Irregular, OSError):
        return None
    base = replaced_offsets(start, table, moves)
    timing = Timing(
        rate, (np.searchsorted(examined, np.arange(count), "right") - 1).astype(np.int32)
    )
    clip = replace(clip_of(table, rows, base, source.path.stem, rate), timing=timing)
    for note in start.diagnostics:
        source.diagnostics.add(note)
    return LongMotion(source.path, table, head.start, base, skeleton_motion(table, clip))


def clip_of(table: Table, values: Floats, base: Floats, name: str, rate: float) -> SampledClip:
    """Return frames (N, C) as a clip, for the offsets (M,) that position channels replace."""
    translations = placed(table, shifts_of(table, values, base)) if table.moves else None
    rows = np.arange(len(values), dtype=np.int32)
    return SampledClip(name, Timing(rate, rows), rotations_of(table, values), translations)


def skeleton_motion(table: Table, clip: SampledClip) -> SkeletonMotion:
    """Return the joints of a file with their motion, and estimates of unit and up axis."""
    parents = np.array(table.parents, dtype=np.int32)
    # Offsets are used as written, because differences of positions would be rounded.
    skeleton = ball_skeleton(table.names, parents, np.zeros((len(parents), 3)))
    boxes = _boxes(table, parents)
    skeleton = replace(
        skeleton, rest_translations=table.offsets, boxes=boxes, boxes_from_bones=True
    )
    joints = np.zeros((skeleton.n_joints, 3))
    for joint, parent in enumerate(table.parents):
        joints[joint] = table.offsets[joint] + (joints[parent] if parent >= 0 else 0.0)
    tips = [joints[joint] + offset for joint, offset in table.ends]
    points = np.concatenate([joints, np.reshape(tips, (-1, 3))])
    unit, facts, unit_note = guess_unit(points)
    figure = Figure(clip.name, skeleton=skeleton, unit=unit)
    up, more, up_notes = guess_up(figure, clip, points)
    facts += (*more, ("frames", f"{clip.timing.n_frames} at {clip.timing.frame_rate:g} fps"))
    return SkeletonMotion(replace(figure, up=up, facts=facts), clip, unit_note, up_notes)


def _boxes(table: Table, parents: Ints) -> Floats:
    """Return a box for each joint from itself to its children or End Sites: (J, 2, 3)."""
    # The exporter relies on an invariant: an End Site is at twice the centre of its joint's box.
    inner = np.flatnonzero(parents >= 0)
    owners = np.concatenate([parents[inner], [joint for joint, _ in table.ends]]).astype(np.int32)
    tips = np.concatenate(
        [table.offsets[inner], np.reshape([tip for _, tip in table.ends], (-1, 3))]
    )
    lengths = np.linalg.norm(tips, axis=1)
    size = float(np.median(lengths[lengths > 0.0])) if lengths.any() else 1.0
    half = np.clip(_THICKNESS * lengths, _THINNEST * size, _THICKEST * size)[:, None]
    # Along its main axis, a box is as long as the bone; the other sides have a limited thickness.
    along = np.abs(tips) >= np.abs(tips).max(axis=1, keepdims=True)
    reach = np.where(along, np.abs(0.5 * tips), np.minimum(np.abs(0.5 * tips), 2.0 * half))
    reach = np.where(reach < half, reach + half, reach)
    boxes = np.stack([np.full((len(parents), 3), np.inf), np.full((len(parents), 3), -np.inf)], 1)
    np.minimum.at(boxes[:, 0], owners, 0.5 * tips - reach)
    np.maximum.at(boxes[:, 1], owners, 0.5 * tips + reach)
    bare = ~np.isfinite(boxes[:, 0, 0])
    boxes[bare] = np.array([-1.0, 1.0])[:, None] * _THICKNESS * size
    return boxes
