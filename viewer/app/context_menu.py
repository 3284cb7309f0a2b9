"""Menu at a right click in the view: actions on the joint, vertex and actor there."""

from __future__ import annotations

from functools import partial

from imgui_bundle import imgui

from viewer.app.actors.following import Following, toggle_following
from viewer.app.actors.parts_panel import isolate_part, part_label, set_part_shown
from viewer.app.core.reasons import no_pose, no_skeleton
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import begin_menu, menu_item
from viewer.app.palette import toggle_palette
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.posing import copy_pose, paste_pose, reset_actor, reset_joint
from viewer.app.rigging.joint_editing.commands import mirror
from viewer.app.view.camera_panel import fit_actor, fit_selection
from viewer.app.view.display_panel import draw_bone_styles, draw_views, toggle_option
from viewer.app.view.hovering import Picking
from viewer.app.view.picks import Spot, spot_at
from viewer.app.weights.weights_panel import Weights, no_view, pin_vertex, show_scalar, unpin
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.renderer import Renderer
from viewer.rigs.skeleton import joint_label

_POPUP = "context menu"
_LONGEST = 40  # maximum length of a name in characters


@dataclass(slots=True)
class ContextMenu:
    """State of the menu."""

    spot: Spot | None = None
    """The item that was hit; None for the background."""
    is_wanted: bool = False
    """Whether the menu opens in the next frame."""


@shows_errors
def answer_right_click(
    state: AppState, renderer: Renderer, size: tuple[int, int], scale: float
) -> None:
    """Find the item that a right click hit, and request its menu; ``size`` in pixels."""
    picking, menu = state.of(Picking), state.of(ContextMenu)
    place, picking.menu_at = picking.menu_at, None
    if place is None:
        return
    menu.spot = spot_at(state, renderer, size, (place[0] * scale, place[1] * scale))
    menu.is_wanted = True


def draw_context_menu(state: AppState) -> None:
    """Draw the menu while it is open."""
    menu = state.of(ContextMenu)
    if menu.is_wanted:
        menu.is_wanted = False
        imgui.open_popup(_POPUP)
    if not imgui.begin_popup(_POPUP):
        return
    spot = menu.spot
    # The scene may have been replaced while the menu was open.
    if spot is not None and spot.actor < len(state.scene.actors):
        _draw_joint(state, spot)
        _draw_vertex(state, spot)
        _draw_part(state, spot)
        _draw_actor(state, spot)
    else:
        draw_views(state)
        imgui.separator()
        hidden = [actor for actor in state.scene.actors if not actor.visible]
        why = "" if hidden else "no actor is hidden"
        if menu_item(state, "Show all actors", why=why):
            for actor in hidden:
                actor.visible = True
        nothing = state.selected_joint < 0 and not state.is_actor_selected
        if menu_item(state, "Deselect", "Esc", why="nothing is selected" if nothing else ""):
            state.deselect()
        if menu_item(state, "Paste pose", "Ctrl+V", why=no_pose(state)):
            paste_pose(state)
        imgui.separator()
        if menu_item(state, "Grid", "G", state.options.grid):
            toggle_option(state, "grid", "Grid")
        if menu_item(state, "X-ray", "B", state.options.xray, no_skeleton(state)):
            toggle_option(state, "xray", "X-ray")
        if begin_menu(state, "Bones", not no_skeleton(state)):
            draw_bone_styles(state)
            imgui.end_menu()
    imgui.separator()
    if menu_item(state, "Find an action…", "Ctrl+P"):
        toggle_palette(state)
    imgui.end_popup()


