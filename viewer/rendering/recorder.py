"""Many frames of a scene in order: drawn, read back and handed on while the next are drawn.

Three things happen at the same time. The driver draws a frame into one of two targets; this thread
reads the frame before it, which is already done, into one of two pixel buffers; and the sink's
workers encode the frames before those. So recording takes about as long as the slowest of the three
alone, where they do not compete for the same processor.

The window and the command line use it alike::

    steps = record(Recording(scene, times, camera, size, options), renderer, sink)
    for progress in steps:       # one step a frame; draw a progress bar, answer the mouse
        if cancelled:
            steps.close()        # stops the workers; nothing half-written stays
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Protocol

import moderngl
import numpy as np

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.renderer import Renderer
from viewer.rendering.target import Target, picture_rows, straight
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.follow import followed_point
from viewer.rig.motion import pose_actor
from viewer.rig.scene import Scene, scene_box

__all__ = ["Follow", "Progress", "Recording", "Sink", "copied", "pose_scene", "record"]

_WAITING = 2  # frames that wait for a worker, beside those being encoded: memory stays bounded
_PATIENCE = 0.05  # seconds between two steps while the sink finishes


class Sink(Protocol):
    """Where frames go; ``viewer.formats`` has sinks for pictures, contact sheets and videos.

    Attributes
    ----------
    workers : int
        How many threads may call ``write`` at the same time. 1 for whoever needs the frames in
        order.
    """

    @property
    def workers(self) -> int:
        """How many threads may call ``write``."""

    def write(self, frame: int, pixels: Bytes) -> None:
        """Take one frame; called in a worker's thread.

        Parameters
        ----------
        frame : int
            Counted from 0.
        pixels : (H, W, 4) uint8
            sRGB and alpha, not multiplied, first row at the top; not to be changed.
        """

    def close(self) -> None:
        """Put the result under its final name; called once, after the last frame."""

    def abort(self) -> None:
        """Remove what is not finished; nothing if ``close`` went through already."""


@dataclass(frozen=True, slots=True, eq=False)
class Follow:
    """Whom the camera goes with, at the distance and angle that it has.

    Attributes
    ----------
    actor : int
        Index in the scene.
    joint : int
        Of its skeleton or points, -1 for the middle of all.
    origin : (3,)
        Where that was when the camera was aimed, scene space.
    """

    actor: int
    joint: int
    origin: Floats


@dataclass(slots=True, eq=False)
class Recording:
    """What is recorded.

    Attributes
    ----------
    scene : Scene
        Its actors are copied: neither their poses nor their presence change.
    times : (F,)
        Seconds of the scene's clock, a frame each.
    camera : Camera
        The first frame's point of view.
    size : (int, int)
        Width and height in pixels.
    options : DisplayOptions
        What is shown and how.
    box : (2, 3) or None
        What the grid lies under and the depth range covers; None for the scene as it is.
    moves : bool
        Whether clips pose the actors; False keeps their poses, for a turntable of a still.
    fill : bool
        Bridge the gaps of captures.
    turn : float
        Degrees by which the camera turns about its target from the first frame to the one that
        would follow the last: 360 makes a seamless loop.
    follow : Follow or None
        Whom the camera goes with.
    """

    scene: Scene
    times: Floats
    camera: Camera
    size: tuple[int, int]
    options: DisplayOptions = field(default_factory=DisplayOptions)
    box: Floats | None = None
    moves: bool = True
    fill: bool = False
    turn: float = 0.0
    follow: Follow | None = None

    @property
    def n_frames(self) -> int:
        """Number of frames, F."""
        return len(self.times)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a recording is.

    Attributes
    ----------
    done : int
        Frames that are drawn and handed to the sink.
    total : int
        All frames.
    seconds : float
        Since the first step.
    """

    done: int
    total: int
    seconds: float

    @property
    def left(self) -> float:
        """Seconds that the rest will take if it goes on like this; 0 before the first frame."""
        return self.seconds * (self.total - self.done) / self.done if self.done else 0.0


def copied(scene: Scene) -> Scene:
    """Return a scene whose actors can be posed without changing this one's; figures are shared."""
    actors = [
        replace(actor, pose=None if actor.pose is None else actor.pose.copy())
        for actor in scene.actors
    ]
    return replace(scene, actors=actors)


