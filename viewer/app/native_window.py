"""The native window: GLFW, its OpenGL context, ImGui, and the events that reach it.

ImGui spreads the press and release of a key over two frames, so that no press is lost, and delays
all later input. On a slow machine, typed text would appear at one or two characters per frame.
Characters arrive as separate events, so a text field needs no key events for letters and digits:
``TypedKeys`` leaves them out. Keys with an effect, such as Enter, Backspace and Ctrl+A, and the
mouse stay in the queue, so that a press and release within one frame still works.

ImGui sees modifiers at the end of a frame's events. If the modifier of a shortcut is released in
the frame in which its key was pressed, as happens on a slow machine, the shortcut would be lost:
``end_frame_before`` puts the earlier events into a frame of their own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence, Sized
from pathlib import Path
from typing import Any

import moderngl
from imgui_bundle import imgui, implot

from viewer.app.core.theme import apply_theme
from viewer.app.display import (
    import_glfw,
    stop_watching,
    window_error,
)
from viewer.app.files.recent import load_layout, save_layout
from viewer.app.preferences.applying import (
    chosen_scale,
    system_theme,
)
from viewer.app.preferences.preferences import Appearance, load_preferences
from viewer.errors import RenderError
from viewer.rendering.gpu.context import explain_failure

glfw = import_glfw()
_SIZE = (1280, 800)
_PRINTABLE = range(32, 163)  # GLFW's keys from Space to World 2
_KEYPAD = (*range(320, 335), 336)  # digits and operators, without Enter
_RELEASE, _PRESS = 0, 1
_CTRL, _ALT, _SUPER = 0x2, 0x4, 0x8
_MODIFIERS = range(340, 348)  # GLFW's keys from left Shift to right Super

# No keyboard has this key. ImGui ends a frame's events at the second event of the same key.
_SEPARATOR = imgui.Key.gamepad_back


class Shell:
    """Window that shows the progress of opening files, and then the files.

    ``scale``: of the interface; the preferred one, or that of the monitor, if omitted. Raises
    ``RenderError`` without usable OpenGL.
    """

    def __init__(self, title: str, scale: float | None = None) -> None:
        self.problems: list[str] = []
        self.preferences = load_preferences(self.problems.append)
        self.appearance = Appearance()
        self.handle = create_window(title, scale=scale or self.preferences.scale)
        try:
            glfw.make_context_current(self.handle)
            glfw.swap_interval(1)
            self.context = create_context()
        except BaseException:
            glfw.destroy_window(self.handle)
            stop_watching()
            raise
        self.dropped: list[Path] = []
        self.is_dirty = True
        self._title = title
        self._saves_layout = True
        self._typed_keys = TypedKeys()
        # These callbacks only record events for the loop, so none of them can raise.
        glfw.set_drop_callback(self.handle, self._on_drop)
        glfw.set_framebuffer_size_callback(self.handle, self._on_change)
        glfw.set_window_refresh_callback(self.handle, self._on_change)
        self.imgui = imgui.create_context()
        self.implot = implot.create_context()
        self._set_up_imgui(scale)

    def _on_drop(self, _: object, names: Sequence[str]) -> None:
        self.dropped += map(Path, names)

    def _on_key(self, _: object, key: int, code: int, action: int, modifiers: int) -> None:
        is_typing = imgui.get_io().want_text_input
        if self._typed_keys.passes(key, action, modifiers, is_typing):
            end_frame_before(self.imgui.input_events_queue, key, action)
            imgui.backends.glfw_key_callback(self._address, key, code, action, modifiers)

    def _on_button(self, _: object, button: int, action: int, modifiers: int) -> None:
        end_frame(self.imgui.input_events_queue)
        imgui.backends.glfw_mouse_button_callback(self._address, button, action, modifiers)

    def _on_change(self, *_: object) -> None:
        self.is_dirty = True

    def _set_up_imgui(self, scale: float | None) -> None:
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        # ImGui would write the file in place, and load whatever is in it.
        io.set_ini_filename(None)
        layout = load_layout(self.problems.append)
        self.has_layout = bool(layout)
        imgui.load_ini_settings_from_memory(layout)
        appearance, preferences = self.appearance, self.preferences
        appearance.given_scale, appearance.screen_scale = scale, self.screen_scale()
        if preferences.theme == "system":
            appearance.system_theme = system_theme()
        appearance.scale = chosen_scale(preferences, appearance)
        apply_theme(appearance.scale)
        self._address = ctypes.cast(self.handle, ctypes.c_void_p).value or 0
        imgui.backends.glfw_init_for_opengl(self._address, True)
        # These replace callbacks of ImGui.
        glfw.set_key_callback(self.handle, self._on_key)
        glfw.set_mouse_button_callback(self.handle, self._on_button)
        imgui.backends.opengl3_init("#version 330")

    def screen_scale(self) -> float:
        """Return the scale of the interface for the screen, in window coordinates."""
        content = glfw.get_window_content_scale(self.handle)[0] or 1.0
        return max(content / self.pixels_per_point(), 0.5)

    def pixels_per_point(self) -> float:
        """Return the number of pixels per window coordinate."""
        width = glfw.get_window_size(self.handle)[0]
        pixels = glfw.get_framebuffer_size(self.handle)[0]
        return pixels / width if width and pixels else 1.0

    def begin_frame(self) -> None:
        """Begin a frame of ImGui."""
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()

    def save_layout(self) -> str:
        """Store the layout of the panels; return the reason if that fails for the first time."""
        imgui.get_io().want_save_ini_settings = False
        if not self._saves_layout:
            return ""
        why = save_layout(imgui.save_ini_settings_to_memory())
        self._saves_layout = not why
        return f"the layout cannot be saved: {why}" if why else ""

    def set_title(self, title: str) -> None:
        """Set the title of the window if it has changed."""
        if title != self._title:
            glfw.set_window_title(self.handle, title)
            self._title = title

    def release(self) -> None:
        """Close the window and release everything."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        implot.destroy_context(self.implot)
        imgui.destroy_context(self.imgui)
        self.context.release()
        glfw.destroy_window(self.handle)
        stop_watching()


