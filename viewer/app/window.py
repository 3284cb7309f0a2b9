"""The window: a frame loop that sleeps until something happens."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from viewer.app.display import find_display, import_glfw, window_error
from viewer.app.files.state import Files
from viewer.app.shown_panels import ShownPanels
from viewer.app.weights.state import Weights

glfw = import_glfw()

import moderngl  # noqa: E402  after glfw, whose library imgui-bundle chooses
from imgui_bundle import imgui, implot  # noqa: E402

from viewer.app.core.jobs import FrameJob  # noqa: E402
from viewer.app.core.state import AppState  # noqa: E402
from viewer.app.display_loss import stop_watching  # noqa: E402
from viewer.app.files.recent import (  # noqa: E402
    load_arranged,
    load_closed_panels,
    load_recent,
    remember,
    save_arranged,
    save_closed_panels,
    state_folder,
)
from viewer.app.frame import Frame  # noqa: E402
from viewer.app.layout import Layout  # noqa: E402
from viewer.app.preferences.applying import scale_of, start_with  # noqa: E402
from viewer.app.preferences.state import Appearance, Preferences  # noqa: E402
from viewer.app.preferences.storage import load_preferences  # noqa: E402
from viewer.app.preferences.system_theme import system_theme  # noqa: E402
from viewer.app.theme import add_system_fonts, apply_theme  # noqa: E402
from viewer.app.typed_keys import TypedKeys, end_frame, end_frame_before  # noqa: E402
from viewer.app.view.flight import Flight  # noqa: E402
from viewer.app.view.hovering import Hovered  # noqa: E402
from viewer.app.weights.actions import start_heat_map  # noqa: E402
from viewer.errors import RenderError  # noqa: E402
from viewer.formats import opened_text  # noqa: E402
from viewer.interrupts import hold, poll  # noqa: E402
from viewer.loading import MotionSettings  # noqa: E402
from viewer.loading.capturing import Builder  # noqa: E402
from viewer.phrases import printable  # noqa: E402
from viewer.rendering.camera import Camera, facing_camera  # noqa: E402
from viewer.rendering.gpu.context import explain  # noqa: E402
from viewer.rendering.gpu.program import Programs  # noqa: E402
from viewer.rendering.options import DisplayOptions  # noqa: E402
from viewer.rig.inspection.front import guess_front  # noqa: E402
from viewer.rig.mesh import bounding_box  # noqa: E402
from viewer.rig.scene import Scene, scene_points  # noqa: E402

__all__ = ["Rest", "awaits_tooltip", "probe", "show"]

_SIZE = (1280, 800)
_SETTLE_FRAMES = 3  # frames drawn after an event: ImGui's layout needs two frames
_FIRST_FRAMES = 3  # frames after which fonts for additional scripts are loaded
_IDLE_SECONDS = 0.5  # interval between checks for messages that time out, seconds
_BUSY_SECONDS = 0.05  # interval between frames while a file is being read, seconds


def show(
    scene: Scene,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
    paths: Sequence[str | Path] = (),
    scale: float | None = None,
    fit_distance: bool = True,
    builders: Sequence[Builder] = (),
    plays: bool = False,
    motion: MotionSettings | None = None,
) -> None:
    """Open a window and return when it is closed.

    Parameters
    ----------
    scene : Scene
        Scene to show; the user's edits change its poses.
    camera : Camera, optional
        Initial camera; fitted to the scene if omitted.
    options : DisplayOptions, optional
        Initial display settings.
    paths : sequence of str or Path
        Files of the scene, for the title and the list of recent files.
    scale : float, optional
        Scale of the interface; the scale of the screen if omitted.
    fit_distance : bool
        Whether the camera is kept fitted to the scene until the user moves it.
    builders : sequence of Builder
        Captures of the scene that have not been read completely yet.
    plays : bool
        Whether motions play from the start.
    motion : MotionSettings, optional
        Settings with which the scene's motions were read.

    Raises
    ------
    NoDisplay
        If there is no display.
    RenderError
        If there is no usable OpenGL.
    """
    find_display()
    preferences = load_preferences()
    options = options or DisplayOptions(samples=preferences.samples, quality=preferences.quality)
    points = scene_points(scene, options.show)
    camera = camera or facing_camera(guess_front(scene), scene.up)
    files = tuple(map(Path, paths))
    hold()  # exceptions raised in GLFW's callbacks, such as interrupts, would be lost
    state = AppState(scene, camera, options, bounding_box(points), files)
    state.motion_settings = motion
    if motion is not None and motion.frame_rate is not None:
        state.clock.count_by(motion.frame_rate)
    state.framing.is_fitting = fit_distance
    if options.shading == "scalar":
        start_heat_map(state)
    opened = state.of(Files)
    opened.recent = load_recent()
    state.of(ShownPanels).closed = load_closed_panels()
    start_with(state, preferences)
    state.of(Layout).is_arranged = load_arranged()
    state.say(*filter(None, [remember(opened.recent, files)]))
    state.clock.playing = plays and state.clock.has_motion
    window = _Window(state, scale)
    try:
        window.frame.stream(builders)
        window.run()
    finally:
        window.release()


def probe() -> str:
    """Open a hidden window and return its renderer and OpenGL version; raises as ``show``."""
    find_display()
    handle = _create_window("viewer", is_visible=False)
    try:
        glfw.make_context_current(handle)
        context = _context()
        found = f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"
        context.release()
        return found
    finally:
        glfw.destroy_window(handle)
        stop_watching()


class _Window:
    """One GLFW window with its OpenGL and ImGui contexts, and its frame loop."""

    def __init__(self, state: AppState, scale: float | None) -> None:
        self.state = state
        self.handle = _create_window(_title(state), scale=scale or state.of(Preferences).scale)
        try:
            glfw.make_context_current(self.handle)
            glfw.swap_interval(1)
            self.context = _context()
        except BaseException:
            glfw.destroy_window(self.handle)
            stop_watching()
            raise
        self._dropped: list[Path] = []
        self._is_dirty = True
        self._n_drawn = 0
        self._title = ""
        self._typed_keys = TypedKeys()
        self._set_callbacks()
        self._imgui: Any = imgui.create_context()
        self._implot: Any = implot.create_context()
        self._set_up_imgui(scale)
        self.frame = Frame(state, Programs(self.context), glfw.post_empty_event, keeps_recent=True)

    def _set_callbacks(self) -> None:
        """Set callbacks that only record events for the loop, so that none of them can raise."""
        glfw.set_drop_callback(self.handle, self._on_drop)
        glfw.set_framebuffer_size_callback(self.handle, self._on_change)
        glfw.set_window_refresh_callback(self.handle, self._on_change)

    def _on_drop(self, _: Any, names: Sequence[str]) -> None:
        self._dropped += map(Path, names)

    def _on_key(self, _: Any, key: int, code: int, action: int, modifiers: int) -> None:
        is_typing = imgui.get_io().want_text_input
        if self._typed_keys.passes(key, action, modifiers, is_typing):
            end_frame_before(self._imgui.input_events_queue, key, action)
            imgui.backends.glfw_key_callback(self._address, key, code, action, modifiers)

    def _on_button(self, _: Any, button: int, action: int, modifiers: int) -> None:
        end_frame(self._imgui.input_events_queue)
        imgui.backends.glfw_mouse_button_callback(self._address, button, action, modifiers)

    def _on_change(self, *_: Any) -> None:
        self._is_dirty = True

    def _set_up_imgui(self, scale: float | None) -> None:
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        folder = state_folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            io.set_ini_filename(str(folder / "layout.ini"))
        except OSError as problem:
            io.set_ini_filename(None)
            self.state.say(f"the layout cannot be saved: {problem.strerror}")
        appearance, preferences = self.state.of(Appearance), self.state.of(Preferences)
        appearance.given_scale, appearance.screen_scale = scale, self._screen_scale()
        if preferences.theme == "system":
            appearance.system_theme = system_theme()
        appearance.scale = scale_of(self.state)
        apply_theme(appearance.scale)
        self._address = ctypes.cast(self.handle, ctypes.c_void_p).value or 0
        imgui.backends.glfw_init_for_opengl(self._address, True)
        # These replace callbacks of ImGui.
        glfw.set_key_callback(self.handle, self._on_key)
        glfw.set_mouse_button_callback(self.handle, self._on_button)
        imgui.backends.opengl3_init("#version 330")

    def _screen_scale(self) -> float:
        """Return the scale of the interface for the screen, in window coordinates."""
        content = glfw.get_window_content_scale(self.handle)[0] or 1.0
        return max(content / self._pixels_per_point(), 0.5)

    def _pixels_per_point(self) -> float:
        width = glfw.get_window_size(self.handle)[0]
        pixels = glfw.get_framebuffer_size(self.handle)[0]
        return pixels / width if width and pixels else 1.0

    def run(self) -> None:
        """Draw frames until the window is closed; sleep while nothing happens."""
        rest = Rest()
        while not glfw.window_should_close(self.handle):
            poll()
            happened = self._wait(rest.left > 0)
            rest.count(happened, self._awaits())
            if self._dropped:
                self.frame.open(self._dropped)
                self._dropped = []
            if rest.left < 0 or not self._draw():
                continue
            if "quit" in self.state.wants:
                glfw.set_window_should_close(self.handle, True)

    def _wait(self, is_settling: bool) -> bool:
        """Process events; wait for one unless frames are left to draw.

        Returns whether there was an event. ImGui spreads quick events over several frames, so
        events left in its queue also count.
        """
        self._is_dirty = False
        state = self.state
        # Threads are polled at intervals only, because drawing frames would slow them down.
        steps = isinstance(state.job, FrameJob) or state.of(Flight).is_active
        # An unfinished image is refined in every frame.
        improves = self.frame.pace.is_unfinished
        if is_settling or state.clock.playing or steps or improves:
            glfw.poll_events()
        else:
            moves = self._awaits() or state.job is not None
            glfw.wait_events_timeout(_BUSY_SECONDS if moves else _IDLE_SECONDS)
            # Redraw for messages that time out, progress bars and blinking text cursors.
            self._is_dirty |= moves or bool(state.messages.notes or imgui.get_io().want_text_input)
        self._is_dirty |= state.clock.playing or state.job is not None or steps or improves
        return self._is_dirty or bool(self._dropped) or len(self._imgui.input_events_queue) > 0

    def _awaits(self) -> bool:
        """Return whether a change is expected without an event: of files, extent or hover text."""
        state = self.state
        files = state.of(Files)
        is_read = files.loader is not None or files.stream is not None
        is_read |= not state.framing.is_settled
        is_waiting = state.of(Weights).is_waiting or state.of(Hovered).is_waiting
        return is_read or is_waiting or awaits_tooltip(self._imgui)

    def _draw(self) -> bool:
        """Draw one frame; return False if the window currently has no pixels."""
        size = glfw.get_framebuffer_size(self.handle)
        if min(size) < 1:
            return False
        self._set_title()
        self._n_drawn += 1
        if self._n_drawn == _FIRST_FRAMES:
            add_system_fonts()
        self.state.of(Appearance).screen_scale = self._screen_scale()
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        self.frame.draw(self.context.screen, size, self._pixels_per_point())
        glfw.swap_buffers(self.handle)
        return True

    def _set_title(self) -> None:
        title = _title(self.state)
        if title != self._title:
            glfw.set_window_title(self.handle, title)
            self._title = title

    def release(self) -> None:
        """Save the layout, close the window, and release everything."""
        save_closed_panels(self.state.of(ShownPanels).closed)
        save_arranged(self.state.of(Layout).is_arranged)
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        implot.destroy_context(self._implot)
        imgui.destroy_context(self._imgui)
        self.frame.release()
        self.context.release()
        glfw.destroy_window(self.handle)
        stop_watching()


class Rest:
    """Counts the frames that remain to be drawn until the interface has settled."""

    def __init__(self) -> None:
        self.left = _SETTLE_FRAMES
        self._awaited = False

    def count(self, happened: bool, awaits: bool) -> None:
        """Advance to the next frame, which is drawn if ``left`` is not negative.

        An expected change may happen in the last frame after the panels were drawn, so its
        completion counts as an event. A tooltip's window also needs some frames to get its size.

        Parameters
        ----------
        happened : bool
            Whether there was an event, or something is moving.
        awaits : bool
            Whether a change is expected without an event.
        """
        is_over = self._awaited and not awaits
        self._awaited = awaits
        self.left = _SETTLE_FRAMES if happened or is_over else self.left - 1


def awaits_tooltip(context: Any) -> bool:
    """Return whether the mouse is over an item whose delayed tooltip has not appeared yet."""
    delay = imgui.get_style().hover_delay_normal
    return context.hover_item_delay_id != 0 and context.hover_item_delay_timer < delay


def _title(state: AppState) -> str:
    names = [opened_text(path) for path in state.paths] or [state.scene.title]
    return f"{printable(' + '.join(names), 100)} - viewer"


def _create_window(title: str, is_visible: bool = True, scale: float = 0.0) -> Any:
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


def _context() -> moderngl.Context:
    try:
        return moderngl.create_context(require=330)
    except Exception as problem:  # glcontext raises bare Exception
        raise RenderError(explain(str(problem))) from None
