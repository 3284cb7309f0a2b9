"""Opening of the first files in a thread, with a progress window if it takes more than a moment."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar

from viewer.app.core.jobs import ThreadJob
from viewer.phrases import printable
from viewer.progress import Cancelled

if TYPE_CHECKING:
    from viewer.app.native_window import Shell

_PATIENCE = 0.6  # seconds before the window opens; most files take less time to read
_EVERY = 0.05  # seconds between frames
_BAR_WIDTH = 26.0  # width of the progress bar, in font sizes

Found = TypeVar("Found")


class Opening(ThreadJob, Generic[Found]):
    """Thread that opens files; ``act`` returns the result, and ``result`` raises its errors."""

    def __init__(self, title: str, act: Callable[[], Found]) -> None:
        self._found: list[Found] = []
        self._problem: BaseException | None = None
        super().__init__(
            title, lambda: self._found.append(act()), names_steps=False, is_daemon=True
        )

    def fail(self, problem: BaseException) -> None:
        """Keep an error for the caller's thread."""
        self._problem = problem

    def result(self) -> Found:
        """Wait for the end; return the result, or raise the error."""
        while not self.wait(0.1):  # a limited wait, so that signals are handled
            pass
        if self._problem is not None:
            raise self._problem
        if not self._found:
            raise Cancelled
        return self._found[0]


def watch(opening: Opening[Found], scale: float | None = None) -> Shell | None:
    """Wait for the files; if it takes more than a moment, return a window with the progress.

    Raises ``Cancelled`` if the user closed the window or pressed Cancel.
    """
    if opening.wait(_PATIENCE):
        return None
    from viewer.app.native_window import Shell
    from viewer.interrupts import hold

    hold()  # exceptions raised in GLFW's callbacks, such as interrupts, would be lost
    shell = Shell(f"{printable(opening.title, 100)} - viewer", scale)
    try:
        from viewer.app.core.theme import set_theme
        from viewer.app.display import import_glfw
        from viewer.app.preferences.applying import chosen_theme
        from viewer.interrupts import poll

        glfw = import_glfw()
        set_theme(chosen_theme(shell.preferences, shell.appearance))
        while not opening.wait(0.0):
            poll()
            glfw.wait_events_timeout(_EVERY)
            if glfw.window_should_close(shell.handle) or _draw(opening, shell):
                raise Cancelled
    except BaseException:
        opening.cancel()
        shell.release()
        opening.wait(1.0)
        raise
    return shell


def _draw(opening: Opening[Found], shell: Shell) -> bool:
    """Draw one frame, and return whether Cancel was pressed."""
    from imgui_bundle import imgui

    from viewer.app.display import import_glfw

    glfw = import_glfw()
    size = glfw.get_framebuffer_size(shell.handle)
    if min(size) < 1:
        return False
    shell.begin_frame()
    center, half = imgui.get_main_viewport().get_center(), imgui.ImVec2(0.5, 0.5)
    imgui.set_next_window_pos(center, imgui.Cond_.always, half)
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    is_pressed = False
    if imgui.begin("##opening", None, flags)[0]:
        bar = min(_BAR_WIDTH * imgui.get_font_size(), 0.8 * imgui.get_main_viewport().size.x)
        imgui.text_unformatted(f"Opening {printable(opening.title, 60)}")
        imgui.progress_bar(opening.fraction, (bar, 0.0), opening.text)
        is_pressed = imgui.button("Cancel opening") or imgui.is_key_pressed(imgui.Key.escape)
    imgui.end()
    imgui.render()
    shell.context.screen.use()
    shell.context.viewport = (0, 0, *size)
    shell.context.screen.clear(*imgui.get_style_color_vec4(imgui.Col_.title_bg))
    imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
    glfw.swap_buffers(shell.handle)
    return is_pressed
