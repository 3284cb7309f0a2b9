"""Style of a drawn skeleton, and its opacity over a skin."""

from __future__ import annotations

from viewer.rendering.options import OPACITIES, DisplayOptions
from viewer.rig.skeleton import Skeleton

__all__ = ["bone_style", "skeleton_opacity"]


def bone_style(skeleton: Skeleton, options: DisplayOptions) -> str:
    """Return the style of a drawn skeleton, a key of ``BONES`` other than ``"auto"``."""
    if options.bones != "auto":
        return options.bones
    return "octahedra" if skeleton.boxes is None or skeleton.boxes_from_bones else "boxes"


def skeleton_opacity(skeleton: Skeleton, options: DisplayOptions) -> float:
    """Return the opacity of a skeleton that is drawn over a skin, 0 to 1."""
    if options.skeleton_opacity is not None:
        return options.skeleton_opacity
    return OPACITIES[bone_style(skeleton, options)]
