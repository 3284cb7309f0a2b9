"""Actions that change how the scene is drawn."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.view.axis_gizmo import AxisGizmo
from viewer.app.weights.actions import start_heat_map
from viewer.rendering.options import BONES, SHOWN, Lights

__all__ = [
    "reset_lights",
    "set_shading",
    "show",
    "show_bones",
    "toggle_binding",
    "toggle_gizmo",
    "toggle_option",
    "toggle_skeleton",
]


def toggle_skeleton(state: AppState) -> None:
    """Show or hide the skeleton together with the skin."""
    shown = {"skin": "both", "both": "skin", "skeleton": "skin", "binding": "skeleton"}
    show(state, shown[state.options.show])


def toggle_binding(state: AppState) -> None:
    """Switch between the posed skin and the skin in its bind pose."""
    show(state, "skin" if state.options.show == "binding" else "binding")


def show(state: AppState, what: str) -> None:
    """Choose the visible parts, a key of ``SHOWN``, and show a status message."""
    state.options.show = what
    state.say_status(SHOWN[what])


def set_shading(state: AppState, name: str) -> None:
    """Choose the shading, a key of ``SHADING_CHOICES``, and a scalar quantity if needed."""
    state.options.shading = name
    if name == "scalar":
        start_heat_map(state)


def toggle_option(state: AppState, name: str, text: str) -> None:
    """Toggle a display option, and show its new state."""
    value = not getattr(state.options, name)
    setattr(state.options, name, value)
    state.say_status(f"{text} {'on' if value else 'off'}")


def show_bones(state: AppState, style: str) -> None:
    """Choose the style of skeletons, a key of ``BONES``, and show a status message."""
    state.options.bones = style
    state.say_status(f"Bones: {BONES[style].lower()}")


def toggle_gizmo(state: AppState) -> None:
    """Show or hide the axis gizmo of the view."""
    gizmo = state.of(AxisGizmo)
    gizmo.is_shown = not gizmo.is_shown
    state.say_status(f"Axis gizmo {'on' if gizmo.is_shown else 'off'}")


def reset_lights(state: AppState) -> None:
    """Reset both lights, the ambient light and the highlight to their defaults."""
    state.options.lights = Lights()
