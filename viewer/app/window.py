"""The window: a frame loop that sleeps until something happens."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.app.display import find_display, import_glfw
from viewer.app.files.files import Files, open_files, stream_captures
from viewer.app.layout import ShownPanels
from viewer.app.weights.weights_panel import Weights

glfw = import_glfw()

from imgui_bundle import imgui  # noqa: E402  after glfw, whose library imgui-bundle chooses

from viewer.app.closing import (  # noqa: E402
    Closing,
    request_quit,
)
from viewer.app.core.jobs import FrameJob  # noqa: E402
from viewer.app.core.state import AppState  # noqa: E402
from viewer.app.core.theme import add_system_fonts  # noqa: E402
from viewer.app.display import stop_watching  # noqa: E402
from viewer.app.files.recent import (  # noqa: E402
    load_arranged,
    load_closed_panels,
    load_recent,
    remember,
    save_arranged,
    save_closed_panels,
)
from viewer.app.frame import Frame  # noqa: E402
from viewer.app.layout import Layout  # noqa: E402
from viewer.app.live import Live, advance_live  # noqa: E402
from viewer.app.native_window import Shell, create_context, create_window  # noqa: E402
from viewer.app.posing.posing import Posing  # noqa: E402
from viewer.app.preferences.applying import start_with  # noqa: E402
from viewer.app.preferences.preferences import load_preferences  # noqa: E402
from viewer.app.view.flight import Flight  # noqa: E402
from viewer.app.view.hovering import Hovered  # noqa: E402
from viewer.app.weights.weights_panel import start_heat_map  # noqa: E402
from viewer.formats import opened_text  # noqa: E402
from viewer.interrupts import hold, poll  # noqa: E402
from viewer.loading import MotionSettings  # noqa: E402
from viewer.loading.capturing import Builder  # noqa: E402
from viewer.phrases import in_window, printable  # noqa: E402
from viewer.rendering.camera import Camera, facing_camera  # noqa: E402
from viewer.rendering.gpu.program import Programs  # noqa: E402
from viewer.rendering.options import DisplayOptions  # noqa: E402
from viewer.rigs.inspection.front import guess_front  # noqa: E402
from viewer.rigs.mesh import bounding_box  # noqa: E402
from viewer.rigs.scene import Scene, scene_points  # noqa: E402

_SETTLE_FRAMES = 3  # frames drawn after an event: ImGui's layout needs two frames
_FIRST_FRAMES = 3  # frames after which fonts for additional scripts are loaded
_IDLE_SECONDS = 0.5  # interval between checks for messages that time out, seconds
_BUSY_SECONDS = 0.05  # interval between frames while a file is being read, seconds


@in_window()
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
    shell: Shell | None = None,
    messages: Sequence[str] = (),
    live: Live | None = None,
) -> None:
    """Open a window and return when it is closed; RenderError without usable OpenGL.

    ``camera`` fits the scene if omitted, and keeps fitting it if ``fit_distance``. ``paths``: files
    of the scene, for the title and the recent files. ``builders``: its captures that are still
    being read. ``motion``: settings with which its motions were read. ``scale`` of the interface:
    that of the screen if omitted. ``shell``: a window that is already open, closed at the end.
    ``live``: what other programs may change.
    """
    if shell is None:
        find_display()
    problems = [*messages]
    preferences = load_preferences(problems.append) if shell is None else shell.preferences
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
    opened.recent, opened.keeps_recent = load_recent(problems.append), True
    opened.wake = glfw.post_empty_event
    if live is not None:
        state.put(live).wake_by(glfw.post_empty_event)
    state.of(ShownPanels).closed = load_closed_panels(problems.append)
    start_with(state, preferences)
    is_arranged = load_arranged(problems.append)
    state.say(*problems, *filter(None, [remember(opened.recent, files)]))
    state.clock.playing = plays and state.clock.has_motion
    shell = shell or Shell(_title(state), scale)
    state.put(shell.appearance)
    state.of(Layout).is_arranged = is_arranged and shell.has_layout
    window = _Window(state, shell)
    try:
        stream_captures(state, builders)
        window.run()
    finally:
        state.of(Live).wake_by(lambda: None)  # GLFW ends before threads of other programs do
        window.release()


def probe() -> str:
    """Open a hidden window and return its renderer and OpenGL version; raises as ``show``."""
    find_display()
    handle = create_window("viewer", is_visible=False)
    try:
        glfw.make_context_current(handle)
        context = create_context()
        found = f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"
        context.release()
        return found
    finally:
        glfw.destroy_window(handle)
        stop_watching()


class _Window:
    """The frame loop of one window."""

    def __init__(self, state: AppState, shell: Shell) -> None:
        self.state, self.shell, self.handle = state, shell, shell.handle
        self._n_drawn = 0
        state.say(*shell.problems)
        self.frame = Frame(state, Programs(shell.context))

    def run(self) -> None:
        """Draw frames until the window is closed; sleep while nothing happens."""
        rest = Rest()
        while not self.state.of(Closing).is_over:
            poll()
            happened = self._wait(rest.left > 0) | self._is_asked_to_close()
            rest.count(happened, self._awaits())
            if self.shell.dropped:
                open_files(self.state, self.shell.dropped)
                self.shell.dropped = []
            if rest.left >= 0:
                self._draw()

    def _is_asked_to_close(self) -> bool:
        """Pass on a click of the close button; return whether there was one."""
        if not glfw.window_should_close(self.handle):
            return False
        glfw.set_window_should_close(self.handle, False)
        request_quit(self.state)
        if glfw.get_window_attrib(self.handle, glfw.ICONIFIED):
            glfw.restore_window(self.handle)  # a question must be seen
        return True

    def _wait(self, is_settling: bool) -> bool:
        """Process events, waiting for one if no frames are left; return whether there was one."""
        shell, state = self.shell, self.state
        shell.is_dirty = False
        # Threads are polled at intervals only, because drawing frames would slow them down.
        steps = isinstance(state.job, FrameJob) or state.of(Flight).is_active
        drag = state.of(Posing).drag
        steps |= drag is not None and drag.goes_on
        # An unfinished image is refined in every frame.
        improves = self.frame.pace.is_unfinished
        if is_settling or state.clock.playing or steps or improves:
            glfw.poll_events()
        else:
            moves = self._awaits() or state.job is not None
            glfw.wait_events_timeout(_BUSY_SECONDS if moves else _IDLE_SECONDS)
            # Redraw for messages that time out, progress bars and blinking text cursors.
            shell.is_dirty |= moves or bool(state.messages.notes or imgui.get_io().want_text_input)
        shell.is_dirty |= state.clock.playing or state.job is not None or steps or improves
        shell.is_dirty |= state.of(Live).has_news
        # ImGui spreads quick events over several frames, so those left in its queue also count.
        return shell.is_dirty or bool(shell.dropped) or len(shell.imgui.input_events_queue) > 0

    def _awaits(self) -> bool:
        """Return whether a change is expected without an event: of files, extent or hover text."""
        state = self.state
        files = state.of(Files)
        loader = files.loader
        # Files that have been read may wait for an answer of the user.
        is_read = (loader is not None and not loader.is_done) or files.stream is not None
        is_read |= not state.framing.is_settled
        is_waiting = state.of(Weights).is_waiting or state.of(Hovered).is_waiting
        return is_read or is_waiting or awaits_tooltip(self.shell.imgui)

    def _draw(self) -> None:
        """Draw one frame unless the window currently has no pixels."""
        size = glfw.get_framebuffer_size(self.handle)
        if min(size) < 1:
            advance_live(self.state)  # programs do not wait until the window is restored
            return
        shell = self.shell
        shell.set_title(_title(self.state))
        self._n_drawn += 1
        if self._n_drawn == _FIRST_FRAMES:
            add_system_fonts()
        shell.appearance.screen_scale = shell.screen_scale()
        shell.begin_frame()
        self.frame.draw(shell.context.screen, size, shell.pixels_per_point())
        glfw.swap_buffers(self.handle)
        if imgui.get_io().want_save_ini_settings:
            self.state.say(*filter(None, [shell.save_layout()]))

    def release(self) -> None:
        """Save the layout, close the window, and release everything."""
        save_closed_panels(self.state.of(ShownPanels).closed)
        save_arranged(self.state.of(Layout).is_arranged)
        self.shell.save_layout()
        self.frame.release()
        self.shell.release()


class Rest:
    """Counts the frames that remain to be drawn until the interface has settled."""

    def __init__(self) -> None:
        self.left = _SETTLE_FRAMES
        self._awaited = False

    def count(self, happened: bool, awaits: bool) -> None:
        """Advance to the next frame, which is drawn if ``left`` is not negative."""
        # A change without an event, as of a job, may be complete only after the last frame's
        # panels were drawn, so its end counts as an event. Tooltips need frames to get their size.
        is_over = self._awaited and not awaits
        self._awaited = awaits
        self.left = _SETTLE_FRAMES if happened or is_over else self.left - 1


def awaits_tooltip(context: imgui.internal.Context) -> bool:
    """Return whether the mouse is over an item whose delayed tooltip has not appeared yet."""
    delay = imgui.get_style().hover_delay_normal
    return context.hover_item_delay_id != 0 and context.hover_item_delay_timer < delay


def _title(state: AppState) -> str:
    names = [opened_text(path) for path in state.paths] or [state.scene.title]
    return f"{printable(' + '.join(names), 100)} - viewer"
