"""Which times of a motion are drawn, and how the camera turns meanwhile."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import ViewerError, printable
from viewer.formats._video_kinds import MOST_GIF_RATE
from viewer.rig.arrays import Floats
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.commands._sequence import Request

__all__ = ["Range", "Shots", "Turntable", "parse_range", "parse_turntable", "shots_of"]

_MOST_FRAMES = 1_000_000
_LAST_NUMBER = 1_000_000_000
_TURN_SECONDS = 6.0  # of a turntable of something that does not move
_FULL = 360.0  # degrees


@dataclass(frozen=True, slots=True)
class Range:
    """Frames ``first``, ``first + step`` … below ``stop``; None for the motion's end."""

    first: int
    stop: int | None
    step: int


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
    notes : list of str
        What is not as one might expect.
    """

    times: Floats
    numbers: list[int]
    rate: float
    moves: bool
    turn: float
    seconds: float
    notes: list[str] = field(default_factory=list)


def parse_range(text: str) -> Range:
    """Return the range that ``A:B`` or ``A:B:STEP`` stands for; A and B may be left out.

    >>> parse_range("10:20:2"), parse_range(":5")
    (Range(first=10, stop=20, step=2), Range(first=0, stop=5, step=1))
    """
    found = re.fullmatch(r"(\d{0,9}):(\d{0,9})(?::(\d{1,9}))?", text.strip(), re.ASCII)
    if found:
        first, stop = int(found[1] or 0), int(found[2]) if found[2] else None
        step = int(found[3] or 1)
        if step >= 1 and (stop is None or first < stop <= _LAST_NUMBER):
            return Range(first, stop, step)
    raise ViewerError(
        f'--frames: expected A:B or A:B:STEP with A below B, as 0:100, found "{printable(text)}"'
    )


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

    Raises
    ------
    ViewerError
        If nothing moves, or there are no or too many frames.
    """
    is_still = arguments.frame is not None or arguments.time is not None
    moves = not is_still and any(actor.clip is not None for actor in scene.actors)
    if not moves and request.turntable is None:
        found = "a single frame is asked for" if is_still else "no file is a clip"
        raise ViewerError(f"nothing moves: {found} (--turntable turns the camera)")
    if not moves and request.range is not None:
        raise ViewerError("--frames: no file is a clip")
    from viewer.rig.motion import scene_rate, time_span

    counted = arguments.fps or scene_rate(scene.actors)
    rate, notes = counted, []
    if request.kind == "video" and request.output.suffix.lower() == ".gif" and rate > MOST_GIF_RATE:
        rate = MOST_GIF_RATE
        notes.append(
            f"GIFs show at most {rate:g} frames a second: drawn at {rate:g}, not {counted:g}"
        )
    if moves:
        places, more = _places(request, arguments, scene, counted, rate)
        notes += [*more, *_overridden(arguments)]
    else:
        assert request.turntable is not None  # or nothing would move
        places = np.zeros(_count((request.turntable.seconds or _TURN_SECONDS) * rate))
    seconds = len(places) / rate
    if request.kind == "sheet":
        places = _spread(places, arguments.contact_sheet, moves)
    is_counted = moves and (request.turntable is None or request.turntable.seconds is None)
    numbers = np.rint(places).astype(int).tolist() if is_counted else list(range(len(places)))
    start = time_span(scene.actors)[0] if moves else 0.0
    turn = 0.0 if request.turntable is None else request.turntable.degrees
    return Shots(start + places / counted, numbers, rate, moves, turn, seconds, notes)


def _places(
    request: Request, arguments: argparse.Namespace, scene: Scene, counted: float, rate: float
) -> tuple[Floats, list[str]]:
    """Return the frames that are drawn, as numbers that need not be whole, and notes."""
    from viewer.rig.motion import time_span

    start, end = time_span(scene.actors)
    total = math.floor((end - start) * counted + 1e-6) + 1
    asked = request.range or Range(0, None, 1)
    stop = total if asked.stop is None else asked.stop
    if asked.first >= stop:
        raise ViewerError(f"--frames: there are {total} frames, 0 to {total - 1}")
    behind = f"frames {max(total, asked.first)} to {stop - 1}"
    notes = [f"--frames: {behind} are behind the motion's end"] if stop > total else []
    # Frames of the motion from one drawn frame to the next.
    pace = asked.step * (arguments.speed or 1.0) * counted / rate
    length = stop - asked.first
    begin = asked.first if pace > 0.0 else stop - 1
    seconds = None if request.turntable is None else request.turntable.seconds
    if seconds is None:
        count = _count(math.floor((length - 1) / abs(pace) + 1e-9) + 1)
        return begin + np.arange(count) * pace, notes
    # The motion begins again until the camera is all the way round.
    run = begin - asked.first + np.arange(_count(seconds * rate)) * pace
    return asked.first + np.minimum(np.mod(run, length), length - 1), notes


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


def _overridden(arguments: argparse.Namespace) -> list[str]:
    """Return which options pose figures that the motion then poses anew."""
    given = [name for name in ("pose", "dof", "mirror") if getattr(arguments, name)]
    return [f"--{name}: only figures without a motion keep it" for name in given]
