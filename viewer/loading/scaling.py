"""Scaling of actors to one unit of length.

Placement needs it before any capture is read, and captured people, which are built later, too.
"""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.rigs.arrays import Floats
from viewer.rigs.scene import Actor
from viewer.rigs.units import METRES, UNIT_NAMES


def scale_to_unit(actor: Actor, unit: str) -> list[Diagnostic]:
    """Scale an actor to a unit; return a note if both units are known and differ."""
    own = known_unit(actor)
    if not unit or own in ("", unit):
        return []
    factor = METRES[own] / METRES[unit]
    actor.placement = scaling(factor) @ actor.placement
    values = {"figure": actor.name, "unit": UNIT_NAMES[own], "wanted": UNIT_NAMES[unit]}
    return [
        note(
            "F007.unit-matched: {figure} is in {unit}: scaled by {factor:g} to match the "
            "scene, which is in {wanted}",
            **values,
            factor=factor,
        )
    ]


def scaling(factor: float) -> Floats:
    """Return the matrix of a uniform scale: (4, 4)."""
    return np.diag([factor, factor, factor, 1.0])


def known_unit(actor: Actor) -> str:
    """Return the unit of an actor; empty if it is unknown."""
    if actor.figure.points is not None:  # captured keypoints
        return "m"
    return actor.figure.unit if actor.figure.unit in METRES else ""
