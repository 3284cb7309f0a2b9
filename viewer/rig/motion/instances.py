"""Instances: many actors of one figure posed together, and their joint matrices.

All computation is vectorised over actors; only copying results into each pose is per actor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_euler, quaternion_to_matrix
from viewer.rig.geometry.transform import affine_matrices
from viewer.rig.kinematics import (
    is_posed,
    joint_worlds,
    posed_skeleton,
    skinning_matrices,
)
from viewer.rig.motion.clip import Clip, evaluate_all
from viewer.rig.motion.evaluation import place_pose, pose_actor
from viewer.rig.motion.sampled_clip import SampledClip, sample_rows
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose, PosedSkeleton, dof_rotations, local_transforms
from viewer.rig.posing.pose_vector import rotation_rows
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton, clamp_dofs
from viewer.rig.transform_keys.sampling import apply_placements, apply_transforms, sample_transforms


def pose_actors(actors: Iterable[Actor], time: float, interpolate: bool = False) -> None:
    """Pose actors by their clips at one time of the scene's clock, in place.

    Actors with the same figure and clip, each at its own offset, are posed together; the result
    equals the result of ``viewer.rig.motion.evaluation.pose_actor`` for each.

    ``actors``: actors to pose; those without a clip are unchanged. ``time``: seconds; each actor's
    own ``offset`` is subtracted. ``interpolate``: interpolate across gaps of captures instead of
    marking actors as absent.
    """
    groups: dict[tuple[int, int], list[Actor]] = {}
    for actor in actors:
        groups.setdefault((id(actor.figure), id(actor.clip)), []).append(actor)
    for group in groups.values():
        clip, skeleton = group[0].clip, group[0].figure.skeleton
        poses = [actor.pose for actor in group if actor.pose is not None]
        times = np.array([time - actor.offset for actor in group])
        if skeleton is None or len(group) < 2:
            clip = None
        if isinstance(clip, Clip) and skeleton is not None:
            _pose_by_curves(clip, skeleton, poses, times)
        elif isinstance(clip, TransformClip) and skeleton is not None:
            _pose_by_transforms(clip, skeleton, poses, times)
        elif isinstance(clip, SampledClip) and skeleton is not None and _is_unrestricted(skeleton):
            _pose_by_frames(group, clip, skeleton, times, interpolate)
        else:
            for actor in group:
                pose_actor(actor, time, interpolate)
            continue
        for actor in group:
            if actor.springs is not None and actor.is_present:
                actor.springs.swing(actor, time - actor.offset)


def _is_unrestricted(skeleton: Skeleton) -> bool:
    """Return whether the DOFs of every joint can represent any rotation."""
    return bool((rotation_rows(skeleton) >= 0).all())


def _pose_by_curves(clip: Clip, skeleton: Skeleton, poses: list[Pose], times: Floats) -> None:
    targets, values = evaluate_all(clip, times)
    dofs = np.stack([pose.dofs for pose in poses])
    dofs[:, targets] = values
    for pose, row in zip(poses, clamp_dofs(skeleton, dofs), strict=True):
        pose.dofs[:] = row


def _pose_by_transforms(
    clip: TransformClip, skeleton: Skeleton, poses: list[Pose], times: Floats
) -> None:
    samples = sample_transforms(clip, times)
    balls = rotation_rows(skeleton)[samples.rotated]
    if (balls < 0).any():
        for row, pose in enumerate(poses):
            apply_transforms(samples, row, skeleton, pose)
        return
    base = quaternion_to_matrix(skeleton.rest_rotations[samples.rotated])
    within = np.swapaxes(base, -1, -2) @ quaternion_to_matrix(samples.rotations)
    dofs = np.stack([pose.dofs for pose in poses])
    dofs[:, balls] = matrix_to_euler(within)
    if len(samples.rotated):
        dofs = clamp_dofs(skeleton, dofs)
    for row, pose in enumerate(poses):
        pose.dofs[:] = dofs[row]
        pose.rotations[samples.rotated] = skeleton.rest_rotations[samples.rotated]
        apply_placements(samples, row, skeleton, pose)


def _pose_by_frames(
    actors: list[Actor], clip: SampledClip, skeleton: Skeleton, times: Floats, interpolate: bool
) -> None:
    """Pose by captured rotations, for skeletons whose joint DOFs can represent any rotation."""
    balls, rows = rotation_rows(skeleton), sample_rows(clip, times, interpolate)
    base = quaternion_to_matrix(skeleton.rest_rotations)
    within = np.swapaxes(base, -1, -2) @ quaternion_to_matrix(rows.rotations)
    dofs = np.stack([actor.pose.dofs for actor in actors if actor.pose is not None])
    dofs[:, skeleton.dof_kinds < FIRST_ROTATION] = 0.0
    dofs[:, balls] = matrix_to_euler(within)
    dofs = clamp_dofs(skeleton, dofs)
    for row, actor in enumerate(actors):
        actor.is_present = bool(rows.present[row])
        if actor.is_present and actor.pose is not None:
            actor.pose.dofs[:] = dofs[row]
            actor.pose.rotations[:] = skeleton.rest_rotations
            place_pose(actor.pose, rows, row)


def local_rotations(skeleton: Skeleton, poses: Sequence[Pose]) -> Floats:
    """Return each joint's rotation relative to its parent, R(quaternion) R(DOFs).

    ``poses``: DOFs in lengths and radians. Returns (A, J, 3, 3), matrices for column vectors.
    """
    beneath = quaternion_to_matrix(np.stack([pose.rotations for pose in poses]))
    return beneath @ dof_rotations(skeleton, np.stack([pose.dofs for pose in poses]))


def worlds(skeleton: Skeleton, poses: Sequence[Pose], rotations: Floats | None = None) -> Floats:
    """Return the world matrices of poses; see ``viewer.rig.kinematics.world_matrices``.

    ``poses``: DOFs in lengths and radians. ``rotations``: (A, J, 3, 3), ``local_rotations`` of the
    poses, if already computed. Returns (A, J, 4, 4), joint-to-figure matrices.
    """
    rotations = local_rotations(skeleton, poses) if rotations is None else rotations
    parts = (
        np.stack([getattr(pose, name) for pose in poses])
        for name in ("dofs", "translations", "scales")
    )
    return joint_worlds(skeleton.parents, *local_transforms(skeleton, rotations, *parts))


def posed_worlds(
    skeleton: Skeleton, poses: Sequence[Pose], rotations: Floats | None = None
) -> Floats:
    """Return ``worlds``; missing matrices are computed in one batch and cached in the poses.

    ``poses``: at least one; DOFs in lengths and radians. ``rotations``: (A, J, 3, 3),
    ``local_rotations`` of the poses, if already computed. Returns (A, J, 4, 4), joint-to-figure
    matrices.
    """
    rows = [row for row, pose in enumerate(poses) if not is_posed(skeleton, pose)]
    missing = [poses[row] for row in rows]
    if missing:
        found = worlds(skeleton, missing, None if rotations is None else rotations[rows])
        for pose, world in zip(missing, found, strict=True):
            pose.posed = PosedSkeleton(skeleton, pose.skinning_key, world)
        if len(missing) == len(poses):
            return found
    return np.stack([posed_skeleton(skeleton, pose).world for pose in poses])


def palettes(figure: Figure, poses: Sequence[Pose]) -> Floats:
    """Return the skinning matrices of poses of one shape: M[a, j] = W[a, j] inverse(B[j]).

    Returns (A, J, 4, 4), bind-to-posed matrices, without the figure's own placement.
    """
    figure = shaped(figure, poses[0].shape_weights)
    return skinning_matrices(
        worlds(figure.require_skeleton(), poses), figure.require_skin().inverse_bind
    )


def placements(poses: Sequence[Pose]) -> Floats:
    """Return T(figure_translation) S(figure_scale) of poses: (A, 4, 4), applied after skinning."""
    scales = np.array([pose.figure_scale for pose in poses])
    places = np.array([pose.figure_translation for pose in poses])
    return affine_matrices(scales[:, None, None] * np.eye(3), places)
