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
estimated, unless the user specifies them, and the motion records how.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.formats._bvh.guess import frame_rate, guess_unit, guess_up
from viewer.formats._bvh.hierarchy import BvhJoint, called, read_hierarchy
from viewer.formats._bvh.motion import Motion, read_motion
from viewer.formats._neutral import held_rows
from viewer.formats._reach import FARTHEST, is_beyond
from viewer.formats._source import Source
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import DEFAULT_RATE, Timing
from viewer.rig.skeleton import Skeleton, ball_skeleton

__all__ = ["read"]

_LARGEST_RATIO = 8  # maximum ratio of rotations to numbers in the file
_SMALL_CLIP = 1 << 24  # number of rotations up to which any ratio is accepted
_CHUNK = 256  # frames at a time, so that their numbers fit into the processor's cache
_THICKNESS = 0.1  # thickness of a joint's box, relative to the length of the bone
# Limits of the thickness, relative to the length of a typical bone.
_THINNEST, _THICKEST = 0.05, 0.3


def read(source: Source) -> SkeletonMotion:
    """Read a skeleton and its motion.

    Parameters
    ----------
    source : Source
        The file; recoverable errors are added to its warnings.

    Returns
    -------
    SkeletonMotion
        Lengths as in the file. Every joint is a ball joint; the clip's translations are the
        position channels minus the OFFSET. End Sites are the far ends of the joints' boxes.

    Raises
    ------
    FormatError
        If the text violates the grammar; the error has the file and line.
    """
    hierarchy = read_hierarchy(source)
    table = _table(source, hierarchy.joints)
    starts = [joint.start for joint in hierarchy.joints if not joint.is_end]
    source.remember("joints", starts.__getitem__)
    motion = read_motion(source, hierarchy.motion, table.n_channels)
    _refuse_empty_joints(source, table, motion)
    skeleton = _skeleton(table)
    has_motion = hierarchy.motion >= 0
    rate = frame_rate(source, motion.frame_time) if has_motion else DEFAULT_RATE
    clip = SampledClip(
        source.path.stem,
        Timing(rate, np.arange(len(motion.values), dtype=np.int32)),
        _rotations(table, motion.values),
        _translations(source, table, motion.values),
    )
    points = _rest_points(table, skeleton)
    unit, facts, unit_note = guess_unit(points)
    figure = Figure(source.path.stem, skeleton=skeleton, unit=unit)
    up, more, up_notes = guess_up(figure, clip, points)
    facts += (*more, ("frames", f"{len(motion.values)} at {rate:g} fps"))
    return SkeletonMotion(replace(figure, up=up, facts=facts), clip, unit_note, up_notes)


@dataclass(frozen=True, slots=True)
class _Table:
    """Joints, without End Sites, and the columns of a frame that move them."""

    names: tuple[str, ...]
    parents: list[int]
    offsets: Floats  # (J, 3)
    columns: list[list[tuple[int, int]]]  # per joint: code of the channel, column
    ends: list[tuple[int, list[float]]]  # joint, offset of an End Site
    n_channels: int


def _table(source: Source, joints: list[BvhJoint]) -> _Table:
    place: dict[int, int] = {}
    columns: list[list[tuple[int, int]]] = []
    ends: list[tuple[int, list[float]]] = []
    kept: list[BvhJoint] = []
    count = 0
    for index, joint in enumerate(joints):
        if joint.offset is None:
            at = place[joint.parent] if joint.is_end else len(kept)
            source.warn(
                "F007.bvh-no-offset",
                joint.start,
                part="joints",
                places=[at],
                joint=called(joint),
            )
        codes = joint.channels or []
        if joint.is_end:
            ends.append((place[joint.parent], joint.offset or [0.0, 0.0, 0.0]))
            if codes:
                source.warn(
                    "F006.bvh-end-channels",
                    joint.start,
                    part="joints",
                    places=[place[joint.parent]],
                    joint=called(joint),
                )
        else:
            place[index] = len(kept)
            kept.append(joint)
            columns.append([(code, count + at) for at, code in enumerate(codes)])
        count += len(codes)
    return _Table(
        tuple(joint.name for joint in kept),
        [place.get(joint.parent, -1) for joint in kept],
        np.array([joint.offset or [0.0, 0.0, 0.0] for joint in kept]),
        columns,
        ends,
        count,
    )


def _refuse_empty_joints(source: Source, table: _Table, motion: Motion) -> None:
    """Refuse files that would exhaust memory: many frames for many joints without channels."""
    rotations = len(motion.values) * len(table.names)
    if rotations > max(_SMALL_CLIP, _LARGEST_RATIO * motion.values.size):
        raise source.fault(
            "F002.bvh-few-channels",
            channels=table.n_channels,
            joints=len(table.names),
            frames=len(motion.values),
        )


