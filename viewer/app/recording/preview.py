"""Preview of a recording: the current view as a frame of the recording."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.recording.state import RecordingState, RecordSettings, recorded_options
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.renderer import Renderer

__all__ = ["Preview", "preview_size"]

_WIDEST, _HIGHEST = 320, 200  # maximum size of the preview, pixels


class Preview:
    """Draws the preview into a texture whenever the preview changes.

    Parameters
    ----------
    programs : Programs
        Programs of the context that is current in every call.
    """

    def __init__(self, programs: Programs) -> None:
        self._programs, self.context = programs, programs.context
        self.target: Target | None = None
        self._renderer: Renderer | None = None
        self._drawn: object = None
        self._old: list[Target] = []

    def draw(self, state: AppState, key: object) -> None:
        """Draw the preview if the Record window is open and the image has changed.

        Parameters
        ----------
        state : AppState
            State with the settings; receives the texture.
        key : object
            Identifies the image of the view.
        """
        recording = state.of(RecordingState)
        settings = recording.settings
        self._release_old()
        if settings is None:
            self._drawn, recording.preview = None, 0
            self._retire()
            self._release_renderer()
            return
        size = preview_size(settings.pixels((state.view_rect[2], state.view_rect[3])))
        wanted = (key, size, settings.look, settings.background, settings.kind, settings.samples)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        recording.preview = self._draw(state, settings, size)

    def _draw(self, state: AppState, settings: RecordSettings, size: tuple[int, int]) -> int:
        """Draw the preview and return the ID of its texture."""
        options = recorded_options(state, settings, 2)
        target = self.target
        if target is None or (target.size, target.asked_samples) != (size, options.samples):
            self._retire()
            self.target = target = Target(self.context, size, options.samples)
        camera = state.camera.copy()
        selected = (state.chosen_actor, state.selected_joint)
        # The view's renderer may still be averaging its own image.
        renderer = self._renderer = self._renderer or Renderer(self._programs)
        renderer.draw(state.scene, camera, options, target, state.box, selected)
        target.resolve()
        return int(target.texture.glo)

    def _retire(self) -> None:
        """Release the target in the next frame: panels of this frame may show its texture."""
        if self.target is not None:
            self._old.append(self.target)
            self.target = None

    def _release_old(self) -> None:
        for target in self._old:
            target.release()
        self._old.clear()

    def release(self) -> None:
        """Release everything, as when the window is closed."""
        self._retire()
        self._release_old()
        self._release_renderer()

    def _release_renderer(self) -> None:
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None


def preview_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return the size of the preview of an image, pixels.

    >>> preview_size((1920, 1080)), preview_size((1000, 2000)), preview_size((16, 4000))
    ((320, 180), (100, 200), (1, 200))
    """
    factor = min(_WIDEST / size[0], _HIGHEST / size[1], 1.0)
    return max(round(factor * size[0]), 1), max(round(factor * size[1]), 1)
