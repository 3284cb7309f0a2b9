"""Frame numbers on the command line: those of a capture's files, or counted from 0."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import Literal

from viewer.commands._settings import add_settings, number, settings_of
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rigs.scene import Actor, Scene

_SLOWEST, _FASTEST = 0.001, 100_000.0  # limits of frame rates, frames per second
_RATE = f"expected {_SLOWEST:g} to {_FASTEST:,.0f} frames per second, found {{found}}"
_LAST_NUMBER = 1_000_000_000
_RANGE = "frames A to B - 1{step}; A or B may be omitted (default: the whole motion)"


@dataclass(frozen=True, slots=True)
class Range:
    """Frames ``first``, ``first + step`` … below ``stop``; None for the motion's own ends."""

    first: int | None
    stop: int | None
    step: int = 1

    def __str__(self) -> str:
        ends = ["" if end is None else str(end) for end in (self.first, self.stop)]
        return ":".join(ends) + (f":{self.step}" if self.step > 1 else "")


@dataclass(frozen=True, slots=True)
class Numbering:
    """Numbering of the frames of motions."""

    first: int
    """Number of the first frame."""
    count: int
    """Number of frames up to the end of the motions."""
    start: float
    end: float
    """The earliest start and the latest end, in seconds."""
    rate: float
    """Frames per second of the numbering."""
    runs_on: bool
    """Whether frames beyond the last one exist: keyframed clips extrapolate, captures do not."""
    holds: bool = False
    """Whether the first and last pose are held outside the motions, as keys of glTF and FBX files
    are."""

    @property
    def last(self) -> int:
        """Number of the last frame."""
        return self.first + self.count - 1

    def time_of(self, frame: int, option: str = "--frame") -> float:
        """Return the time of a frame in seconds; errors name the ``option`` that gave the frame."""
        last = _LAST_NUMBER if self.runs_on else self.last
        if not self.first <= frame <= last:
            wanted = f"{self.first} or more" if frame < self.first and self.runs_on else ""
            raise ViewerError(
                f"{option}: expected {wanted or f'{self.first} to {last}'}, found {frame}"
            )
        return self.start + (frame - self.first) / self.rate

    def checked_time(self, time: float) -> float:
        """Return a time within the motions."""
        # A capture's last frame is extended by half a frame's duration, because users rarely enter
        # its exact time.
        if self.runs_on:
            return time
        if not self.holds and self.is_outside(time):
            raise ViewerError(
                f"--time: expected {self.start:.6g} to {self.end:.6g} seconds, found {time:g}"
            )
        return min(max(time, self.start), self.end)

    def is_outside(self, time: float) -> bool:
        """Return whether a time is more than half a frame outside the motions."""
        half = 0.5 / self.rate
        return not self.start - half <= time <= self.end + half

    def span(self, asked: Range | None) -> tuple[int, int]:
        """Return the first frame of a range and the frame after its last, counted from 0."""
        if asked is None:
            return 0, self.count
        first = 0 if asked.first is None else asked.first - self.first
        stop = self.count if asked.stop is None else asked.stop - self.first
        if not 0 <= first < stop or (stop > self.count and not self.runs_on):
            raise ViewerError(
                f"--frames: expected a range within {self.first}:{self.last + 1} "
                f"(frames {self.first} to {self.last}), found {asked}"
            )
        return first, stop


def numbering_of(actors: Sequence[Actor], rate: float | None = None) -> Numbering:
    """Return the frame numbering of some actors' motions at a rate, frames per second."""
    # The longest capture defines it: at its own rate, which is the default, frames have the numbers
    # in its files. At another rate, or if there are only keyframed clips, frames count from 0.
    from viewer.rigs.motion.timing import frame_at
    from viewer.rigs.scene import scene_rate, time_span

    captures = [actor.captured for actor in actors if actor.captured is not None]
    longest = max(captures, key=lambda clip: clip.end - clip.start, default=None)
    own = scene_rate(actors)
    counted = rate or own
    first = longest.timing.first_frame if longest is not None and counted == own else 0
    start, end = time_span(actors)
    count = frame_at(end - start, counted) + 1
    runs_on = any(actor.keyed and not actor.transforms for actor in actors)
    return Numbering(first, count, start, end, counted, runs_on, holds=not captures and not runs_on)


def rate(text: str) -> float:
    """Return the frame rate given to an option; raises as ``number`` does."""
    value = number(text)
    if not _SLOWEST <= value <= _FASTEST:
        raise argparse.ArgumentTypeError(_RATE.format(found=text))
    return value


