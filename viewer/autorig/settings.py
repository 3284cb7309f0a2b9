"""What may be asked for when a rig is carried over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.errors import RigError

__all__ = ["JOINTS", "METHODS", "Report", "TransferSettings"]

Report = Callable[[float, str], None]
"""Told the share that is done and what is being done; may raise to cancel."""

METHODS = {
    "robust": "closest surface points, checked, the rest filled in (Abdrashitov et al. 2023)",
    "nearest": "boxes laid onto each other, nearest vertices, joints copied (Tex-An Mesh)",
}
"""What menus and the command line offer."""

JOINTS = ("carried", "copied")
"""Joints moved as the surface around them, or with the alignment alone."""


@dataclass(frozen=True, slots=True, eq=False)
class TransferSettings:
    """How a rig is carried over.

    Attributes
    ----------
    method : str
        A key of ``METHODS``; all else is for ``"robust"``.
    alignment : AlignmentSettings
        What is known of how the meshes lie.
    weights : WeightSettings
        When a vertex matches; smoothing; number of influences.
    joints : str
        One of ``JOINTS``.
    fits : bool
        Whether the template's joints are turned and its limbs resized, where it stands otherwise
        than the target or has other proportions.
    correctives : bool
        Whether pose correctives of the template are carried.
    mends : bool
        Whether the surroundings of singular vertices are smoothed.
    """

    method: str = "robust"
    alignment: AlignmentSettings = field(default_factory=AlignmentSettings)
    weights: WeightSettings = field(default_factory=WeightSettings)
    joints: str = "carried"
    fits: bool = True
    correctives: bool = True
    mends: bool = True

    def __post_init__(self) -> None:
        for name, known in (("method", tuple(METHODS)), ("joints", JOINTS)):
            if getattr(self, name) not in known:
                raise RigError(
                    f'{name}: expected {" or ".join(known)}, found "{getattr(self, name)}"'
                )
