"""Parser for the MOTION of a BVH file: frame time, rows of numbers, and the joints that they move.

A frame is a row with one number per channel, usually on its own line; line ends only matter if the
numbers do not fit. Angles are degrees. A joint's rotation channels multiply from left to right.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._frame_gaps import gap_notes, no_frames
from viewer.formats._placeholders import held_rows
from viewer.formats._source import Source
from viewer.formats._text.growing_table import GrowingTable
from viewer.formats._text.numbers import is_infinite, parse_numbers, to_number
from viewer.formats._text.words import Words, number_key, read_words, refuse_words
from viewer.formats._translation_limit import FARTHEST, is_beyond
from viewer.formats.bvh.hierarchy import BvhJoint, read_hierarchy
from viewer.phrases import brief, counted, optional, quoted, rounded
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.geometry.quaternion import align_signs

_FRAMES = re.compile(rb"\s*Frames[ \t]*:?\s*(\S*)", re.IGNORECASE)
_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?\s*(\S*)", re.IGNORECASE)
_ROUNDING = 1e-4  # positions of 0 in files with few decimals, relative to the longest OFFSET
PART = 1 << 19
"""Bytes of text from which frames are read together, and the rest of the last line."""
_CHUNK = 256  # number of frames per batch, whose values fit into the processor's cache
_Places = NDArray[np.int64]


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


@dataclass(frozen=True, slots=True)
class Head:
    """All that precedes the frames of a file."""

    table: Table
    """Joints and channels."""
    start: int
    """Offset of the frames."""
    has_motion: bool = False
    """Whether the file has the word MOTION."""
    declared: int | None = None
    """Number of frames; None if missing."""
    frame_time: bytes | None = None
    """Seconds between frames as written; None if missing."""


class Irregular(Exception):  # noqa: N818 - it is not an error
    """Raised if frames have faults, which only the whole file explains."""


def read_motion(source: Source, head: Head) -> tuple[Floats, Bools | None]:
    """Return the frames (N, C), lengths and degrees, and which are gaps (N,), None if none is."""
    width = head.table.n_channels
    none = np.zeros((0, width)), None
    if not head.has_motion:
        source.warn("F007.bvh-no-motion: no MOTION section: shown in the rest pose", source.end)
        return none
    if head.declared is None:
        source.warn("F007.bvh-no-count: missing Frames: all rows are used", head.start)
    if width == 0:
        source.warn(
            "F007.bvh-no-channels: no joint has channels: shown in the rest pose", head.start
        )
        return none
    # An offset is only needed for an error.
    source.remember(
        "frames", lambda row: source.number_offset(head.start, len(source.data), row * width)
    )
    rows = _regular_rows(source, head)
    return _faulty_rows(source, head.start, width, head.declared) if rows is None else (rows, None)


def read_head(source: Source) -> Head:
    """Read everything that precedes the frames."""
    joints, start = read_hierarchy(source)
    table = table_of(source, joints)
    starts = [joint.start for joint in joints if not joint.is_end]
    source.remember("joints", starts.__getitem__)
    if start < 0:
        return Head(table, start)
    declared: int | None = None
    time: bytes | None = None
    is_header = True
    while is_header:
        is_header = False
        if declared is None and (match := _FRAMES.match(source.data, start)):
            declared, start, is_header = _count(source, match), match.end(), True
        if time is None and (match := _TIME.match(source.data, start)):
            time, start, is_header = _seconds(source, match), match.end(), True
    return Head(table, start, True, declared, time)


def _count(source: Source, match: re.Match[bytes]) -> int:
    value = to_number(match[1])
    if value is None or value < 0 or value != int(value):
        raise source.fault(
            wording.COUNT, match.start(1), item="Frames", found=quoted(match[1] or None)
        )
    return int(value)


def _seconds(source: Source, match: re.Match[bytes]) -> bytes:
    value = to_number(match[1])
    if value is None or value < 0.0:
        raise source.fault(
            "F002.bvh-seconds: Frame Time: expected seconds, found {found}",
            match.start(1),
            found=quoted(match[1] or None),
        )
    return match[1]


def frame_parts(texts: Iterable[bytes], width: int) -> Iterator[Floats]:
    """Yield the frames (N, width) of each text, whose last words need not fill a frame.

    Raises Irregular if a word is not a number, or numbers are left at the end.
    """
    rest = np.zeros(0)
    for text in texts:
        # Motions are usually read once, and exported ones are read back: caching would only waste
        # space.
        values, bad = parse_numbers(text, 0, len(text), is_kept=False)
        if bad >= 0:
            raise Irregular
        if len(rest):
            values = np.concatenate([rest, values])
        end = len(values) - len(values) % width
        yield values[:end].reshape(-1, width)
        rest = values[end:]
    if len(rest):
        raise Irregular


def _regular_rows(source: Source, head: Head) -> Floats | None:
    """Return all frames, (N, C); None if their number is wrong, or any has a fault."""
    width = head.table.n_channels
    rows = GrowingTable((width,), np.float64)
    try:
        for part in frame_parts(source.line_parts(PART, head.start), width):
            rows.add(part)
    except Irregular:
        return None
    found = rows.rows()
    return found if len(found) and head.declared in (None, len(found)) else None


def _faulty_rows(
    source: Source, start: int, width: int, declared: int | None
) -> tuple[Floats, Bools | None]:
    """Return all complete frames, (N, C), and which of them are gaps, if any; record faults."""
    words = read_words(source.data, start, len(source.data))
    held = _held_frames(source, words, width, declared)
    if held is not None:
        return held
    bad = int(words.bad[0]) if len(words.bad) else -1
    values = words.values[:bad] if bad >= 0 else words.values
    whole, rest = divmod(len(values), width)
    if bad >= 0:
        offset, word = int(words.offsets[bad]), words.word(bad)
        if declared is None or bad < declared * width:
            frame = Phrase("frame {frame}", frame=bad // width)
            raise source.fault(number_key(word), offset, item=frame, found=quoted(word))
        source.warn(
            "F006.bvh-after: ignored data after the last frame, starting with {found}",
            offset,
            found=quoted(word),
        )
    if rest or (declared is not None and whole != declared):
        _check_lines(source, words, width, declared)
        _warn_of_difference(source, width, declared, whole, rest)
    if whole == 0:
        source.warn("F007.bvh-empty: no frames: shown in the rest pose", start)
    return values[: whole * width].reshape(whole, width), None


def _held_frames(
    source: Source, words: Words, width: int, declared: int | None
) -> tuple[Floats, Bools | None] | None:
    """Record all errors in the frames; return frames and gaps, None if their starts are unknown."""
    begins, sizes = words.rows()
    rest = 0
    if (sizes == width).sum() * 2 > len(sizes):  # the file has one frame per line
        last = int(sizes[-1])
        if last < width and not np.isnan(words.values[begins[-1] :]).any():  # it is cut short
            begins, sizes, rest = begins[:-1], sizes[:-1], last
        begins, sizes = begins[:declared], sizes[:declared]
    else:
        end = len(words.values) if declared is None else declared * width
        if len(words.values) < end or end % width:
            return None
        begins, sizes = np.arange(0, end, width), np.full(end // width, width)
    end = int(begins[-1] + sizes[-1]) if len(begins) else 0
    bad = words.bad[words.bad < end]
    fits = sizes == width
    if fits.all() and len(bad) == 0:
        return None
    frames = np.searchsorted(begins, bad, side="right") - 1
    frame_of = dict(zip(bad.tolist(), frames.tolist(), strict=True))
    is_number = np.array([is_infinite(words.word(index)) for index in bad.tolist()], dtype=np.bool_)
    refuse_words(
        source,
        words,
        bad[~is_number],
        lambda word: Phrase("frame {frame}", frame=frame_of[word]),
        "frames",
        frames[~is_number],
    )
    lost = _gaps(source, words, bad[is_number], frames[is_number], len(begins))
    # Refuse rows that are too short or too long.
    offsets = words.offsets[begins]
    wrong = np.flatnonzero(sizes != width)
    if len(wrong):
        first = int(wrong[0])
        source.refuse(
            wording.BVH_ROW,
            int(offsets[first]),
            len(wrong),
            "frames",
            wrong,
            frame=first,
            expected=counted(width, "number"),
            found=int(sizes[first]),
        )
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    if rest or (declared is not None and len(rows) != declared):
        _warn_of_difference(source, width, declared, len(rows), rest)
    return held_rows(rows, np.isnan(rows).any(axis=1)), lost


def _gaps(source: Source, words: Words, bad: _Places, frames: _Places, count: int) -> Bools | None:
    """Report the words that are not finite, in ``frames``; return which of all frames have any."""
    if len(bad) == 0:
        return None
    word, offset = words.word(int(bad[0])), int(words.offsets[bad[0]])
    item = Phrase("frame {frame}", frame=int(frames[0]))
    first = source.fault(number_key(word), offset, item=item, found=quoted(word))
    source.frame_faults.append(first.diagnostic)
    lost = np.zeros(count, dtype=np.bool_)
    lost[frames] = True
    if lost.all():
        raise no_frames(source, count)
    for note in gap_notes(source, {None: np.flatnonzero(lost)}):
        source.diagnostics.add(note)
    return lost


def _check_lines(source: Source, words: Words, width: int, declared: int | None) -> None:
    """Refuse a file with one frame per line if a row other than the last has a wrong length."""
    begins, sizes = words.rows()
    odd = np.flatnonzero(sizes != width)
    if len(odd) == 0 or len(sizes) < 2:
        return
    row = int(odd[0])
    is_wrong = bool(row < len(sizes) - 1 or sizes[row] > width)
    if len(odd) == len(sizes):
        # No row has the right length: lines are frames only if there are as many as declared.
        is_wrong = len(sizes) == declared
    if is_wrong:
        raise source.fault(
            wording.BVH_ROW,
            int(words.offsets[begins[row]]),
            frame=row,
            expected=counted(width, "number"),
            found=int(sizes[row]),
        )


def _warn_of_difference(
    source: Source, width: int, declared: int | None, whole: int, rest: int
) -> None:
    frames = None if declared is None else Phrase("{n}", n=counted(declared, "frame"))
    part = Phrase("{n} of {width} numbers for the next", n=rest, width=width) if rest else None
    expected = optional("expected {} as declared by Frames, ", frames)
    more = optional(" and {}", part)
    if whole == 0 and (declared or rest):
        raise source.fault(
            "F002.bvh-no-frame: {expected}found none{rest}",
            source.end,
            expected=expected,
            rest=more,
        )
    source.warn(
        "F007.bvh-frames: {expected}found {found}{rest}; only complete frames are used",
        source.end,
        expected=expected,
        found=whole,
        rest=more,
    )


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
                "F007.bvh-no-offset: {joint} has no OFFSET: 0 0 0 assumed",
                joint.start,
                part="joints",
                places=[at],
                joint=joint.called,
            )
        codes = joint.channels or []
        if joint.is_end:
            ends.append((place[joint.parent], joint.offset or [0.0, 0.0, 0.0]))
            if codes:
                source.warn(
                    "F006.bvh-end-channels: ignored CHANNELS in {joint}",
                    joint.start,
                    part="joints",
                    places=[place[joint.parent]],
                    joint=joint.called,
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
    # (v, w) (s e, c) = (w s e + c v + s v x e, w c - s v . e) for the axis e, with s and c the sine
    # and cosine of half the angle; v x e has the components (0, v_3, -v_2) in the order e, 2, 3.
    other, third = (axis + 1) % 3, (axis + 2) % 3
    a, b, c, w = parts[axis], parts[other], parts[third], parts[3]
    parts[axis], parts[3] = a * cosine + w * sine, w * cosine - a * sine
    parts[other], parts[third] = b * cosine + c * sine, c * cosine - b * sine


def translations_of(source: Source, table: Table, values: Floats) -> Floats | None:
    """Return the position channels minus the OFFSET that they replace: (N, J, 3)."""
    if not table.moves:
        return None
    base = replaced_offsets(source, table, moves_inner(table, values))
    return placed(table, _within_reach(source, table, shifts_of(table, values, base)))


def replaced_offsets(source: Source, table: Table, moves: bool) -> Floats:
    """Return the offsets (M,) that position channels replace, given whether inner joints move."""
    base, inner = offsets_of(table), inner_moves(table)
    if base[inner].any() and not moves:
        source.warn(
            "F007.bvh-positions: position channels below the root are 0: added to OFFSET "
            "instead of replacing it"
        )
        base[inner] = 0.0
    return base


def inner_moves(table: Table) -> list[int]:
    """Return the indices of the position channels of joints with a parent."""
    return [at for at, (joint, _, _) in enumerate(table.moves) if table.parents[joint] >= 0]


def moves_inner(table: Table, values: Floats) -> bool:
    """Return whether frames (N, C) translate joints with a parent, beyond rounding."""
    inner = inner_moves(table)
    positions = values[:, [table.moves[at][2] for at in inner]]
    least = _ROUNDING * np.abs(offsets_of(table)[inner]).max(initial=0.0)
    return bool((np.abs(positions) > least).any())


def offsets_of(table: Table) -> Floats:
    """Return the component of the OFFSET along each position channel: (M,)."""
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


def check_reach(table: Table, values: Floats) -> None:
    """Raise Irregular if a frame translates a joint beyond the limit."""
    if is_beyond(shifts_of(table, values, offsets_of(table))).any():
        raise Irregular


def _within_reach(source: Source, table: Table, shifts: Floats) -> Floats:
    """Refuse frames that translate a joint beyond the limit, and repeat the previous frame."""
    is_far = is_beyond(shifts)
    if is_far.any():
        frame = int(is_far.argmax())
        at = int(np.abs(shifts[frame]).argmax())
        joint, axis, _ = table.moves[at]
        source.refuse(
            wording.BEYOND,
            source.offset_of("frames", frame),
            int(is_far.sum()),
            "frames",
            np.flatnonzero(is_far),
            item=Phrase(
                "frame {frame}: {axis}position of joint {joint}",
                frame=frame,
                axis="XYZ"[axis],
                joint=brief(table.names[joint]),
            ),
            most=rounded(FARTHEST, 2),
            found=float(shifts[frame, at]),
        )
    return held_rows(shifts, is_far)
