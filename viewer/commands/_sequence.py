"""Times of a motion to draw, and the camera's rotation over them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from viewer.commands._frames import Frames, Numbering, Range, numbering_of
from viewer.commands._pose import PoseOptions
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.media.video_kinds import MOST_GIF_RATE, QUALITY, TURN_SECONDS
from viewer.phrases import printable
from viewer.rendering.camera import Camera
from viewer.rigs.arrays import Floats
from viewer.rigs.scene import Scene

if TYPE_CHECKING:
    from viewer.rendering.options import DisplayOptions
    from viewer.rendering.recorder import Recording

_MOST_FRAMES = 1_000_000
_FULL = 360.0  # full revolution, degrees


@dataclass(frozen=True, slots=True)
class Turntable:
    """Rotation of the camera in degrees, and its duration in seconds; None for the whole motion."""

    degrees: float
    seconds: float | None


def parse_turntable(text: str) -> Turntable:
    """Parse seconds per turn (``6``, ``6s``), degrees (``-90deg``) or an empty string, one turn."""
    if not text:
        return Turntable(_FULL, None)
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+))(s|deg)?", text.strip(), re.ASCII)
    value = float(found[1]) if found else 0.0
    if found and found[2] == "deg" and 0.0 < abs(value) <= 100.0 * _FULL:
        return Turntable(value, None)
    if found and found[2] != "deg" and 0.0 < value <= 1e5:
        return Turntable(_FULL, value)
    raise ViewerError(
        "--turntable: expected seconds such as 6, or degrees such as 90deg, "
        f'found "{printable(text)}"'
    )


@dataclass(slots=True)
class Request:
    """The requested output, checked as thoroughly as possible before anything is opened."""

    output: Path
    """The given path; includes ``{frame}`` for numbered images."""
    turntable: Turntable | None = setting(
        None,
        "rotate the camera once within the given number of seconds, or by the given degrees",
        nargs="?",
        const="",
        read=parse_turntable,
        metavar="SECONDS|DEGREESdeg",
    )
    contact_sheet: int | None = setting(
        None,
        "one image of N numbered frames, evenly spaced over the motion, with a common scale and "
        "ground line",
        metavar="N",
    )
    onion: int | None = setting(
        None,
        "one image of N poses, each at its position, evenly spaced over the motion, with earlier "
        "poses fainter",
        metavar="N",
    )
    speed: float | None = setting(
        None, "playback speed of videos: 0.5 is half as fast, -1 backwards", metavar="S"
    )
    video_quality: float = setting(
        QUALITY, "quality of .mp4 and .webm: 0 to 100 (default: {default})", given=None, metavar="Q"
    )
    kind: Literal["", "pictures", "video", "sheet", "onion"] = ""
    """A still image, one file per frame, one video file, or one image of all frames: in cells or
    superimposed."""
    range: Range | None = None
    """Range of frames; None for the whole motion."""
    is_certain: bool = True
    """False for a GIF, which is a still image if nothing moves."""

    @property
    def is_still(self) -> bool:
        """Whether it is one image."""
        return self.kind in ("", "onion")

    @property
    def step(self) -> int:
        """Every ``step``-th frame of the motion is drawn."""
        return 1 if self.range is None else self.range.step

    def skips(self, fps: float | None) -> bool:
        """Return whether a video shows each frame for the time of the skipped ones, too."""
        return self.step > 1 and self.kind == "video" and fps is None


def recording_of(
    request: Request, frames: Frames, pose: PoseOptions, scene: Scene, options: DisplayOptions
) -> tuple[Recording, list[str]]:
    """Return the frames of a scene to draw, without their camera, and messages."""
    from viewer.rendering.recorder import Recording

    is_still = frames.is_one
    moves = not is_still and any(actor.clip is not None for actor in scene.actors)
    if not moves and request.turntable is None:
        found = "a single frame is requested" if is_still else "no file has a motion"
        raise ViewerError(f"nothing moves: {found} (--turntable rotates the camera)")
    if not moves and request.range is not None:
        raise ViewerError("--frames: no file has a motion")
    numbering = numbering_of(scene.actors, frames.fps)
    rates = _rates(request, frames.fps, numbering.rate)
    notes = [*rates.notes]
    if moves:
        places, more = _places(request, numbering, rates)
        notes += [*more, *_overridden(pose, scene)]
    else:
        assert request.turntable is not None  # something moves: figures or the camera
        places = np.zeros(_count((request.turntable.seconds or TURN_SECONDS) * rates.drawn))
    if request.contact_sheet is not None:
        places = _spread(places, request.contact_sheet, moves)
        notes += _too_few("contact-sheet", len(places), request.contact_sheet)
    if request.onion is not None:
        places = _spread(places, request.onion, moves)
        notes += _too_few("onion", len(places), request.onion)
    # A rotation longer than the motion repeats its frames.
    is_counted = moves and (request.turntable is None or request.turntable.seconds is None)
    first = numbering.first if is_counted else 0
    numbers = np.rint(places).astype(int) if is_counted else np.arange(len(places))
    turntable = 0.0 if request.turntable is None else request.turntable.degrees
    times = (numbering.start if moves else 0.0) + places / numbering.rate
    recording = Recording(
        scene,
        times,
        Camera(up=scene.up),
        (1, 1),
        options,
        numbers=(first + numbers).tolist(),
        rate=rates.drawn,
        moves=moves,
        interpolate=frames.interpolates,
        turntable=turntable,
    )
    return recording, notes


@dataclass(frozen=True, slots=True)
class _Rates:
    """Frames per second: of the motion played in real time, and of the drawn frames."""

    played: float
    drawn: float
    notes: tuple[str, ...]


def _rates(request: Request, fps: float | None, counted: float) -> _Rates:
    """Return the frame rates; videos that skip frames keep the motion's speed."""
    # A frame is also shown for the time of the skipped frames.
    played = counted / request.step if request.skips(fps) else counted
    is_gif = request.kind == "video" and request.output.suffix.lower() == ".gif"
    drawn = min(played, MOST_GIF_RATE) if is_gif else played
    notes: tuple[str, ...] = ()
    if drawn < played:
        notes = (
            f"GIFs show at most {drawn:g} frames per second: drawn at {drawn:g}, not {played:g}",
        )
    return _Rates(played, drawn, notes)


