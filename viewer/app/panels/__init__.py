"""Panels: one module each with ``draw(state)``, docked where the table says."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

__all__ = ["PANELS", "Panel", "panel_module"]


@dataclass(frozen=True, slots=True)
class Panel:
    """What the layout must know of a panel.

    Attributes
    ----------
    title : str
        Of its tab.
    place : str
        At first: ``"left"``, ``"bottom"``, or ``"right 1"`` to ``"right 3"`` downwards.
    needs : str
        A part of ``Figure`` without which the panel is left out; ``"motion"`` or ``"actors"``:
        something that moves, or that or several actors; empty for nothing.
    leads : bool
        Whether it comes to the front of its tabs when a scene brings it.
    on_demand : bool
        Whether it is closed until somebody asks for it.
    """

    title: str
    place: str
    needs: str = ""
    leads: bool = False
    on_demand: bool = False


PANELS = {
    "joints": Panel("Joints", "left"),
    "shape": Panel("Shape", "left", needs="blend_shapes"),
    "hands": Panel("Hands", "left", needs="hands"),
    "vertex": Panel("Vertex", "left", on_demand=True),
    "lint": Panel("Lint", "left", on_demand=True),
    "rig": Panel("Rig", "left", on_demand=True),
    "display": Panel("Display", "right 1"),
    "skinning": Panel("Skinning", "right 1"),
    "weights": Panel("Weights", "right 1"),
    "camera": Panel("Camera", "right 2"),
    "lights": Panel("Lights", "right 2"),
    "stats": Panel("Stats", "right 3"),
    "actors": Panel("Actors", "right 3", needs="actors"),
    "timeline": Panel("Timeline", "bottom", needs="motion", leads=True),
    "curves": Panel("Curves", "bottom", needs="motion"),
}
"""Modules in this folder."""


def panel_module(name: str) -> ModuleType:
    """Return a panel's module, imported on first use."""
    return import_module(f"{__name__}.{name}")
