"""Human bones of a figure, as VRM 1.0 requires them."""

from __future__ import annotations

from collections.abc import Mapping

from viewer.diagnostics import note
from viewer.errors import RigError
from viewer.phrases import counted, listed
from viewer.rigs.figure import Figure
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.humanoid import HUMAN_BONES, REQUIRED_BONES, SPINE_BONES, bone_above
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton


def human_bones(figure: Figure) -> dict[str, int]:
    """Return each human bone's joint, without optional bones in places that VRM does not allow."""
    skeleton = figure.require_skeleton()
    found = dict(skeleton.humanoid.joints) if skeleton.humanoid is not None else _named(skeleton)
    # Bones below an omitted bone are omitted, too, in whatever order the file lists them.
    while misplaced := [bone for bone in found if not _is_allowed(skeleton, found, bone)]:
        for bone in misplaced:
            del found[bone]
    missing = [bone for bone in REQUIRED_BONES if bone not in found]
    if missing:
        values = {
            "figure": figure.name,
            "names": listed(missing, 12),
            "n": counted(len(missing), "required human bone"),
        }
        raise RigError(
            note(
                "F004.vrm-bones: {figure} cannot be written as VRM: {n} not found: {names}",
                **values,
            )
        )
    return found


def is_humanoid(figure: Figure) -> bool:
    """Return whether a figure with a skeleton has all required human bones."""
    try:
        return bool(human_bones(figure))
    except RigError:
        return False


def _named(skeleton: Skeleton) -> dict[str, int]:
    """Return the bones that joint names imply; hips, legs and arms are needed for a humanoid."""
    joints = {name: joint for joint, name in enumerate(joint_meanings(skeleton)) if name}
    found = {bone: joints[name] for bone, name in HUMAN_BONES.items() if name in joints}
    spine = [joints[name] for name in ("spine1", "spine2", "spine3") if name in joints]
    return found | dict(zip(SPINE_BONES, spine, strict=False))


def _is_allowed(skeleton: Skeleton, bones: Mapping[str, int], bone: str) -> bool:
    """Return whether a bone is below its required ancestor."""
    above = bone_above(bone)
    is_known = above in bones or above in REQUIRED_BONES
    ancestors = path_to_root(skeleton.parents, bones[bone])[1:]
    return not above or (is_known and bones.get(above, -1) in (*ancestors, -1))
