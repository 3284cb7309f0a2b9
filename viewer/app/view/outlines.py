"""Outlines of the parts that are selected in the window or are under the pointer."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.view.hovering import Hovered
from viewer.app.weights.state import Weights
from viewer.data_classes import dataclass
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rendering.visibility import shows_skeleton
from viewer.rig.geometry.transform import apply_transform

__all__ = ["Outlines", "outlined_parts", "toggle_outlines"]


@dataclass(slots=True)
class Outlines:
    """State of the outlines.

    Attributes
    ----------
    is_shown : bool
        Whether outlines are drawn in the window.
    """

    is_shown: bool = True


def toggle_outlines(state: AppState) -> None:
    """Show or hide the outlines of the window."""
    outlines = state.of(Outlines)
    outlines.is_shown = not outlines.is_shown
    state.say_status(f"Selection outlines {'on' if outlines.is_shown else 'off'}")


def outlined_parts(state: AppState) -> tuple[Outlined, ...]:
    """Return the outlines of the current frame.

    The selected joint is outlined if the skeleton is drawn; otherwise, the actor is outlined if the
    user chose it among several. The pinned vertex and the item under the pointer are also outlined.
    """
    if not state.of(Outlines).is_shown:
        return ()
    hovered, chosen, joint = state.of(Hovered), state.chosen_actor, state.selected_joint
    found = []
    if joint >= 0 and shows_skeleton(state.actor, state.options):
        found.append(Outlined(chosen, joint))
    elif state.is_actor_selected and len(state.scene.actors) > 1:
        found.append(Outlined(chosen))
    if hovered.joint >= 0 and hovered.joint != joint:
        found.append(Outlined(chosen, hovered.joint, is_hovered=True))
    elif hovered.actor >= 0 and (hovered.actor != chosen or not state.is_actor_selected):
        found.append(Outlined(hovered.actor, is_hovered=True))
    return (*found, *_pinned(state))


def _pinned(state: AppState) -> list[Outlined]:
    """Return the outline of the pinned vertex, if it is drawn."""
    weights = state.of(Weights)
    pinned, explanation = weights.pinned, weights.explanation
    if pinned is None or explanation is None or state.options.show == "binding":
        return []
    if pinned.actor >= len(state.scene.actors) or not weights.annotations:
        return []
    actor = state.scene.actors[pinned.actor]
    return [
        Outlined(pinned.actor, points=apply_transform(actor.placement, explanation.position)[None])
    ]
