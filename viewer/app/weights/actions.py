"""Actions of keys, menus and buttons on weights and vertices."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.posing.joint_tree import select_joint
from viewer.app.shown_panels import is_open, set_open, show_panel
from viewer.app.weights.state import Pinned, Weights
from viewer.phrases import printable
from viewer.rig.inspection.explanation import Explanation, explain
from viewer.rig.pose import pose_key
from viewer.rig.scalars import (
    SCALARS,
    informative_quantity,
    joint_influences,
    joint_text,
    missing_part,
    most_influential,
    split_name,
)

__all__ = [
    "explained",
    "no_view",
    "pin_vertex",
    "show_scalar",
    "shown_joint",
    "start_heat_map",
    "toggle_picking",
    "toggle_vertex_info",
    "toggle_weights",
    "unpin",
]

_FIRST = ("weight", "field", "class", "parts")
"""Quantities to show initially, in order of preference."""


def no_view(state: AppState, key: str) -> str:
    """Return the reason why a scalar quantity cannot be shown; a joint or field may yet be chosen.

    Parameters
    ----------
    state : AppState
        State with the scene.
    key : str
        A key of ``SCALARS``.
    """
    figures = [actor.figure for actor in state.scene.actors if actor.figure.mesh is not None]
    if not figures:
        return "there is no mesh"
    lacks = [missing_part(key, figure) for figure in figures]
    if not all(lacks) or (SCALARS[key].takes_joint and "a selected joint" in lacks):
        return ""
    return f"no figure in the scene has {lacks[0]}"


def start_heat_map(state: AppState) -> None:
    """Show a scalar quantity as colours; choices that would show nothing are replaced.

    A quantity that no figure has is replaced by an available one; a missing joint, or one without
    influence, by the joint with the most influence; a field that is 0 everywhere by the first one
    that is not.
    """
    options = state.options
    options.shading = "scalar"
    key, about = split_name(options.scalar)
    if no_view(state, key):
        key, about = next((one for one in _FIRST if not no_view(state, one)), key), ""
        options.scalar = key
    if about:
        return
    if SCALARS[key].takes_joint:
        _start_with_joint(state, key)
    elif SCALARS[key].about:
        options.scalar = informative_quantity(key, [actor.figure for actor in state.scene.actors])


def _start_with_joint(state: AppState, key: str) -> None:
    """Select the joint with the most influence if the selected one has none."""
    figure, joint = state.actor.figure, state.selected_joint
    sums = joint_influences(figure)
    if 0 <= joint < len(sums) and sums[joint]:
        return
    most = most_influential(figure)
    if most < 0:  # the chosen actor has no weights, but another actor may have some
        state.options.scalar = informative_quantity(
            key, [actor.figure for actor in state.scene.actors]
        )
        return
    if joint >= 0:
        names = (printable(joint_text(figure, one), 60) for one in (joint, most))
        state.say("{} has no influence: selected {}, which has the most".format(*names))
    select_joint(state, most)


def show_scalar(state: AppState, name: str) -> None:
    """Show a scalar quantity; a range that was fixed for another quantity is discarded."""
    options = state.options
    if split_name(name)[0] != split_name(options.scalar)[0]:
        options.scalar_range = options.isolines = None
    options.scalar = name
    start_heat_map(state)


def shown_joint(state: AppState) -> str:
    """Return the name of the joint whose weights are shown; empty if none is selected."""
    about, figure = split_name(state.options.scalar)[1], state.actor.figure
    if about or state.selected_joint < 0:
        return about
    if figure.skin is None or state.selected_joint >= figure.skin.n_joints:
        return ""
    return joint_text(figure, state.selected_joint)


def toggle_weights(state: AppState) -> None:
    """Switch between the weights of the selected joint as colours and normal shading."""
    options = state.options
    if options.shading == "scalar" and options.scalar == "weight":
        options.shading = "auto"
        state.say_status("Weights off")
        return
    why = no_view(state, "weight")
    if why:
        state.say_status(why)
        return
    show_scalar(state, "weight")
    joint = shown_joint(state)
    state.say_status(f"Weights of {printable(joint, 60)}" if joint else "No joint has influence")


def toggle_vertex_info(state: AppState) -> None:
    """Choose whether hover text is shown always or only while the Weights panel is visible."""
    view = state.of(Weights)
    view.always_shows_info = not view.always_shows_info
    state.say_status(f"Inspect vertex under cursor {'on' if view.always_shows_info else 'off'}")


def toggle_picking(state: AppState) -> None:
    """Switch between pinning vertices and selecting actors and joints by clicks."""
    view = state.of(Weights)
    view.picks_vertices = not view.picks_vertices
    state.say_status(
        "Clicks pin vertices" if view.picks_vertices else "Clicks select actors and joints"
    )


def pin_vertex(state: AppState, actor: int, vertex: int) -> None:
    """Pin a vertex, and explain it in the Vertex panel.

    Parameters
    ----------
    state : AppState
        State with the scene.
    actor : int
        Index of the actor in the scene.
    vertex : int
        Index of the vertex in the figure.
    """
    figure = state.scene.actors[actor].figure
    if not figure.is_attached:
        state.say_status("This figure has no skin attached to a skeleton: no influences to explain")
        return
    state.of(Weights).pinned = Pinned(actor, figure, vertex)
    show_panel(state, "vertex")


def unpin(state: AppState) -> None:
    """Unpin the vertex, and close the Vertex panel."""
    set_open(state, "vertex", False)
    view = state.of(Weights)
    view.pinned = view.explanation = view.explanation_key = None
    view.annotations, view.annotation_key = (), None


def explained(state: AppState) -> Explanation | None:
    """Return the explanation of the pinned vertex in the current pose; None if none is pinned.

    Raises
    ------
    ViewerError
        If the figure's shapes cannot be read.
    """
    view, actors = state.of(Weights), state.scene.actors
    pinned = view.pinned
    if pinned is None:
        return None
    if not is_open(state, "vertex"):
        unpin(state)  # the user has closed the panel
        return None
    is_there = pinned.actor < len(actors) and actors[pinned.actor].figure is pinned.figure
    pose = actors[pinned.actor].pose if is_there else None
    if pose is None:
        unpin(state)
        return None
    key = (pinned, pose_key(pose), repr(state.options.skinning))
    if key != view.explanation_key:
        view.explanation = explain(pinned.figure, pose, state.options.skinning, pinned.vertex)
        view.explanation_key = key
    return view.explanation
