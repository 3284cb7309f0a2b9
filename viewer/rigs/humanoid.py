"""Humanoids: joints by the standard names of human bones in VRM files."""

from __future__ import annotations

from collections.abc import Container, Mapping
from functools import cache

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


_FINGERS = ("Index", "Middle", "Ring", "Little")
_ABOVE = {
    **{"spine": "hips", "chest": "spine", "upperChest": "chest", "neck": "spine", "head": "spine"},
    **{"UpperLeg": "hips", "LowerLeg": "UpperLeg", "Foot": "LowerLeg", "Toes": "Foot"},
    **{"Shoulder": "spine", "UpperArm": "spine", "LowerArm": "UpperArm", "Hand": "LowerArm"},
    **{"Eye": "head", "jaw": "head"},
    **{"ThumbMetacarpal": "Hand", "ThumbProximal": "ThumbMetacarpal"},
    "ThumbDistal": "ThumbProximal",
    **{f"{finger}Proximal": "Hand" for finger in _FINGERS},
    **{f"{finger}Intermediate": f"{finger}Proximal" for finger in _FINGERS},
    **{f"{finger}Distal": f"{finger}Intermediate" for finger in _FINGERS},
}
"""Required ancestor of each bone, without its side."""
_ALL_ABOVE = {
    **{"neck": "upperChest", "leftShoulder": "upperChest", "rightShoulder": "upperChest"},
    **{"head": "neck", "leftUpperArm": "leftShoulder", "rightUpperArm": "rightShoulder"},
}
"""Ancestors of bones in a complete skeleton, where optional bones are between required ones."""


def bone_above(bone: str) -> str:
    """Return the required ancestor of a bone; empty for the hips, and for names that are none."""
    side = next((side for side in ("left", "right") if bone.startswith(side)), "")
    found = _ABOVE.get(bone.removeprefix(side), "")
    return f"{side}{found}" if found[:1].isupper() else found


def parent_bone(bone: str, bones: Container[str]) -> str:
    """Return the nearest ancestor of a bone among some bones; empty if there is none."""
    return next((above for above in ancestors_of(bone) if above in bones), "")


@cache
def ancestors_of(bone: str) -> tuple[str, ...]:
    """Return the ancestors of a bone in a complete skeleton, nearest first."""
    above = _ALL_ABOVE.get(bone) or bone_above(bone)
    return (above, *ancestors_of(above)) if above else ()


@dataclass(frozen=True, slots=True, eq=False)
class Humanoid:
    """Joints of a figure by the standard names of human bones."""

    joints: Mapping[str, int]
    """Bones of VRM 1.0 (``"hips"``, ``"leftUpperArm"`` ...) and the joint of each."""
