"""The rest pose of a motion whose zero pose is not a standing pose.

Retargeting relates two skeletons by their rest poses. Some programs write skeletons whose zero pose
is arbitrary, for instance with all bones along +x. The rest pose is then the T-pose in which the
axes of the joints are parallel to the body's, if they are chosen so; otherwise a frame in a T- or
A-pose, if there is one, or estimated from the anatomy of the body in motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.phrases import Remedy, listed
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.placed_figure import bound_in
from viewer.rigs.pose import joint_rotations, rest_pose
from viewer.rigs.retargeting.anatomical_rest import (
    SIDES,
    Postures,
    anatomical_rest,
    limb_axes,
    postures_of,
    rest_posture,
    upright_frames,
)
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton

SourceRest = int | str
"""A frame number, ``"zero"`` for the zero pose, or ``"auto"``."""

# Cosine of the minimum angle between the trunk and a leg's bones.
_FOLDED = np.cos(np.radians(60.0))
_NEAR = np.radians(20.0)  # maximum deviation of a bone from a T- or A-pose
_A_POSE = np.radians(55.0)  # maximum angle of the arms of an A-pose below the horizontal
_T_POSE = np.radians(20.0)  # maximum angle of the arms of a T-pose to the horizontal
_UPRIGHT = np.cos(np.radians(40.0))  # maximum angle between the legs and an axis
# Limits of a figure that is driven, whose bones may be fitted to a mesh: a cosine, and an angle.
# Within them, head, hands and feet of a mesh are held as in a T- or A-pose; short bones of a fitted
# skeleton may be 50 degrees off in the pose without rotations.
_STANDING, _STANDING_ARMS = np.cos(np.radians(35.0)), np.radians(60.0)
_ROLLED = np.cos(np.radians(60.0))  # maximum roll of the limbs in a T- or A-pose
_AXES = (
    "F007.rest-axes: rest pose of {motion}: a T-pose, in which its joint axes are parallel to the "
    "body's, because its zero pose is not a standing pose{remedy}"
)
_REMEDY = Remedy("", " (--source-rest overrides it)")


def rest_fault(motion: SkeletonMotion, choice: SourceRest) -> Diagnostic | None:
    """Return a message if a motion lacks the frame that is its rest pose."""
    timing = motion.clip.timing
    if isinstance(choice, str) or _row(motion, choice) >= 0:
        return None
    last = timing.first_frame + timing.n_frames - 1
    values = {"first": timing.first_frame, "last": last, "found": choice}
    return Diagnostic(
        "F004.rest-frame: --source-rest: expected a frame from {first} to {last} with a "
        "pose, found {found}",
        values=values,
    )


def with_source_rest(
    motion: SkeletonMotion, choice: SourceRest
) -> tuple[SkeletonMotion, list[Diagnostic]]:
    """Return a motion whose skeleton has the requested rest pose, and a note of which.

    "auto": the skeleton's own if it stands or its limbs have no known names; otherwise the T-pose
    with parallel joint axes, the best T- or A-pose among the frames, or an estimate from anatomy.
    RigError if there is no such frame.
    """
    fault = rest_fault(motion, choice)
    if fault is not None:
        raise RigError(fault)
    skeleton, called = motion.figure.skeleton, {"motion": motion.figure.name}
    if skeleton is None or choice == "zero":
        return motion, []
    if not isinstance(choice, str):
        local = motion.clip.rotations[_row(motion, choice)]
        note = Diagnostic(
            "F007.rest-asked: rest pose of {motion}: frame {frame}, as requested",
            values={**called, "frame": choice},
        )
        return with_rest_rotations(motion, local), [note]
    still = rest_posture(skeleton, motion.figure.up)
    if still is None or _is_body(still):
        return motion, []
    postures = postures_of(motion)
    upright = None if postures is None else upright_frames(postures)
    if postures is None:
        return motion, []
    if upright is None:
        found = anatomical_rest(postures.righted(), skeleton, has_stances=False)
        key = (
            _AXES
            if found.is_parallel
            else "F007.rest-lying: rest pose of {motion}: estimated from trunk, knees and elbows, "
            "with an assumed slope of the feet, because the person never stands{remedy}"
        )
        note = Diagnostic(key, values={**called, "remedy": _REMEDY})
        return _placed(motion, skeleton, found.rotations), [note]
    return _estimated(motion, skeleton, upright)


def with_rest_angles(figure: Figure) -> Figure:
    """Return a figure to drive whose rest rotations contain the angles of its rest pose.

    Its DOFs are 0 then. The mesh is bound there, so that soles and skin are those at rest. If a
    person does not stand there, or it is none, the angles are just a pose: animals are often bound
    with DOFs at 0 and look around at rest.
    """
    given, skeleton = figure, figure.require_skeleton()
    pose, rotates = rest_pose(skeleton), skeleton.dof_kinds >= FIRST_ROTATION
    if not pose.dofs[rotates].any():
        return figure
    pose.dofs[~rotates] = 0.0  # motions set them to 0
    if figure.is_attached and figure.blend_shapes is None:
        figure = bound_in(figure, pose)
        skeleton = figure.require_skeleton()
    rested = replace(
        skeleton,
        rest_rotations=matrix_to_quaternion(joint_rotations(skeleton, pose)),
        rest_dofs=np.zeros(skeleton.n_dofs),
        dof_limits=np.where(rotates[:, None], [-np.inf, np.inf], skeleton.dof_limits),
    )
    still = rest_posture(rested, figure.up)
    if still is None or not _stands(still):
        return given
    return replace(figure, skeleton=rested)


def with_standing_rest(figure: Figure) -> Figure:
    """Return a figure to drive, whose skeleton stands at rest if its joint axes tell how.

    Meshes may be bound in any pose, such as scans of runners. If the joints' axes were parallel to
    the body's in a T- or A-pose, that pose is the one without rotations.
    """
    skeleton = figure.require_skeleton()
    still = rest_posture(skeleton, figure.up)
    if still is None or _stands(still):
        return figure
    upright = replace(
        skeleton, rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (skeleton.n_joints, 1))
    )
    found = rest_posture(upright, figure.up)
    if found is None or _calibration(found)[0] < 0:
        return figure
    return replace(figure, skeleton=upright)


def _stands(still: Postures) -> bool:
    """Return whether a rest pose is about a T- or A-pose, with legs straight as a whole."""
    # Knees of short legs may be anywhere between hip and ankle.
    legs = [still.direction(f"{side}_hip", f"{side}_ankle")[0] for side in SIDES]
    upright = [still.trunk()[0] @ still.up, *(leg @ -still.up for leg in legs)]
    arms, _ = _arm_angles(still)
    return min(upright) > _STANDING and float(np.max(arms)) < _STANDING_ARMS


def with_upright_rest(motion: SkeletonMotion) -> SkeletonMotion:
    """Return a motion whose rest pose stands along the up axis."""
    # Some programs rotate the root of a skeleton with y up into a world with z up, in which its
    # rest pose lies. Skeletons whose legs are along no axis, or have no known names, stay.
    skeleton, up = motion.figure.skeleton, axis_vector(motion.figure.up)
    still = None if skeleton is None else rest_posture(skeleton, motion.figure.up)
    if skeleton is None or still is None:
        return motion
    legs = sum(still.direction(f"{side}_ankle", f"{side}_hip")[0] for side in SIDES)
    axis = int(np.abs(legs).argmax())
    stands = np.sign(legs[axis]) * np.eye(3)[axis]
    if legs @ stands < _UPRIGHT * np.linalg.norm(legs) or stands @ up == 1.0:
        return motion
    turn = quaternion_to_matrix(between(stands, up))
    return _placed(motion, skeleton, turn @ still.rotations[0])


def _estimated(
    motion: SkeletonMotion, skeleton: Skeleton, upright: Postures
) -> tuple[SkeletonMotion, list[Diagnostic]]:
    """Return a motion with a rest pose estimated from its upright frames."""
    called = {"motion": motion.figure.name, "remedy": _REMEDY}
    found = anatomical_rest(upright, skeleton)
    if found.is_parallel:
        # More exact than a frame, in which nobody stands perfectly.
        note = Diagnostic(_AXES, values=called)
        return _placed(motion, skeleton, found.rotations), [note]
    row, drop = _calibration(upright)
    if row >= 0:
        timing = motion.clip.timing
        frame = timing.first_frame + int(np.flatnonzero(timing.rows == row)[0])
        pose = Phrase("a T-pose" if drop < _T_POSE else "an A-pose")
        note = Diagnostic(
            "F007.rest-frame: rest pose of {motion}: frame {frame}, {pose}, because its zero "
            "pose is not a standing pose{remedy}",
            values={**called, "frame": frame, "pose": pose},
        )
        return with_rest_rotations(motion, motion.clip.rotations[row]), [note]
    notes = [
        Diagnostic(
            "F007.rest-anatomy: rest pose of {motion}: estimated from trunk, soles, knees and "
            "elbows, because neither its zero pose nor any frame is a T- or A-pose{remedy}",
            values=called,
        )
    ]
    if found.unseen:
        values = {**called, "names": listed(list(found.unseen))}
        notes.append(
            Diagnostic(
                "F007.rest-straight: roll assumed for limbs of {motion} that hardly bend: {names}",
                values=values,
            )
        )
    return _placed(motion, skeleton, found.rotations), notes


def _placed(motion: SkeletonMotion, skeleton: Skeleton, worlds: Floats) -> SkeletonMotion:
    """Return a motion whose skeleton has other world rotations at rest: (J, 3, 3)."""
    above = worlds[skeleton.parents]
    above[skeleton.parents < 0] = np.eye(3)
    local = matrix_to_quaternion(np.swapaxes(above, 1, 2) @ worlds)
    return with_rest_rotations(motion, local)


def with_rest_rotations(motion: SkeletonMotion, local: Floats) -> SkeletonMotion:
    """Return a motion whose skeleton has other local rotations at rest: (J, 4)."""
    skeleton = motion.figure.require_skeleton()
    rested = replace(skeleton, rest_rotations=local)
    return replace(motion, figure=replace(motion.figure, skeleton=rested))


def _row(motion: SkeletonMotion, frame: int) -> int:
    """Return the row of a frame, -1 if it is missing."""
    timing = motion.clip.timing
    place = frame - timing.first_frame
    return int(timing.rows[place]) if 0 <= place < timing.n_frames else -1


def _is_body(still: Postures) -> bool:
    """Return whether a rest pose is a body's, upright or not: legs off trunk, limbs unfolded."""
    trunk = still.trunk()[0]
    side = still.direction("right_hip", "left_hip")[0]
    for name, sign in zip(SIDES, (1.0, -1.0), strict=True):
        thigh, shin = _bones(still, name, "hip knee ankle")
        arm, forearm = _bones(still, name, "shoulder elbow wrist")
        if trunk @ thigh[0] > _FOLDED or trunk @ shin[0] > _FOLDED or thigh[0] @ shin[0] < 0.0:
            return False
        if arm[0] @ forearm[0] < -_FOLDED or sign * (side @ arm[0]) < -_FOLDED:
            return False
    return abs(side @ trunk) < _FOLDED


