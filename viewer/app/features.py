"""The table of panels: each is a module of its feature's folder with ``draw(state)``."""

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
    feature : str
        The folder with the panel's module, ``<name>_panel.py``.
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

    feature: str
    title: str
    place: str
    needs: str = ""
    leads: bool = False
    on_demand: bool = False


PANELS = {
    "joints": Panel("posing", "Joints", "left"),
    "shape": Panel("posing", "Shape", "left", needs="blend_shapes"),
    "hands": Panel("posing", "Hands", "left", needs="hands"),
    "vertex": Panel("weights", "Vertex", "left", on_demand=True),
    "lint": Panel("linting", "Lint", "left", on_demand=True),
    "rig": Panel("rigging", "Rig", "left", on_demand=True),
    "display": Panel("view", "Display", "right 1"),
    "skinning": Panel("view", "Skinning", "right 1"),
    "weights": Panel("weights", "Weights", "right 1"),
    "camera": Panel("view", "Camera", "right 2"),
    "lights": Panel("view", "Lights", "right 2"),
    "stats": Panel("view", "Stats", "right 3"),
    "actors": Panel("actors", "Actors", "right 3", needs="actors"),
    "timeline": Panel("playback", "Timeline", "bottom", needs="motion", leads=True),
    "curves": Panel("curves", "Curves", "bottom", needs="motion"),
}
"""In the order in which they are docked and listed in the menu."""


def panel_module(name: str) -> ModuleType:
    """Return a panel's module, imported on first use."""
    return import_module(f"viewer.app.{PANELS[name].feature}.{name}_panel")
