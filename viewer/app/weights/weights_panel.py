"""Weights panel: heat maps of scalar quantities, and the vertex that is hovered or pinned."""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import begin_field
from viewer.app.core.reasons import no_mesh
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.text_fields import number_field
from viewer.app.core.widgets import (
    button,
    checkbox,
    choice,
    disabled,
    draw_setting,
    explain,
    note_item,
    plain_zero,
    radio,
    same_line_if_room,
)
from viewer.app.layout import is_open, set_open, show_panel
from viewer.app.posing.joint_tree import select_joint
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rendering.overlay.annotation import Annotation
from viewer.rendering.scalar_look import TYPICAL
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.explanation import Explanation
from viewer.rigs.inspection.explanation import explain as explain_vertex
from viewer.rigs.number_text import short_number
from viewer.rigs.pose import pose_key
from viewer.rigs.scalars import (
    SCALARS,
    find_quantity,
    informative_quantity,
    joint_influences,
    joint_text,
    length_unit,
    menu_title,
    missing_part,
    most_influential,
    shown_unit,
    split_name,
    unused_plugins,
)

_LONGEST = 40  # maximum length of a name in characters
_FIELD = 7.0  # width of a field, in font sizes
_WHOLE = ("discrete", "categorical")
_FIRST = ("weight", "field", "class", "parts")
"""Quantities to show initially, in order of preference."""


@dataclass(frozen=True, slots=True, eq=False)
class _Pinned:
    """The vertex that the Vertex panel explains."""

    actor: int
    """Index of its actor in the scene."""
    figure: Figure
    """Figure of that actor, for which the index is valid."""
    vertex: int
    """Index of the vertex."""


@dataclass(slots=True)
class Hover:
    """The vertex under a mouse that does not move."""

    since: float = 0.0
    """Time since which neither mouse nor image has changed, seconds of ImGui's clock."""
    place: tuple[float, float] = (-1.0, -1.0)
    """Position of the mouse, window coordinates."""
    picture: object = None
    """Key of the image, compared to detect a change."""
    is_known: bool = False
    """Whether the vertex has been determined since then."""
    lines: tuple[str, ...] = ()
    """Hover text; empty if there is no vertex."""
    point: Floats = field(default_factory=lambda: np.zeros(3))
    """Position of the vertex, scene space: (3,)."""


@dataclass(slots=True)
class Weights:
    """State of the Weights and Vertex panels."""

    panel_frame: int = -1
    """ImGui's number of the last frame in which the Weights panel was drawn."""
    always_shows_info: bool = False
    """Whether hover text is shown even if the Weights panel is not visible."""
    picks_vertices: bool = False
    """Whether clicks pin vertices instead of selecting actors and joints."""
    hover: Hover = field(default_factory=Hover)
    """The vertex under the mouse."""
    is_waiting: bool = False
    """Whether the mouse is still, but not yet for long enough."""
    pinned: _Pinned | None = None
    """The vertex that is explained."""
    draws_lines: bool = True
    """Whether lines are drawn from the vertex to its images under each joint alone."""
    explanation: Explanation | None = None
    """Latest explanation of the vertex."""
    explanation_key: object = None
    """Key of the state for which the explanation was computed."""
    annotations: tuple[Annotation, ...] = ()
    """Annotation of the vertex in the view; at most one."""
    annotation_key: object = None
    """Key of the state for which the annotation was created."""


def wants_vertex(view: Weights) -> bool:
    """Return whether a click pins a vertex: with Alt, or while vertices are picked."""
    return view.picks_vertices or imgui.get_io().key_alt


def draw(state: AppState) -> None:
    """Draw the panel."""
    state.of(Weights).panel_frame = imgui.get_frame_count()
    options, why = state.options, no_mesh(state)
    shows = options.shading == "scalar"
    if checkbox(state, "Heat map", shows, why) != shows:
        if shows:
            options.shading = "auto"
        else:
            start_heat_map(state)
    _draw_views(state)
    key = split_name(options.scalar)[0]
    if SCALARS[key].takes_joint:
        _draw_joint(state)
    if SCALARS[key].about == "field":
        _draw_fields(state, key)
    if state.options.shading == "scalar" and SCALARS[key].unit == "length":
        factor, unit = length_unit(state.actor.figure)
        most = short_number(factor * state.stats.scalar_range[1])
        imgui.text_wrapped(f"up to {most} {unit} in this pose")
    with disabled(state, "" if options.shading == "scalar" else "the heat map is off"):
        _draw_range(state, key)
        _draw_marks(state, key)
    imgui.separator()
    _draw_vertex_tools(state)