class TypedKeys:
    """Decides which key events are passed to ImGui; called for every event."""

    def __init__(self) -> None:
        self._left_out: set[int] = set()

    def passes(self, key: int, action: int, modifiers: int, is_typing: bool) -> bool:
        """Return whether a key event is passed to ImGui."""
        if action == _RELEASE:
            # A key that was pressed before the field became active must be released.
            is_known = key not in self._left_out
            self._left_out.discard(key)
            return is_known
        has_effect = bool(modifiers & (_CTRL | _ALT | _SUPER))
        if not is_typing or has_effect or not (key in _PRINTABLE or key in _KEYPAD):
            return True
        if action == _PRESS:
            self._left_out.add(key)
        return False


def create_window(title: str, is_visible: bool = True, scale: float = 0.0) -> Any:
    """Create a window, larger for a larger scale of the interface; 0 for the monitor's scale."""
    glfw.default_window_hints()
    glfw.window_hint(glfw.VISIBLE, is_visible)
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    glfw.window_hint(glfw.SAMPLES, 0)  # the scene has its own multisampled framebuffer
    glfw.window_hint(glfw.SCALE_TO_MONITOR, not scale)
    glfw.window_hint_string(glfw.X11_CLASS_NAME, "viewer")
    handle = glfw.create_window(*_window_size(scale or 1.0), title, None, None)
    if not handle:
        code, text = glfw.get_error()
        message = text.decode() if isinstance(text, bytes) else text or f"GLFW error {code}"
        raise window_error(message)
    glfw.set_window_size_limits(handle, 320, 240, glfw.DONT_CARE, glfw.DONT_CARE)
    return handle


def _window_size(scale: float) -> tuple[int, int]:
    """Return the size of a new window, in window coordinates, limited to the monitor."""
    width, height = (round(side * scale) for side in _SIZE)
    monitor = glfw.get_primary_monitor()
    if not monitor or scale == 1.0:
        return width, height
    _, _, widest, highest = glfw.get_monitor_workarea(monitor)
    return min(width, max(widest, _SIZE[0])), min(height, max(highest, _SIZE[1]))


def create_context() -> moderngl.Context:
    """Return an OpenGL context for the current window; raises RenderError."""
    try:
        return moderngl.create_context(require=330)
    except Exception as problem:  # glcontext raises bare Exception
        raise RenderError(explain_failure(str(problem))) from None


def end_frame_before(queue: Sized, key: int, action: int) -> None:
    """Put the events before a modifier's release into a separate frame."""
    if action == _RELEASE and key in _MODIFIERS:
        end_frame(queue)


def end_frame(queue: Sized) -> None:
    """Make ImGui process the queued events, if any, in a frame before later ones."""
    # Tabs and other widgets that may overlap react to a press only if they were hovered in an
    # earlier frame, and the last motion of a drag counts only before its release.
    if len(queue):
        for is_down in (True, False):
            imgui.get_io().add_key_event(_SEPARATOR, is_down)