def _places(request: Request, numbering: Numbering, rates: _Rates) -> tuple[Floats, list[str]]:
    """Return the frames to draw, counted from 0 at the start, possibly fractional, and messages."""
    start, stop = numbering.span(request.range)
    total, first = numbering.count, numbering.first
    behind = f"frames {first + max(total, start)} to {first + stop - 1}"
    notes = [f"--frames: {behind} are beyond the end of the motion"] if stop > total else []
    # Step between drawn frames, in frames of the motion.
    pace = request.step * (request.speed or 1.0) * rates.played / rates.drawn
    length = stop - start
    begin = start if pace > 0.0 else stop - 1
    seconds = None if request.turntable is None else request.turntable.seconds
    if seconds is None:
        count = _count(math.floor((length - 1) / abs(pace) + 1e-9) + 1)
        return begin + np.arange(count, dtype=np.float64) * pace, notes
    # The motion loops until the camera has completed its rotation.
    n_frames = _count(seconds * rates.drawn)
    run = begin - start + np.arange(n_frames, dtype=np.float64) * pace
    return start + np.minimum(np.mod(run, length), length - 1), notes


def _count(frames: float) -> int:
    count = max(round(frames), 1)
    if count > _MOST_FRAMES:
        raise ViewerError(f"expected at most {_MOST_FRAMES:,} frames, found {count:,}")
    return count


def _spread(places: Floats, count: int, moves: bool) -> Floats:
    """Choose evenly spaced frames, including the first and the last."""
    if not moves:
        return np.zeros(count)
    chosen = np.unique(np.rint(np.linspace(0, len(places) - 1, count)).astype(int))
    return places[chosen]


def _too_few(option: str, found: int, wanted: int) -> list[str]:
    """Return a message if there are fewer frames than requested; no frame is shown twice."""
    if found == wanted:
        return []
    frames = "is 1 frame" if found == 1 else f"are {found} frames"
    return [f"--{option}: there {frames}, not {wanted}; no frame is shown twice"]


def _overridden(pose: PoseOptions, scene: Scene) -> list[str]:
    """Return messages about shape and pose options that the motion overrides."""
    names = ["pose", "dof", "mirror"]
    clips = [actor.joint_motion for actor in scene.actors]
    if any(clip is not None and clip.sets_shape for clip in clips):
        names += ["shape", "expression"]
    given = [name for name in names if getattr(pose, name)]
    return [f"--{name}: applies only to figures without a motion" for name in given]
