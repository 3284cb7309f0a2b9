"""When the view is drawn: the key of its image, passes of still scenes, quality of moving ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation, Marks
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rendering.sampling import n_passes

_FADE = 0.2  # seconds in which shadows appear or vanish
_RESTS = 0.25  # seconds without a change after which the scene counts as still
_SLOW = 1.0 / 24.0  # frame time in seconds above which a moving scene is drawn in draft quality
_LONGEST = 0.1  # maximum time step for fading, seconds


@dataclass(frozen=True, slots=True)
class Step:
    """Drawing step: options, passes of final quality, and strength of shadows, 0 to 1."""

    options: DisplayOptions
    passes: range
    strength: float


class Pace:
    """Redraws the image when it changes, and refines it while it stays the same."""

    def __init__(self) -> None:
        self._key: object = None
        self._changed = self._now = float("-inf")
        self._is_moving = False
        self._done = 0  # completed passes of the image that is shown
        # If a frame with shadows takes too long, shadows fade out during movement and in again
        # afterwards, so that the brightness never jumps.
        self._strength = 1.0
        self._cost = 0.0  # frame time with shadows, once measured
        self.is_unfinished = False

    def step(self, key: object, options: DisplayOptions, now: float) -> Step | None:
        """Return the drawing step at a time in seconds; None if the image is finished."""
        is_changed = key != self._key
        faded = self._fade(is_changed, options, now)
        self._key = key
        total = n_passes(options)
        if self._strength == 0.0:
            options, total = replace(options, quality="draft"), 1
        if is_changed or faded:
            self._done = 0
        self.is_unfinished = options.quality != "draft" and self._done + 1 < total
        self.is_unfinished |= self._strength < 1.0
        if self._done >= total:
            return None
        # While shadows fade, only the first pass is redrawn.
        index = self._done
        self._done = total if self._strength < 1.0 else index + 1
        return Step(options, range(index, index + 1), self._strength)

    def _fade(self, is_changed: bool, options: DisplayOptions, now: float) -> bool:
        """Move the strength of shadows towards its target; return whether it changed."""
        change = min(now - self._now, _LONGEST) / _FADE
        is_first, before, self._now = self._key is None, self._strength, now
        # A slow frame between two changes does not count as a pause.
        is_rest = now - self._changed >= _RESTS + 2.0 * self._cost
        if is_changed:
            self._is_moving, self._changed = not is_rest, now
        elif is_rest:
            self._is_moving = False
        wanted = 0.0 if self._is_moving and self._cost > _SLOW else 1.0
        if is_first or options.quality == "draft":
            self._strength = 1.0
        else:
            self._strength = min(max(wanted, before - change), before + change)
        return self._strength != before

    def restart(self) -> None:
        """Draw the next frame again, although nothing has changed."""
        self._done = 0

    def measured(self, step: Step, seconds: float) -> None:
        """Record how long a step took to draw."""
        if step.options.quality != "draft":
            self._cost = seconds


def picture_key(
    state: AppState,
    size: tuple[int, int],
    marks: Marks | None = None,
    ghost: Ghost | None = None,
    annotations: Sequence[Annotation] = (),
) -> tuple[object, ...]:
    """Return all that the image depends on; items drawn over it are compared by identity."""
    camera, version = state.camera, state.version
    place = (camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination)
    lens = (camera.fov, camera.orthographic, camera.up, id(camera.fixed))
    # Motion paths show the motion around the current time, and cameras show their current images.
    shows_images = camera.fixed is not None or version.options.cameras
    time = state.scene.time if version.options.path_joints or shows_images else None
    selected = (state.chosen_actor, state.selected_joint)
    ground = state.box.tobytes()
    return (size, place, lens, ground, version, time, selected, marks, ghost, *annotations)