def _draw_views(state: AppState) -> None:
    """Draw the list of quantities; unavailable ones are disabled, with the reason as tooltip."""
    key = split_name(state.options.scalar)[0]
    imgui.set_next_item_width(-1.0)
    whole = imgui.ComboFlags_.height_largest
    skinning = state.options.skinning
    opened = imgui.begin_combo("##Heat map of", menu_title(key, skinning), whole)
    if not opened:
        note_item(state, "##Heat map of")
        return
    for name in SCALARS:
        why = no_view(state, name)
        with disabled(state, why):
            # Choosing the current quantity again keeps a joint named on the command line.
            if imgui.selectable(menu_title(name, skinning), name == key)[0]:
                show_scalar(state, state.options.scalar if name == key else name)
            note_item(state, f"view {name}")
            explain("", why)
    for plugin in unused_plugins():
        with disabled(state, no_mesh(state)):
            if imgui.selectable(f"{plugin.name} ({plugin.distribution})", False)[0]:
                _show_plugin(state, plugin.name)
            note_item(state, f"view {plugin.name}")
    imgui.end_combo()


@shows_errors
def _show_plugin(state: AppState, name: str) -> None:
    """Show a plug-in's quantity, whose module is now imported."""
    find_quantity(name)
    show_scalar(state, name)


def _draw_joint(state: AppState) -> None:
    """Draw the name of the joint whose weights are shown: the selected joint or an explicit one."""
    joint, named = _shown_joint(state), split_name(state.options.scalar)[1]
    if not joint:
        imgui.text_wrapped("Click the skin in the view, or a joint in the tree.")
        return
    imgui.text_wrapped(f"of {printable(joint, _LONGEST)}")
    if named and button(state, "Of the selected joint"):
        state.options.scalar = split_name(state.options.scalar)[0]
    shown = printable(joint, _LONGEST)
    explain(f"{shown} is currently shown, regardless of the selected joint" if named else "")


def _draw_fields(state: AppState, key: str) -> None:
    """Draw the list of fields if a figure has several."""
    fields = {
        field.name: field.title
        for actor in state.scene.actors
        for field in actor.figure.fields
        if bool(field.names) == (key == "class")
    }
    if len(fields) < 2:
        return
    about = split_name(state.options.scalar)[1]
    chosen = choice(state, "Field", about, fields)
    if chosen != about and (about or chosen != next(iter(fields))):
        show_scalar(state, f"{key}:{chosen}")


def _draw_range(state: AppState, key: str) -> None:
    """Draw the choice of the colour range: automatic, or fixed by two numbers."""
    options = state.options
    why = "this quantity has one colour per integer" if SCALARS[key].kind in _WHOLE else ""
    text = "the colours span all values"
    if SCALARS[key].robust:
        text = f"the colours span {TYPICAL:.0%} of the nonzero values; values outside have the end "
        text += "colours"
    if radio(state, "Automatic", options.scalar_range is None, text=text, why=why):
        options.scalar_range = None
    same_line_if_room("Fixed")
    text = "the range does not change with the pose; values outside it have the end colours"
    if radio(state, "Fixed", options.scalar_range is not None, text=text, why=why):
        # The current automatic range, in the unit of the legend.
        factor = shown_unit(options.scalar, state.actor.figure)[0]
        low, high = (float(f"{factor * end:.3g}") for end in state.stats.scalar_ends)
        options.scalar_range = options.scalar_range or (low, high)
    if options.scalar_range is not None and not why:
        low, high = options.scalar_range
        unit = shown_unit(options.scalar, state.actor.figure)[1]
        options.scalar_range = (
            _end_field(state, "From", low, unit, -math.inf, high),
            _end_field(state, "To", high, unit, low, math.inf),
        )
    draw_setting(state, "Colours", options, "colormap", why=why)


