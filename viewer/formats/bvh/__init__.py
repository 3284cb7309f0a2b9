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
from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import LongText, Source, line_parts
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
from viewer.phrases import Remedy, Shown, bare, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import DEFAULT_RATE, FASTEST, SLOWEST, Timing, is_rate
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.units import METRES, SIZES, UNIT_NAMES

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
    up, more, up_notes, hangs = guess_up(figure, clip, points)
    facts += (*more, ("frames", f"{clip.timing.n_frames} at {clip.timing.frame_rate:g} fps"))
    figure = replace(figure, up=up, facts=facts)
    return SkeletonMotion(figure, clip, unit_note, up_notes, hangs)


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


# Estimates of what the file does not state: unit, up axis and exact frame rate.

Facts = tuple[tuple[str, str], ...]
_DESPITE_FRAMES = "{up} up assumed, although the skeleton is upright along {axis} in the frames"
_INCHES = (30.0, 90.0)  # heights of humans in inches, 0.76 to 2.3 m
_RATES = (
    *(12.0, 15.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 90.0, 100.0, 120.0, 144.0, 150.0),
    *(180.0, 200.0, 240.0, 250.0, 300.0, 480.0, 500.0, 1000.0),
    *(24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001),
)
_FASTEST_CAMERA = 2000.0  # frames per second; for motion capture
_LONGEST = 5.0  # seconds; longer frame times are rates or milliseconds
_DECIMALS = 9  # decimals of frame times in seconds that this program writes, however long
_LONG = 2.0  # ratio of z extent to y extent above which z is up
_UPRIGHT = 0.8  # minimum cosine of the angle between a standing body and an axis, 37 degrees

# Distance from the ground, and length of a path that is none, relative to the body.
_NEAR, _STILL = 0.15, 1e-3
_LOOKS = 16  # number of frames to examine
_UPPER = ("head", "neck", "left_shoulder", "right_shoulder")
_LOWER = ("left_ankle", "right_ankle", "left_knee", "right_knee")


def frame_rate(source: Source, frame_time: bytes | None) -> float:
    """Return the standard rate whose rounded frame time is in the file: 0.033367 is 30000/1001."""
    if frame_time is None:
        source.warn("F007.bvh-no-time: missing Frame Time: {rate:g} fps assumed", rate=DEFAULT_RATE)
        return DEFAULT_RATE
    seconds = float(frame_time.rstrip(b"fF"))
    if seconds == 0.0 or not is_rate(1.0 / seconds):
        low, high = 1.0 / FASTEST, 1.0 / SLOWEST
        source.warn(
            "C017.bvh-time: Frame Time: expected {low:g} to {high:,.0f} seconds, found "
            "{seconds:g}; {rate:g} fps assumed",
            seconds=seconds,
            low=low,
            high=high,
            rate=DEFAULT_RATE,
        )
        return DEFAULT_RATE
    is_own = len(frame_time.partition(b".")[2]) >= _DECIMALS
    if _LONGEST <= seconds <= max(_RATES) and not is_own:
        # No frame takes that many seconds: the number is a rate, or in milliseconds.
        is_standard = _nearest_rate(frame_time, seconds) in _RATES
        in_milliseconds = _nearest_rate(frame_time, 1000.0 / seconds)
        is_rate_written = is_standard or seconds.is_integer() or in_milliseconds not in _RATES
        rate = seconds if is_rate_written else in_milliseconds
        source.warn(
            "C017.bvh-rate: Frame Time: expected seconds, found {found}, which looks like a frame "
            "rate; {rate:g} fps assumed ({remedy} overrides it)"
            if is_rate_written
            else "C017.bvh-milliseconds: Frame Time: expected seconds, found {found}, which looks "
            "like milliseconds; {rate:g} fps assumed ({remedy} overrides it)",
            found=bare(frame_time),
            rate=rate,
            remedy=Remedy("Frames per second in the Timeline", "--fps"),
        )
        return rate
    rate = _nearest_rate(frame_time, 1.0 / seconds)
    if rate > _FASTEST_CAMERA:
        source.warn(
            "C017.bvh-fast: Frame Time: {found} seconds is {rate:,.0f} fps, faster than motion "
            "capture cameras ({remedy} overrides it)",
            found=bare(frame_time),
            rate=rate,
            remedy=Remedy("Frames per second in the Timeline", "--fps"),
        )
    return rate


def _nearest_rate(frame_time: bytes, exact: float) -> float:
    """Return the standard rate from which an exact rate differs only by rounding, or the latter."""
    digits = frame_time.lower().partition(b"e")[0].rstrip(b"f").replace(b".", b"").lstrip(b"+0")
    if len(digits) < 2:
        return float(round(exact)) if abs(exact - round(exact)) < 1e-9 * exact else exact
    # Half a unit of the last digit written, relative to the frame time.
    rounding = 0.5 / float(digits)
    nearest = min((*_RATES, float(max(round(exact), 1))), key=lambda rate: abs(rate - exact))
    return nearest if abs(nearest / exact - 1.0) <= rounding * (1.0 + 1e-9) else exact


