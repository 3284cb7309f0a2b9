"""Playback of spring joints: an actor's pose and baked frames follow the simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.geometry.vectors import axis_vector, unit
from viewer.rigs.motion.evaluation import JointMotion, frames_of, rest_translations_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing, frame_times
from viewer.rigs.pose import Pose, PoseKey, pose_key, set_joint_rotations
from viewer.rigs.scene import Actor, still_pose
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.springs.simulation import STEPS_PER_SECOND, PosedJoints, SpringTrack
from viewer.rigs.springs.spring_joints import Springs

_MOST_TRACKS = 4


class SpringMotion:
    """Simulation of spring joints that ``Actor.springs`` holds while enabled; copies may share it.

    It is cached until the clip, or what the clip does not animate, changes. ``up`` (3,): up
    direction of the clip's world in figure space, with which gravity rotates; by default the
    figure's up axis.
    """

    def __init__(self, up: Floats | None = None) -> None:
        self._up = up
        self._tracks: dict[tuple[int, PoseKey], tuple[JointMotion, SpringTrack]] = {}

    def swing(self, actor: Actor, time: float) -> None:
        """Rotate an actor's spring joints, in place, once its clip has posed it."""
        clip, skeleton = actor.joint_motion, actor.figure.skeleton
        if clip is None or skeleton is None or skeleton.springs is None:
            return
        rotations = self.rotations(actor, np.array([time]))[0]
        matrices = quaternion_to_matrix(rotations)
        pose = actor.pose
        set_joint_rotations(skeleton, pose, skeleton.springs.joints, matrices, "dofs")

    def rotations(self, actor: Actor, times: Floats) -> Floats:
        """Return the rotations of the spring joints (F, N, 4) at times (F,) in seconds."""
        clip, figure = actor.joint_motion, actor.figure
        if clip is None:
            raise RigError(f"{actor.name} has no motion of joints")
        base, skeleton = still_pose(actor), actor.figure.require_skeleton()
        if skeleton.springs is not None:
            _rest(actor.figure, skeleton.springs, base)
        key = id(clip), pose_key(base)
        if key not in self._tracks:
            while len(self._tracks) >= _MOST_TRACKS:
                del self._tracks[next(iter(self._tracks))]
            track = SpringTrack(self.skeleton_of(figure), clip.start, clip.end)
            # A reference to the clip keeps it alive, so that no other clip gets its id.
            self._tracks[key] = clip, track
        track = self._tracks[key][1]
        return track.rotations(times, lambda at: _posed(figure, clip, at, base))

    def skeleton_of(self, figure: Figure) -> Skeleton:
        """Return the skeleton with gravity in the world of the clip."""
        skeleton, own = figure.require_skeleton(), axis_vector(figure.up)
        if self._up is None or skeleton.springs is None or np.allclose(own, self._up):
            return skeleton
        middle = unit(own + self._up)
        if not middle.any():
            middle = np.eye(3)["yzx".index(figure.up)]
        # Two rotations by 180 degrees: about the figure's up axis, and about the bisector of both
        # axes.
        first = 2.0 * np.outer(own, own) - np.eye(3)
        turn = (2.0 * np.outer(middle, middle) - np.eye(3)) @ first
        springs = skeleton.springs
        turned = replace(springs, gravities=springs.gravities @ turn.T)
        return replace(skeleton, springs=turned)


def springs_for(actor: Actor, up: str) -> SpringMotion | None:
    """Return an actor's simulation in a scene whose up axis is ``up``; None without springs."""
    if not has_springs(actor):
        return None
    return SpringMotion(unit(actor.placement[:3, :3].T @ axis_vector(up)))


def has_springs(actor: Actor) -> bool:
    """Return whether an actor's figure has spring joints."""
    skeleton = actor.figure.skeleton
    return skeleton is not None and skeleton.springs is not None


def release_springs(actor: Actor) -> None:
    """Reset the spring joints of a pose to rest, in place, for instance to switch them off."""
    skeleton = actor.figure.skeleton
    if skeleton is not None and skeleton.springs is not None and actor.own_pose is not None:
        _rest(actor.figure, skeleton.springs, actor.own_pose)


def with_baked_springs(actor: Actor, rate: float | None = None) -> SampledClip:
    """Return frames with springs at a rate: the motion's, or the simulation's, if omitted."""
    clip, skeleton = actor.joint_motion, actor.figure.require_skeleton()
    if clip is None or skeleton.springs is None:
        raise RigError(f"{actor.name} has no motion of spring joints")
    if rate is None:
        rate = STEPS_PER_SECOND if clip.kind == "curves" else clip.frame_rate
    times = frame_times(clip.start, clip.end, rate)
    frames = frames_of(actor.figure, clip, times, actor.own_pose)
    rotations = frames.rotations.copy()
    swings = actor.springs if isinstance(actor.springs, SpringMotion) else SpringMotion()
    rotations[:, skeleton.springs.joints] = swings.rotations(actor, times)
    rows: Ints = np.arange(len(times), dtype=np.int32)
    return SampledClip(
        clip.name,
        Timing(rate, np.where(frames.present, rows, -1).astype(np.int32), start=clip.start),
        rotations,
        frames.translations if frames.translations.any() else None,
        frames.figure_translations if frames.figure_translations.any() else None,
        frames.figure_scales if (frames.figure_scales != 1.0).any() else None,
        frames.shape_weights if actor.figure.n_shapes else None,
        frames.scales,
    )


def _rest(figure: Figure, springs: Springs, pose: Pose) -> None:
    """Reset spring joints to their rest rotation, in place."""
    own, skeleton = figure_pose(figure), figure.require_skeleton()
    pose.rotations[springs.joints] = own.rotations[springs.joints]
    chosen = np.isin(skeleton.dof_joints, springs.joints) & (skeleton.dof_kinds >= 3)
    np.copyto(pose.dofs, own.dofs, where=chosen)


def _posed(figure: Figure, clip: JointMotion, times: Floats, base: Pose) -> PosedJoints:
    """Return the joints of a motion without springs."""
    frames = frames_of(figure, clip, times, base, interpolate=True)
    world, count = world_frames(figure, frames), frames.n_frames
    local = affine_matrices(
        quaternion_to_matrix(frames.rotations),
        rest_translations_of(figure, frames.shape_weights) + frames.translations,
    )
    places = affine_matrices(
        frames.figure_scales[:, None, None] * np.eye(3), frames.figure_translations
    )
    scales = np.broadcast_to(frames.scales, (count, *frames.scales.shape[1:]))
    return PosedJoints(world, local, scales, places)