def _end_field(
    state: AppState, label: str, value: float, unit: str, above: float, below: float
) -> float:
    """Draw a field for one end of the range; the ends keep their order."""
    hidden = begin_field(label, _FIELD)
    typed = number_field(state, hidden, plain_zero(value, "%.6g"))
    note_item(state, label)
    if unit:
        imgui.same_line()
        imgui.text_disabled(unit)
    return typed if typed is not None and above < typed < below else value


def _draw_marks(state: AppState, key: str) -> None:
    """Draw the check boxes for isolines and the legend."""
    options, view = state.options, SCALARS[key]
    why = "isolines need a continuous quantity" if view.kind in _WHOLE else ""
    shown = view.isolines if options.isolines is None else options.isolines
    wanted = checkbox(state, "Isolines", shown and not why, why)
    if wanted != shown and not why:
        options.isolines = None if wanted == view.isolines else wanted
    same_line_if_room("Legend in pictures")
    text = "draw the legend into screenshots and recordings"
    draw_setting(state, "Legend in pictures", options, "legend", text)


def _draw_vertex_tools(state: AppState) -> None:
    """Draw the settings of hover text and vertex picking."""
    view, why = state.of(Weights), no_mesh(state)
    imgui.text_wrapped("Hover over a surface to see the properties of a vertex.")
    text = "Even without this panel"
    view.always_shows_info = checkbox(state, text, view.always_shows_info, why)
    view.picks_vertices = checkbox(state, "Pick vertices", view.picks_vertices, why)
    explain("click to explain a vertex; Alt+click does so at any time")
    if view.pinned is not None:
        same_line_if_room(f"Unpin {view.pinned.vertex}")
        if button(state, f"Unpin {view.pinned.vertex}###unpin"):
            unpin(state)


def no_view(state: AppState, key: str) -> str:
    """Return why a key of ``SCALARS`` cannot be shown; its joint or field may yet be chosen."""
    figures = [actor.figure for actor in state.scene.actors if actor.figure.mesh is not None]
    if not figures:
        return "there is no mesh"
    lacks = [missing_part(key, figure) for figure in figures]
    if not all(lacks) or (SCALARS[key].takes_joint and "a selected joint" in lacks):
        return ""
    return f"no figure in the scene has {lacks[0]}"


def start_heat_map(state: AppState) -> None:
    """Show a scalar quantity as colours; choices that would show nothing are replaced."""
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


def _shown_joint(state: AppState) -> str:
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
    joint = _shown_joint(state)
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
    """Pin a vertex, and explain it in the Vertex panel."""
    figure = state.scene.actors[actor].figure
    if not figure.is_attached:
        state.say_status("This figure has no skin attached to a skeleton: no influences to explain")
        return
    state.of(Weights).pinned = _Pinned(actor, figure, vertex)
    show_panel(state, "vertex")


def unpin(state: AppState) -> None:
    """Unpin the vertex, and close the Vertex panel."""
    set_open(state, "vertex", False)
    view = state.of(Weights)
    view.pinned = view.explanation = view.explanation_key = None
    view.annotations, view.annotation_key = (), None


def explained(state: AppState) -> Explanation | None:
    """Return the pinned vertex's explanation in the current pose; None if none is pinned."""
    view, actors = state.of(Weights), state.scene.actors
    pinned = view.pinned
    if pinned is None:
        return None
    if not is_open(state, "vertex"):
        unpin(state)  # the user has closed the panel
        return None
    is_there = pinned.actor < len(actors) and actors[pinned.actor].figure is pinned.figure
    pose = actors[pinned.actor].own_pose if is_there else None
    if pose is None:
        unpin(state)
        return None
    key = (pinned, pose_key(pose), repr(state.options.skinning))
    if key != view.explanation_key:
        try:
            view.explanation = explain_vertex(
                pinned.figure, pose, state.options.skinning, pinned.vertex
            )
        except ViewerError as problem:  # the figure's shapes cannot be read
            state.error = str(problem)
            unpin(state)
            return None
        view.explanation_key = key
    return view.explanation
