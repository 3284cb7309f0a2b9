"""Parser for the MOTION of a BVH file: frame time and one row of numbers per frame."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._neutral import held_rows
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_numbers, to_number
from viewer.formats._text.words import Words, number_key, read_words, refuse_words
from viewer.rig.arrays import Floats

__all__ = ["Motion", "read_head", "read_motion"]

Places = NDArray[np.int64]

_FRAMES = re.compile(rb"\s*Frames[ \t]*:?\s*(\S*)", re.IGNORECASE)
_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?\s*(\S*)", re.IGNORECASE)
_LINE = re.compile(rb"[^\r\n]+")


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The channel values of all frames.

    Attributes
    ----------
    values : (N, C)
        One column per channel: lengths and degrees.
    frame_time : bytes or None
        Seconds between frames as written; None if missing.
    has_frames : bool
        False for the rest pose of a file without frames.
    """

    values: Floats
    frame_time: bytes | None
    has_frames: bool = True


def read_motion(source: Source, start: int, n_channels: int) -> Motion:
    """Read the frames.

    Parameters
    ----------
    source : Source
        The file; warned if the number of frames differs from the declared one.
    start : int
        Offset after the word MOTION; -1 for a file without one.
    n_channels : int
        Values per frame, C.

    Returns
    -------
    Motion
        Motion with at least one frame: zeros if the file has none.

    Raises
    ------
    FormatError
        If a word is not a number, or a row is too short or too long; the error has the line.
    """
    if start < 0:
        source.warn("F007.bvh-no-motion", source.end)
        return _rest(n_channels, None)
    declared, time, start = read_head(source, start)
    if declared is None:
        source.warn("F007.bvh-no-count", start)
    if n_channels == 0:
        source.warn("F007.bvh-no-channels", start)
        return _rest(0, time)
    rows = _rows(source, start, n_channels, declared)
    return Motion(rows, time) if len(rows) else _rest(n_channels, time)


def read_head(source: Source, start: int) -> tuple[int | None, bytes | None, int]:
    """Return the declared number of frames and frame time, if any, and the offset after them."""
    declared: int | None = None
    time: bytes | None = None
    is_header = True
    while is_header:
        is_header = False
        if declared is None and (match := _FRAMES.match(source.data, start)):
            declared, start, is_header = _count(source, match), match.end(), True
        if time is None and (match := _TIME.match(source.data, start)):
            time, start, is_header = _seconds(source, match), match.end(), True
    return declared, time, start


def _rest(n_channels: int, time: bytes | None) -> Motion:
    return Motion(np.zeros((1, n_channels)), time, has_frames=False)


def _count(source: Source, match: re.Match[bytes]) -> int:
    value = to_number(match[1])
    if value is None or value < 0 or value != int(value):
        raise source.fault("F002.count", match.start(1), item="Frames", found=match[1] or None)
    return int(value)


def _seconds(source: Source, match: re.Match[bytes]) -> bytes:
    value = to_number(match[1])
    if value is None or value < 0.0:
        raise source.fault("F002.bvh-seconds", match.start(1), found=match[1] or None)
    return match[1]


def _rows(source: Source, start: int, width: int, declared: int | None) -> Floats:
    """Return all complete frames: (N, C)."""
    data = source.data
    source.remember("frames", lambda row: source.number_offset(start, len(data), row * width))
    # Motions are usually read once, and exported ones are read back: caching would only waste
    # space.
    values, bad = parse_numbers(data, start, len(data), is_kept=False)
    whole, rest = divmod(len(values), width)
    is_whole = bad < 0 and rest == 0 and whole > 0
    if is_whole and (declared is None or whole == declared):
        return values.reshape(whole, width)
    repaired = _held_frames(source, start, width, declared)
    if repaired is not None:
        return repaired
    if bad >= 0:
        _refuse_word(source, start, bad, width, declared)
    if rest or (declared is not None and whole != declared):
        _check_lines(source, start, width, declared)
        _warn_of_difference(source, width, declared, whole, rest)
    if whole == 0:
        source.warn("F007.bvh-empty", start)
    return values[: whole * width].reshape(whole, width)


