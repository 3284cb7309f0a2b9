r"""Reader of ``.rig`` files (UCSD course CSE169): the names of files that belong together.

::

    rig   = "rig" name? "{" item* "}"
    item  = "skeleton" file | "skin" file | "morphs" n "{" file*n "}"

Files are relative to the folder of the ``.rig``, and must be below it. A name in double quotes may
contain spaces.
"""

from __future__ import annotations

import re
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._references import referenced_path
from viewer.formats._source import Source
from viewer.formats._text.numbers import to_number
from viewer.phrases import counted, quoted

_WORD = re.compile(rb'[{}]|"[^"\r\n]*"|[^{}\s]+')

Words = list[re.Match[bytes]]


@dataclass(frozen=True, slots=True)
class NamedFiles:
    """Files to open together."""

    name: str
    """Name of the rig."""
    paths: tuple[Path, ...]
    """Skeleton, skin and morphs in the order of the file; not checked for existence."""


def read(source: Source) -> NamedFiles:
    """Read the names of files that belong together, without opening them."""
    words = list(_WORD.finditer(source.data))
    words.reverse()
    _expect(source, words, b"rig")
    name: list[str] = []
    while words and words[-1].group() not in (b"{", b"}"):
        name.append(_text(words.pop()))
    _expect(source, words, b"{")
    files: list[Path] = []
    while words and words[-1].group() != b"}":
        files += _item(source, words)
    if not words:
        source.warn(wording.CLOSING)
    elif len(words) > 1:
        source.warn(
            "F006.rig-after: ignored data after the rig, starting with {found}",
            words[-2].start(),
            found=quoted(words[-2].group()),
        )
    if not files:
        raise source.fault(
            "F002.rig-empty: expected the file name of a skeleton or skin, found none",
            _next(source, words)[0],
        )
    return NamedFiles(" ".join(name) or source.path.stem, tuple(files))


def _item(source: Source, words: Words) -> list[Path]:
    word = words.pop()
    if word.group() in (b"skeleton", b"skin"):
        return [_file(source, words, word.group().decode())]
    if word.group() != b"morphs":
        raise source.fault(
            "F002.rig-item: expected skeleton, skin or morphs, found {found}",
            word.start(),
            found=quoted(word.group()),
        )
    count = to_number(words[-1].group()) if words else None
    if count is None or count != int(count) or count < 0:
        where, found = _next(source, words)
        raise source.fault(wording.COUNT, where, item="morphs", found=quoted(found))
    stated = words.pop()
    _expect(source, words, b"{")
    files = []
    while words and words[-1].group() != b"}":
        files.append(_file(source, words, "morphs"))
    if len(files) != count:
        raise source.fault(
            "F002.rig-morphs: morphs: expected {expected}, found {found}",
            stated.start(),
            expected=counted(int(count), "file"),
            found=len(files),
        )
    _expect(source, words, b"}")
    return files


def _file(source: Source, words: Words, item: str) -> Path:
    if not words or words[-1].group() in (b"{", b"}"):
        where, found = _next(source, words)
        raise source.fault(
            "F002.rig-name: {item}: expected a file name, found {found}",
            where,
            item=item,
            found=quoted(found),
        )
    word = words.pop()
    path = referenced_path(source.path.parent, _text(word))
    if path is None:
        raise source.fault(
            "F002.rig-outside: {item}: expected a file within the folder of the .rig, found "
            "{found}",
            word.start(),
            item=item,
            found=quoted(word.group()),
        )
    return path


def _text(word: re.Match[bytes]) -> str:
    return word.group().strip(b'"').decode("utf-8", "surrogateescape")


def _expect(source: Source, words: Words, text: bytes) -> None:
    if not words or words[-1].group() != text:
        where, found = _next(source, words)
        raise source.fault(
            'F002.rig-word: expected "{expected}", found {found}',
            where,
            expected=text.decode(),
            found=quoted(found),
        )
    words.pop()


def _next(source: Source, words: Words) -> tuple[int, bytes | None]:
    """Return the next word and its offset; None at the end of the file."""
    return (words[-1].start(), words[-1].group()) if words else (source.end, None)