def guess_unit(points: Floats) -> tuple[str, Facts, Phrase | None]:
    """Return the unit in which the rest pose (P, 3) has a human's size, with facts and a note."""
    size = float(np.ptp(points, axis=0).max())
    metres = size * METRES["in"]
    is_near = _INCHES[0] < size < _INCHES[1]
    inches = f"; if in inches, {metres:.3g} m" if is_near else ""
    values = {
        "size": rounded(size, 4),
        "metres": Shown(inches, metres if is_near else 0.0),
    }
    for unit, (low, high) in SIZES.items():
        if low <= size <= high:
            fact = f"{unit}, estimated from the skeleton's size of {size:.4g}{inches}"
            note = Phrase(
                "{unit} assumed (skeleton {size} high{metres})", unit=UNIT_NAMES[unit], **values
            )
            return unit, (("unit", fact),), None if unit == "m" else note
    fact = f"unknown; the skeleton's size is {size:.4g}{inches}"
    note = Phrase("unit unknown (skeleton {size} high{metres})", **values)
    return "", (("unit", fact),), note if size > 0.0 else None


def guess_up(
    figure: Figure, clip: SampledClip, points: Floats
) -> tuple[Up, Facts, tuple[Phrase, ...], bool]:
    """Return the up axis, facts, notes and whether it points down, from rest (P, 3) and frames."""
    # Animals are longer than high; y is up if their legs then reach the ground. If the skeleton is
    # upright along another axis in the frames, that one is up, because some programs rotate the
    # root of a skeleton with y up into a world with z up.
    skeleton = figure.skeleton
    assert skeleton is not None  # created by the reader
    names = joint_meanings(skeleton)
    upper, lower = (
        [names.index(name) for name in part if name in names] for part in (_UPPER, _LOWER)
    )
    if not upper or not lower:
        if _stands_on_four_legs(skeleton, points):
            return "y", (("up", "y, the rest skeleton stands on its legs"),), (), False
        _, deep, high = np.ptp(points, axis=0)[[0, 1, 2]]
        if high > _LONG * deep:
            note = Phrase("{up} up assumed: the rest skeleton is longest along {up}", up="z")
            return "z", (("up", "z, along which the rest skeleton is longest"),), (note,), False
        return "y", (), (), False
    joints = points[: skeleton.n_joints]
    rest = _axis(joints[upper].mean(axis=0) - joints[lower].mean(axis=0))
    up: Up = "z" if rest == "+z" else "y"
    every = examined_frames(clip.timing.n_frames) / clip.timing.frame_rate
    posed = world_frames(figure, frames_of(figure, clip, every))[:, :, :3, 3]
    heights = posed[:, upper].mean(axis=1) - posed[:, lower].mean(axis=1)
    stands = _axis(heights.mean(axis=0))
    if stands in ("+y", "+z") and stands[1] != up:
        other: Up = "z" if up == "y" else "y"
        size = float(np.linalg.norm(heights, axis=1).mean())
        if rest in ("+y", "+z") and _lies(posed, other, up, size):
            note = Phrase(_DESPITE_FRAMES, up=up, axis=stands)
            return up, (("up", f"{up}, from the rest skeleton"),), (note,), False
        note = Phrase(wording.UP_OF_FRAMES, up=other, axis=rest or Phrase("no axis"))
        return other, (("up", f"{other}, from the frames"),), (note,), False
    if rest == stands and rest in ("-y", "-z"):
        note = Phrase(
            "{axis} up assumed: the skeleton is upright along {axis} at rest and in the frames, "
            "and is rotated upright",
            axis=rest,
        )
        up = "z" if rest == "-z" else "y"
        return up, (("up", f"{rest}, from the rest skeleton"),), (note,), True
    if up == "z":
        note = Phrase("{up} up assumed: the head is above the feet along {up}", up="z")
        return "z", (("up", "z, from the rest skeleton"),), (note,), False
    if rest == "+y":
        # A handstand, or the space of a camera: only the user knows.
        over = (Phrase(_DESPITE_FRAMES, up="y", axis=stands),) if stands == "-y" else ()
        return "y", (("up", "y, from the rest skeleton"),), over, False
    if stands == "+y":
        note = Phrase(wording.UP_OF_FRAMES, up="y", axis=rest or Phrase("no axis"))
        return "y", (("up", "y, from the frames"),), (note,), False
    note = Phrase(
        "{up} up assumed, although the rest skeleton is upright along {axis}", up="y", axis=rest
    )
    return "y", (("up", "y, assumed"),), (note,) if rest else (), False


def _lies(posed: Floats, along: str, up: Up, size: float) -> bool:
    """Return whether a body (F, J, 3), upright along one axis, lies in a world with another up."""
    # A standing body moves with its feet near 0 along its own axis. A lying one is near 0 along the
    # up axis, and anywhere along its own. Without a path there is no evidence, and people stand.
    moves = np.ptp(posed[:, 0], axis=0).max() > _STILL * size
    lowest = np.abs(np.median(posed.min(axis=1), axis=0)) < _NEAR * size
    return bool(moves and not lowest["xyz".index(along)] and lowest["xyz".index(up)])


def _stands_on_four_legs(skeleton: Skeleton, points: Floats) -> bool:
    """Return whether a skeleton has an animal's legs if y is up, but not if z is."""
    # Imported here because few files need it.
    from viewer.rigs.feet.legs import animal_legs

    joints = points[: skeleton.n_joints]
    return [bool(animal_legs(skeleton.parents, joints, up)) for up in np.eye(3)[1:]] == [
        True,
        False,
    ]


def examined_frames(count: int) -> Floats:
    """Return the frames that ``guess_up`` examines, ascending whole numbers, of ``count``."""
    return np.linspace(0, count - 1, min(_LOOKS, count)).round()


def _axis(direction: Floats) -> str:
    """Return the axis nearest to a direction, such as ``"+y"``; empty if there is none."""
    axis = int(np.abs(direction).argmax())
    if not abs(direction[axis]) > _UPRIGHT * np.linalg.norm(direction):
        return ""
    return ("-" if direction[axis] < 0 else "+") + "xyz"[axis]
