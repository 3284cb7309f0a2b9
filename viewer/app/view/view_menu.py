"""The View menu: named views, skeleton styles, joint overlays, weights and vertices."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.reasons import no_mesh, no_skeleton, no_texture
from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_menu, menu_item
from viewer.app.features import key_of
from viewer.app.view.axis_gizmo import AxisGizmo
from viewer.app.view.camera_actions import (
    fit_selection,
    fit_view,
    fly_to,
    look_through,
    toggle_projection,
)
from viewer.app.view.display_actions import (
    show_bones,
    toggle_gizmo,
    toggle_option,
    toggle_skeleton,
)
from viewer.app.view.outlines import Outlines, toggle_outlines
from viewer.app.weights.actions import (
    no_view,
    toggle_picking,
    toggle_vertex_info,
    toggle_weights,
    unpin,
)
from viewer.app.weights.state import Weights
from viewer.phrases import printable
from viewer.rendering.camera import VIEWS
from viewer.rendering.options import BONES

__all__ = ["JOINT_TOGGLES", "draw_bone_styles", "draw_view_menu", "draw_views"]

JOINT_TOGGLES = {
    "xray": ("X-ray", "B"),
    "joint_names": ("Joint names", "J"),
    "joint_axes": ("Joint axes", "Shift+J"),
}
"""Display options for joints, with their label and key."""

_SURFACE_TOGGLES = {
    "wireframe": ("Wireframe", "W"),
    "normals": ("Vertex normals", "N"),
    "texture": ("Texture", "T"),
}
_ACTIONS = "view.camera_actions"


def draw_view_menu(state: AppState) -> None:
    """Draw the menu in the menu bar."""
    if not begin_menu(state, "View"):
        return
    draw_views(state)
    _draw_cameras(state)
    imgui.separator()
    _draw_figures(state)
    imgui.separator()
    _draw_vertices(state)
    imgui.separator()
    if menu_item(state, "Grid", "G", state.options.grid):
        toggle_option(state, "grid", "Grid")
    if menu_item(state, "Axis gizmo", "", state.of(AxisGizmo).is_shown):
        toggle_gizmo(state)
    if menu_item(state, "Selection outlines", "", state.of(Outlines).is_shown):
        toggle_outlines(state)
    if menu_item(state, "Hide menus and panels", "Tab"):
        state.panels_visible = False
    imgui.end_menu()


def draw_views(state: AppState) -> None:
    """Draw the items of named views, fitting and projection."""
    for name in VIEWS:
        if menu_item(state, f"{name.capitalize()} view", key_of(f"{_ACTIONS}.look", name)):
            fly_to(state, name)
    imgui.separator()
    if menu_item(state, "Fit all", key_of(f"{_ACTIONS}.fit_view")):
        fit_view(state)
    if menu_item(state, "Fit selection", key_of(f"{_ACTIONS}.fit_selection")):
        fit_selection(state)
    if menu_item(state, "Orthographic view", "5", state.camera.orthographic):
        toggle_projection(state)


def _draw_cameras(state: AppState) -> None:
    """Draw the submenu of calibrated cameras if there are any."""
    views = state.scene.views
    if not views or not begin_menu(state, "Calibrated camera"):
        return
    for number, view in enumerate(views):
        text = f"{printable(view.name, 60)}##camera{number}"
        if menu_item(state, text, "", state.camera.fixed is view):
            look_through(state, number)
    imgui.end_menu()


def _draw_figures(state: AppState) -> None:
    """Draw the items of surfaces and skeletons."""
    options, no_bones = state.options, no_skeleton(state)
    for name, (text, key) in _SURFACE_TOGGLES.items():
        why = no_texture(state) if name == "texture" else no_mesh(state)
        if menu_item(state, text, key, getattr(options, name), why):
            toggle_option(state, name, text)
    shows = options.show in ("skeleton", "both")
    if menu_item(state, "Skeleton##shown", "S", shows, no_bones):
        toggle_skeleton(state)
    if begin_menu(state, "Bones", not no_bones):
        draw_bone_styles(state)
        imgui.end_menu()
    for name, (text, key) in JOINT_TOGGLES.items():
        if menu_item(state, text, key, getattr(options, name), no_bones):
            toggle_option(state, name, text)


def draw_bone_styles(state: AppState) -> None:
    """Draw an item for each style of skeletons."""
    for style, text in BONES.items():
        if menu_item(state, f"{text}##bones", "", state.options.bones == style):
            show_bones(state, style)


def _draw_vertices(state: AppState) -> None:
    """Draw the items of weights and vertices."""
    options, view = state.options, state.of(Weights)
    shows = options.shading == "scalar" and options.scalar == "weight"
    text = "Weights of the selected joint"
    if menu_item(state, text, "V", shows, "" if shows else no_view(state, "weight")):
        toggle_weights(state)
    why = no_mesh(state)
    if menu_item(state, "Inspect vertex under cursor", "", view.always_shows_info, why):
        toggle_vertex_info(state)
    if menu_item(state, "Pick vertices", "", view.picks_vertices, why):
        toggle_picking(state)
    why = "" if view.pinned is not None else "no vertex is pinned: Alt+click one"
    if menu_item(state, "Unpin vertex", "Esc", why=why):
        unpin(state)
