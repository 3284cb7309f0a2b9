"""What the numbers of a scalar quantity are computed from."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rig.figure import Figure
from viewer.rig.pose import Pose
from viewer.rig.skin import Skin
from viewer.rig.skinning import Skinning, skin_used

_FOUR = 4  # influences of most engines, if no other number is chosen


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A figure as it is drawn, and the joint that a quantity is about.

    Attributes
    ----------
    figure : Figure
        Has what the quantity needs.
    pose : Pose or None
        Never None for quantities that depend on the pose.
    skinning : Skinning
        How the mesh is drawn.
    joint : int
        Of the skin, -1 for quantities that are about no joint.
    about : str
        What the quantity's name says behind its colon.
    """

    figure: Figure
    pose: Pose | None
    skinning: Skinning
    joint: int = -1
    about: str = ""

    @property
    def skin(self) -> Skin:
        """The influences that count: all as stored, or cut and scaled as asked."""
        return skin_used(self.figure.require_skin(), self.skinning)


def influences_kept(skinning: Skinning) -> int:
    """Return to how many influences a figure is compared: as many as are chosen, else four."""
    return skinning.max_influences or _FOUR