def _refuse_word(source: Source, start: int, bad: int, width: int, declared: int | None) -> None:
    """Refuse a word that is not a number, unless it follows the last frame."""
    offset = source.word_offset(start, bad)
    match = source.next_word(offset)
    word = b"" if match is None else match.group()
    if declared is not None and bad >= declared * width:
        source.warn("F006.bvh-after", offset, found=word)
        return
    frame = Phrase("bvh-frame", frame=bad // width)
    raise source.fault(number_key(word), offset, item=frame, found=word)


def _held_frames(source: Source, start: int, width: int, declared: int | None) -> Floats | None:
    """Record all errors in the frames, and return the frames with invalid ones replaced.

    None if there is no error in them, or the starts of the frames are unknown.
    """
    words = read_words(source.data, start, len(source.data))
    begins, sizes = words.rows()
    rest = 0
    if (sizes == width).sum() * 2 > len(sizes):  # the file has one frame per line
        begins, sizes, rest = _without_rest(words, begins, sizes, width)
        begins, sizes = begins[:declared], sizes[:declared]
    else:
        end = len(words.values) if declared is None else declared * width
        if len(words.values) < end or end % width:
            return None
        begins, sizes = np.arange(0, end, width), np.full(end // width, width)
    last = int(begins[-1] + sizes[-1]) if len(begins) else 0
    bad = words.bad[words.bad < last]
    fits = sizes == width
    if fits.all() and len(bad) == 0:
        return None
    frames = np.searchsorted(begins, bad, side="right") - 1
    frame_of = dict(zip(bad.tolist(), frames.tolist(), strict=True))
    refuse_words(
        source,
        words,
        bad,
        lambda word: Phrase("bvh-frame", frame=frame_of[word]),
        "frames",
        frames,
    )
    _refuse_sizes(source, words.offsets[begins], sizes, width)
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    if rest or (declared is not None and len(rows) != declared):
        _warn_of_difference(source, width, declared, len(rows), rest)
    return held_rows(rows, np.isnan(rows).any(axis=1))


def _without_rest(
    words: Words, begins: Places, sizes: Places, width: int
) -> tuple[Places, Places, int]:
    """Return lines without a truncated last one, and the number of its values."""
    size = int(sizes[-1])
    if size >= width or np.isnan(words.values[begins[-1] :]).any():
        return begins, sizes, 0
    return begins[:-1], sizes[:-1], size


def _refuse_sizes(source: Source, offsets: Places, sizes: Places, width: int) -> None:
    """Refuse rows that are too short or too long."""
    wrong = np.flatnonzero(sizes != width)
    if len(wrong):
        first = int(wrong[0])
        source.refuse(
            "F002.bvh-row",
            int(offsets[first]),
            len(wrong),
            "frames",
            wrong,
            frame=first,
            expected=width,
            found=int(sizes[first]),
        )


def _check_lines(source: Source, start: int, width: int, declared: int | None) -> None:
    """Refuse a file with one frame per line if a row other than the last has a wrong length."""
    lines = [
        (line.start(), len(line.group().split())) for line in _LINE.finditer(source.data, start)
    ]
    lines = [line for line in lines if line[1]]
    odd = [(at, row) for row, (at, found) in enumerate(lines) if found != width]
    if not odd or len(lines) < 2:
        return
    if len(odd) == len(lines):
        # If no row has the right length, each line is a frame only if all lines have the same
        # count.
        if len(lines) == declared:
            raise _wrong_row(source, 0, width, lines[0])
        return
    row = odd[0][1]
    if row < len(lines) - 1 or lines[row][1] > width:
        raise _wrong_row(source, row, width, lines[row])


def _wrong_row(source: Source, row: int, width: int, line: tuple[int, int]) -> FormatError:
    return source.fault("F002.bvh-row", line[0], frame=row, expected=width, found=line[1])


def _warn_of_difference(
    source: Source, width: int, declared: int | None, whole: int, rest: int
) -> None:
    expected = None if declared is None else Phrase("bvh-frames", n=declared)
    part = Phrase("bvh-part", n=rest, width=width) if rest else None
    if whole == 0 and (declared or rest):
        raise source.fault("F002.bvh-no-frame", source.end, expected=expected, rest=part)
    source.warn("F007.bvh-frames", source.end, expected=expected, found=whole, rest=part)
