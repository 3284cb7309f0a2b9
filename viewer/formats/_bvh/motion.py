"""The MOTION of a BVH file: frame time and one row of numbers per frame."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from viewer.errors import FormatError, counted
from viewer.formats._numbers import parse_numbers, to_number
from viewer.formats._source import Source, no_number
from viewer.formats._tolerant import held_rows, read_words, refuse_words
from viewer.phrases import quoted
from viewer.rig.arrays import Floats

__all__ = ["Motion", "read_motion"]

_FRAMES = re.compile(rb"\s*Frames[ \t]*:?\s*(\S*)", re.IGNORECASE)
_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?\s*(\S*)", re.IGNORECASE)
_LINE = re.compile(rb"[^\r\n]+")


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The numbers of all frames.

    Attributes
    ----------
    values : (N, C)
        One column per channel: lengths and degrees.
    frame_time : bytes or None
        Seconds between frames as written; None if the file does not say.
    """

    values: Floats
    frame_time: bytes | None


def read_motion(source: Source, start: int, n_channels: int) -> Motion:
    """Read the frames.

    Parameters
    ----------
    source : Source
        The file; warnings say where fewer or more frames follow than are declared.
    start : int
        Offset behind the word MOTION; -1 for a file without one.
    n_channels : int
        Numbers per frame, C.

    Returns
    -------
    Motion
        With at least one frame: zeros, so the rest pose, if the file has none.

    Raises
    ------
    FormatError
        With the line of a word that should be a number, or of a row that is too short or long.
    """
    if start < 0:
        source.warn("no MOTION: shown in the rest pose", len(source.data.rstrip()))
        return _rest(n_channels, None)
    declared: int | None = None
    time: bytes | None = None
    is_header = True
    while is_header:
        is_header = False
        if declared is None and (match := _FRAMES.match(source.data, start)):
            declared, start, is_header = _count(source, match), match.end(), True
        if time is None and (match := _TIME.match(source.data, start)):
            time, start, is_header = _seconds(source, match), match.end(), True
    if declared is None:
        source.warn("Frames is missing: all rows are used", start)
    if n_channels == 0:
        source.warn("no joint has channels: shown in the rest pose", start)
        return _rest(0, time)
    return Motion(_rows(source, start, n_channels, declared), time)


def _rest(n_channels: int, time: bytes | None) -> Motion:
    return Motion(np.zeros((1, n_channels)), time)


def _count(source: Source, match: re.Match[bytes]) -> int:
    value = to_number(match[1])
    if value is None or value < 0 or value != int(value):
        raise source.error(f"Frames: expected a count, found {_found(match[1])}", match.start(1))
    return int(value)


def _seconds(source: Source, match: re.Match[bytes]) -> bytes:
    value = to_number(match[1])
    if value is None or value < 0.0:
        raise source.error(
            f"Frame Time: expected seconds, found {_found(match[1])}", match.start(1)
        )
    return match[1]


def _found(word: bytes) -> str:
    return quoted(word) if word else "the end of the file"


def _mended(source: Source, start: int, width: int, declared: int | None) -> Floats | None:
    """Return the frames, noting all faults in them; None if there are none, or too many to tell.

    A frame that cannot be used is as the one before.
    """
    words = read_words(source.data, start, len(source.data))
    bad = words.bad
    begins, sizes = words.rows()
    by_line = (sizes == width).sum() * 2 > len(sizes)
    if by_line and declared is not None:
        begins, sizes = begins[:declared], sizes[:declared]
    if not by_line:
        end = len(words.values) if declared is None else declared * width
        if len(words.values) < end or end % width:
            return None
        begins, sizes = np.arange(0, end, width), np.full(end // width, width)
    last = int(begins[-1] + sizes[-1]) if len(begins) else 0
    bad = bad[bad < last]
    fits = sizes == width
    if fits.all() and len(bad) == 0:
        return None
    frames = np.searchsorted(begins, bad, side="right") - 1
    names = dict(zip(bad.tolist(), frames.tolist(), strict=True))
    refuse_words(source, words, bad, lambda word: f"frame {names[word]}", "frames", frames)
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        first = int(wrong[0])
        place = int(words.offsets[begins[first]]), int(sizes[first])
        error = _wrong_row(source, first, width, place)
        source.refuse_error(error, len(wrong), "frames", wrong)
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    if declared is not None and len(rows) != declared:
        _say_difference(source, width, declared, len(rows), 0)
    return held_rows(rows, np.isnan(rows).any(axis=1))


def _rows(source: Source, start: int, width: int, declared: int | None) -> Floats:
    """Return all whole frames: (N, C)."""
    source.remember(
        "frames", lambda row: source.number_offset(start, len(source.data), row * width)
    )
    if source.faults is not None:
        mended = _mended(source, start, width, declared)
        if mended is not None:
            return mended
    values, bad = parse_numbers(source.data, start, len(source.data))
    if bad >= 0:
        offset = source.word_offset(start, bad)
        word = source.next_word(offset)
        found = quoted(word.group()) if word else "the end of the file"
        if declared is None or bad < declared * width:
            text = no_number(word.group() if word else None)
            raise source.error(f"frame {bad // width}: {text}", offset)
        source.warn(f"ignored what follows the last frame, {found}", offset)
    whole, rest = divmod(len(values), width)
    if rest or (declared is not None and whole != declared):
        _check_lines(source, start, width, declared)
        _say_difference(source, width, declared, whole, rest)
    if whole == 0:
        source.warn("no frames: shown in the rest pose", start)
        return _rest(width, None).values
    return values[: whole * width].reshape(whole, width)


def _check_lines(source: Source, start: int, width: int, declared: int | None) -> None:
    """Refuse a file with a frame per line where a row other than the last has a wrong length."""
    lines = [
        (line.start(), len(line.group().split())) for line in _LINE.finditer(source.data, start)
    ]
    lines = [line for line in lines if line[1]]
    odd = [(at, row) for row, (at, found) in enumerate(lines) if found != width]
    if not odd or len(lines) < 2:
        return
    if len(odd) == len(lines):
        # No row fits: a frame per line only if the file has as many lines as frames.
        if len(lines) == declared:
            raise _wrong_row(source, 0, width, lines[0])
        return
    row = odd[0][1]
    if row < len(lines) - 1 or lines[row][1] > width:
        raise _wrong_row(source, row, width, lines[row])


def _wrong_row(source: Source, row: int, width: int, line: tuple[int, int]) -> FormatError:
    return source.error(
        f"frame {row}: expected {width} numbers as CHANNELS says, found {line[1]}", line[0]
    )


def _say_difference(
    source: Source, width: int, declared: int | None, whole: int, rest: int
) -> None:
    wanted = "" if declared is None else f"expected {counted(declared, 'frame')} as Frames says, "
    part = f" and {rest} of {width} numbers of the next" if rest else ""
    if whole == 0 and (declared or rest):
        raise source.error(f"{wanted}found none{part}", len(source.data.rstrip()))
    source.warn(f"{wanted}found {whole}{part}; the whole ones are used", len(source.data.rstrip()))
