r"""Read and write ``.anim`` clips (UCSD course CSE169).

::

    anim    = "animation" "{" "range" t0 t1 "numchannels" C channel*C "}"
    channel = "channel" label? "{" "extrapolate" mode mode "keys" n "{" key*n "}" "}"
    mode    = constant | linear | cycle | cycle_offset | bounce
    key     = time value tangent tangent                   incoming, outgoing
    tangent = flat | linear | smooth | number

Times are seconds. Channels are the root's translation x, y, z and then the rotations x, y, z of
joint 0, 1, 2 and so on, which is the order of the skeleton's DOF table.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats._numbers import to_number
from viewer.formats._reach import FARTHEST, within_text
from viewer.formats._source import Source, no_number
from viewer.media.saving import save_text
from viewer.phrases import quoted
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import (
    EXTRAPOLATIONS,
    TANGENT_RULES,
    Channel,
    Clip,
    Extrapolation,
    Tangent,
)
from viewer.rig.number_text import number_text

__all__ = ["read", "write"]

_MODES: dict[bytes, Extrapolation] = {mode.encode(): mode for mode in EXTRAPOLATIONS}
_RULES: dict[bytes, Tangent] = {rule.encode(): rule for rule in TANGENT_RULES}
_WORDS_PER_KEY = 4

Word = re.Match[bytes]
_Key = tuple[float, float, Tangent, Tangent, int]  # the last is where it begins


def read(source: Source) -> Clip:
    """Read a clip.

    Parameters
    ----------
    source : Source
        The file; what is odd but readable is added to its warnings.

    Returns
    -------
    Clip
        Channel i moves DOF i.

    Raises
    ------
    FormatError
        With file and line, if the text breaks the grammar.
    """
    return _Parser(source).clip()


class _Parser:
    """Walks the words of a file."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.words = source.words()
        self.word: Word | None = None
        self.what = "animation"
        self.began = 0  # where that begins
        self.starts: list[int] = []  # of all channels

    def clip(self) -> Clip:
        """Return the whole file as a clip."""
        self._advance()
        self._expect(b"animation")
        self._expect(b"{")
        span: tuple[float, float] | None = None
        count: int | None = None
        stated: Word | None = None
        channels: list[Channel] = []
        while self.word is not None and self.word.group() != b"}":
            text = self.word.group()
            if text == b"range":
                self._advance()
                span = self._range()
            elif text == b"numchannels":
                self._advance()
                stated, count = self.word, self._count("numchannels")
            elif text == b"channel":
                channels.append(self._channel(len(channels)))
            else:
                raise self._error(f"expected a channel, found {quoted(text)}")
        self._finish(count, stated, len(channels))
        self.source.remember("channels", self.starts.__getitem__)
        return Clip(self.source.path.stem, tuple(channels), *(span or self._key_span(channels)))

    def _range(self) -> tuple[float, float]:
        word, start, end = self.word, self._number("range"), self._number("range")
        if start > end:
            where = None if word is None else word.start()
            span = f"{number_text(end)} to {number_text(start)}"
            self.source.warn(f"range ends before it begins: read as {span}", where)
        return min(start, end), max(start, end)

    def _key_span(self, channels: list[Channel]) -> tuple[float, float]:
        times = np.concatenate([np.zeros(0), *(channel.times for channel in channels)])
        span = (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)
        shown_span = f"{number_text(span[0])} to {number_text(span[1])}"
        self.source.warn(f"no range: that of the keys is played, {shown_span}")
        return span

    def _finish(self, count: int | None, stated: Word | None, found: int) -> None:
        self.what, self.began = "animation", 0
        if self.word is None:
            self.source.warn('the last "}" is missing')
        if count != found:
            wanted = "numchannels" if count is None else f"{count} channels as numchannels says"
            self.source.refuse_error(self._error(f"expected {wanted}, found {found}", stated))
        self._advance()
        if self.word is not None:
            self.source.warn(
                f"ignored what follows the animation, {quoted(self.word.group())}",
                self.word.start(),
            )

    def _channel(self, index: int) -> Channel:
        self.what = f"channel {index}"
        self.began = self.word.start() if self.word else 0
        self.starts.append(self.began)
        self._advance()
        # Some files number their channels; the order counts, not the number.
        while self.word is not None and self.word.group() not in (b"{", b"}", b"extrapolate"):
            self._advance()
        self._expect(b"{")
        extrapolation: tuple[Extrapolation, Extrapolation] = ("constant", "constant")
        rows: list[_Key] | None = None
        while self.word is not None and self.word.group() != b"}":
            text = self.word.group()
            if text == b"extrapolate":
                self._advance()
                extrapolation = (self._mode(), self._mode())
            elif text == b"keys":
                if rows is not None:
                    raise self._error("expected one list of keys, found another")
                self._advance()
                rows = self._keys()
            else:
                raise self._error(f"expected extrapolate or keys, found {quoted(text)}")
        self._expect(b"}")
        return self._make_channel(index, rows or [], extrapolation)

    def _make_channel(
        self,
        index: int,
        rows: list[_Key],
        extrapolation: tuple[Extrapolation, Extrapolation],
    ) -> Channel:
        times = [row[0] for row in rows]
        if not rows:
            self.source.warn(f"channel {index} has no keys: its value is 0")
        if times != sorted(times):
            late = next(i for i in range(1, len(times)) if times[i] < times[i - 1])
            self.source.warn(
                f"channel {index}: key {late} is before key {late - 1}; keys sorted", rows[late][4]
            )
            rows = sorted(rows, key=lambda row: row[0])
        return Channel(
            target=index,
            times=np.array([row[0] for row in rows], dtype=np.float64),
            values=np.array([row[1] for row in rows], dtype=np.float64),
            tangents=tuple((row[2], row[3]) for row in rows),
            extrapolation=extrapolation,
        )

    def _keys(self) -> list[_Key]:
        stated, count = self.word, self._count("keys")
        self._expect(b"{")
        rows: list[_Key] = []
        lost = 0
        while self.word is not None and self.word.group() != b"}":
            self.what = f"{self.what.split(',')[0]}, key {len(rows) + lost}"
            start = self.word.start()
            time, value = self._number("time", of_key=True), self._number("value", of_key=True)
            row = time, value, self._tangent(), self._tangent(), start
            if math.isnan(time + value):
                lost += 1  # it was noted; the curve is drawn through the other keys
            else:
                rows.append(row)
        self.what = self.what.split(",")[0]
        if len(rows) + lost != count:
            found = f"expected {count} keys, found {len(rows) + lost}"
            self.source.refuse_error(self._error(found, stated))
        self._expect(b"}")
        return rows

    def _advance(self) -> None:
        self.word = next(self.words, None)

    def _error(self, message: str, word: Word | None = None) -> FormatError:
        """Return an error at a word, or else at the current one."""
        word = self.word if word is None else word
        if word is not None:
            return self.source.error(f"{self.what}: {message}", word.start())
        first = self.source.line(self.began)
        return self.source.error(
            f"{self.what}: {message} ({self.what.split(',')[0]} begins in line {first})",
            len(self.source.data.rstrip()),
        )

    def _found(self) -> str:
        return "the end of the file" if self.word is None else quoted(self.word.group())

    def _expect(self, text: bytes) -> None:
        if self.word is None or self.word.group() != text:
            looks = self.source.looks_like() if text == b"animation" else None
            hint = f" ({looks})" if looks else ""
            raise self._error(f'expected "{text.decode()}", found {self._found()}{hint}')
        self._advance()

    def _number(self, item: str, of_key: bool = False) -> float:
        """Read a number; NaN for a key's that is none, where faults are noted."""
        value = None if self.word is None else to_number(self.word.group())
        if value is None:
            word = None if self.word is None else self.word.group()
            error = self._error(f"{item}: {no_number(word)}")
            if not of_key or self.word is None or self.word.group() in (b"{", b"}"):
                raise error
            self.source.refuse_error(error)
            value = math.nan
        elif item == "value" and abs(value) > FARTHEST:
            self.source.refuse_error(self._error(f"{item}: {within_text(value)}"))
            value = math.nan
        self._advance()
        return value

    def _count(self, item: str) -> int:
        word, value = self.word, self._number(item)
        left = len(self.source.data) - (word.end() if word else 0)
        if value != int(value) or value < 0 or value * _WORDS_PER_KEY > left:
            self.word = word
            raise self._error(
                f"{item}: expected a count that the file can hold, found {self._found()} "
                f"with {left} bytes left"
            )
        return int(value)

    def _mode(self) -> Extrapolation:
        mode = _MODES.get(self.word.group()) if self.word else None
        if mode is None:
            raise self._error(
                f"extrapolate: expected one of {', '.join(EXTRAPOLATIONS)}, found {self._found()}"
            )
        self._advance()
        return mode

    def _tangent(self) -> Tangent:
        text = self.word.group() if self.word else b""
        tangent = _RULES.get(text, to_number(text))
        if tangent is None:
            error = self._error(
                f"tangent: expected {', '.join(TANGENT_RULES)} or a number, found {self._found()}"
            )
            if self.word is None or text in (b"{", b"}"):
                raise error
            self.source.refuse_error(error)
            tangent = "smooth"
        self._advance()
        return tangent


