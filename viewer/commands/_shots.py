"""Which times of a motion are drawn, and how the camera turns meanwhile."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from viewer.commands._frame_numbers import Numbering, numbering_of
from viewer.errors import ViewerError, printable
from viewer.media.video_kinds import MOST_GIF_RATE
from viewer.rig.arrays import Floats
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.commands._sequence import Request

_MOST_FRAMES = 1_000_000
_TURN_SECONDS = 6.0  # of a turntable of something that does not move
_FULL = 360.0  # degrees


@dataclass(frozen=True, slots=True)
class Turntable:
    """How far the camera turns, in degrees, and in how many seconds; None for the motion's."""

    degrees: float
    seconds: float | None


@dataclass(slots=True, eq=False)
class Shots:
    """What is drawn.

    Attributes
    ----------
    times : (F,)
        Seconds of the scene's clock.
    numbers : list of F int
        What the frames are called in file names and contact sheets.
    rate : float
        Frames a second of the result.
    moves : bool
        Whether motions pose the figures.
    turn : float
        Degrees that the camera turns over all frames.
    seconds : float
        How long it takes to see all frames.
    remark : str
        What is to be said of the rate, after it; may be empty.
    notes : list of str
        What is not as one might expect.
    """

    times: Floats
    numbers: list[int]
    rate: float
    moves: bool
    turn: float
    seconds: float
    remark: str = ""
    notes: list[str] = field(default_factory=list)


def parse_turntable(text: str) -> Turntable:
    """Return what ``6``, ``6s``, ``90deg`` or nothing stands for.

    >>> parse_turntable(""), parse_turntable("4s"), parse_turntable("-90deg")
    (Turntable(degrees=360.0, seconds=None), Turntable(degrees=360.0, seconds=4.0), \
Turntable(degrees=-90.0, seconds=None))
    """
    if not text:
        return Turntable(_FULL, None)
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+))(s|deg)?", text.strip(), re.ASCII)
    value = float(found[1]) if found else 0.0
    if found and found[2] == "deg" and 0.0 < abs(value) <= 100.0 * _FULL:
        return Turntable(value, None)
    if found and found[2] != "deg" and 0.0 < value <= 1e5:
        return Turntable(_FULL, value)
    raise ViewerError(
        f'--turntable: expected seconds, as 6, or degrees, as 90deg, found "{printable(text)}"'
    )


def shots_of(request: Request, arguments: argparse.Namespace, scene: Scene) -> Shots:
    """Return what is drawn of a scene.

    Raises ViewerError if nothing moves, or there are no or too many frames.
    """
    is_still = arguments.frame is not None or arguments.time is not None
    moves = not is_still and any(actor.clip is not None for actor in scene.actors)
    if not moves and request.turntable is None:
        found = "a single frame is asked for" if is_still else "no file is a clip"
        raise ViewerError(f"nothing moves: {found} (--turntable turns the camera)")
    if not moves and request.range is not None:
        raise ViewerError("--frames: no file is a clip")
    numbering = numbering_of(scene.actors, arguments.fps)
    rates = _rates(request, arguments, numbering.rate)
    notes = [*rates.notes]
    if moves:
        places, more = _places(request, arguments, numbering, rates)
        notes += [*more, *_overridden(arguments, scene)]
    else:
        assert request.turntable is not None  # or nothing would move
        places = np.zeros(_count((request.turntable.seconds or _TURN_SECONDS) * rates.drawn))
    seconds = len(places) / rates.drawn
    if request.kind == "sheet":
        places = _spread(places, arguments.contact_sheet, moves)
        notes += _too_few(len(places), arguments.contact_sheet)
    # What goes round for longer than the motion lasts shows its frames again.
    is_counted = moves and (request.turntable is None or request.turntable.seconds is None)
    first = numbering.first if is_counted else 0
    numbers = np.rint(places).astype(int) if is_counted else np.arange(len(places))
    turn = 0.0 if request.turntable is None else request.turntable.degrees
    times = (numbering.start if moves else 0.0) + places / numbering.rate
    called = (first + numbers).tolist()
    return Shots(times, called, rates.drawn, moves, turn, seconds, rates.remark, notes)


