"""Actions on the parts of an actor's mesh: hide, isolate, show."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rig.scene import Actor

__all__ = ["isolate_part", "part_label", "set_part_shown", "show_all_parts"]


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
