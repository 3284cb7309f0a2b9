"""Tools to move the template by hand, and the update of the Rig panel in each frame."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.posing.state import Posing
from viewer.app.rigging.landmarks import draw_landmarks, show_both, take_click
from viewer.app.rigging.placing import aligned_template, ghost_of, placing_now
from viewer.app.rigging.sources import refresh
from viewer.app.rigging.state import TOOLS, Rigging
from viewer.app.rigging.template_gizmo import use_gizmo
from viewer.app.rigging.work import finish_work, start_align, start_reading
from viewer.rendering.passes.ghost_pass import Ghost

__all__ = ["choose_rig_tool", "draw_rig_tools", "drop_rig_tool", "holds_mouse", "show_rig"]


def choose_rig_tool(state: AppState, tool: str) -> None:
    """Choose a tool to move the template, a key of ``TOOLS``."""
    view = state.of(Rigging)
    if tool and aligned_template(state) is None:
        start_reading(state)
        return
    state.of(Posing).tool = "select"
    view.tool, view.pending, view.holds_mouse = tool, None, False
    if tool == "landmarks":
        show_both(state)
    if tool:
        state.say_status(f"{TOOLS[tool][0]}: {TOOLS[tool][1]}")


def drop_rig_tool(state: AppState) -> bool:
    """Discard an incomplete pair of landmarks, or deselect the tool; return whether it did so."""
    view = state.of(Rigging)
    if view.pending is not None:
        view.pending = None
        return True
    had_one, view.tool, view.holds_mouse = bool(view.tool), "", False
    return had_one


def holds_mouse(state: AppState) -> bool:
    """Return whether the gizmo uses the mouse, in which case a drag does not orbit."""
    return state.of(Rigging).holds_mouse


def show_rig(state: AppState) -> Ghost | None:
    """Apply finished jobs and clicks of the Rig panel; return the template if it is to be drawn.

    Called in each frame after the scene is posed and before it is drawn.
    """
    refresh(state)
    finish_work(state)
    view = state.of(Rigging)
    if view.target is None or aligned_template(state) is None:
        view.tool = ""
    if not view.tool:
        view.holds_mouse = False
    elif view.tool == "landmarks":
        take_click(state)
    _measure(state)
    view.shown = ghost_of(state)
    return view.shown


def _measure(state: AppState) -> None:
    """Measure the error of the template's placement once its handle is released."""
    view, placing = state.of(Rigging), placing_now(state)
    if not view.was_dragged or imgui.is_mouse_down(imgui.MouseButton_.left):
        return
    if placing is None:
        view.was_dragged = False
    elif not no_job_room(state):
        view.was_dragged = False
        start_align(state, placing.settings)


def draw_rig_tools(state: AppState) -> None:
    """Draw the gizmo or the landmarks over the viewport, and handle drags."""
    view, template = state.of(Rigging), aligned_template(state)
    x, y, width, height = state.view_rect
    if not view.tool or template is None or view.target is None or min(width, height) < 40.0:
        return
    ink = imgui.get_background_draw_list()
    ink.push_clip_rect((x, y), (x + width, y + height), True)
    if view.tool == "landmarks":
        draw_landmarks(state, template)
    else:
        use_gizmo(state, template)
    ink.pop_clip_rect()
