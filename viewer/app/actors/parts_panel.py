"""Parts panel: visibility of the parts of the chosen actor's mesh."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    button,
    explain,
    menu_item,
    note_item,
    same_line_if_room,
    visible_rows,
)
from viewer.phrases import printable
from viewer.rigs.scene import Actor

_LONGEST = 60  # maximum length of a name in characters


def draw(state: AppState) -> None:
    """Draw the panel."""
    actor = state.actor
    count = len(actor.figure.require_mesh().parts)
    hidden = len(actor.hidden_parts)
    if button(state, "Show all", "" if hidden else "no part is hidden"):
        show_all_parts(state)
    same_line_if_room("Invert")
    if button(state, "Invert"):
        actor.hidden_parts = frozenset(range(count)) - actor.hidden_parts
    imgui.same_line()
    imgui.text_disabled(f"{count - hidden} of {count} shown" if hidden else f"{count} parts")
    for part in visible_rows(count, imgui.get_frame_height_with_spacing()):
        # Draw the check box of one part; a right-click opens a menu.
        imgui.push_id(part)
        shown = part not in actor.hidden_parts
        label = printable(part_label(actor, part), _LONGEST)
        changed, wanted = imgui.checkbox(label, shown)
        note_item(state, f"part {part}")
        if changed:
            set_part_shown(actor, part, wanted)
        explain("show or hide this part; right-click for more")
        if imgui.begin_popup_context_item("part menu"):
            if menu_item(state, "Show only this part"):
                isolate_part(actor, part)
            why = "" if actor.hidden_parts else "no part is hidden"
            if menu_item(state, "Show all parts", why=why):
                show_all_parts(state)
            imgui.end_popup()
        imgui.pop_id()


def part_label(actor: Actor, part: int) -> str:
    """Return a part's name or number, followed by its view if it is drawn in only one."""
    mesh = actor.figure.require_mesh()
    view = mesh.part_views[part] if mesh.part_views else "both"
    note = f" ({view.replace('-', ' ')} only)" if view.endswith("person") else ""
    return (mesh.parts[part] or f"part {part}") + note


def set_part_shown(actor: Actor, part: int, shown: bool) -> None:
    """Show or hide one part of an actor."""
    one = frozenset({part})
    actor.hidden_parts = actor.hidden_parts - one if shown else actor.hidden_parts | one


def isolate_part(actor: Actor, part: int) -> None:
    """Hide all other parts of an actor."""
    count = len(actor.figure.require_mesh().parts)
    actor.hidden_parts = frozenset(range(count)) - {part}


def show_all_parts(state: AppState) -> None:
    """Show all parts of the chosen actor."""
    state.actor.hidden_parts = frozenset()
