"""Joints of a BVH file with the columns that move them, and the motion of a table of frames."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.formats._bvh.hierarchy import BvhJoint, called
from viewer.formats._neutral import held_rows
from viewer.formats._reach import FARTHEST, is_beyond
from viewer.formats._source import Source
from viewer.rig.arrays import Floats
from viewer.rig.geometry.quaternion import align_signs

__all__ = [
    "Table",
    "inner_moves",
    "moves_inner",
    "offsets_replaced",
    "placed",
    "rotations_of",
    "shifts_of",
    "table_of",
    "translations_of",
]

# Positions of 0 in files with few decimals, as a fraction of the longest OFFSET.
_ROUNDING = 1e-4
_CHUNK = 256  # number of frames per batch, whose values fit into the processor's cache


@dataclass(frozen=True, slots=True)
class Table:
    """Joints, without End Sites, and the columns of a frame that move them."""

    names: tuple[str, ...]
    parents: list[int]
    offsets: Floats  # (J, 3)
    columns: list[list[tuple[int, int]]]  # code and column of each channel, per joint
    ends: list[tuple[int, list[float]]]  # joint and offset of each End Site
    n_channels: int

    @property
    def moves(self) -> list[tuple[int, int, int]]:
        """Joint, axis and column of each position channel."""
        return [
            (joint, code, column)
            for joint, row in enumerate(self.columns)
            for code, column in row
            if code < 3
        ]


def table_of(source: Source, joints: list[BvhJoint]) -> Table:
    """Return the joints and their columns; missing offsets are recorded."""
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
    return Table(
        tuple(joint.name for joint in kept),
        [place.get(joint.parent, -1) for joint in kept],
        np.array([joint.offset or [0.0, 0.0, 0.0] for joint in kept]),
        columns,
        ends,
        count,
    )


def rotations_of(table: Table, values: Floats) -> Floats:
    """Multiply each joint's rotation channels, joints with the same axes together: (N, J, 4)."""
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
    align_signs(rotations)
    rotations.flags.writeable = False  # the clip can use a read-only array without a copy
    return rotations


def _rotate(parts: list[Floats], axis: int, sine: Floats, cosine: Floats) -> None:
    """Multiply quaternions (x, y, z, w) on the right by rotations about an axis, in place."""
    other, third = (axis + 1) % 3, (axis + 2) % 3
    a, b, c, w = parts[axis], parts[other], parts[third], parts[3]
    parts[axis], parts[3] = a * cosine + w * sine, w * cosine - a * sine
    parts[other], parts[third] = b * cosine + c * sine, c * cosine - b * sine


def translations_of(source: Source, table: Table, values: Floats) -> Floats | None:
    """Return the position channels minus the OFFSET that they replace: (N, J, 3)."""
    if not table.moves:
        return None
    base = offsets_replaced(table)
    inner = inner_moves(table)
    if base[inner].any() and not moves_inner(table, values):
        source.warn("F007.bvh-positions")
        base[inner] = 0.0
    shifts = shifts_of(table, values, base)
    names = [("XYZ"[axis], table.names[joint]) for joint, axis, _ in table.moves]
    return placed(table, _within_reach(source, shifts, names))


def inner_moves(table: Table) -> list[int]:
    """Return the indices of the position channels of joints with a parent."""
    return [at for at, (joint, _, _) in enumerate(table.moves) if table.parents[joint] >= 0]


def moves_inner(table: Table, values: Floats) -> bool:
    """Return whether position channels of joints with a parent differ from 0 beyond rounding.

    ``values`` (N, C): some frames.
    """
    inner = inner_moves(table)
    positions = values[:, [table.moves[at][2] for at in inner]]
    least = _ROUNDING * np.abs(offsets_replaced(table)[inner]).max(initial=0.0)
    return bool((np.abs(positions) > least).any())


def offsets_replaced(table: Table) -> Floats:
    """Return the part of the OFFSET that each position channel replaces: (M,)."""
    return np.array([table.offsets[joint, axis] for joint, axis, _ in table.moves])


def shifts_of(table: Table, values: Floats, base: Floats) -> Floats:
    """Return the position channels minus their offsets: (N, M)."""
    return values[:, [column for _, _, column in table.moves]] - base


def placed(table: Table, shifts: Floats) -> Floats:
    """Return translations of all joints, given those with a channel: (N, J, 3), read-only."""
    translations = np.zeros((len(shifts), len(table.names), 3))
    joints, axes = ([move[part] for move in table.moves] for part in (0, 1))
    translations[:, joints, axes] = shifts
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
