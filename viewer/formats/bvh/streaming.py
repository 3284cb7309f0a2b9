"""Part-by-part reading of long ``.bvh`` files, with memory use independent of their length.

A file can be streamed if it is regular: the number of frames is declared, each frame has its own
line, and there is nothing to report about the frames. Any other file must be read as a whole by
``bvh.read``, which finds and reports all errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_numbers
from viewer.formats._translation_limit import is_beyond
from viewer.formats.bvh import has_few_channels, skeleton_motion
from viewer.formats.bvh.guess import examined_frames, frame_rate
from viewer.formats.bvh.hierarchy import read_hierarchy
from viewer.formats.bvh.motion import (
    Table,
    inner_moves,
    moves_inner,
    offsets_replaced,
    placed,
    read_head,
    rotations_of,
    shifts_of,
    table_of,
)
from viewer.rig.arrays import Floats
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import Timing

_HEAD = 1 << 20  # maximum number of bytes up to the end of the hierarchy
_PART = 1 << 19  # bytes per part, which is extended to the end of its last line
_LONGEST = 1 << 24  # maximum length of a line, bytes
_MARK = b"\xef\xbb\xbf"  # byte order mark, which Source removes


class Irregular(Exception):  # noqa: N818 - it is not an error
    """Raised if a file is not regular, so that it must be read as a whole."""


@dataclass(frozen=True, slots=True, eq=False)
class BvhStream:
    """A regular file whose frames are read on demand."""

    path: Path
    """The file."""
    table: Table
    """Its joints."""
    start: int
    """Offset of the first frame in the file."""
    motion: SkeletonMotion
    """The skeleton, with the few frames that the estimates need. The timing of its clip has all
    frames, each of which refers to the row of one of these few."""

    @property
    def n_frames(self) -> int:
        """Number of frames, N."""
        return self.motion.clip.timing.n_frames

    @property
    def may_move_inner_joints(self) -> bool:
        """Whether a joint other than a single root has position channels."""
        if self.table.parents.count(-1) > 1:
            return bool(self.table.moves)
        return bool(inner_moves(self.table))

    def clips(self, first: int, stop: int) -> Iterator[SampledClip]:
        """Yield a range of frames as clips of consecutive parts, each starting at 0 seconds.

        Raises Irregular if any part of the file is invalid, even if parts have already been
        yielded.
        """
        clip, count, is_zero = self.motion.clip, 0, True
        for part in _parts(self.path, self.start):
            values = parsed_rows(part, self.table.n_channels)
            is_zero = is_zero and not moves_inner(self.table, values)
            chosen = values[max(first - count, 0) : max(stop - count, 0)]
            count += len(values)
            if len(chosen):
                yield clip_of(self.table, chosen, clip.name, clip.timing.frame_rate)
            if len(chosen) < len(values):
                _check_reach(self.table, values)
        # Reading the whole file reports position channels of inner joints that are all zero.
        base = offsets_replaced(self.table)
        if count != self.n_frames or (is_zero and base[inner_moves(self.table)].any()):
            raise Irregular


def open_stream(source: Source) -> BvhStream | None:
    """Return a long file as a stream, or None if it must be read as a whole.

    ``source``: the file, recognised as a ``.bvh``; warnings about its hierarchy are added, unless
    the result is None.
    """
    with source.path.open("rb") as file:
        data = file.read(_HEAD)
    head = Source(source.path, data)
    try:
        hierarchy = read_hierarchy(head)
        table = table_of(head, hierarchy.joints)
        if hierarchy.motion < 0:
            return None
        declared, time, start = read_head(head, hierarchy.motion)
        first = head.next_word(start)
        if declared is None or time is None or first is None or first.end() == len(data):
            return None
        rate = frame_rate(head, time)
        if table.n_channels == 0 or has_few_channels(table, declared):
            return None
        start = first.start() + (len(_MARK) if data.startswith(_MARK) else 0)
        stream = _opened(head, table, start, declared, rate)
    except (FormatError, Irregular, OSError):
        return None
    for found in head.diagnostics:
        source.diagnostics.add(found)
    return stream


def _opened(source: Source, table: Table, start: int, count: int, rate: float) -> BvhStream:
    """Count the lines, and read the frames that are needed for the estimates."""
    wanted = examined_frames(count).astype(np.int64) if count else np.zeros(0, np.int64)
    found: list[bytes] = []
    n_lines = 0
    for part in _parts(source.path, start):
        n_new = part.count(b"\n")
        inside = wanted[(wanted >= n_lines) & (wanted < n_lines + n_new)] - n_lines
        if len(inside):
            lines = part.split(b"\n")
            found += [lines[line] for line in inside.tolist()]
        n_lines += n_new
    if n_lines != count or count == 0:
        raise Irregular
    values = parsed_rows(b"\n".join(found) + b"\n", table.n_channels)
    clip = clip_of(table, values, source.path.stem, rate)
    rows = np.searchsorted(wanted, np.arange(count), side="right") - 1
    timing = Timing(rate, rows.astype(np.int32))
    motion = skeleton_motion(table, replace(clip, timing=timing))
    return BvhStream(source.path, table, start, motion)


def _parts(path: Path, start: int) -> Iterator[bytes]:
    """Yield parts of the file that consist of whole lines, each ending with LF."""
    with path.open("rb") as file:
        file.seek(start)
        while part := file.read(_PART):
            part += file.readline(_LONGEST)
            if not part.endswith(b"\n") or not file.peek(1):
                if len(part) > _LONGEST:
                    raise Irregular
                part = part.rstrip()
                part += b"\n" if part else b""
            yield part


def parsed_rows(part: bytes, width: int) -> Floats:
    """Return the frames in a text of whole lines: (N, width); raises Irregular if invalid."""
    values, bad = parse_numbers(part, 0, len(part), is_kept=False)
    if bad >= 0 or len(values) != width * part.count(b"\n"):
        raise Irregular
    return values.reshape(-1, width)


def clip_of(table: Table, values: Floats, name: str, rate: float) -> SampledClip:
    """Return frames as a clip; raises Irregular if a translation is beyond the limit."""
    translations = None
    if table.moves:
        translations = placed(table, _check_reach(table, values))
    rows = np.arange(len(values), dtype=np.int32)
    return SampledClip(name, Timing(rate, rows), rotations_of(table, values), translations)


def _check_reach(table: Table, values: Floats) -> Floats:
    """Return the translations of frames: (N, M); raises Irregular if one is beyond the limit."""
    shifts = shifts_of(table, values, offsets_replaced(table))
    if is_beyond(shifts).any():
        raise Irregular
    return shifts
