"""Frames of the window or of a headless run: interface, input, jobs and scene."""

from __future__ import annotations

import time

import moderngl
from imgui_bundle import imgui

from viewer.app.actors.following import follow_actor, stop_following
from viewer.app.closing import (
    Closing,
    advance_closing,
    draw_question,
    may_replace_scene,
)
from viewer.app.context_menu import answer_right_click, draw_context_menu
from viewer.app.core.camera_moves import keep_fitting
from viewer.app.core.state import AppState
from viewer.app.features import KEYS, entries
from viewer.app.files.file_dialog import draw_file_dialog
from viewer.app.files.files import Files, take_loaded, take_streamed
from viewer.app.files.saving import save_screenshot
from viewer.app.interface import draw_interface
from viewer.app.keys import handle_keys
from viewer.app.linting.marks import show_finding
from viewer.app.live import advance_live
from viewer.app.manual import Manual
from viewer.app.mouse import drop_motion_before_press, handle_mouse, is_held, stops_time
from viewer.app.overlays import draw_hints
from viewer.app.pace import Pace, Step, picture_key
from viewer.app.palette import draw_palette
from viewer.app.posing.gizmo import draw_gizmo
from viewer.app.posing.shape_panel import drop_unreadable_shapes
from viewer.app.preferences.applying import follow_preferences
from viewer.app.recording.recording import Preview, draw_record_dialog, start_recording
from viewer.app.rigging.facing import FacingPictures
from viewer.app.rigging.joint_editing.drags import draw_joint_edits, update_joints
from viewer.app.rigging.tools import draw_rig_tools, show_rig
from viewer.app.view.axis_gizmo import draw_axis_gizmo
from viewer.app.view.flight import advance_flight
from viewer.app.view.hovering import draw_hovered_name, hover_joint
from viewer.app.view.outlines import OutlineLayer
from viewer.app.view.picks import answer_picks
from viewer.app.weights.vertex_panel import draw_hovered, pinned_annotations
from viewer.errors import ViewerError
from viewer.rendering.gpu.context import is_software
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.renderer import Renderer
from viewer.rendering.sampling import n_passes
from viewer.rigs.arrays import Bytes

_LAID_OUT = 2  # first frame in which the panels leave room for the view, counted from 1


class Frame:
    """Runs and draws frames of one state in one context; the caller begins ImGui's frame."""

    def __init__(self, state: AppState, programs: Programs) -> None:
        self.state, self.context = state, programs.context
        self.renderer = Renderer(programs)
        self.target: Target | None = None
        self._preview = Preview(programs)
        self._fronts = FacingPictures(programs)
        self.outlines = OutlineLayer(self.context)
        self._drawn: object = None
        self._n_frames = 0
        self.pace = Pace()
        self._is_software = is_software(self.context)
        state.stats.renderer = self.context.info["GL_RENDERER"]
        state.stats.version = self.context.info["GL_VERSION"]

    def draw(self, framebuffer: moderngl.Framebuffer, size: tuple[int, int], scale: float) -> None:
        """Run one frame after ``imgui.new_frame`` and paint it; ``size`` in pixels."""
        started = time.perf_counter()
        self.run(scale)
        self.paint(framebuffer, size)
        self.state.stats.frame_ms = 1e3 * (time.perf_counter() - started)

    def run(self, scale: float) -> None:
        """Run a frame without painting the panels."""
        state = self.state
        self._n_frames += 1
        drop_motion_before_press()
        follow_preferences(state, KEYS)
        if not stops_time(state):
            state.clock.advance(imgui.get_io().delta_time)
        drop_unreadable_shapes(state)
        draw_interface(state)
        draw_record_dialog(state)
        draw_context_menu(state)
        draw_palette(state, entries)
        draw_file_dialog(state)
        draw_question(state)
        handle_keys(state, KEYS)
        handle_mouse(state)
        advance_flight(state, imgui.get_io().delta_time)
        state.limit_camera()
        if state.wants_screenshot:
            save_screenshot(state, self.scene_picture)
            state.wants_screenshot = False
        start_recording(state, self.renderer)
        if take_loaded(state, may_replace_scene, self.renderer.prepare):
            stop_following(state)
        if state.advance_job():
            state.of(Closing).withdraw()  # the user may want to export again
        # Edits are recorded before the clock poses the scene, which is not an edit.
        state.observe(is_held(state))
        take_streamed(state)
        if state.clock.pose(state.actor):
            state.history.follow(state.update_version(), state.clock.time)
        advance_live(state)
        follow_actor(state)
        keep_fitting(state, state.of(Files).stream is not None)
        self.renderer.marks, self.renderer.ghost = show_finding(state), show_rig(state)
        update_joints(state)
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

    def _draw_scene(self, scale: float) -> None:
        """Draw the scene if it has changed, and show it behind the panels."""
        state = self.state
        x, y, width, height = state.view_rect
        size = (round(width * scale), round(height * scale))
        if min(size) < 1 or (state.panels_visible and self._n_frames < _LAID_OUT):
            return
        renderer = self.renderer
        renderer.annotations = pinned_annotations(state, size)
        key = picture_key(state, size, renderer.marks, renderer.ghost, renderer.annotations)
        self._drawn = key
        # If drawing fails, it is retried only after a change.
        step = self.pace.step(key, state.options, time.perf_counter())
        if step is not None:
            self._draw_target(size, step)
        self._preview.draw(state, key)
        self._fronts.draw(state)
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
            draw_joint_edits(state)
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
            state.stats.scalar_range = self.renderer.scalars.range
            state.stats.scalar_ends = self.renderer.scalars.ends
            state.stats.legend = self.renderer.scalars.legend
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
        manual = self.state.of(Manual)
        for item in (
            self.target,
            self._preview,
            self._fronts,
            self.outlines,
            self.renderer,
            manual,
        ):
            if item is not None:
                item.release()