def pose_scene(scene: Scene, recording: Recording, seconds: float) -> None:
    """Pose a copy of the recording's scene as it is at one time."""
    if recording.moves:
        scene.time = seconds
        for actor in scene.actors:
            pose_actor(actor, seconds, recording.fill)


def record(recording: Recording, renderer: Renderer, sink: Sink) -> Generator[Progress]:
    """Draw all frames and hand them to a sink, one step a frame.

    The renderer's context must be current in every step, and when the generator is closed. What
    else is drawn between the steps is free to bind other framebuffers. A generator that is closed,
    or dropped, before its end aborts the sink.

    Parameters
    ----------
    recording : Recording
        What is drawn.
    renderer : Renderer
        Best one of its own: what it holds for other scenes is freed and uploaded again.
    sink : Sink
        Gets the frames; closed after the last one, aborted if anything goes wrong.

    Yields
    ------
    Progress
        After each frame, and while the sink finishes.

    Raises
    ------
    ViewerError
        If the driver cannot draw a picture of this size.
    OutputError
        If the sink cannot write.
    """
    started, total = time.perf_counter(), recording.n_frames
    pool = ThreadPoolExecutor(max(sink.workers, 1), "viewer-record")
    waiting: deque[Future[None]] = deque()
    frames = _drawn(recording, renderer)
    is_opaque = recording.options.background != "transparent"

    def encode(frame: int, data: bytes) -> None:
        pixels = picture_rows(data, recording.size)
        sink.write(frame, pixels if is_opaque else straight(pixels))

    try:
        for done, data in enumerate(frames, 1):
            waiting.append(pool.submit(encode, done - 1, data))
            while len(waiting) > sink.workers + _WAITING:
                waiting.popleft().result()
            yield Progress(done, total, time.perf_counter() - started)
        while waiting:
            waiting.popleft().result()
        closing = pool.submit(sink.close)
        while wait([closing], _PATIENCE).not_done:
            yield Progress(total, total, time.perf_counter() - started)
        closing.result()
    except BaseException:  # also Ctrl-C, and a generator that is closed
        pool.shutdown(wait=True, cancel_futures=True)
        sink.abort()
        raise
    finally:
        pool.shutdown(wait=True)
        frames.close()


def _drawn(recording: Recording, renderer: Renderer) -> Generator[bytes]:
    """Yield every frame's bytes as OpenGL has them, last row first."""
    scene, context = copied(recording.scene), renderer.context
    cameras = _Cameras(recording)
    box = scene_box(scene, recording.options.show) if recording.box is None else recording.box
    owned: list[Target | moderngl.Buffer] = []
    try:
        targets = [Target(context, recording.size, recording.options.samples) for _ in range(2)]
        owned += targets
        n_bytes = 4 * recording.size[0] * recording.size[1]
        buffers = [context.buffer(reserve=n_bytes) for _ in range(2)]
        owned += buffers
        for step in range(recording.n_frames + 2):
            # Drawing comes first: the driver works on it while the frames before are read.
            if step < recording.n_frames:
                pose_scene(scene, recording, float(recording.times[step]))
                camera = cameras.at(step, scene)
                renderer.draw(scene, camera, recording.options, targets[step % 2], box)
            if 1 <= step <= recording.n_frames:
                targets[(step - 1) % 2].resolve()
                targets[(step - 1) % 2].read_into(buffers[(step - 1) % 2])
            if step >= 2:
                yield buffers[step % 2].read()
    finally:
        for item in owned:
            item.release()


class _Cameras:
    """The point of view of each frame, asked for in order."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._shift = np.zeros(3)  # of whoever is followed; kept while they are absent

    def at(self, frame: int, scene: Scene) -> Camera:
        recording = self._recording
        camera, follow = recording.camera.copy(), recording.follow
        if recording.turn:
            turned = camera.azimuth + recording.turn * frame / recording.n_frames
            camera.azimuth = (turned + 180.0) % 360.0 - 180.0
        if follow is not None:
            place = followed_point(scene.actors[follow.actor], follow.joint)
            self._shift = self._shift if place is None else place - follow.origin
            camera.target = camera.target + self._shift
        return camera