def _skeleton(table: _Table) -> Skeleton:
    parents = np.array(table.parents, dtype=np.int32)
    # Offsets are used as written, because differences of positions would be rounded.
    skeleton = ball_skeleton(table.names, parents, np.zeros((len(parents), 3)))
    return replace(skeleton, rest_translations=table.offsets, boxes=_boxes(table, parents))


def _rest_points(table: _Table, skeleton: Skeleton) -> Floats:
    """Return the positions of joints and End Sites in the rest pose: (P, 3)."""
    joints = np.zeros((skeleton.n_joints, 3))
    for joint, parent in enumerate(table.parents):
        joints[joint] = table.offsets[joint] + (joints[parent] if parent >= 0 else 0.0)
    tips = [joints[joint] + offset for joint, offset in table.ends]
    return np.concatenate([joints, np.reshape(tips, (-1, 3))])


def _boxes(table: _Table, parents: Ints) -> Floats:
    """Return a box for each joint from itself to its children or End Sites: (J, 2, 3).

    Invariant for the exporter: if a joint has an End Site, it is at twice the centre of the box.
    """
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


def _rotations(table: _Table, values: Floats) -> Floats:
    """Multiply each joint's rotation channels, all joints with the same axes at once: (N, J, 4)."""
    rotations = np.empty((len(values), len(table.names), 4))
    groups: dict[tuple[int, ...], list[int]] = {}
    turns = [[(code, column) for code, column in row if code >= 3] for row in table.columns]
    for joint, row in enumerate(turns):
        groups.setdefault(tuple(code - 3 for code, _ in row), []).append(joint)
    for axes, joints in groups.items():
        columns = [[turns[joint][place][1] for joint in joints] for place in range(len(axes))]
        for start in range(0, len(values), _CHUNK):
            rows = slice(start, start + _CHUNK)
            parts = [np.zeros((len(values[rows]), len(joints))) for _ in range(3)]
            parts.append(np.ones_like(parts[0]))
            for axis, chosen in zip(axes, columns, strict=True):
                half = values[rows, chosen] * (np.pi / 360.0)
                _rotate(parts, axis, np.sin(half), np.cos(half))
            for number, part in enumerate(parts):
                rotations[rows, joints, number] = part
    _keep_signs(rotations)
    rotations.flags.writeable = False  # the clip can use a read-only array without a copy
    return rotations


def _rotate(parts: list[Floats], axis: int, sine: Floats, cosine: Floats) -> None:
    """Multiply quaternions (x, y, z, w) on the right by rotations about an axis, in place."""
    other, third = (axis + 1) % 3, (axis + 2) % 3
    a, b, c, w = parts[axis], parts[other], parts[third], parts[3]
    parts[axis], parts[3] = a * cosine + w * sine, w * cosine - a * sine
    parts[other], parts[third] = b * cosine + c * sine, c * cosine - b * sine


def _keep_signs(rotations: Floats) -> None:
    """Replace q by -q, the same rotation, if that is nearer to the previous frame; in place."""
    products = np.einsum("nja,nja->nj", rotations[1:], rotations[:-1])
    turned = np.logical_xor.accumulate(products < 0.0, axis=0)
    if turned.any():
        rotations[1:][turned] *= -1.0


def _translations(source: Source, table: _Table, values: Floats) -> Floats | None:
    """Return the position channels minus the OFFSET that they replace: (N, J, 3)."""
    moves = [
        (joint, code, column)
        for joint, row in enumerate(table.columns)
        for code, column in row
        if code < 3
    ]
    if not moves:
        return None
    joints, axes, columns = (list(part) for part in zip(*moves, strict=True))
    shifts = values[:, columns]
    inner = [at for at, joint in enumerate(joints) if table.parents[joint] >= 0]
    base = table.offsets[joints, axes]
    if base[inner].any() and not shifts[:, inner].any():
        source.warn("F007.bvh-positions")
        base[inner] = 0.0
    translations = np.zeros((len(values), len(table.names), 3))
    names = [("XYZ"[axis], table.names[at]) for at, axis in zip(joints, axes, strict=True)]
    translations[:, joints, axes] = _within_reach(source, shifts - base, names)
    translations.flags.writeable = False
    return translations


def _within_reach(source: Source, shifts: Floats, names: list[tuple[str, str]]) -> Floats:
    """Refuse frames that translate a joint beyond the limit, and repeat the previous frame.

    ``names`` are the axis and joint of each column.
    """
    is_far = is_beyond(shifts)
    if is_far.any():
        frame = int(is_far.argmax())
        at = int(np.abs(shifts[frame]).argmax())
        axis, joint = names[at]
        source.refuse(
            "F003.beyond",
            source.offset_of("frames", frame),
            int(is_far.sum()),
            "frames",
            np.flatnonzero(is_far),
            item=Phrase("bvh-position", frame=frame, axis=axis, joint=joint),
            most=FARTHEST,
            found=float(shifts[frame, at]),
        )
    return held_rows(shifts, is_far)
