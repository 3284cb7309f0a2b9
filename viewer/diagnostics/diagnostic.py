"""Errors, warnings and notes as data.

A ``Diagnostic`` is the key and sentence of a message, a location and the values of the message; a
value that is text with values of its own is a ``Phrase``. A ``Collector`` keeps what a reader
finds, ``merged`` counts what differs only in its location, and ``described`` returns everything as
JSON data.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from viewer.data_classes import dataclass
from viewer.phrases import NO_VALUE, Remedy, Shown, as_data, listed, printable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from viewer.diagnostics.codes import Severity
    from viewer.schemas import DiagnosticData

Part = Literal[
    "",
    "positions",
    "weights",
    "triangles",
    "bindings",
    "joints",
    "items",
    "channels",
    "frames",
]
"""Part of a figure or motion that a diagnostic refers to."""
# Maximum number of warnings per file: users do not read longer lists.
_MOST = 100
# Maximum number of indices and names per diagnostic; the total is always included.
_LISTED = 100
_LONGEST = 1000  # maximum number of characters of a text in a sentence

NOUNS: dict[Part, str] = {
    "positions": "vertices",
    "weights": "vertices",
    "triangles": "triangles",
    "bindings": "joints",
    "joints": "joints",
    "items": "joints",
    "frames": "frames",
}
"""Plural noun for the elements of a part."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostic:
    """An error, warning or note from a reader, check or operation."""

    key: str
    """Code, dot and name of the message: ``"W004.vertices"``. The call adds a colon and the
    sentence, with the names of values in braces: ``"W006.joints: {n} no influence: {names}"``."""
    path: Path | None = None
    """The file that the message is about."""
    line: int | None = None
    """Line in that file, from 1."""
    part: Part = ""
    """Part of the figure or motion that ``places`` indexes. Readers replace the faulty elements
    with neutral values."""
    places: NDArray[np.int32] | None = None
    """(N,): indices, ascending: vertices (positions, weights), triangles, joints (bindings, joints,
    and items: boxes, limits and poses), channels of a clip, or rows of frames."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """Values in the sentence, as data. In the call they may be ``Shown`` as text."""
    count: int = 1
    """Number of errors that it represents; 0 if it only adds indices to an error reported by
    another diagnostic."""
    level: Severity | None = None
    """Severity, if different from that of the code."""
    is_refusal: bool = False
    """Whether ``load`` refuses the file because of it."""
    is_final: bool = False
    """Whether parsing of the file stopped there."""
    pointer: str = ""
    """JSON pointer (RFC 6901) to the element of that file, as in ``"/skins/0/joints/3"``."""
    sentence: str = ""
    """The message, with names of values in braces."""
    texts: Mapping[str, Shown | Remedy] = field(default_factory=dict)
    """Text of the values that are not written as they are."""

    def __post_init__(self) -> None:
        """Separate key and sentence, and data and text of the values."""
        key, _, sentence = self.key.partition(": ")
        if not (sentence or self.sentence):
            raise ValueError(f"message {key} without a sentence")
        values, texts = _apart(self.values)
        put = object.__setattr__
        put(self, "key", key)
        put(self, "sentence", sentence or self.sentence)
        put(self, "values", values)
        put(self, "texts", {**self.texts, **texts})

    @property
    def code(self) -> str:
        """The stable code: a key of ``CODES``."""
        return self.key.partition(".")[0]

    @property
    def severity(self) -> Severity:
        """A refusal is an error unless ``level`` differs."""
        from viewer.diagnostics.codes import CODES

        return self.level or ("error" if self.is_refusal else CODES[self.code].severity)

    @property
    def message(self) -> str:
        """The message on one line, without the location."""
        return _filled(self.sentence, self.values, self.texts)

    @property
    def full_message(self) -> str:
        """The message with the number of errors, and whether it stopped parsing."""
        text = self.message
        if self.count > 1:
            text += f"; first of {self.count}"
            noun = NOUNS.get(self.part)
            if self.places is not None and len(self.places) > 1 and noun is not None:
                text += f" ({noun} {listed(self.places.tolist())})"
        # Nothing could be checked in a file that cannot be read at all.
        is_cut = self.is_final and self.code != "F001"
        return text + "; the rest of the file was not checked" * is_cut

    @property
    def place(self) -> str:
        """``file:line`` or ``file#pointer``, or the known part of it."""
        return self.placed()

    def placed(self, longest: int = 300, is_short: bool = False) -> str:
        """Return ``place``, of at most ``longest`` characters; short without the folder."""
        if self.path is None:
            return ""
        path = printable(self.path.name if is_short else self.path, longest)
        if self.pointer:
            return f"{path}#{printable(self.pointer, 120)}"
        return path if self.line is None else f"{path}:{self.line}"

    @property
    def labelled(self) -> str:
        """Location and message, prefixed with the severity unless it is a note."""
        return str(self) if self.severity == "note" else f"{self.severity}: {self}"

    def __repr__(self) -> str:
        return f"<{self.key}: {self}>"

    def __str__(self) -> str:
        """Return location and message on one line."""
        return ": ".join(filter(None, (self.place, self.message)))


def note(key: str, path: Path | None = None, /, **values: Any) -> Diagnostic:
    """Return a message, mostly about a whole file, with the values of its sentence."""
    return Diagnostic(key, path, values=values)


