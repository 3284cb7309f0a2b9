"""Estimates of properties missing from a BVH file: unit, up axis and exact frame rate."""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Phrase, wording
from viewer.formats._source import Source
from viewer.phrases import Remedy, Shown, bare, rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import DEFAULT_RATE, FASTEST, SLOWEST, is_rate
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.units import METRES, SIZES, UNIT_NAMES

Facts = tuple[tuple[str, str], ...]
_INCHES = (30.0, 90.0)  # heights of humans in inches, 0.76 to 2.3 m
_RATES = (
    *(12.0, 15.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 90.0, 100.0, 120.0, 144.0, 150.0),
    *(180.0, 200.0, 240.0, 250.0, 300.0, 480.0, 500.0, 1000.0),
    *(24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001),
)
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
            "F007.bvh-time: Frame Time: expected {low:g} to {high:,.0f} seconds, found "
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
    return _nearest_rate(frame_time, 1.0 / seconds)


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
) -> tuple[Up, Facts, tuple[Phrase, ...]]:
    """Return the up axis, facts and notes, from the rest pose (P, 3) and from the frames."""
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
            return "y", (("up", "y, the rest skeleton stands on its legs"),), ()
        _, deep, high = np.ptp(points, axis=0)[[0, 1, 2]]
        if high > _LONG * deep:
            note = Phrase("{up} up assumed: the rest skeleton is longest along {up}", up="z")
            return "z", (("up", "z, along which the rest skeleton is longest"),), (note,)
        return "y", (), ()
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
            note = Phrase(
                "{up} up assumed, although the skeleton is upright along {axis} in the frames",
                up=up,
                axis=stands,
            )
            return up, (("up", f"{up}, from the rest skeleton"),), (note,)
        note = Phrase(wording.UP_OF_FRAMES, up=other, axis=rest or Phrase("no axis"))
        return other, (("up", f"{other}, from the frames"),), (note,)
    if up == "z":
        note = Phrase("{up} up assumed: the head is above the feet along {up}", up="z")
        return "z", (("up", "z, from the rest skeleton"),), (note,)
    if rest == "+y":
        return "y", (("up", "y, from the rest skeleton"),), ()
    if stands == "+y":
        note = Phrase(wording.UP_OF_FRAMES, up="y", axis=rest or Phrase("no axis"))
        return "y", (("up", "y, from the frames"),), (note,)
    note = Phrase(
        "{up} up assumed, although the rest skeleton is upright along {axis}", up="y", axis=rest
    )
    return "y", (("up", "y, assumed"),), (note,) if rest else ()


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
