"""The ``material`` section of a ``.skin`` file, and the image that it references."""

from __future__ import annotations

import re
from collections.abc import Container

from viewer.formats._mesh.texture import load_image
from viewer.formats._source import Source
from viewer.formats._text.numbers import is_number
from viewer.rig.arrays import Bytes
from viewer.rig.material import Material, Texture

__all__ = ["read_material"]

# A file name may contain spaces: it extends to the end of the line.
_FILE_NAME = re.compile(rb"[ \t\n\r\v\f]*([^\r\n{}]*)")

Word = re.Match[bytes]


def read_material(
    source: Source, header: Word, keywords: Container[bytes], pictures: dict[str, Bytes | None]
) -> tuple[Material, int]:
    """Read one material.

    Parameters
    ----------
    source : Source
        The file.
    header : Word
        The word ``material``.
    keywords : container of bytes
        Keywords of sections, which cannot be part of a name.
    pictures : dict
        Images loaded so far, by name; the image of this material is added.

    Returns
    -------
    material : Material
        Material with its image, if the image can be read.
    end : int
        Offset after the section.

    Raises
    ------
    FormatError
        If a brace is missing.
    """
    name, brace = _name(source, header, keywords)
    texture: str | None = None
    named = header.start()
    position = brace.end()
    while (word := source.next_word(position)) is not None and word.group() != b"}":
        if word.group() == b"texture":
            rest = _FILE_NAME.match(source.data, word.end())
            assert rest is not None  # the pattern also matches the empty string
            texture = rest[1].strip().decode("utf-8", "surrogateescape") or None
            named, position = word.start(), rest.end()
        else:
            source.warn("F006.skin-material", word.start(), found=word.group())
            position = _skip(source, word)
    if word is None:
        line = source.line(header.start())
        raise source.fault("F002.unclosed", source.end, section="material", line=line, found=None)
    if texture is None:
        source.warn("F005.skin-material", header.start())
        return Material(name), word.end()
    if texture not in pictures:
        pictures[texture] = load_image(source, texture, named)
    return Material(name, Texture(texture, pictures[texture])), word.end()


def _name(source: Source, header: Word, keywords: Container[bytes]) -> tuple[str, Word]:
    """Return the words up to the opening brace, and that brace."""
    words: list[bytes] = []
    word = source.next_word(header.end())
    while word is not None and word.group() not in (b"{", b"}") and word.group() not in keywords:
        words.append(word.group())
        word = source.next_word(word.end())
    if word is None or word.group() != b"{":
        where = header.start() if word is None else word.start()
        raise source.fault(
            "F002.skin-brace", where, section="material", found=word and word.group()
        )
    return b" ".join(words).decode("utf-8", "surrogateescape"), word


def _skip(source: Source, word: Word) -> int:
    """Return the offset after an unknown item: after its numbers or its balanced block."""
    position, depth = word.end(), int(word.group() == b"{")
    while (following := source.next_word(position)) is not None:
        text = following.group()
        if depth == 0 and text != b"{" and not is_number(text):
            return position
        depth += {b"{": 1, b"}": -1}.get(text, 0)
        position = following.end()
        if text == b"}" and depth == 0:
            return position
    if depth:
        raise source.fault("F002.open", word.start(), word=word.group())
    return position
