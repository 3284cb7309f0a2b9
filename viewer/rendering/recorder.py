"""Recording of frames: drawn, read back and passed to a sink while the next are drawn.

Three things happen at the same time. The driver draws a frame; this thread poses the next one; and
the sink's workers encode those before, for which this thread lets go of Python's lock while it
waits for the driver. So recording takes about as long as drawing or encoding alone, whichever is
slower, as far as they do not compete for the same processors (``tests/bench/bench_video.py``).

The window and the command line use it alike::

    steps = record(Recording(scene, times, camera, size, options), renderer, sink)
    for progress in steps:       # one step a frame; draw a progress bar, answer the mouse
        if cancelled:
            steps.close()        # stops the workers; nothing half-written stays
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.target import Target, picture_rows, straight
from viewer.rendering.gpu.upload import checked
from viewer.rendering.gpu.waiting import Waiter
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation
from viewer.rendering.renderer import Renderer
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.motion.follow import followed_point
from viewer.rig.motion.instances import pose_actors
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
    n_samples : int
        How many frames, spread over the whole, ``look`` is to see before the first is written.
    """

    @property
    def workers(self) -> int:
        """How many threads may call ``write``."""

    @property
    def n_samples(self) -> int:
        """How many frames ``look`` is to see."""

    def look(self, pixels: Bytes) -> None:
        """See a frame before any is written: to choose the colours of a GIF."""

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
    """The actor or joint that the camera follows, keeping its distance and angle.

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
    """Parameters of a recording.

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
    interpolate : bool
        Interpolate over the gaps of captures.
    turn : float
        Degrees by which the camera turns about its target from the first frame to the one that
        would follow the last: 360 makes a seamless loop.
    follow : Follow or None
        Whom the camera goes with.
    selected : (int, int)
        An actor's index and its joint that is highlighted, as ``Renderer.draw`` takes them.
    annotations : callable or None
        Gives what is drawn over a frame, from the posed scene and the picture's size.
    """

    scene: Scene
    times: Floats
    camera: Camera
    size: tuple[int, int]
    options: DisplayOptions = field(default_factory=DisplayOptions)
    box: Floats | None = None
    moves: bool = True
    interpolate: bool = False
    turn: float = 0.0
    follow: Follow | None = None
    selected: tuple[int, int] = (0, -1)
    annotations: Callable[[Scene, tuple[int, int]], Sequence[Annotation]] | None = None

    @property
    def n_frames(self) -> int:
        """Number of frames, F."""
        return len(self.times)


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a recording.

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
    return replace(scene, actors=[actor.copy() for actor in scene.actors])


def pose_scene(scene: Scene, recording: Recording, seconds: float) -> None:
    """Pose a copy of the recording's scene as it is at one time."""
    if recording.moves:
        scene.time = seconds
        pose_actors(scene.actors, seconds, recording.interpolate)


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
    samples = np.unique(np.rint(np.linspace(0, total - 1, sink.n_samples)).astype(int)).tolist()
    queue = _Queue(max(sink.workers, 1))
    is_opaque = recording.options.background != "transparent"

    def pixels_of(data: bytes) -> Bytes:
        pixels = picture_rows(data, recording.size)
        return pixels if is_opaque else straight(pixels)

    def look(data: bytes) -> None:
        sink.look(pixels_of(data))

    def write(frame: int, data: bytes) -> None:
        sink.write(frame, pixels_of(data))

    def progress(done: int) -> Progress:
        return Progress(done, total, time.perf_counter() - started)

    drawer: _Drawer | None = None
    try:
        drawer = _Drawer(recording, renderer)
        for data in drawer.draw(samples):
            queue.begin(partial(look, data)).result()  # one at a time, in order
            yield progress(0)
        for frame, data in enumerate(drawer.draw(range(total))):
            queue.add(partial(write, frame, data))
            yield progress(frame + 1)
        queue.finish()
        closing = queue.begin(sink.close)
        while wait([closing], _PATIENCE).not_done:
            yield progress(total)
        closing.result()
    except BaseException:  # also Ctrl-C, and a generator that is closed
        queue.stop()
        sink.abort()
        raise
    finally:
        queue.stop()
        if drawer is not None:
            drawer.release()


class _Queue:
    """Work for some threads, of which only a little may wait."""

    def __init__(self, workers: int) -> None:
        self._pool = ThreadPoolExecutor(workers, "viewer-record")
        self._most = workers + _WAITING
        self._waiting: deque[Future[None]] = deque()

    def begin(self, work: Callable[[], None]) -> Future[None]:
        return self._pool.submit(work)

    def add(self, work: Callable[[], None]) -> None:
        """Begin some work; wait for the oldest if there is too much, and raise what it raised."""
        self._waiting.append(self.begin(work))
        while len(self._waiting) > self._most:
            self._waiting.popleft().result()

    def finish(self) -> None:
        while self._waiting:
            self._waiting.popleft().result()

    def stop(self) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)


class _Drawer:
    """Draws frames of a recording; one is being drawn while the one before is handed on."""

    def __init__(self, recording: Recording, renderer: Renderer) -> None:
        self._recording, self._renderer = recording, renderer
        self._scene, context = copied(recording.scene), renderer.context
        show = recording.options.show
        self._box = scene_box(self._scene, show) if recording.box is None else recording.box
        self._waiter = Waiter(context)
        self._target = Target(context, recording.size, recording.options.samples)
        try:
            n_bytes = 4 * math.prod(recording.size)
            what = f"a buffer of {n_bytes / 1e6:.1f} MB for frames"
            self._buffer = checked(context, context.buffer(reserve=n_bytes), what)
        except BaseException:
            self._release_target()
            raise

    def draw(self, frames: Sequence[int]) -> Generator[bytes]:
        """Yield some frames' bytes as OpenGL has them, last row first."""
        cameras, times = _Cameras(self._recording), self._recording.times
        for step in range(len(frames) + 1 if frames else 0):
            if step < len(frames):
                # The driver still draws the frame before.
                pose_scene(self._scene, self._recording, float(times[frames[step]]))
            if step:
                self._waiter.end()
                self._target.resolve()
                self._target.read_into(self._buffer)
            if step < len(frames):
                self._draw(cameras.at(frames[step], self._scene))
            if step:
                yield self._buffer.read()

    def _draw(self, camera: Camera) -> None:
        recording, scene, target = self._recording, self._scene, self._target
        if recording.annotations is not None:
            self._renderer.annotations = recording.annotations(scene, recording.size)
        self._renderer.draw(scene, camera, recording.options, target, self._box, recording.selected)
        self._waiter.begin()

    def release(self) -> None:
        """Free what was drawn into; the framebuffer of nobody is bound then."""
        self._release_target()
        self._buffer.release()

    def _release_target(self) -> None:
        # One that is bound must not be freed: moderngl would bind it again.
        self._renderer.context.detect_framebuffer(0).use()
        self._target.release()


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
