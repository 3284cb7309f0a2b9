"""Frames of the window or of a headless run: interface, input, jobs and scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import moderngl
from imgui_bundle import imgui

from viewer.app.actors.following import follow_actor, stop_following
from viewer.app.closing import (
    Closing,
    advance_closing,
    draw_question,
    may_replace_scene,
    request_quit,
)
from viewer.app.context_menu import answer_right_click, draw_context_menu
from viewer.app.core.camera_moves import keep_fitting
from viewer.app.core.edited_animations import Animations, keep_edited
from viewer.app.core.saved_work import SavedPose, SavedWork
from viewer.app.core.state import AppState
from viewer.app.files.file_choice import PICTURES, FileDialog, folder_of
from viewer.app.files.file_dialog import draw_file_dialog
from viewer.app.files.files import Files, Loader, Stream
from viewer.app.files.recent import remember
from viewer.app.interface import draw_interface
from viewer.app.keys import handle_keys
from viewer.app.linting.marks import show_finding
from viewer.app.mouse import drop_motion_before_press, handle_mouse, is_held, stops_time
from viewer.app.overlays import draw_hints
from viewer.app.pace import Pace, PictureKeys, Step
from viewer.app.palette import draw_palette
from viewer.app.posing.gizmo import draw_gizmo
from viewer.app.posing.shape_panel import drop_unreadable_shapes
from viewer.app.preferences.applying import follow_preferences
from viewer.app.preferences.preferences import Preferences
from viewer.app.recording.record_dialog import Preview, draw_record_dialog
from viewer.app.recording.recording_steps import start_recording
from viewer.app.rigging.tools import draw_rig_tools, show_rig
from viewer.app.view.axis_gizmo import draw_axis_gizmo
from viewer.app.view.flight import advance_flight
from viewer.app.view.hovering import draw_hovered_name, hover_joint
from viewer.app.view.outlines import OutlineLayer
from viewer.app.view.picks import answer_picks
from viewer.app.weights.vertex_panel import draw_hovered, pinned_annotations
from viewer.errors import RenderError, ViewerError
from viewer.formats import FORMATS, free_path, save_image
from viewer.loading import Contents, MotionSettings, bundled_body, bundled_files
from viewer.loading.additions import add_to_actor
from viewer.loading.capturing import Builder
from viewer.phrases import printable
from viewer.rendering.gpu.context import is_software
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.renderer import Renderer
from viewer.rendering.sampling import n_passes
from viewer.rig.arrays import Bytes
from viewer.rig.pose import pose_key
from viewer.rig.scene import Actor, Scene

_ADDED = {*FORMATS["pose"].suffixes, *PICTURES}
"""Suffixes of poses and textures, which are applied to the open figure."""
_LAID_OUT = 2  # first frame in which the panels leave room for the view, counted from 1


class Frame:
    """Runs and draws frames of one state in one context; the caller begins ImGui's frame.

    ``wake``: called from other threads when a frame must be drawn.
    """

    def __init__(
        self,
        state: AppState,
        programs: Programs,
        wake: Callable[[], None] = lambda: None,
        keeps_recent: bool = False,
    ) -> None:
        self.state, self.context, self.wake = state, programs.context, wake
        self.keeps_recent = keeps_recent
        self.renderer = Renderer(programs)
        self.target: Target | None = None
        self._preview = Preview(programs)
        self.outlines = OutlineLayer(self.context)
        self._drawn: object = None
        self._n_frames = 0
        self._keys, self.pace = PictureKeys(), Pace()
        self._is_software = is_software(self.context)
        state.stats.renderer = self.context.info["GL_RENDERER"]
        state.stats.version = self.context.info["GL_VERSION"]

    def draw(self, framebuffer: moderngl.Framebuffer, size: tuple[int, int], scale: float) -> None:
        """Run one frame between ``imgui.new_frame`` and the swap of buffers, and paint it.

        ``size``: width and height of the framebuffer, pixels.
        """
        started = time.perf_counter()
        self.run(scale)
        self.paint(framebuffer, size)
        self.state.stats.frame_ms = 1e3 * (time.perf_counter() - started)

    def run(self, scale: float) -> None:
        """Run a frame without painting the panels."""
        state = self.state
        self._n_frames += 1
        drop_motion_before_press()
        follow_preferences(state)
        if not stops_time(state):
            state.clock.advance(imgui.get_io().delta_time)
        drop_unreadable_shapes(state)
        self.open(draw_interface(state))
        draw_record_dialog(state)
        draw_context_menu(state)
        draw_palette(state)
        draw_file_dialog(state)
        draw_question(state)
        files = state.of(Files)
        self.open(files.wants_open)
        files.wants_open = []
        handle_keys(state)
        handle_mouse(state)
        advance_flight(state, imgui.get_io().delta_time)
        state.limit_camera()
        self._do_wanted()
        self._take_loaded()
        if _advance_job(state):
            state.of(Closing).withdraw()  # the user may want to export again
        # Edits are recorded before the clock poses the scene, which is not an edit.
        state.history.observe(state.scene, state.options, is_held(state))
        self._take_streamed()
        if state.clock.pose(state.actor):
            state.history.follow(state.clock.time)
        follow_actor(state)
        keep_fitting(state, files.stream is not None)
        self.renderer.marks, self.renderer.ghost = show_finding(state), show_rig(state)
        advance_closing(state)  # after a new rig, which is unsaved, has been put into the scene
        hover_joint(state)
        self._draw_scene(scale)
        if self.target is not None:
            answer_picks(state, self.renderer, self.target.size, scale, self._drawn)
            answer_right_click(state, self.renderer, self.target.size, scale)
        imgui.render()

    def paint(self, framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> None:
        """Paint the panels of the last frame, and the scene behind them."""
        framebuffer.use()
        self.context.viewport = (0, 0, *size)
        framebuffer.clear(*imgui.get_style_color_vec4(imgui.Col_.title_bg))
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def _take_streamed(self) -> None:
        """Add the parts of captures read since the last frame."""
        state, files = self.state, self.state.of(Files)
        stream = files.stream
        if stream is None:
            return
        try:
            new, notes, grew = stream.take()
        except ViewerError as problem:
            state.error, files.stream = str(problem), None
            stream.cancel()
            return
        if grew:
            self._add_actors(new)
        state.say(*notes)
        if stream.is_done:
            files.stream = None
            if stream.error:
                state.error = stream.error

    def _add_actors(self, actors: Sequence[Actor]) -> None:
        """Add actors and longer clips as captures are read."""
        state = self.state
        state.scene.actors += actors
        state.of(SavedWork).add_actors(actors)
        state.clock.pose(state.actor, again=True)
        state.history.add_actors(state.scene, state.options)
        state.history.follow(state.clock.time)

    def _draw_scene(self, scale: float) -> None:
        """Draw the scene if it has changed, and show it behind the panels."""
        state = self.state
        x, y, width, height = state.view_rect
        size = (round(width * scale), round(height * scale))
        if min(size) < 1 or (state.panels_visible and self._n_frames < _LAID_OUT):
            return
        renderer = self.renderer
        renderer.annotations = pinned_annotations(state, size)
        key = self._keys.key(state, size, renderer.marks, renderer.ghost, renderer.annotations)
        self._drawn = key
        # If drawing fails, it is retried only after a change.
        step = self.pace.step(key, state.options, time.perf_counter())
        if step is not None:
            self._draw_target(size, step)
        self._preview.draw(state, key)
        if self.target is not None:
            corner = (x + size[0] / scale, y + size[1] / scale)
            draw_list = imgui.get_background_draw_list()
            outlines = self.outlines.texture(state, renderer, size, key)
            for texture in filter(None, (self.target.texture, outlines)):
                picture = imgui.ImTextureRef(texture.glo)
                # Textures have their first row at the bottom.
                draw_list.add_image(picture, (x, y), corner, (0.0, 1.0), (1.0, 0.0))
            draw_hovered(state)
            draw_hovered_name(state)
            draw_gizmo(state)
            draw_rig_tools(state)
            if state.panels_visible:
                draw_hints(state)
                draw_axis_gizmo(state)

    def _draw_target(self, size: tuple[int, int], step: Step) -> None:
        """Draw the scene; if the driver fails, show a message and keep the window open."""
        state, started = self.state, time.perf_counter()
        try:
            target = self._target(size)
            selected = (state.chosen_actor, state.selected_joint)
            self.renderer.draw(
                state.scene,
                state.camera,
                step.options,
                target,
                state.box,
                selected,
                step.passes,
                step.strength,
            )
            target.resolve()
            if self._is_software:
                self.context.finish()
                self.pace.measured(step, time.perf_counter() - started)
            state.stats.samples = target.samples
            state.stats.scalar_range = self.renderer.scalar_range
            state.stats.scalar_ends = self.renderer.scalars.ends
            state.stats.legend = self.renderer.legend
        except ViewerError as problem:
            state.error = str(problem)
        state.say(*self.renderer.notes)
        self.renderer.notes.clear()

    def _target(self, size: tuple[int, int]) -> Target:
        samples = self.state.options.samples
        target = self.target
        if target is None or (target.size, target.asked_samples) != (size, samples):
            if target is not None:
                target.release()
            self.target = None
            self.target = target = Target(self.context, size, samples)
        return target

    def open(self, paths: Sequence[Path]) -> None:
        """Begin to read files; the current scene is shown until they have been read.

        A skin opened while the scene is a lone skeleton, or the reverse, is attached if it matches.
        """
        if not paths:
            return
        state = self.state
        paths = [Path(path) for path in paths]
        attempts = [paths]
        figures = [actor.figure for actor in state.scene.actors]
        is_part = len(figures) == 1 and (figures[0].mesh is None or figures[0].skeleton is None)
        suffixes = {path.suffix.lower() for path in (*paths, *state.paths)}
        is_part &= len(paths) == 1 and len(state.paths) == 1 and len(suffixes) == 2
        if is_part and paths[0].suffix.lower() not in _ADDED:
            attempts.insert(0, [*state.paths, *paths])
        opened = state.paths or bundled_files()
        up = state.of(Preferences).up
        rig, state.of(Files).rig = state.of(Files).rig, ""
        settings = MotionSettings(up=up or "", rig=rig, springs=True)
        state.of(Files).loader = Loader(paths, attempts, self.wake, settings, opened)

    def _take_loaded(self) -> None:
        """Show the files that were read, or the error."""
        state, loader = self.state, self.state.of(Files).loader
        if loader is None or not loader.is_done:
            return
        if loader.scene is not None and not may_replace_scene(state):
            return
        state.of(Files).loader = None
        if loader.addition is not None:
            self._add(loader.addition)
        elif loader.scene is None:
            state.error = loader.error
        else:
            self._show(loader.scene, loader.paths, loader.builders)

    def _show(
        self, scene: Scene, paths: tuple[Path, ...], builders: Sequence[Builder] = ()
    ) -> None:
        state = self.state
        state.of(Closing).discards = False  # the agreement to lose edits concerned these files
        try:
            self.renderer.prepare(scene)
        except RenderError as problem:
            state.error = str(problem)
            return
        files = state.of(Files)
        if files.stream is not None:
            files.stream.cancel()
        state.show_scene(scene, paths)
        stop_following(state)
        self.stream(builders)
        if self.keeps_recent:
            problem_text = remember(files.recent, paths)
            if problem_text:
                state.say(problem_text)

    def stream(self, builders: Sequence[Builder]) -> None:
        """Begin to read the remaining parts of captures."""
        left = [builder for builder in builders if not builder.is_done]
        self.state.of(Files).stream = Stream(left, self.wake) if left else None

    def _add(self, contents: Contents) -> None:
        """Apply poses and textures to the chosen actor."""
        state, saved = self.state, self.state.of(SavedWork)
        state.history.observe(state.scene, state.options, busy=False)
        try:
            actor, notes = add_to_actor(contents, state.actor)
        except ViewerError as problem:
            state.error = str(problem)
            return
        if actor is not state.actor:
            keep_edited(state.of(Animations), state.actor, actor)
            state.history.exchange_actor(state.actor, actor)
            saved.exchange_actor(state.actor, actor)
            state.scene.actors[state.chosen_actor] = actor
        if contents.poses and actor.pose is not None:
            saved.add(SavedPose(actor, pose_key(actor.pose)))
        state.scene.files += contents.files
        added = [*contents.poses, *contents.pictures]
        state.say(*contents.diagnostics, *notes)
        state.say_status(f"Applied {', '.join(printable(path.name, 60) for path, _ in added)}")

    def _do_wanted(self) -> None:
        """Serve the requests made during the frame."""
        state = self.state
        if "open dialog" in state.wants:
            state.of(Files).dialog = FileDialog(folder_of(state.paths))
        if "open bundled" in state.wants:
            self.open(bundled_files())
        if "open body" in state.wants:
            self.open([bundled_body()])
        if "screenshot" in state.wants:
            _save_screenshot(state, self.scene_picture)
        if "quit" in state.wants:
            request_quit(state)
        start_recording(state, self.renderer)
        state.wants.clear()

    def scene_picture(self) -> Bytes:
        """Return the last image of the scene, without panels: (H, W, 4) uint8."""
        if self.target is None:
            raise ViewerError("nothing has been drawn yet")
        self.finish_picture()
        return self.target.read()

    def finish_picture(self) -> None:
        """Draw all passes of an image with full shadows instead of improving it in later frames."""
        if self.target is not None and self.pace.is_unfinished:
            options = self.state.options
            self._draw_target(self.target.size, Step(options, range(n_passes(options)), 1.0))
            self.pace.restart()

    def release(self) -> None:
        """Release all GL objects, and end background work."""
        for work in (self.state.job, self.state.of(Files).stream):
            if work is not None:
                work.cancel()
        for item in (self.target, self._preview, self.outlines, self.renderer):
            if item is not None:
                item.release()


def _save_screenshot(state: AppState, picture: Callable[[], Bytes]) -> None:
    """Save an image of the scene under an unused name in the current folder."""
    try:
        path = free_path(Path.cwd(), state.scene.title, ".png")
        save_image(path, picture())
        state.say(f"Saved {printable(path, 200)}")
        if "##legend" in state.item_rects:  # drawn over the image, not into it
            state.say('Saved without the legend: turn on "Legend in pictures" in the Weights panel')
    except ViewerError as problem:
        state.error = str(problem)
    except OSError as problem:
        state.error = f"the current folder: {problem.strerror}"


def _advance_job(state: AppState) -> bool:
    """Perform the next step of the running job, and report how it ended."""
    job = state.job
    if job is None:
        return False
    job.step()
    if not job.is_done:
        return False
    state.job = None
    # A cancelled export may have been finished all the same.
    if job.is_cancelled and not job.output:
        return False
    state.say(*job.lines)
    state.error = job.error or state.error
    return bool(job.error)
