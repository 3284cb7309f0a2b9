"""Parts of figures that formats cannot store."""

from __future__ import annotations

from collections.abc import Sequence

from viewer.diagnostics import Diagnostic, Phrase
from viewer.rig.figure import Figure


def extra_parts(figure: Figure) -> list[Phrase]:
    """Return the parts of a figure other than mesh, skeleton, skin and shapes."""
    extras = {
        "part-body-parts": figure.body_parts,
        "part-keypoints": figure.keypoints,
        "part-symmetry": figure.symmetry,
        "part-reduced": figure.reduced,
        "part-regressor": figure.joint_regressor,
    }
    return [Phrase(name) for name, part in extras.items() if part is not None]


def not_held_note(kind: str, parts: Sequence[Phrase]) -> list[Diagnostic]:
    """Return a note that lists the parts that a format cannot store, if there are any."""
    return [Diagnostic("X003.parts", values={"format": kind, "parts": parts})] if parts else []