def _draw_joint(state: AppState, spot: Spot) -> None:
    actor, joint = state.scene.actors[spot.actor], spot.joint
    skeleton = actor.figure.skeleton
    if skeleton is None or not 0 <= joint < skeleton.n_joints:
        return
    imgui.separator_text(printable(joint_label(skeleton, joint), _LONGEST))
    is_selected = (spot.actor, joint) == (state.chosen_actor, state.selected_joint)
    choose = partial(_choose_joint, state, spot)
    if menu_item(state, "Select joint", "", is_selected):
        choose()
    why = "" if (skeleton.dof_joints == joint).any() else "this joint has no DOFs"
    if menu_item(state, "Reset joint", why=why):
        choose()
        reset_joint(state, joint)
    if menu_item(state, "Show weights", "V", why=no_view(state, "weight")):
        choose()
        show_scalar(state, "weight")
    if menu_item(state, "Fit joint", "."):
        choose()
        fit_selection(state)
    _draw_following(state, "Camera follows joint", spot.actor, joint)
    path = (spot.actor, joint)
    shown, others = state.options.path_joints, [p for p in state.options.path_joints if p != path]
    why = "" if actor.clip is not None else "this actor has no motion"
    if menu_item(state, "Motion path", "", path in shown, why):
        state.options.path_joints = tuple(others) if path in shown else (*shown, path)
    if menu_item(state, "Copy name"):
        imgui.set_clipboard_text(joint_label(skeleton, joint))


def _draw_vertex(state: AppState, spot: Spot) -> None:
    if spot.vertex < 0:
        return
    imgui.separator_text(f"Vertex {spot.vertex}")
    figure = state.scene.actors[spot.actor].figure
    why = "" if figure.is_attached else "this figure has no skin that follows a skeleton"
    if menu_item(state, "Explain vertex", "Alt+click", why=why):
        pin_vertex(state, spot.actor, spot.vertex)
    if state.of(Weights).pinned is not None and menu_item(state, "Unpin vertex", "Esc"):
        unpin(state)
    if menu_item(state, "Copy index"):
        imgui.set_clipboard_text(str(spot.vertex))


def _draw_part(state: AppState, spot: Spot) -> None:
    actor = state.scene.actors[spot.actor]
    mesh = actor.figure.mesh
    if mesh is None or not 0 <= spot.part < len(mesh.parts) or len(mesh.parts) < 2:
        return
    imgui.separator_text(printable(part_label(actor, spot.part), _LONGEST))
    if menu_item(state, "Hide part"):
        set_part_shown(actor, spot.part, False)
    if menu_item(state, "Show only this part"):
        isolate_part(actor, spot.part)
    if menu_item(state, "Show all parts", why="" if actor.hidden_parts else "no part is hidden"):
        actor.hidden_parts = frozenset()


def _draw_actor(state: AppState, spot: Spot) -> None:
    actor, several = state.scene.actors[spot.actor], len(state.scene.actors) > 1
    imgui.separator_text(printable(actor.name, _LONGEST))
    choose = partial(_choose_actor, state, spot.actor)
    if several and menu_item(state, "Select actor", "", state.chosen_actor == spot.actor):
        choose()
    if menu_item(state, "Fit actor"):
        choose()
        fit_actor(state)
    _draw_following(state, "Camera follows actor", spot.actor, -1)
    if menu_item(state, "Hide actor"):
        actor.visible = False
    if several and menu_item(state, "Hide others"):
        for other in state.scene.actors:
            other.visible = other is actor
    why = "" if actor.own_pose is not None else "this figure has no joints to pose"
    for text, key, act in (
        ("Reset pose", "", reset_actor),
        ("Mirror pose or joints", "M", mirror),
        ("Copy pose", "Ctrl+C", copy_pose),
        ("Paste pose", "Ctrl+V", paste_pose),
    ):
        if menu_item(state, text, key, why=why):
            choose()
            act(state)


def _draw_following(state: AppState, text: str, actor: int, joint: int) -> None:
    """Draw the item that lets the camera follow an actor or joint."""
    follows = state.of(Following).target == (actor, joint)
    if menu_item(state, text, "", follows):
        toggle_following(state, actor, joint)


def _choose_actor(state: AppState, index: int) -> None:
    if index != state.chosen_actor or not state.is_actor_selected:
        joint = state.selected_joint if index == state.chosen_actor else -1
        state.select_actor(index)
        state.selected_joint = joint


def _choose_joint(state: AppState, spot: Spot) -> None:
    _choose_actor(state, spot.actor)
    select_joint(state, spot.joint)
