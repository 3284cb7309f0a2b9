"""Figures whose feet or hands are not below their limbs, as if they were.

Rigs that were exported with the controls of their animators have feet that are joints of the root,
where inverse kinematics used to hold them; after the export, nothing connects them to the shins.
A motion is retargeted to the same joints in the hierarchy of a body, in which feet follow their
legs, and then expressed in the hierarchy of the file: joints that were moved get translations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.feet.body import is_solvable
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import conjugate, multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.hierarchy import depth_first, path_to_root
from viewer.rigs.kinematics import joint_worlds, world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.pose import zero_pose
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton, joint_labels

# Joints of a body, each with the joint below which it hangs; upper ones first.
_LIMBS = (
    ("hip", "pelvis"), ("knee", "hip"), ("ankle", "knee"), ("foot", "ankle"),
    ("elbow", "shoulder"), ("wrist", "elbow"), ("hand", "wrist"),
)  # fmt: skip

_found: Memo[Figure, LimbFigure | None] = Memo()


@dataclass(frozen=True, slots=True, eq=False)
class LimbFigure:
    """A figure in the hierarchy of a body, and how its joints are numbered."""

    figure: Figure
    """The figure; joints of limbs are below the joints to which they belong."""
    order: Ints
    """(J,). Joint of the original figure for each joint."""

    def renamed(self, joint_map: JointMap | None, original: Figure) -> JointMap | None:
        """Return a map of the original figure's joints for this one, in which labels may differ."""
        if joint_map is None:
            return None
        before = joint_labels(original.require_skeleton())
        after = joint_labels(self.figure.require_skeleton())
        labels = {before[old]: after[new] for new, old in enumerate(self.order.tolist())}
        pairs = tuple((labels.get(mine, mine), theirs) for mine, theirs in joint_map.pairs)
        return replace(joint_map, pairs=pairs)

    def original_clip(self, clip: SampledClip, original: Figure) -> SampledClip:
        """Return a clip of this figure as one of the original, with the same world matrices."""
        mine, theirs = self.figure.require_skeleton(), original.require_skeleton()
        place = np.argsort(self.order)
        none = np.zeros_like(clip.rotations[..., :3])
        shifts = none if clip.translations is None else clip.translations
        turns = quaternion_to_matrix(clip.rotations) * mine.rest_scales[:, None, :]
        worlds = joint_worlds(mine.parents, turns, mine.rest_translations + shifts)
        rotations, offsets = clip.rotations[:, place], shifts[:, place].copy()
        spun = clip.rotations.copy()
        for joint, parent in enumerate(mine.parents):
            if parent >= 0:
                spun[:, joint] = multiply(spun[:, parent], spun[:, joint])
        for joint, parent in enumerate(theirs.parents.tolist()):
            new = int(place[joint])
            above = int(place[parent]) if parent >= 0 else -1
            if int(mine.parents[new]) == above:
                continue
            # With the worlds W of the joint and P of its parent, the local matrix is P^-1 W.
            local, rotation = worlds[:, new, :3, 3], spun[:, new]
            if above >= 0:
                away = (local - worlds[:, above, :3, 3])[..., None]
                local = (np.linalg.inv(worlds[:, above, :3, :3]) @ away)[..., 0]
                rotation = multiply(conjugate(spun[:, above]), rotation)
            offsets[:, joint] = local - theirs.rest_translations[joint]
            rotations[:, joint] = rotation
        moved = offsets if offsets.any() else None
        return replace(clip, rotations=rotations, translations=moved)


def limb_figure(figure: Figure) -> LimbFigure | None:
    """Return a figure with its limbs connected; None if they are, or cannot be."""
    return _found.get(figure, None, lambda: _limb_figure(figure))


def _limb_figure(figure: Figure) -> LimbFigure | None:
    skeleton = figure.require_skeleton()
    if skeleton.posing is not None or skeleton.constraints or skeleton.humanoid is not None:
        return None
    parents = limb_parents(skeleton)
    moved = np.flatnonzero(parents != skeleton.parents)
    if not len(moved) or figure.joint_regressor is not None:
        return None
    world = world_matrices(skeleton, zero_pose(skeleton))
    if not is_solvable(world[:, :3, :3]):
        return None
    order = depth_first(parents)
    place = np.argsort(order).astype(np.int32)
    above = parents[order]
    offsets, rotations, scales = _rests(skeleton, parents, moved.tolist(), world)
    built = Skeleton(
        names=tuple(skeleton.names[joint] for joint in order),
        parents=np.where(above >= 0, place[above], -1),
        rest_translations=offsets[order],
        rest_rotations=rotations[order],
        rest_scales=scales[order],
        dof_joints=place[skeleton.dof_joints],
        dof_kinds=skeleton.dof_kinds,
        rest_dofs=skeleton.rest_dofs,
        dof_limits=skeleton.dof_limits,
        auxiliary=None if skeleton.auxiliary is None else skeleton.auxiliary[order],
    )
    skin = figure.skin
    if skin is not None:
        skin = replace(skin, joints=place[skin.joints], inverse_bind=skin.inverse_bind[order])
    plain = replace(figure, skeleton=built, skin=skin, animations=(), record=None, pose_layout=None)
    return LimbFigure(plain, order)


def limb_parents(skeleton: Skeleton) -> Ints:
    """Return the parents (J,), with joints of limbs below those to which they belong."""
    names, parents = joint_meanings(skeleton), skeleton.parents.copy()
    place = {name: joint for joint, name in enumerate(names) if name}
    for side in ("left", "right"):
        for part, upper in _LIMBS:
            joint = place.get(f"{side}_{part}", -1)
            above = place.get(upper if upper == "pelvis" else f"{side}_{upper}", -1)
            # A limb that ends in the joint below which it should hang is not that of a body.
            if min(joint, above) < 0 or joint in path_to_root(parents, above):
                continue
            if above not in path_to_root(parents, joint):
                parents[joint] = above
    return parents


def _rests(
    skeleton: Skeleton, parents: Ints, moved: list[int], world: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return rest translations, rotations and scales relative to other parents."""
    offsets, scales = skeleton.rest_translations.copy(), skeleton.rest_scales.copy()
    rotations = skeleton.rest_rotations.copy()
    for joint in moved:
        local = np.linalg.solve(world[parents[joint]], world[joint])
        factor = np.linalg.norm(local[:3, 0])
        offsets[joint], scales[joint] = local[:3, 3], factor
        rotations[joint] = matrix_to_quaternion(local[:3, :3] / factor)
    return offsets, rotations, scales
