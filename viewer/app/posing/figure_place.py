"""Rows of the Joints panel for translation and scale of the whole figure."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from viewer.app.core.fields import slider_float
from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item, plain_zero, show_tooltip
from viewer.rig.mesh import box_size
from viewer.rig.pose import Pose

__all__ = ["draw_figure_place"]


def draw_figure_place(state: AppState, pose: Pose) -> None:
    """Draw translation and scale, which are applied after skinning."""
    imgui.set_next_item_open(state.actor.figure.pose_layout is not None, imgui.Cond_.once)
    is_open = imgui.tree_node_ex("Whole figure", imgui.TreeNodeFlags_.span_avail_width)
    note_item(state, "figure")
    if not is_open:
        return
    reach = box_size(state.box) or 1.0
    for axis, name in enumerate(("tx", "ty", "tz")):
        value = _row(state, name, float(pose.figure_translation[axis]), -reach, reach, 0.0)
        pose.figure_translation[axis] = value
    scale = _row(state, "scale", pose.figure_scale, 0.1, 3.0, 1.0)
    pose.figure_scale = max(scale, 1e-3)
    imgui.tree_pop()


def _row(state: AppState, name: str, value: float, low: float, high: float, rest: float) -> float:
    imgui.align_text_to_frame_padding()
    imgui.text_disabled(name)
    imgui.same_line(4.2 * imgui.get_font_size())
    imgui.set_next_item_width(-1.0)
    changed, moved = slider_float(
        state, f"##figure {name}", plain_zero(value, "%.4f"), low, high, "%.4f"
    )
    note_item(state, f"figure.{name}")
    if imgui.is_item_hovered():
        show_tooltip(f"figure.{name}\nCtrl+click to type a value, double-click to reset")
        if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
            return rest
    return moved if changed and math.isfinite(moved) and abs(moved) < 1e9 else value
