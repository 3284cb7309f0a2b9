"""Clock of the window: the time shown, playback, and the poses at that time."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Literal, NamedTuple, TypeAlias

from viewer.data_classes import dataclass
from viewer.rigs.motion.timing import DEFAULT_RATE, frame_at
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_rate, time_span

PlaybackMode: TypeAlias = Literal["loop", "once", "ping-pong", "run on"]
MODES: dict[PlaybackMode, str] = {
    "loop": "Loop",
    "once": "Once",
    "ping-pong": "Ping-pong",
    "run on": "Run on",
}
"""Playback modes, which differ at the end of the range, with their labels."""

FASTEST = 4.0
"""Maximum playback speed, forwards and backwards."""


class PosedFor(NamedTuple):
    """Key that identifies the poses: actors are posed again only if it changes."""

    time: float
    """Seconds."""
    interpolate_gaps: bool
    """Whether captures are interpolated in their gaps."""
    clips: tuple[object, ...]
    """Clip and offset of each actor; clips are replaced, never modified."""


@dataclass(slots=True)
class Clock:
    """Advances the time of a scene by the wall clock, dropping frames, and poses its actors."""

    scene: Scene = field(default_factory=lambda: Scene([]))
    """Scene that the clock drives."""
    playing: bool = False
    """Whether time advances."""
    speed: float = 1.0
    """Seconds of motion per second, -4 to 4."""
    mode: PlaybackMode = "loop"
    start: float = 0.0
    end: float = 0.0
    """Playback range, seconds."""
    whole: tuple[float, float] = (0.0, 0.0)
    """Time range of all clips, seconds."""
    frame_rate: float = DEFAULT_RATE
    """Frames per second for stepping and frame numbers: the rate of the chosen actor's capture, so
    that each of its frames can be reached, or of the longest capture if it has none."""
    origin: float = 0.0
    """Time of that capture's first frame, seconds."""
    keyed_rate: float = DEFAULT_RATE
    """Frames per second for scenes without sampled motion: the rate that was set, or else the rate
    of the keys."""
    _is_rate_set: bool = False
    first_frame: int = 0
    """Number of that frame in its file."""
    has_frames: bool = False
    """Whether any motion is sampled: each frame is then shown for its whole duration."""
    interpolate_gaps: bool = False
    """Whether captures are interpolated in their gaps."""
    has_motion: bool = False
    """Whether any actor has a motion."""
    _over: float = 0.0  # seconds elapsed in the last frame of the range
    _is_returning: bool = False  # whether ping-pong playback runs backwards
    posed_for: PosedFor | None = None
    """Key of the current poses; time may have advanced since."""
    n_posed: int = 0
    """Number of times the actors were posed."""
    _grid: tuple[object, ...] = ()  # key of the capture that defines the frames

    @property
    def time(self) -> float:
        """Time of the scene that is shown, seconds."""
        return 0.0 if self.scene.time is None else self.scene.time

    @time.setter
    def time(self, time: float) -> None:
        self.scene.time = time

    def show(self, scene: Scene) -> None:
        """Attach a scene: use the range of its clips, and go to its time, or to the start."""
        self.scene, self.posed_for = scene, None
        self.playing, self.mode, self.speed = False, "loop", 1.0
        self._is_rate_set, self.has_frames = False, False
        self._grid = ()
        self.follow(scene.actors[0] if scene.actors else None)
        self.start, self.end = self.whole
        self.seek(self.start if scene.time is None else scene.time)

    def follow(self, chosen: Actor | None = None) -> None:
        """Adapt range and frame to changed clips; the chosen actor's capture defines the frames.

        A range that covered all clips still does. If only the frame rate changes, time and range
        stay on their frames.
        """
        was_whole = (self.start, self.end) == self.whole
        moving = [actor for actor in self.scene.actors if actor.clip is not None]
        keyed, sampled = list[Actor](), list[Actor]()
        for actor in moving:
            (sampled if actor.captured else keyed).append(actor)
        if not self._is_rate_set:
            self.keyed_rate = scene_rate(keyed)
        self.has_motion, self.has_frames = bool(moving), bool(sampled)
        self.whole = time_span(moving)
        counted = chosen if chosen in sampled else max(sampled, key=_length, default=None)
        self._count(counted)
        if was_whole:
            self.start, self.end = self.whole
        else:
            self.set_range(self.start, self.end)

    def _count(self, actor: Actor | None) -> None:
        """Count the frames of an actor's capture; for None, frames at the rate of keyed clips."""
        clip = None if actor is None else actor.captured
        old_rate, old_origin, old_grid = self.frame_rate, self.origin, self._grid
        if actor is None or clip is None:
            self.frame_rate, self.first_frame = self.keyed_rate, 0
            self.origin, self._grid = self.whole[0], ()
            return
        timing = clip.timing
        self.frame_rate, self.first_frame = timing.frame_rate, timing.first_frame
        self.origin = timing.start + actor.offset
        self._grid = (id(actor), timing.n_frames, timing.first_frame)
        if self._grid == old_grid and old_rate != self.frame_rate:
            self.time, self.start, self.end = (
                self.origin + (time - old_origin) * old_rate / self.frame_rate
                for time in (self.time, self.start, self.end)
            )

    def count_by(self, rate: float) -> None:
        """Set the frame rate used to count keyed clips."""
        self.keyed_rate, self._is_rate_set = rate, True
        if not self.has_frames:
            self.frame_rate = rate

    @property
    def n_frames(self) -> int:
        """Number of frames of the whole range."""
        low, high = self.frame_range
        return high - low + 1

    @property
    def frame_range(self) -> tuple[int, int]:
        """First and last frame of the whole range, in the numbering of ``frame``."""
        low, high = self.whole
        first = -frame_at(self.origin - low, self.frame_rate)
        return first, frame_at(high - self.origin, self.frame_rate)

    @property
    def frame(self) -> int:
        """Index of the current frame, 0 at the origin."""
        return frame_at(self.time - self.origin, self.frame_rate)

    def frame_time(self, frame: int) -> float:
        """Return the time of a frame, seconds."""
        return self.origin + frame / self.frame_rate

    def nearest_frame_time(self, time: float) -> float:
        """Return the time of the frame nearest to a time, within the whole range, seconds."""
        low, high = self.frame_range
        if low > high:  # the range is shorter than a frame
            return time
        return self.frame_time(min(max(round((time - self.origin) * self.frame_rate), low), high))

    def scrub(self, time: float, between: bool = False) -> None:
        """Go to the frame nearest to a time, or to the exact time if it may lie between frames."""
        self.seek(time if between else self.nearest_frame_time(time))

    def seek(self, time: float) -> None:
        """Go to a time, clamped to the whole range unless the mode is "run on"."""
        is_free = self.mode == "run on"
        self.time = time if is_free else min(max(time, self.whole[0]), self.whole[1])
        self._over, self._is_returning = 0.0, False

    def step(self, frames: int) -> None:
        """Stop and step by whole frames, snapping to a frame first."""
        self.playing = False
        place = (self.time - self.origin) * self.frame_rate
        nearest = round(place)
        if abs(place - nearest) < 1e-6:
            target = nearest + frames
        else:
            target = (math.floor(place) if frames < 0 else math.ceil(place)) + frames
            target += 1 if frames < 0 else -1
        self.seek(self.frame_time(target))

    def toggle(self) -> None:
        """Play or pause; at the end of a range played once, restart from its start."""
        self.playing = not self.playing
        if self.playing and self.mode == "once":
            if self.speed >= 0.0 and self.time >= self.end - 1e-9:
                self.seek(self.start)
            elif self.speed < 0.0 and self.time <= self.start + 1e-9:
                self.seek(self.end)

    def set_range(self, start: float, end: float) -> None:
        """Set the playback range; start and end are ordered and clamped to the whole range."""
        low, high = self.whole
        start, end = sorted((min(max(start, low), high), min(max(end, low), high)))
        self.start, self.end = start, end

    def advance(self, seconds: float) -> None:
        """Advance by some wall clock time, if playing."""
        if not self.playing or not self.has_motion:
            return
        step = seconds * self.speed
        if self.mode == "run on":
            self.time += step
        elif self.mode == "ping-pong":
            self._bounce(step)
        else:
            self._run(step)

    def _run(self, step: float) -> None:
        """Move within the range; at its end, wrap around or stop."""
        # The last frame is shown for as long as every other frame.
        hold = 1.0 / self.frame_rate if self.has_frames and self.end > self.start else 0.0
        period = self.end - self.start + hold
        if period <= 0.0:
            self.time, self.playing = self.start, self.playing and self.mode != "once"
            return
        place = self.time - self.start + self._over + step
        if not 0.0 <= place < period:
            if self.mode == "once":
                self.playing, self._over = False, 0.0
                self.time = self.end if place > 0.0 else self.start
                return
            place %= period
        self.time = min(self.start + place, self.end)
        self._over = max(self.start + place - self.end, 0.0)

    def _bounce(self, step: float) -> None:
        """Move back and forth within the range."""
        length = self.end - self.start
        if length <= 0.0:
            self.time = self.start
            return
        # The way back is the second half of a period of two lengths.
        place = min(max(self.time - self.start, 0.0), length)
        place = ((2.0 * length - place if self._is_returning else place) + step) % (2.0 * length)
        self._is_returning = place > length
        self.time = self.start + (2.0 * length - place if self._is_returning else place)

    def pose(self, chosen: Actor | None = None, again: bool = False) -> bool:
        """Pose all actors if the time or a clip changed, or ``again``; return whether they were."""
        actors, before = self.scene.actors, self.posed_for
        clips = tuple((actor.clip, actor.offset) for actor in actors)
        if before is None or before.clips != clips:
            self.follow(chosen)
        wanted = PosedFor(self.time, self.interpolate_gaps, clips)
        if wanted == before and not again:
            return False
        self.posed_for = wanted
        self.n_posed += 1
        pose_actors(actors, self.time, self.interpolate_gaps)
        return True

    def posed(self, actor: Actor, pose: Pose) -> Pose:
        """Return a copy of a pose with the values that an actor's clip sets; no spring moves."""
        copied = actor.copy()
        copied.pose, copied.springs = pose.copy(), None
        time = self.time if self.posed_for is None else self.posed_for.time
        pose_actors([copied], time, self.interpolate_gaps)
        return copied.pose

    def go_back(self, time: float, chosen: Actor | None = None) -> None:
        """Go to a time with restored actors and clips, and pose the actors for it."""
        self.follow(chosen)
        self.seek(time)
        self.pose(chosen, again=True)


def _length(actor: Actor) -> float:
    assert actor.clip is not None  # only moving actors are compared
    return actor.clip.end - actor.clip.start