def write(clip: Clip | Figure, path: str | Path) -> None:
    """Write a clip.

    Parameters
    ----------
    clip : Clip
        With one channel per DOF, in the order of the table.
    path : str or Path
        Replaced only when the whole text has been written.

    Raises
    ------
    UnsupportedFormatError
        If it is a figure, or channels are missing or in another order.
    OutputError
        If the file cannot be written.
    """
    if not isinstance(clip, Clip):
        raise UnsupportedFormatError(".anim holds a clip, not a figure")
    if [channel.target for channel in clip.channels] != list(range(len(clip.channels))):
        raise UnsupportedFormatError(".anim needs a channel for every DOF, in their order")
    head = f"animation {{\n\trange {clip.start!r} {clip.end!r}\n"
    head += f"\tnumchannels {len(clip.channels)}\n"
    save_text(path, head + "".join(map(_channel_text, clip.channels)) + "}\n")


def _channel_text(channel: Channel) -> str:
    keys = zip(channel.times.tolist(), channel.values.tolist(), channel.tangents, strict=True)
    lines = "".join(
        f"\t\t\t{time!r} {value!r} {incoming} {outgoing}\n"
        for time, value, (incoming, outgoing) in keys
    )
    before, after = channel.extrapolation
    return (
        f"\tchannel {{\n\t\textrapolate {before} {after}\n"
        f"\t\tkeys {len(channel.times)} {{\n{lines}\t\t}}\n\t}}\n"
    )
