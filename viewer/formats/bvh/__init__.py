r"""Reader of ``.bvh``: a skeleton and its motion (BioVision; the format has no standard).

::

    bvh       = "HIERARCHY" root+ "MOTION" "Frames:" N "Frame Time:" seconds number*
    root      = "ROOT" name "{" item* "}"
    item      = "OFFSET" x y z | "CHANNELS" n channel*n | "JOINT" name "{" item* "}"
              | "End" "Site" name? "{" item* "}"
    channel   = Xposition | Yposition | Zposition | Xrotation | Yrotation | Zrotation
    name      = word*

Words are separated by any white space, including line ends, and keywords are case-insensitive. A
frame has one number per channel, with joints in the order of the file. Angles are degrees; a
joint's rotation channels multiply from left to right: ``Zrotation Yrotation Xrotation`` is R = Rz
Ry Rx. Position channels replace the joint's OFFSET. Unit and up axis are not in the file: both are
estimated, unless the user specifies them, and the motion records the method.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.formats._source import Source
from viewer.formats.bvh.guess import frame_rate, guess_unit, guess_up
from viewer.formats.bvh.hierarchy import read_hierarchy
from viewer.formats.bvh.motion import Table, read_motion, rotations_of, table_of, translations_of
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import DEFAULT_RATE, Timing
from viewer.rig.skeleton import Skeleton, ball_skeleton

_LARGEST_RATIO = 8  # maximum ratio of rotations to numbers in the file
_SMALL_CLIP = 1 << 24  # number of rotations up to which any ratio is accepted
_THICKNESS = 0.1  # thickness of a joint's box, relative to the length of the bone

# Limits of the thickness, relative to the length of a typical bone.
_THINNEST, _THICKEST = 0.05, 0.3


def read(source: Source) -> SkeletonMotion:
    """Read a skeleton and its motion.

    Lengths are those of the file. Every joint is a ball joint; the clip's translations are the
    position channels minus the OFFSET. End Sites are the far ends of the joints' boxes. Raises
    ``FormatError`` if the text violates the grammar; the error has the file and line.
    """
    hierarchy = read_hierarchy(source)
    table = table_of(source, hierarchy.joints)
    starts = [joint.start for joint in hierarchy.joints if not joint.is_end]
    source.remember("joints", starts.__getitem__)
    motion = read_motion(source, hierarchy.motion, table.n_channels)
    if has_few_channels(table, len(motion.values)):
        raise source.fault(
            "F002.bvh-few-channels: expected channels for most joints, found {channels} for "
            "{joints} joints in {frames} frames",
            channels=table.n_channels,
            joints=len(table.names),
            frames=len(motion.values),
        )
    has_motion = hierarchy.motion >= 0
    rate = frame_rate(source, motion.frame_time) if has_motion else DEFAULT_RATE
    rows = np.arange(len(motion.values), dtype=np.int32)
    if motion.lost is not None:
        rows[motion.lost] = -1
    clip = SampledClip(
        source.path.stem,
        Timing(rate, rows),
        rotations_of(table, motion.values),
        # Position channels replace the OFFSETs, so zeros would not be the rest pose.
        translations_of(source, table, motion.values) if motion.has_frames else None,
    )
    return skeleton_motion(table, clip)


def has_few_channels(table: Table, n_frames: int) -> bool:
    """Return whether a file could exhaust memory: many frames for many joints without channels."""
    rotations = n_frames * len(table.names)
    return rotations > max(_SMALL_CLIP, _LARGEST_RATIO * n_frames * table.n_channels)


def skeleton_motion(table: Table, clip: SampledClip) -> SkeletonMotion:
    """Return the joints of a file with their motion, and estimates of unit and up axis."""
    skeleton = _skeleton(table)
    points = _rest_points(table, skeleton)
    unit, facts, unit_note = guess_unit(points)
    figure = Figure(clip.name, skeleton=skeleton, unit=unit)
    up, more, up_notes = guess_up(figure, clip, points)
    facts += (*more, ("frames", f"{clip.timing.n_frames} at {clip.timing.frame_rate:g} fps"))
    return SkeletonMotion(replace(figure, up=up, facts=facts), clip, unit_note, up_notes)


def _skeleton(table: Table) -> Skeleton:
    parents = np.array(table.parents, dtype=np.int32)
    # Offsets are used as written, because differences of positions would be rounded.
    skeleton = ball_skeleton(table.names, parents, np.zeros((len(parents), 3)))
    boxes = _boxes(table, parents)
    return replace(skeleton, rest_translations=table.offsets, boxes=boxes, boxes_from_bones=True)


def _rest_points(table: Table, skeleton: Skeleton) -> Floats:
    """Return the positions of joints and End Sites in the rest pose: (P, 3)."""
    joints = np.zeros((skeleton.n_joints, 3))
    for joint, parent in enumerate(table.parents):
        joints[joint] = table.offsets[joint] + (joints[parent] if parent >= 0 else 0.0)
    tips = [joints[joint] + offset for joint, offset in table.ends]
    return np.concatenate([joints, np.reshape(tips, (-1, 3))])


def _boxes(table: Table, parents: Ints) -> Floats:
    """Return a box for each joint from itself to its children or End Sites: (J, 2, 3)."""
    # The exporter relies on an invariant: an End Site is at twice the centre of its joint's box.
    inner = np.flatnonzero(parents >= 0)
    owners = np.concatenate([parents[inner], [joint for joint, _ in table.ends]]).astype(np.int32)
    tips = np.concatenate(
        [table.offsets[inner], np.reshape([tip for _, tip in table.ends], (-1, 3))]
    )
    lengths = np.linalg.norm(tips, axis=1)
    size = float(np.median(lengths[lengths > 0.0])) if lengths.any() else 1.0
    half = np.clip(_THICKNESS * lengths, _THINNEST * size, _THICKEST * size)[:, None]
    # Along its main axis, a box is as long as the bone; the other sides have a limited thickness.
    along = np.abs(tips) >= np.abs(tips).max(axis=1, keepdims=True)
    reach = np.where(along, np.abs(0.5 * tips), np.minimum(np.abs(0.5 * tips), 2.0 * half))
    reach = np.where(reach < half, reach + half, reach)
    boxes = np.stack([np.full((len(parents), 3), np.inf), np.full((len(parents), 3), -np.inf)], 1)
    np.minimum.at(boxes[:, 0], owners, 0.5 * tips - reach)
    np.maximum.at(boxes[:, 1], owners, 0.5 * tips + reach)
    bare = ~np.isfinite(boxes[:, 0, 0])
    boxes[bare] = np.array([-1.0, 1.0])[:, None] * _THICKNESS * size
    return boxes
