"""The inputs of a scalar quantity."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass
from viewer.rigs.figure import Figure
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import shown_joint_of
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import Skinning, skin_used

if TYPE_CHECKING:
    from viewer.rigs.annotations import VertexField

_FOUR = 4  # maximum number of influences per vertex in most engines


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A figure as it is drawn, and the joint or field of the quantity."""

    figure: Figure
    """Figure with the part that the quantity needs."""
    pose: Pose | None
    """Pose; not None for quantities that depend on it."""
    skinning: Skinning
    """Skinning options of the drawn mesh."""
    joint: int = -1
    """Index of a joint of the skin, -1 for quantities without a joint."""
    about: str = ""
    """Joint or field after the colon of the quantity's name."""

    @property
    def skin(self) -> Skin:
        """Influences as stored, or pruned and normalised; auxiliary joints count as those shown."""
        skin, skeleton = skin_used(self.figure.require_skin(), self.skinning), self.figure.skeleton
        if skeleton is None or skeleton.auxiliary is None:
            return skin
        return replace(skin, joints=shown_joint_of(skeleton)[skin.joints])


def influences_kept(skinning: Skinning) -> int:
    """Return the number of influences for the comparison: the chosen limit, or four."""
    return skinning.max_influences or _FOUR


def field_of(figure: Figure, name: str, is_class: bool) -> VertexField | None:
    """Return a figure's field or class by its case-insensitive name; if empty, the first one."""
    suited = [field for field in figure.fields if bool(field.names) == is_class]
    named = [field for field in suited if not name or field.name.lower() == name.lower()]
    return named[0] if named else None
