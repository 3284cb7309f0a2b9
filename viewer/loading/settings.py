"""What may be asked for when motions are opened."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["MotionSettings"]


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """How motions are read and what they move; the defaults are what their files say.

    Attributes
    ----------
    model : Path or None
        The figure that captured bodies are drawn with, and that BVH drives; None for one among
        the files, or for captures the bundled body.
    frame_rate : float or None
        Frames a second; None for the file's own, or 30 where it does not say.
    up : "y", "z", "-y", "-z" or ""
        The axis that points up in captures and BVH; empty to judge by the bodies.
    unit : str
        Of BVH lengths, which then become metres: a key of ``viewer.rig.units.METRES``; empty to
        judge by the skeleton's size.
    flat_hands : bool or None
        Whether hand components leave the mean hand out; None for the model's custom.
    layout : str
        What captured keypoints are, a title of ``viewer.rig.captures.keypoint_layouts``; empty to
        judge by their number.
    legacy_expression : bool
        Whether expressions drive SMPL-X columns 10 to 19, as EasyMocap has it.
    drives : bool
        Whether a BVH drives a figure that is opened with it, instead of standing beside it.
    """

    model: Path | None = None
    frame_rate: float | None = None
    up: str = ""
    unit: str = ""
    flat_hands: bool | None = None
    layout: str = ""
    legacy_expression: bool = False
    drives: bool = True
