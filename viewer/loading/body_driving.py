"""Motions of captured bodies on characters with other joints, such as VRM and Mixamo figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.joint_map import JointMap


def with_joints(body: Figure, names: Sequence[str]) -> Figure:
    """Return a body without its mesh that has all joints of a motion, to drive other figures."""
    # Joints that the body lacks, such as the fingers of SMPL+H, are at the positions of their
    # parents. Bones without a length have no direction: the joints that they drive keep the shape
    # of their own hand, and get the rotations relative to a flat one. Names of no member of the
    # family are ignored.
    skeleton = body.require_skeleton()
    own, parents = [*skeleton.names], [*skeleton.parents.tolist()]
    for member in FAMILY.values():
        for name, parent in zip(member.names, member.parents, strict=True):
            if name in names and name not in own and member.names[parent] in own:
                parents.append(own.index(member.names[parent]))
                own.append(name)
    count = len(own) - skeleton.n_joints
    extended = replace(
        skeleton,
        names=tuple(own),
        parents=np.array(parents, dtype=np.int32),
        rest_translations=np.concatenate([skeleton.rest_translations, np.zeros((count, 3))]),
        rest_rotations=np.concatenate(
            [skeleton.rest_rotations, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))]
        ),
        rest_scales=np.concatenate([skeleton.rest_scales, np.ones((count, 3))]),
        boxes=None,
    )
    space = body.shape_space
    return Figure(body.name, skeleton=extended, up=body.up, unit=body.unit, shape_space=space)


def body_drive(
    body: Figure,
    clip: SampledClip,
    up: str,
    joint_map: JointMap | None = None,
    plants_feet: bool = True,
    keeps_hands: bool = True,
) -> Drive:
    """Return a body's motion as one that drives figures; ``up``: its world's axis, y, z, -y, -z."""
    moving = Figure(clip.name, skeleton=body.skeleton, up="z" if up.endswith("z") else "y")
    return Drive(
        SkeletonMotion(moving, clip, hangs=up.startswith("-")),
        joint_map=joint_map,
        keeps_up=True,
        plants_feet=plants_feet,
        keeps_hands=keeps_hands,
    )
