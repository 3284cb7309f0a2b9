"""Offscreen rendering: from a scene to an array of pixels."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from functools import partial

from viewer.interrupts import deferred
from viewer.progress import report
from viewer.rendering.camera import Camera, facing_camera, fit
from viewer.rendering.gpu.context import Graphics, is_software, unreadable_devices
from viewer.rendering.gpu.target import Target, check_size
from viewer.rendering.options import SIZE, DisplayOptions
from viewer.rendering.renderer import Renderer
from viewer.rendering.sampling import n_passes
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import Scene, Shown, scene_points

_thread = threading.local()
_BAND = 32  # number of rows that are exchanged at once, so that they stay in the processor's cache


class Offscreen:
    """A headless context that draws any number of scenes.

    The context is current only while drawing, so any thread may use it, one at a time. Another
    context that was current before must be made current again (``with context:``). ``device``:
    index of the EGL device; if omitted, each one is tried in turn. ``graphics``: an existing
    context to draw in, which ``release`` does not free.
    """

    def __init__(self, device: int | None = None, graphics: Graphics | None = None) -> None:
        self._graphics = graphics or Graphics(device)
        self._is_owner = graphics is None
        self.context = self._graphics.context
        with self.context:
            self._graphics.rest()
            self.renderer = Renderer(self._graphics.programs)
        if is_software(self.context):
            self.renderer.notes += [
                f"rendering in software: {node} exists but you have no permission to open it "
                "(group render)"
                for node in unreadable_devices()
            ]
        self._target: Target | None = None

    def target(self, size: tuple[int, int], samples: int) -> Target:
        """Return a target of this size; the last one is reused if it matches."""
        target = self._target
        if target is None or (target.size, target.asked_samples) != (size, samples):
            # moderngl rebinds the old target after creating the new one, so release it last.
            self._target = Target(self.context, size, samples)
            if target is not None:
                target.release()
            return self._target
        return target

    def render(
        self,
        scene: Scene,
        size: tuple[int, int],
        camera: Camera,
        options: DisplayOptions,
        box: Floats,
        on_time: Callable[[float, int], object] | None = None,
    ) -> Bytes:
        """Draw a scene and return its pixels; see ``render``. The last row is first in memory."""
        # The second of several passes is timed, because the first one also compiles shaders and
        # uploads buffers: ``on_time`` is called with its seconds and the number of passes.
        with self.context:
            target = self.target(size, options.samples)
            draw = partial(self.renderer.draw, scene, camera, options, target, box)
            count = n_passes(options)
            if on_time is not None and count > 2:
                draw(passes=range(1))
                self.context.finish()
                started = time.perf_counter()
                draw(passes=range(1, 2))
                self.context.finish()
                on_time(time.perf_counter() - started, count)
                for done in range(2, count):
                    report(done, count, "passes")  # Ctrl+C ends the picture here
                    draw(passes=range(done, done + 1))
                    self.context.finish()
            else:
                draw(passes=range(count))
            target.resolve()
            return target.read()

    def release(self) -> None:
        """Free everything, including the context unless it was given."""
        with self.context:
            self._graphics.rest()
            if self._target is not None:
                self._target.release()
            self.renderer.release()
        if self._is_owner:
            self._graphics.release()

    def __enter__(self) -> Offscreen:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class _OfThread:
    """Thread-local Offscreen, freed when the thread ends."""

    def __init__(self) -> None:
        self.offscreen = Offscreen()

    def __del__(self) -> None:
        # At interpreter exit, objects are freed in an undefined order.
        if hasattr(self, "offscreen") and not sys.is_finalizing():
            self.offscreen.release()


def default_camera(scene: Scene, size: tuple[int, int], show: Shown = "skin") -> Camera:
    """Return a camera that frames the whole scene from the front, slightly left and above."""
    return _framing(scene, size, scene_points(scene, show))


def _framing(scene: Scene, size: tuple[int, int], points: Floats) -> Camera:
    """Return the camera of ``default_camera`` for points (N, 3) of the scene."""
    camera = facing_camera(guess_front(scene), scene.up)
    fit(camera, points, size[0] / size[1])
    return camera


def render(
    scene: Scene,
    size: tuple[int, int] = SIZE,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
) -> Bytes:
    """Draw a scene with this thread's context: (H, W, 4) uint8; see ``viewer.render``."""
    with deferred():
        if not hasattr(_thread, "kept"):
            _thread.kept = _OfThread()
        offscreen: Offscreen = _thread.kept.offscreen
        with offscreen.context:
            check_size(offscreen.context, size)  # checked before the camera divides by the height
    options = options or DisplayOptions(quality="normal")
    points = scene_points(scene, options.show)
    camera = camera or _framing(scene, size, points)
    with deferred():
        pixels = offscreen.render(scene, size, camera, options, bounding_box(points))
    return _contiguous(pixels)


def _contiguous(pixels: Bytes) -> Bytes:
    """Put the first row first in memory, in place; other libraries need that."""
    rows = pixels[::-1]  # as they are in memory
    height = len(rows)
    for top in range(0, height // 2, _BAND):
        bottom = min(top + _BAND, height // 2)
        low, high = rows[top:bottom], rows[height - bottom : height - top]
        kept = low[::-1].copy()
        low[:] = high[::-1]
        high[:] = kept
    return rows