@dataclass(slots=True)
class Frames:
    """The requested frames, numbered as in a capture's files, otherwise from 0."""

    frames: str | None = setting(None, _RANGE, metavar="A:B")
    frame: int | None = setting(None, "pose at frame N of the motion", metavar="N")
    time: float | None = setting(
        None, "pose at S seconds of the motion (default: start)", metavar="S"
    )
    fps: float | None = setting(
        None,
        "frames per second of captures, and for numbering the frames of clips (default: the file's "
        "own, or 30)",
        type=rate,
        metavar="R",
    )
    interpolates: bool = False
    """Whether gaps of captures are interpolated."""
    gaps: Literal["", "hold", "split"] = ""
    """How gaps are written that are not interpolated; empty for the format's default."""
    option: str = "--frame"
    """The option that gave ``frame``, for messages."""

    @property
    def is_one(self) -> bool:
        """Whether a single frame or time is requested."""
        return self.frame is not None or self.time is not None

    def check(self) -> None:
        """Check the rate, and that a range of frames and a single one are not both given."""
        if self.fps is not None and not _SLOWEST <= self.fps <= _FASTEST:
            raise ViewerError(f"--fps: {_RATE.format(found=self.fps)}")
        for option in ("frame", "time"):
            if self.frames is not None and getattr(self, option) is not None:
                raise ViewerError(f"--frames and --{option}: expected one of them, found both")


def frames_of(arguments: argparse.Namespace) -> Frames:
    """Return the requested frames."""
    gaps = getattr(arguments, "gaps", None) or ""
    return settings_of(Frames, arguments, interpolates=arguments.interpolate_gaps, gaps=gaps)


def add_frame_arguments(parser: argparse.ArgumentParser, many: str = "") -> None:
    """Add the options that choose frames; ``many`` is the syntax of a range, if one is allowed."""
    group = parser.add_argument_group("frames: numbered as in a capture's files, otherwise from 0")
    if many:
        step = ", every STEP-th of them" if "STEP" in many else ""
        add_settings(group, Frames, "frames", metavar=many, help=_RANGE.format(step=step))
    add_settings(group, Frames, "frame", "time", "fps")


def parse_range(text: str, option: str = "--frames", *, steps: bool = True) -> Range:
    """Parse ``A:B`` or, if steps are allowed, ``A:B:STEP``; A and B may be omitted.

    >>> parse_range("10:20:2"), parse_range(":5")
    (Range(first=10, stop=20, step=2), Range(first=None, stop=5, step=1))
    """
    found = re.fullmatch(r"(\d{0,9}):(\d{0,9})(?::(\d{1,9}))?", text.strip(), re.ASCII)
    if found:
        first, stop = (int(end) if end else None for end in found.group(1, 2))
        step = int(found[3] or 1)
        is_range = step >= 1 and (stop is None or (first or 0) < stop)
        if is_range and (steps or found[3] is None):
            return Range(first, stop, step)
    forms = "A:B or A:B:STEP" if steps else "A:B"
    raise ViewerError(
        f'{option}: expected {forms} with A below B, as in 0:100, found "{printable(text)}"'
    )


def apply_time(scene: Scene, frames: Frames) -> list[str | Diagnostic]:
    """Pose all actors at the requested frame or time, in place; return messages."""
    # A scene without a motion has one pose, which is its frame 0 and the pose at all times.
    if not frames.is_one:
        return []
    from viewer.rigs.scene import pose_actors

    option = "--time" if frames.frame is None else frames.option
    if frames.frame is not None and frames.time is not None:
        raise ViewerError(f"{option} and --time: expected one of them, found both")
    if all(actor.clip is None for actor in scene.actors):
        if frames.frame:
            raise ViewerError(f"{option}: no file has a motion")
        return [f"{option} has no effect: no file has a motion"]
    numbering = numbering_of(scene.actors, frames.fps)
    if frames.frame is not None:
        scene.time = time = numbering.time_of(frames.frame, option)
    else:
        scene.time = time = numbering.checked_time(frames.time or 0.0)
    notes: list[str | Diagnostic] = []
    if frames.time is not None and numbering.holds and numbering.is_outside(frames.time):
        held = "first" if frames.time < numbering.start else "last"
        notes.append(
            f"--time {frames.time:g}: the motion has keys from {numbering.start:.6g} to "
            f"{numbering.end:.6g} seconds, so its {held} pose is held"
        )
    pose_actors(scene.actors, time, frames.interpolates)
    return notes
