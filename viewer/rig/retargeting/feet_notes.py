"""Messages about the feet of driven figures."""

from __future__ import annotations

from viewer.diagnostics import Diagnostic
from viewer.rig.figure import Figure
from viewer.rig.retargeting.planted_feet import PlantedFeet
from viewer.rig.retargeting.retarget import Retargeted
from viewer.rig.scalars import length_text

__all__ = ["feet_notes"]

_ROUNDING = 1e-6  # length below which 0 is shown, as a fraction of the body's height


def feet_notes(changes: PlantedFeet | None, found: Retargeted, figure: Figure) -> list[Diagnostic]:
    """Return messages about the changes made by planting the feet.

    Parameters
    ----------
    changes : PlantedFeet or None
        The changes.
    found : Retargeted
        The retargeting.
    figure : Figure
        The driven figure.
    """
    if changes is None:
        return []
    called = {"motion": found.source.figure.name, "figure": figure.name}
    if not changes.is_better:
        key = "F007.feet-kept" if changes.n_contacts else "F007.feet-no-contacts"
        return [Diagnostic(key, values=called)]

    def text(length: float) -> str:
        return length_text(figure, length if length > _ROUNDING * changes.size else 0.0)

    values = {
        **called,
        "n": changes.n_contacts,
        "source": text(changes.source),
        "before": text(changes.before),
        "after": text(changes.after),
    }
    notes = [Diagnostic("F007.feet-planted", values=values)]
    own = {"figure": figure.name}
    gaps = own | {"gap_before": text(changes.gap_before), "gap": text(changes.gap_after)}
    notes.append(Diagnostic("F007.feet-gap", values=gaps))
    if changes.lowered > _ROUNDING * changes.size:
        length = text(changes.lowered)
        notes.append(Diagnostic("F007.feet-lowered", values=own | {"length": length}))
    if changes.ground_speed:
        speed = f"{text(changes.ground_speed)}/s"
        notes.append(Diagnostic("F007.feet-ground", values=own | {"speed": speed}))
    return notes