class Phrase:
    """Part of a sentence with values of its own; equal to its text."""

    __slots__ = ("_texts", "sentence", "values")

    def __init__(self, sentence: str, **values: object) -> None:
        self.sentence = sentence
        self.values, self._texts = _apart(values)

    def __str__(self) -> str:
        """Return the text."""
        return _filled(self.sentence, self.values, self._texts)

    def __repr__(self) -> str:
        """Return the call that creates the phrase."""
        values = "".join(f", {name}={value!r}" for name, value in self.values.items())
        return f"Phrase({self.sentence!r}{values})"

    def __eq__(self, other: object) -> bool:
        """Return whether the other phrase or text reads the same."""
        return isinstance(other, Phrase | str) and str(self) == str(other)

    def __hash__(self) -> int:
        """Return the hash of the text."""
        return hash(str(self))


def _apart(values: Mapping[str, object]) -> tuple[Mapping[str, object], dict[str, Shown | Remedy]]:
    """Return values as data, and the texts of those that have one."""
    texts = {name: value for name, value in values.items() if isinstance(value, Shown | Remedy)}
    if not texts:
        return values, texts
    data = {
        name: value.value if isinstance(value, Shown) else value
        for name, value in values.items()
        if not isinstance(value, Remedy) and getattr(value, "value", None) is not NO_VALUE
    }
    return data, texts


def _filled(
    sentence: str, values: Mapping[str, object], texts: Mapping[str, Shown | Remedy]
) -> str:
    """Return a sentence with its values filled in; names and texts come from files."""
    shown = {
        name: printable(value, _LONGEST) if isinstance(value, str | bytes | Path) else value
        for name, value in values.items()
    }
    return sentence.format_map({**shown, **texts})


def frame_range(first: int, last: int) -> Phrase:
    """Return the phrase "frame 3", or "frames 3 to 5" for a range that includes its last frame."""
    if first == last:
        return Phrase("frame {frame}", frame=first)
    return Phrase("frames {first} to {last}", first=first, last=last)


class Collector:
    """Collects the diagnostics of readers and operations.

    Repeated warnings are dropped, as are warnings after the first hundred; all errors are kept.
    Without ``keeps_errors``, the first error is raised where it is recorded.
    """

    def __init__(self, keeps_errors: bool = False) -> None:
        self.keeps_errors = keeps_errors
        self._found: list[Diagnostic] = []
        self._warned: set[str] = set()

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def add(self, found: Diagnostic) -> None:
        """Record an error, or a warning that has not been recorded yet."""
        if found.is_refusal:
            self._found.append(found)
            return
        # A search for all errors has to list each faulty element, even if the messages are equal.
        message = f"{found.pointer} {found.message}" if self.keeps_errors else found.message
        if message in self._warned or len(self._warned) > _MOST:
            return
        self._warned.add(message)
        if len(self._warned) > _MOST:
            found = Diagnostic("F007.further-warnings: further warnings omitted", found.path)
        self._found.append(found)

    @property
    def errors(self) -> list[Diagnostic]:
        """Errors in the order found; ``load`` raises the first."""
        return [found for found in self._found if found.is_refusal]

    @property
    def warnings(self) -> list[Diagnostic]:
        """Warnings and notes in the order found."""
        return [found for found in self._found if not found.is_refusal]


def merged(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return diagnostics in order, with similar ones merged into the first of them.

    Two are similar if message, file, part and names are equal: values of type ``str`` are names,
    while numbers and text from a file (``bytes``) may differ.
    """
    kinds: dict[tuple[object, ...], list[Diagnostic]] = {}
    for one in found:
        if one.count == 0:
            continue
        kinds.setdefault((one.key, one.path, one.part, *_names(one.values)), []).append(one)
    return [_joined(alike) for alike in kinds.values()]


def _names(values: Mapping[str, object]) -> Iterator[tuple[object, ...]]:
    for name, value in sorted(values.items()):
        if isinstance(value, Phrase | Diagnostic):
            kind = value.key if isinstance(value, Diagnostic) else value.sentence
            yield (name, kind, *_names(value.values))
        elif isinstance(value, str):
            yield name, value


def _joined(alike: list[Diagnostic]) -> Diagnostic:
    if len(alike) == 1:
        return alike[0]
    known = [one.places for one in alike if one.places is not None]
    places = np.unique(np.concatenate(known)) if known else None
    return replace(alike[0], places=places, count=sum(one.count for one in alike))


def described(found: Diagnostic) -> DiagnosticData:
    """Return all data of a diagnostic, worded as for the command line, with at most 100 indices."""
    places = np.zeros(0, dtype=np.int32) if found.places is None else found.places
    with as_data():
        return {
            "code": found.code,
            "key": found.key,
            "severity": found.severity,
            "message": printable(found.full_message, 2000),
            "file": None if found.path is None else printable(found.path, 1000),
            "line": found.line,
            "pointer": found.pointer,
            "part": found.part or None,
            "places": places[:_LISTED].tolist(),
            "n_places": len(places),
            "count": found.count,
            "values": plain(found.values),
        }


def plain(value: object) -> Any:
    """Return a value as JSON data: bytes and non-finite numbers as text, at most 100 items."""
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, Phrase):
        return {"text": str(value), "values": plain(value.values)}
    if isinstance(value, Diagnostic):
        return described(value)
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, bool | int | float) or value is None:
        return value
    if isinstance(value, bytes):
        return printable(value.decode("utf-8", "replace"), 1000)
    if isinstance(value, Sequence) and not isinstance(value, str | Path):
        return [plain(item) for item in value[:_LISTED]]
    return printable(value, 1000)
