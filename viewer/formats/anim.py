r"""Reader and writer of ``.anim`` clips (UCSD course CSE169).

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
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Part, Phrase, note, wording
from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats._source import Source
from viewer.formats._text.joint_parser import Word, WordParser
from viewer.formats._text.numbers import to_number
from viewer.formats._text.words import number_key
from viewer.formats._translation_limit import FARTHEST
from viewer.media.saving import save_text
from viewer.phrases import counted, listed, optional, quoted, rounded
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import (
    EXTRAPOLATIONS,
    TANGENT_RULES,
    Channel,
    Clip,
    Extrapolation,
    Tangent,
)
from viewer.rigs.number_text import number_text

_MODES: dict[bytes, Extrapolation] = {mode.encode(): mode for mode in EXTRAPOLATIONS}
_RULES: dict[bytes, Tangent] = {rule.encode(): rule for rule in TANGENT_RULES}
_WORDS_PER_KEY = 4

_Key = tuple[float, float, Tangent, Tangent, int]  # the last item is the key's offset


def read(source: Source) -> Clip:
    """Read a clip."""
    return _Parser(source).clip()


class _Parser(WordParser):
    """Recursive-descent parser over the words of a file."""

    def __init__(self, source: Source) -> None:
        super().__init__(source)
        # The channel and the key that contain the current word.
        self.channel: int | None = None
        self.key: int | None = None
        self.starts: list[int] = []  # offsets of all channels in the file

    def clip(self) -> Clip:
        """Return the whole file as a clip."""
        self._expect(b"animation")
        self._expect(b"{")
        span: tuple[float, float] | None = None
        count: int | None = None
        stated: Word | None = None
        channels: list[Channel] = []
        while self.word is not None and self.word.group() != b"}":
            text = self.word.group()
            if text == b"range":
                self.advance()
                span = self._range()
            elif text == b"numchannels":
                self.advance()
                stated, count = self.word, self._count("numchannels")
            elif text == b"channel":
                channels.append(self._channel(len(channels)))
            else:
                raise self.fault_here("F002.anim-item: {where}: expected a channel, found {found}")
        self.channel, found = None, len(channels)
        if self.word is None:
            self.source.warn(wording.CLOSING)
        if count is None:
            self._refuse(
                "F002.anim-no-count: {where}: expected numchannels, found {found}{begins}",
                found=found,
            )
        elif count != found:
            self._refuse(
                "F002.anim-channels: {where}: expected {expected} as declared by numchannels, "
                "found {found}",
                stated,
                expected=counted(count, "channel"),
                found=found,
            )
        self.advance()
        if self.word is not None:
            self.source.warn(
                "F006.anim-after: ignored data after the animation, starting with {found}",
                self.word.start(),
                found=quoted(self.word.group()),
            )
        self.source.remember("channels", self.starts.__getitem__)
        return Clip(self.source.path.stem, tuple(channels), *(span or self._key_span(channels)))

    def _range(self) -> tuple[float, float]:
        word, start, end = self.word, self._number("range"), self._number("range")
        if start > end:
            where = None if word is None else word.start()
            low, high = number_text(end), number_text(start)
            self.source.warn(
                "F007.anim-reversed: reversed range: read as {start} to {end}",
                where,
                start=low,
                end=high,
            )
        return min(start, end), max(start, end)

    def _key_span(self, channels: list[Channel]) -> tuple[float, float]:
        times = np.concatenate([np.zeros(0), *(channel.times for channel in channels)])
        span = (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)
        start, end = map(number_text, span)
        self.source.warn(
            "F007.anim-no-range: missing range: the range of the keys is used, {start} to {end}",
            start=start,
            end=end,
        )
        return span

    def _channel(self, index: int) -> Channel:
        self.channel = index
        self.starts.append(self.word.start() if self.word else 0)
        self.advance()
        # Some files label channels with numbers, but only the order matters.
        while self.word is not None and self.word.group() not in (b"{", b"}", b"extrapolate"):
            self.advance()
        self._expect(b"{")
        extrapolation: tuple[Extrapolation, Extrapolation] = ("constant", "constant")
        rows: list[_Key] | None = None
        while self.word is not None and self.word.group() != b"}":
            text = self.word.group()
            if text == b"extrapolate":
                self.advance()
                extrapolation = (self._mode(), self._mode())
            elif text == b"keys":
                if rows is not None:
                    raise self.fault_here(
                        "F002.anim-keys-again: {where}: expected a single list of keys, found a "
                        "second one"
                    )
                self.advance()
                rows = self._keys()
            else:
                raise self.fault_here(
                    "F002.anim-channel-item: {where}: expected extrapolate or keys, found {found}"
                )
        self._expect(b"}")
        rows = rows or []
        times = [row[0] for row in rows]
        if not rows:
            self.source.warn(
                "C010.anim-no-keys: channel {channel} has no keys: value 0 used",
                part="channels",
                places=[index],
                channel=index,
            )
        if times != sorted(times):
            late = next(i for i in range(1, len(times)) if times[i] < times[i - 1])
            self.source.warn(
                "C001.anim-sorted: channel {channel}: key {late} is earlier than key {before}; "
                "keys sorted",
                rows[late][4],
                part="channels",
                places=[index],
                channel=index,
                late=late,
                before=late - 1,
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
            self.key = len(rows) + lost
            start = self.word.start()
            time, value = self._number("time", of_key=True), self._number("value", of_key=True)
            row = time, value, self._tangent(), self._tangent(), start
            if math.isnan(time + value):
                lost += 1  # the error has been recorded; the other keys define the curve
            else:
                rows.append(row)
        self.key = None
        found = len(rows) + lost
        if found != count:
            self._refuse(
                "F002.anim-keys: {where}: expected {expected}, found {found}",
                stated,
                expected=counted(count, "key"),
                found=found,
            )
        self._expect(b"}")
        return rows

    def _where(self) -> Phrase:
        """Return the phrase for the item that contains the current word."""
        if self.channel is None:
            return Phrase("animation")
        if self.key is None:
            return Phrase("channel {channel}", channel=self.channel)
        return Phrase("channel {channel}, key {index}", channel=self.channel, index=self.key)

    def _begins(self) -> Phrase | None:
        """Return the location of the last channel if the file ends inside it, or None."""
        if self.word is not None:
            return None
        if self.channel is None:
            return Phrase(
                "{where} begins on line {line}", where=Phrase("animation"), line=self.source.line(0)
            )
        channel = Phrase("channel {channel}", channel=self.channel)
        line = self.source.line(self.starts[self.channel])
        return Phrase("{where} begins on line {line}", where=channel, line=line)

    def _values(self, own: dict[str, object]) -> dict[str, object]:
        """Return the values that all messages about the current word have in common."""
        begins = optional(" ({})", self._begins())
        return {"where": self._where(), "found": quoted(self.text), "begins": begins, **own}

    def fault_here(self, key: str, **values: object) -> FormatError:
        """Return the exception for an error at the current word that stops parsing."""
        return self.source.fault(key, self.place, **self._values(values))

    def _refuse(self, key: str, word: Word | None = None, **values: object) -> None:
        """Record an error at a word, by default the current one, and continue."""
        where = self.place if word is None else word.start()
        part: Part = "" if self.channel is None else "channels"
        places = None if self.channel is None else [self.channel]
        self.source.refuse(key, where, 1, part, places, **self._values(values))

    def _expect(self, text: bytes) -> None:
        if self.text != text:
            looks = self.source.looks_like() if text == b"animation" else None
            raise self.fault_here(
                'F002.anim-word: {where}: expected "{expected}", found {found}{looks}{begins}',
                expected=text.decode(),
                looks=optional(" ({})", looks),
            )
        self.advance()

    def _number(self, item: str, of_key: bool = False) -> float:
        """Read a number; NaN if it belongs to a key and is invalid."""
        if self.word is None:
            raise self.fault_here(
                "F002.anim-end: {item}: expected a number, found the end of the file{begins}",
                item=self._item(item),
            )
        word = self.word.group()
        value = to_number(word)
        if value is None:
            if not of_key or word in (b"{", b"}"):
                raise self.fault_here(number_key(word), item=self._item(item))
            self._refuse(number_key(word), item=self._item(item))
            value = math.nan
        elif item == "value" and abs(value) > FARTHEST:
            self._refuse(
                wording.BEYOND, item=self._item(item), most=rounded(FARTHEST, 2), found=value
            )
            value = math.nan
        self.advance()
        return value

    def _item(self, item: str) -> Phrase:
        return Phrase("{where}: {item}", where=self._where(), item=item)

    def _count(self, item: str) -> int:
        word, value = self.word, self._number(item)
        left = len(self.source.data) - (word.end() if word else 0)
        if value != int(value) or value < 0 or value * _WORDS_PER_KEY > left:
            self.word = word
            raise self.fault_here(
                "F002.anim-count: {item}: expected a count that fits the file, found {found} with "
                "{left} bytes left",
                item=self._item(item),
                left=left,
            )
        return int(value)

    def _mode(self) -> Extrapolation:
        mode = _MODES.get(self.keyword)
        if mode is None:
            raise self.fault_here(
                "F002.anim-mode: {where}: extrapolate: expected one of {modes}, found "
                "{found}{begins}",
                modes=listed(EXTRAPOLATIONS),
            )
        self.advance()
        return mode

    def _tangent(self) -> Tangent:
        text = self.keyword
        tangent = _RULES.get(text, to_number(text))
        if tangent is None:
            message = (
                "F002.anim-tangent: {where}: tangent: expected {rules} or a number, found "
                "{found}{begins}"
            )
            if self.word is None or text in (b"{", b"}"):
                raise self.fault_here(message, rules=listed(TANGENT_RULES))
            self._refuse(message, rules=listed(TANGENT_RULES))
            tangent = "smooth"
        self.advance()
        return tangent


def write(clip: Clip | Figure, path: str | Path) -> list[Diagnostic]:
    """Write a clip with a channel per DOF, in the order of the DOFs."""
    if not isinstance(clip, Clip):
        raise UnsupportedFormatError(note("F002.anim-figure: .anim stores a clip, not a figure"))
    if [channel.target for channel in clip.channels] != list(range(len(clip.channels))):
        raise UnsupportedFormatError(
            note("F002.anim-order: .anim needs one channel per DOF, in the order of the DOFs")
        )
    head = f"animation {{\n\trange {clip.start!r} {clip.end!r}\n"
    head += f"\tnumchannels {len(clip.channels)}\n"
    save_text(path, head + "".join(map(_channel_text, clip.channels)) + "}\n")
    return []


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
