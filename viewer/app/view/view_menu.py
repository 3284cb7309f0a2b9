"""The View menu: joint overlays, weights of the selected joint, and vertices."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.reasons import no_mesh, no_skeleton
from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_menu, menu_item
from viewer.app.view.display_actions import toggle_option
from viewer.app.weights.actions import (
    no_view,
    toggle_picking,
    toggle_telling,
    toggle_weights,
    unpin,
)
from viewer.app.weights.state import Weights

__all__ = ["JOINT_TOGGLES", "draw_view_menu"]

JOINT_TOGGLES = {
    "xray": ("X-ray", "B"),
    "joint_names": ("Joint names", "J"),
    "joint_axes": ("Joint axes", "Shift+J"),
}
"""Display options for joints, with their label and key."""


def draw_view_menu(state: AppState) -> None:
    """Draw the menu in the menu bar."""
    if not begin_menu(state, "View"):
        return
    options, view = state.options, state.of(Weights)
    for name, (text, key) in JOINT_TOGGLES.items():
        if menu_item(state, text, key, getattr(options, name), no_skeleton(state)):
            toggle_option(state, name, text)
    imgui.separator()
    shows = options.shading == "scalar" and options.scalar == "weight"
    text = "Weights of the selected joint"
    if menu_item(state, text, "V", shows, "" if shows else no_view(state, "weight")):
        toggle_weights(state)
    why = no_mesh(state)
    if menu_item(state, "Inspect vertex under cursor", "", view.tells_always, why):
        toggle_telling(state)
    if menu_item(state, "Pick vertices", "", view.picks_vertices, why):
        toggle_picking(state)
    why = "" if view.pinned is not None else "no vertex is pinned: Alt+click one"
    if menu_item(state, "Unpin vertex", "Esc", why=why):
        unpin(state)
    imgui.end_menu()