def _bones(postures: Postures, side: str, parts: str) -> tuple[Floats, Floats]:
    """Return the directions of a limb's two bones: (F, 3) each."""
    start, middle, end = (f"{side}_{part}" for part in parts.split())
    return postures.direction(start, middle), postures.direction(middle, end)


def _calibration(postures: Postures) -> tuple[int, float]:
    """Return the row closest to a T- or A-pose, -1 if none is, and how far its arms are lowered."""
    left, up, forward = postures.left(), postures.up, postures.forward()
    angles = [_angles(postures.trunk(), up)]
    for name in SIDES:
        angles += [_angles(bone, -up) for bone in _bones(postures, name, "hip knee ankle")]
    arms, drops = _arm_angles(postures)
    largest = np.max([*angles, *arms], axis=0)
    largest[_is_rolled(postures, left, forward)] = np.inf
    best = int(largest.argmin())
    row = int(postures.rows[best]) if largest[best] < _NEAR else -1
    return row, float(np.mean(drops, axis=0)[best])


def _arm_angles(postures: Postures) -> tuple[list[Floats], list[Floats]]:
    """Return angles of the arms' bones to the nearest T- or A-pose, and how far it lowers the arms.

    (F,) per bone, and per arm.
    """
    left, up = postures.left(), postures.up
    angles, drops = list[Floats](), list[Floats]()
    for name, sign in zip(SIDES, (1.0, -1.0), strict=True):
        arms = _bones(postures, name, "shoulder elbow wrist")
        outward = np.einsum("fa,fa->f", arms[0], sign * left)
        drop = np.clip(np.arctan2(-arms[0] @ up, outward), 0.0, _A_POSE)
        wanted = np.cos(drop)[:, None] * sign * left - np.sin(drop)[:, None] * up
        angles += [_angles(bone, wanted) for bone in arms]
        drops.append(drop)
    return angles, drops


def _is_rolled(postures: Postures, left: Floats, forward: Floats) -> Bools:
    """Return a mask of the frames whose bending axes differ from a T- or A-pose: (F,)."""
    result = np.zeros(len(postures.rows), dtype=bool)
    for limb in limb_axes(postures):
        if limb.is_seen:
            axes = postures.rotations[:, postures.joints[limb.upper]]
            is_leg = limb.upper.endswith("hip")
            wanted = left if is_leg else np.cross(axes @ limb.bones[0], forward)
            result |= np.einsum("fa,fa->f", axes @ limb.bends[0], wanted) < _ROLLED
    return result


def _angles(vectors: Floats, others: Floats) -> Floats:
    """Return the angles between unit vectors: (F,)."""
    return np.arccos(np.clip((vectors * others).sum(axis=-1), -1.0, 1.0))
