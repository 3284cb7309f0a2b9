"""Humanoids: joints by the standard names of human bones in VRM files."""

from __future__ import annotations

from collections.abc import Mapping

from viewer.data_classes import dataclass

SPINE_BONES = ("spine", "chest", "upperChest")
"""Bones of the spine, from the hips upwards; all but the first may be missing."""


def _human_bones() -> dict[str, str]:
    """Return the SMPL name of every bone, except for spine bones."""
    limbs = {
        **{"UpperLeg": "hip", "LowerLeg": "knee", "Foot": "ankle", "Toes": "foot"},
        **{"Shoulder": "collar", "UpperArm": "shoulder", "LowerArm": "elbow", "Hand": "wrist"},
        "Eye": "eye",
    }
    thumb = {"ThumbMetacarpal": "thumb1", "ThumbProximal": "thumb2", "ThumbDistal": "thumb3"}
    phalanges = {"Proximal": 1, "Intermediate": 2, "Distal": 3}
    fingers = {
        f"{bone}{phalanx}": f"{name}{number}"
        for bone, name in (
            *(("Index", "index"), ("Middle", "middle")),
            *(("Ring", "ring"), ("Little", "pinky")),
        )
        for phalanx, number in phalanges.items()
    }
    sided = {**limbs, **thumb, **fingers}
    return {
        **{"hips": "pelvis", "neck": "neck", "head": "head", "jaw": "jaw"},
        **{
            f"{side}{bone}": f"{side}_{name}"
            for side in ("left", "right")
            for bone, name in sided.items()
        },
    }


HUMAN_BONES: dict[str, str] = _human_bones()
"""SMPL name of every bone of VRM 1.0, except for spine bones."""


_LIMBS = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
REQUIRED_BONES = (
    *("hips", "spine", "head"),
    *(f"{side}{limb}" for side in ("left", "right") for limb in _LIMBS),
)
"""Bones that every VRM character must have."""


@dataclass(frozen=True, slots=True, eq=False)
class Humanoid:
    """Joints of a figure by the standard names of human bones."""

    joints: Mapping[str, int]
    """Bones of VRM 1.0 (``"hips"``, ``"leftUpperArm"`` ...) and the joint of each."""
