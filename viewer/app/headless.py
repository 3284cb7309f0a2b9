"""Interface without a window, for screenshots with panels and tests with synthetic input."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack

from imgui_bundle import imgui, implot

from viewer.app.core.state import AppState
from viewer.app.core.theme import add_system_fonts, apply_theme, lacks_letters
from viewer.app.files.files import Files
from viewer.app.frame import Frame
from viewer.app.preferences.preferences import Appearance
from viewer.phrases import in_window
from viewer.rendering.gpu.context import Graphics
from viewer.rendering.gpu.target import Target
from viewer.rigs.arrays import Bytes

_SETTLE_FRAMES = 3  # docking and automatic sizes take two frames to settle


class HeadlessApp:
    """Runs frames of the interface in an EGL context, its own unless ``graphics`` is given."""

    def __init__(
        self,
        state: AppState,
        size: tuple[int, int],
        scale: float = 1.0,
        pixels_per_point: float = 1.0,
        graphics: Graphics | None = None,
    ) -> None:
        self.state, self.size, self.pixels_per_point = state, size, pixels_per_point
        self._graphics = graphics or Graphics()
        self._is_owner = graphics is None
        self.context = self._graphics.context
        self._make_current()
        self._graphics.rest()
        pixels = (round(size[0] * pixels_per_point), round(size[1] * pixels_per_point))
        self.screen = Target(self.context, pixels, 1)
        self._imgui = imgui.create_context()
        self._implot = implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename(None)
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.display_size = imgui.ImVec2(*size)
        io.display_framebuffer_scale = imgui.ImVec2(pixels_per_point, pixels_per_point)
        apply_theme(scale)
        appearance = state.of(Appearance)
        appearance.scale = appearance.screen_scale = scale
        imgui.backends.opengl3_init("#version 330")
        self.frame = Frame(state, self._graphics.programs)
        self._wording = ExitStack()
        self._wording.enter_context(in_window())

    def step(self, frames: int = 1) -> None:
        """Run frames of a sixtieth of a second each; input comes from the queue of ImGui's io."""
        self._make_current()
        for _ in range(frames):
            imgui.get_io().delta_time = 1.0 / 60.0
            imgui.backends.opengl3_new_frame()
            imgui.new_frame()
            self.screen.framebuffer.use()  # drawing and picking need a bound framebuffer
            self.frame.run(self.pixels_per_point)
            # Glyphs that ImGui has requested, which painting would upload otherwise.
            for texture in imgui.get_platform_io().textures:
                if texture.status != imgui.ImTextureStatus.ok:
                    # This function is missing from the stubs of imgui-bundle.
                    imgui.backends.opengl3_update_texture(texture)  # type: ignore[attr-defined,unused-ignore]

    def _make_current(self) -> None:
        """Make this context current, because another one may have been used since."""
        self.context.__enter__()  # type: ignore[no-untyped-call]

    def pixels(self) -> Bytes:
        """Return the interface of the last frame as pixels, (H, W, 4) uint8."""
        self._make_current()
        self.frame.paint(self.screen.framebuffer, self.screen.size)
        return self.screen.read()

    def picture(self, fits: bool = True) -> Bytes:
        """Return the interface (H, W, 4) with the camera fitted; messages do not time out."""
        for note in self.state.messages.notes:
            note.until = math.inf
        self.state.framing.is_fitting = fits
        if lacks_letters(_names(self.state)):
            add_system_fonts()
        self.step(_SETTLE_FRAMES)
        while self.state.of(Files).stream is None and not self.state.framing.is_settled:
            self.step(1)
        self.step(1)
        # Frames in quick succession count as motion, during which slow drivers draw no shadows.
        self.frame.finish_picture()
        pixels = self.pixels()
        pixels[..., 3] = 255
        return pixels

    def release(self) -> None:
        """Release everything, including the context unless it was given."""
        self._wording.close()
        self._make_current()
        self._graphics.rest()
        self.frame.release()  # it has contexts that need those of ImGui
        imgui.backends.opengl3_shutdown()
        implot.destroy_context(self._implot)
        imgui.destroy_context(self._imgui)
        self.screen.release()
        if self._is_owner:
            self._graphics.release()

    def __enter__(self) -> HeadlessApp:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def _names(state: AppState) -> Iterator[str]:
    """Yield names from files that panels may show, and the messages."""
    yield from (note.text for note in state.messages.notes)
    for actor in state.scene.actors:
        figure = actor.figure
        yield actor.name
        yield from () if figure.skeleton is None else figure.skeleton.names
        yield from () if figure.blend_shapes is None else figure.blend_shapes.names
        yield from () if figure.mesh is None else figure.mesh.parts
