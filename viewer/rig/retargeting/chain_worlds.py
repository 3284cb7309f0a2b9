"""World matrices of a subset of the joints of a moving skeleton."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.kinematics import forward_kinematics
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.skeleton import Skeleton

__all__ = ["Chains", "chain_worlds", "chains_to"]


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """Some joints of a skeleton and all their ancestors, renumbered.

    Attributes
    ----------
    joints : (K,) int32
        Indices of the joints in the skeleton, parents before children.
    parents : (K,) int32
        Parents as indices into ``joints``; -1 for a root.
    place : (J,) int32
        Index into ``joints`` of each joint of the skeleton, -1 if it is not included.
    """

    joints: Ints
    parents: Ints
    place: Ints


def chains_to(skeleton: Skeleton, ends: Iterable[int]) -> Chains:
    """Return the given joints of a skeleton and all their ancestors."""
    parents = skeleton.parents
    chosen = np.zeros(skeleton.n_joints, dtype=np.bool_)
    for end in ends:
        joint = int(end)
        while joint >= 0 and not chosen[joint]:
            chosen[joint] = True
            joint = int(parents[joint])
    joints = np.flatnonzero(chosen).astype(np.int32)
    place = np.full(skeleton.n_joints, -1, dtype=np.int32)
    place[joints] = np.arange(len(joints))
    above = np.where(parents[joints] >= 0, place[parents[joints]], -1).astype(np.int32)
    return Chains(joints, above, place)


def chain_worlds(clip: SampledClip, chains: Chains, translations: Floats, scales: Floats) -> Floats:
    """Return the world matrices of some joints in every row of a clip: (N, K, 4, 4).

    Parameters
    ----------
    clip : SampledClip
        Motion of the whole skeleton.
    chains : Chains
        The joints.
    translations, scales : (J, 3)
        Rest translations and local scale factors of all joints; the clip's scales precede these.
    """
    joints = chains.joints
    local = np.zeros((len(joints), clip.n_rows, 4, 4))
    local[..., 3, 3] = 1.0
    factors = scales[None, joints] if clip.scales is None else clip.scales[:, joints]
    linear = quaternion_to_matrix(clip.rotations[:, joints]) * factors[:, :, None, :]
    local[..., :3, :3] = np.swapaxes(linear, 0, 1)
    offsets = translations[joints]
    if clip.translations is not None:
        offsets = offsets + clip.translations[:, joints]
    local[..., :3, 3] = np.swapaxes(np.broadcast_to(offsets, (clip.n_rows, len(joints), 3)), 0, 1)
    world = np.swapaxes(forward_kinematics(chains.parents, local), 0, 1).copy()
    if clip.figure_scales is not None:
        world[..., :3, :] *= clip.figure_scales[:, None, None, None]
    if clip.figure_translations is not None:
        world[..., :3, 3] += clip.figure_translations[:, None]
    return world