@dataclass(frozen=True, slots=True)
class _Rates:
    """Frames a second: of the motion that is played in real time, and of what is drawn."""

    played: float
    drawn: float
    remark: str
    notes: tuple[str, ...]


def _rates(request: Request, arguments: argparse.Namespace, counted: float) -> _Rates:
    """Return how fast frames follow each other; videos that skip frames keep the motion's pace."""
    step = 1 if request.range is None else request.range.step
    skips = step > 1 and request.kind == "video" and arguments.fps is None
    # A frame is shown as long as those that were skipped would have been.
    played = counted / step if skips else counted
    is_gif = request.kind == "video" and request.output.suffix.lower() == ".gif"
    drawn = min(played, MOST_GIF_RATE) if is_gif else played
    notes: tuple[str, ...] = ()
    if drawn < played:
        notes = (
            f"GIFs show at most {drawn:g} frames a second: drawn at {drawn:g}, not {played:g}",
        )
    remark = f" (one of {step} frames, at the motion's own pace; --fps sets it)" if skips else ""
    return _Rates(played, drawn, remark, notes)


def _places(
    request: Request, arguments: argparse.Namespace, numbering: Numbering, rates: _Rates
) -> tuple[Floats, list[str]]:
    """Return the frames that are drawn, from 0 at the start, not always whole; and notes."""
    start, stop = numbering.span(request.range)
    total, first = numbering.count, numbering.first
    behind = f"frames {first + max(total, start)} to {first + stop - 1}"
    notes = [f"--frames: {behind} are behind the motion's end"] if stop > total else []
    # Frames of the motion from one drawn frame to the next.
    step = 1 if request.range is None else request.range.step
    pace = step * (arguments.speed or 1.0) * rates.played / rates.drawn
    length = stop - start
    begin = start if pace > 0.0 else stop - 1
    seconds = None if request.turntable is None else request.turntable.seconds
    if seconds is None:
        count = _count(math.floor((length - 1) / abs(pace) + 1e-9) + 1)
        return begin + np.arange(count) * pace, notes
    # The motion begins again until the camera is all the way round.
    run = begin - start + np.arange(_count(seconds * rates.drawn)) * pace
    return start + np.minimum(np.mod(run, length), length - 1), notes


def _count(frames: float) -> int:
    count = max(round(frames), 1)
    if count > _MOST_FRAMES:
        raise ViewerError(f"expected at most {_MOST_FRAMES:,} frames, found {count:,}")
    return count


def _spread(places: Floats, count: int, moves: bool) -> Floats:
    """Choose some frames, the first and the last among them."""
    if not moves:
        return np.zeros(count)
    chosen = np.unique(np.rint(np.linspace(0, len(places) - 1, count)).astype(int))
    return places[chosen]


def _too_few(found: int, wanted: int) -> list[str]:
    """Say that there are fewer frames than cells; none is shown twice."""
    if found == wanted:
        return []
    frames = "is 1 frame" if found == 1 else f"are {found} frames"
    return [f"--contact-sheet: there {frames}, not {wanted}; none is shown twice"]


def _overridden(arguments: argparse.Namespace, scene: Scene) -> list[str]:
    """Return which options shape or pose figures that the motion then shapes or poses anew."""
    from viewer.rig.motion.sampled_clip import SampledClip

    names = ["pose", "dof", "mirror"]
    clips = [actor.clip for actor in scene.actors if isinstance(actor.clip, SampledClip)]
    if any(clip.shape_weights is not None for clip in clips):
        names += ["shape", "expression"]
    given = [name for name in names if getattr(arguments, name)]
    return [f"--{name}: only figures without a motion keep it" for name in given]
