"""Recording of frames: drawing, reading back and encoding run in parallel.

While the driver draws a frame, this thread poses the next one, gives it to the driver as well, and
only then waits for the first; meanwhile the sink's workers encode earlier frames. Waiting does not
hold the global interpreter lock (``Readback``), so recording takes about as long as the slower of
drawing and encoding, unless both compete for the same CPU cores (``tests/bench/bench_video.py``).
Frames are in the driver's memory until they are encoded: one that is drawn, one for each worker,
and one that waits for a worker.

The window and the command line both use it::

    steps = record(Recording(scene, times, camera, size, options), renderer, sink)
    for _ in steps:              # one step per frame, which reports its progress: handle input
        if cancelled:
            steps.close()        # stops the workers and removes partial output
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import field, replace
from functools import partial
from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rendering.camera import Camera, follow_view
from viewer.rendering.gpu.target import Readback, Target, make_straight
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation
from viewer.rendering.renderer import Renderer
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_box
from viewer.rigs.skinning import joint_matrices

_WAITING = 1  # number of frames that may wait for a worker, limited to save memory
_PATIENCE = 0.05  # seconds between steps while the sink finishes


@dataclass(slots=True, eq=False)
class Recording:
    """Parameters of a recording."""

    scene: Scene
    """The scene; its actors are copied and not modified."""
    times: Floats
    """(F,). Scene time of each frame, seconds."""
    camera: Camera
    """Camera of the first frame."""
    size: tuple[int, int]
    """Width and height in pixels."""
    options: DisplayOptions = field(default_factory=DisplayOptions)
    numbers: Sequence[int] = ()
    """F numbers of the frames, in file names and contact sheets."""
    rate: float = 30.0
    """Frames per second of the result."""
    box: Floats | None = None
    """(2, 3) or None. Bounds for the ground grid and the depth range; None for the current scene's
    bounds."""
    moves: bool = True
    """Whether clips pose the actors; if False, they keep their poses, for a turntable of a still
    pose."""
    interpolate: bool = False
    """Interpolate across gaps of captures."""
    turntable: float = 0.0
    """Rotation of the camera about its target, degrees, from the first frame to the frame after the
    last: 360 gives a seamless loop."""
    follow: Follow | None = None
    """Actor or joint that the camera follows."""
    shifts: Floats | None = None
    """(F, 3) or None. Displacement of the camera in each frame, scene units; None if it follows an
    actor or does not move."""
    selected: tuple[int, int] = (0, -1)
    """Index of an actor and of its highlighted joint, as in ``Renderer.draw``."""
    annotations: Callable[[Scene, tuple[int, int]], Sequence[Annotation]] | None = None
    """Returns the annotations of a frame, given the posed scene and the image's size."""

    @property
    def n_frames(self) -> int:
        """Number of frames, F."""
        return len(self.times)

    @property
    def seconds(self) -> float:
        """Duration of the result."""
        return self.n_frames / self.rate


@dataclass(frozen=True, slots=True, eq=False)
class Follow:
    """The actor or joint that the camera follows at a constant distance and angle."""

    actor: int
    """Index in the scene."""
    joint: int
    """Index of a joint or captured point; -1 for their centre."""
    origin: Floats
    """(3,). Position of the joint when the camera was framed, scene space."""


class Sink(Protocol):
    """Receiver of frames; ``viewer.media`` has sinks for images, contact sheets and videos."""

    @property
    def workers(self) -> int:
        """Number of threads that may ``write`` at once; 1 if frames must be in order."""

    @property
    def n_samples(self) -> int:
        """Number of frames, spread over the recording, to pass to ``look`` first."""

    @property
    def notes(self) -> Sequence[str]:
        """Messages about what the format changes, one line each."""

    @property
    def n_kept(self) -> int:
        """Number of frames that stay if the recording is aborted."""

    def look(self, pixels: Bytes) -> None:
        """Inspect a sample frame before any frame is written, to choose the palette of a GIF.

        ``pixels``: as in ``write``.
        """

    def write(self, frame: int, pixels: Bytes) -> None:
        """Write a frame, counted from 0, in a worker thread.

        ``pixels``: (H, W, 4) uint8, sRGB with straight alpha, first row at the top; read-only, and
        in memory that is reused afterwards.
        """

    def close(self) -> None:
        """Finish the output and move it to its final name; called once, after the last frame."""

    def abort(self) -> None:
        """Remove unfinished output; does nothing after a successful ``close``."""


def record(recording: Recording, renderer: Renderer, sink: Sink) -> Generator[int]:
    """Draw all frames and pass them to a sink, one step per frame; yield the number drawn so far.

    The renderer's context must be current in every step and when the generator is closed. Other
    framebuffers may be bound between steps. Closing or discarding the generator before its end
    aborts the sink. The renderer is preferably a separate one: buffers of other scenes are freed
    and must be uploaded again.
    """
    total = recording.n_frames
    samples = np.unique(np.rint(np.linspace(0, total - 1, sink.n_samples)).astype(int)).tolist()
    queue = _Queue(max(sink.workers, 1))
    is_opaque = recording.options.background != "transparent"

    def finished(pixels: Bytes) -> Bytes:
        if is_opaque:
            return pixels
        pixels = pixels.copy()
        make_straight(pixels)
        return pixels

    def look(pixels: Bytes) -> None:
        sink.look(finished(pixels))

    def write(frame: int, pixels: Bytes) -> None:
        sink.write(frame, finished(pixels))

    drawer: _Drawer | None = None
    try:
        drawer = _Drawer(recording, renderer, queue.most + 1)
        for pixels in drawer.draw(samples):
            # Sample frames are inspected one at a time, in order.
            queue.begin(partial(look, pixels)).result()
            drawer.readback.free()
            report(0, total, "frames")
            yield 0
        for frame, pixels in enumerate(drawer.draw(range(total))):
            for _ in range(queue.add(partial(write, frame, pixels))):
                drawer.readback.free()
            report(frame + 1, total, "frames")
            yield frame + 1
        queue.finish()
        closing = queue.begin(sink.close)
        while wait([closing], _PATIENCE).not_done:
            yield total
        closing.result()
    except BaseException:  # this includes Ctrl-C and the closing of the generator
        queue.stop()
        sink.abort()
        raise
    finally:
        queue.stop()
        if drawer is not None:
            drawer.release()


