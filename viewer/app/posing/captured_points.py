"""Captured keypoints in the Joints panel, with their current confidences."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.text_fields import search_field
from viewer.app.core.widgets import note_item
from viewer.app.posing.joint_tree import joint_tree
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.captures.points import PointLayout
from viewer.rig.scene import Actor

__all__ = ["draw_captured_points"]

_SEEN, _DOUBTFUL = (0.30, 0.55, 0.38, 1.0), (0.62, 0.42, 0.22, 1.0)
_NAME_WIDTH = 0.55  # width of the names, as a fraction of the panel's width


def draw_captured_points(state: AppState, actor: Actor, layout: PointLayout) -> None:
    """Draw a description of the captured points, and their list.

    Parameters
    ----------
    state : AppState
        State with the filter and the minimum confidence of drawn points.
    actor : Actor
        Actor that consists of captured points.
    layout : PointLayout
        Names of the points.
    """
    points = actor.points if actor.is_present else None
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(
        f"{len(layout.names)} captured points ({printable(layout.title, 40)}), not a skeleton: "
        "there are no joints to rotate."
    )
    imgui.text_disabled(_seen_text(state, points))
    imgui.pop_text_wrap_pos()
    imgui.set_next_item_width(-1.0)
    tree = joint_tree(state)
    tree.filter = search_field("##filter", tree.filter, "Filter points")
    note_item(state, "Filter")
    wanted = joint_tree(state).filter.lower()
    shown = [row for row, name in enumerate(layout.names) if wanted in name.lower()]
    if imgui.begin_child("points", (0.0, 0.0)):
        if not shown:
            imgui.text_disabled("no point name contains this text")
        clipper = imgui.ListClipper()
        clipper.begin(len(shown))
        while clipper.step():
            for row in shown[clipper.display_start : clipper.display_end]:
                _draw_row(state, row, layout.names[row], points)
        clipper.end()
    imgui.end_child()


def _seen_text(state: AppState, points: Floats | None) -> str:
    """Return a sentence with the number of points detected at the current time."""
    if points is None:
        return "Absent at this time."
    confidences, least = points[:, 3], state.options.min_confidence
    text = f"{int((confidences > 0.0).sum())} detected at this time"
    doubtful = int(((confidences > 0.0) & (confidences < least)).sum())
    hidden = f", {doubtful} of them with confidence below {least:g} and not drawn"
    return f"{text}{hidden if doubtful else ''}."


def _draw_row(state: AppState, row: int, name: str, points: Floats | None) -> None:
    """Draw the name of a point, and its confidence as a bar with a number."""
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(printable(name, 40))
    imgui.same_line(_NAME_WIDTH * imgui.get_content_region_avail().x)
    confidence = 0.0 if points is None else float(points[row, 3])
    if confidence <= 0.0:
        imgui.text_disabled("not detected")
    else:
        is_drawn = confidence >= state.options.min_confidence
        imgui.push_style_color(imgui.Col_.plot_histogram, _SEEN if is_drawn else _DOUBTFUL)
        imgui.progress_bar(min(confidence, 1.0), (-1.0, 0.0), f"{confidence:.3g}")
        imgui.pop_style_color()
    note_item(state, f"point {name}")
