"""Retargeting of the motion that drives a figure, and the match of their joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion, up_rotation
from viewer.rigs.geometry.vectors import Up, axes_along, axis_vector
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_feet import feet_notes, plant_feet
from viewer.rigs.retargeting.driven_hands import hand_notes, keep_hands
from viewer.rigs.retargeting.joint_map import JointMap, joint_map_of
from viewer.rigs.retargeting.joint_matches import Matches, match_joints
from viewer.rigs.retargeting.limb_hierarchy import limb_figure
from viewer.rigs.retargeting.rest_alignment import rest_of
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.retargeting.source_rest import (
    with_rest_angles,
    with_source_rest,
    with_standing_rest,
    with_upright_rest,
)

# Pairs of joints that show the left side of a body, the most certain first.
_SIDES = ("hip", "shoulder", "knee", "collar", "elbow")
_SHORT = 1e-6  # minimum distance with a reliable direction, as a fraction of the skeleton's size


def driven_clip(drive: Drive, figure: Figure) -> tuple[SampledClip, list[Diagnostic]]:
    """Return ``retarget``'s clip and notes for a drive, before ``Drive.finish``."""
    figure = with_rest_angles(figure)
    limbs = limb_figure(figure)
    bound = figure if limbs is None else limbs.figure
    body = with_standing_rest(bound)
    chosen = drive.joint_map if limbs is None else limbs.renamed(drive.joint_map, figure)
    found = retarget(drive.motion, body, chosen, drive.source_rest)
    clip, notes = found.clip, found.notes
    if body is not bound:
        key = (
            "F007.rest-figure: rest pose of {figure}: a T- or A-pose, in which its joint axes are "
            "parallel to the body's, because that of its file is not a standing pose"
        )
        notes = [*notes, note(key, figure=figure.name)]
    if drive.plants_feet:
        clip, changes = plant_feet(found, body)
        notes = notes + feet_notes(changes, found, body)
    if drive.keeps_hands:
        clip, kept = keep_hands(found, clip, body)
        notes = notes + hand_notes(kept, found, body)
    if limbs is not None:
        clip = limbs.original_clip(clip, figure)
    up = drive.motion.figure.up
    if not drive.keeps_up or up == figure.up:
        return clip, notes
    # The retargeted figure is upright along its own up axis; rotate it to the world's up axis.
    return _rotated(clip, figure, up_rotation(figure.up, up)), notes


def matches_of(drive: Drive, figure: Figure) -> Matches:
    """Match a drive's joints, maybe too few to drive; RigError if its map is invalid."""
    source = drive.motion.figure
    skeletons = source.require_skeleton(), figure.require_skeleton()
    titles = source.name, figure.name
    return match_joints(*skeletons, drive.joint_map, titles, is_complete=False)


def full_map(drive: Drive, figure: Figure) -> JointMap:
    """Return the match with a figure as a complete joint map; errors as of ``matches_of``."""
    source, target = drive.motion.figure.require_skeleton(), figure.require_skeleton()
    return joint_map_of(matches_of(drive, figure).partners, source, target)


def aligned_rests(drive: Drive, figure: Figure) -> tuple[Floats, Floats]:
    """Return source (S, 3) and figure (J, 3) joints in the aligned rest poses, in figure axes."""
    motion = with_source_rest(with_upright_rest(drive.motion), drive.source_rest)[0].figure
    axes = up_rotation(motion.up, figure.up)
    source = rest_of(motion.require_skeleton(), axes, figure.up).points
    target = with_standing_rest(with_rest_angles(figure)).require_skeleton()
    return source, rest_of(target, np.eye(3), figure.up).points


def front_axes(points: Floats, matches: Matches, up: Up, is_source: bool) -> Floats:
    """Return left, up and forward of a body as rows (3, 3); left is x without known joints."""
    upward = axis_vector(up)
    joints = dict(zip(matches.names, range(len(matches.names)), strict=True))
    short = _SHORT * (float(np.ptp(points, axis=0).max()) or 1.0)
    for side in _SIDES:
        pair = [joints.get(f"{name}_{side}", -1) for name in ("left", "right")]
        if is_source:
            pair = [int(matches.partners[joint]) if joint >= 0 else -1 for joint in pair]
        if min(pair) < 0:
            continue
        left = points[pair[0]] - points[pair[1]]
        if np.linalg.norm(left - (left @ upward) * upward) > short:
            return axes_along(upward, left).T
    return axes_along(upward, np.eye(3)[0]).T


def _rotated(clip: SampledClip, figure: Figure, matrix: Floats) -> SampledClip:
    """Return a motion rotated about the origin: R' = Q R and T' = Q (rest + T) - rest at roots."""
    skeleton = figure.require_skeleton()
    rotations = clip.rotations.copy()
    roots = np.flatnonzero(skeleton.parents < 0)
    rotations[:, roots] = multiply(matrix_to_quaternion(matrix), rotations[:, roots])
    rests = skeleton.rest_translations[roots]
    shifts = np.zeros_like(clip.rotations[..., :3]) if clip.translations is None else (
        clip.translations.copy()
    )  # fmt: skip
    place = clip.figure_translations
    moved = rests + shifts[:, roots]
    if place is None or len(roots) != 1:
        shifts[:, roots] = moved @ matrix.T - rests
        place = None if place is None else place @ matrix.T
    else:
        shifts[:, roots] = 0.0
        place = (moved[:, 0] + place) @ matrix.T - rests[0]
    return replace(
        clip,
        rotations=rotations,
        translations=shifts if shifts.any() else None,
        figure_translations=place,
    )