def copied(scene: Scene) -> Scene:
    """Return a scene with copied actors, so that posing them leaves the original unchanged."""
    return replace(scene, actors=[actor.copy() for actor in scene.actors])


def pose_scene(scene: Scene, recording: Recording, seconds: float) -> None:
    """Pose a copy of the recording's scene at a time."""
    if recording.moves:
        scene.time = seconds
        pose_actors(scene.actors, seconds, recording.interpolate)


class _Queue:
    """Bounded work queue of a thread pool."""

    def __init__(self, workers: int) -> None:
        self._pool = ThreadPoolExecutor(workers, "viewer-record")
        self.most = workers + _WAITING
        self._waiting: deque[Future[None]] = deque()

    def begin(self, work: Callable[[], None]) -> Future[None]:
        return self._pool.submit(work)

    def add(self, work: Callable[[], None]) -> int:
        """Submit work; return how many of the oldest works are done, and raise their exception."""
        # If too much is queued, this waits for the oldest.
        self._waiting.append(self.begin(work))
        n_done = 0
        while self._waiting and (len(self._waiting) > self.most or self._waiting[0].done()):
            self._waiting.popleft().result()
            n_done += 1
        return n_done

    def finish(self) -> None:
        while self._waiting:
            self._waiting.popleft().result()

    def stop(self) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)


class _Drawer:
    """Drawer of a recording's frames; each is drawn while the previous one is passed on."""

    def __init__(self, recording: Recording, renderer: Renderer, n_buffers: int) -> None:
        self._recording, self._renderer = recording, renderer
        self._scene = copied(recording.scene)
        show = recording.options.show
        self._box = scene_box(self._scene, show) if recording.box is None else recording.box
        self._target = Target(renderer.context, recording.size, recording.options.samples)
        try:
            self.readback = Readback(self._target, n_buffers)
        except BaseException:
            self._release_target()
            raise

    def draw(self, frames: Sequence[int]) -> Generator[Bytes]:
        """Yield the pixels of frames, with premultiplied alpha; free each one afterwards."""
        cameras, times = _Cameras(self._recording), self._recording.times
        for step in range(len(frames) + 1 if frames else 0):
            if step < len(frames):
                # The driver is still drawing the previous frame.
                pose_scene(self._scene, self._recording, float(times[frames[step]]))
            if step:
                self.readback.begin()
            if step < len(frames):
                self._draw(cameras.at(frames[step], self._scene))
            if step:
                yield self.readback.end()

    def _draw(self, camera: Camera) -> None:
        recording, scene, target = self._recording, self._scene, self._target
        if recording.annotations is not None:
            self._renderer.annotations = recording.annotations(scene, recording.size)
        self._renderer.draw(scene, camera, recording.options, target, self._box, recording.selected)
        self.readback.submit()

    def release(self) -> None:
        """Free target and buffers, and leave the default framebuffer bound."""
        self._release_target()
        self.readback.release()

    def _release_target(self) -> None:
        # Unbind the target before freeing it, since moderngl would bind it again.
        self._renderer.context.detect_framebuffer(0).use()
        self._target.release()


class _Cameras:
    """Cameras of the frames, which must be requested in order."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._shift = np.zeros(3)  # shift of the followed actor; unchanged while it is absent

    def at(self, frame: int, scene: Scene) -> Camera:
        recording = self._recording
        camera, follow = recording.camera.copy(), recording.follow
        follow_view(camera, recording.size, scene)
        if recording.turntable:
            rotated = camera.azimuth + recording.turntable * frame / recording.n_frames
            camera.azimuth = (rotated + 180.0) % 360.0 - 180.0
        if follow is not None:
            place = followed_point(scene.actors[follow.actor], follow.joint)
            self._shift = self._shift if place is None else place - follow.origin
            camera.target = camera.target + self._shift
        elif recording.shifts is not None:
            camera.target = camera.target + recording.shifts[frame]
        return camera


def followed_point(actor: Actor, joint: int = -1) -> Floats | None:
    """Return a joint's scene position (3,), or all joints' or points' mean; None while absent."""
    if not actor.is_present:
        return None
    if actor.points is not None:
        seen = actor.points[:, 3] > 0.0
        chosen = seen & (np.arange(len(seen)) == joint) if joint >= 0 else seen
        points = actor.points[chosen, :3]
    elif actor.own_pose is not None and actor.figure.skeleton is not None:
        joints = joint_matrices(actor.figure, actor.own_pose)[:, :3, 3]
        points = joints[[joint]] if 0 <= joint < len(joints) else joints
    else:
        return None
    return apply_transform(actor.placement, points).mean(axis=0) if len(points) else None
