"""The ``bindings`` section of a ``.skin`` file."""

from __future__ import annotations

import re

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats._skin.blocks import find_block, unclosed, words_of
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_few
from viewer.rig.arrays import Floats

__all__ = ["read_bindings"]

_NEUTRAL: Floats = np.eye(4, 3).ravel()  # identity as four rows of three, as in the file

Word = re.Match[bytes]


def read_bindings(source: Source, count: int, position: int) -> tuple[Floats, int]:
    """Return each B = [a b c d; 0 0 0 1], (count, 4, 4), and the offset after the section."""
    stated = position - 1
    word = source.next_word(position)
    if word is not None and word.group() == b"{":
        position = word.end()
    matrices: list[Floats] = []
    offsets: list[int] = []
    while (word := source.next_word(position)) is not None and word.group() == b"matrix":
        rows, position = _read_matrix(source, len(matrices), word)
        matrices.append(rows)
        offsets.append(word.start())
    source.remember("bindings", offsets.__getitem__)
    if len(matrices) != count:
        is_whole = word is not None and word.group() == b"}"
        end = source.end if word is None else word.start()
        then = word and word.group()
        found = len(matrices)
        # The error is located at the count or, if the file is truncated, at its end.
        if not is_whole:
            line = source.line(stated)
            raise source.fault(
                "F002.skin-bindings-end", end, line=line, expected=count, found=found, then=then
            )
        line = source.line(end)
        source.refuse("B001.skin-count", stated, line=line, expected=count, found=found, then=then)
    if word is None:
        source.warn("F006.last-brace", section="bindings")
    elif word.group() != b"}":
        raise source.fault("F002.skin-bindings-brace", word.start(), found=word.group())
    bindings = np.tile(np.eye(4), (len(matrices), 1, 1))
    if matrices:
        bindings[:, :3, :] = np.array(matrices).reshape(-1, 4, 3).transpose(0, 2, 1)
    return bindings, len(source.data) if word is None else word.end()


def _read_matrix(source: Source, index: int, word: Word) -> tuple[Floats, int]:
    block = find_block(source, f"matrix {index} of bindings", word, word.end())
    values, bad = parse_few(source.data[block.start : block.end])
    words = words_of(source, block) if bad >= 0 else None
    if not block.closed:
        raise unclosed(source, block, source.end, None)
    if words is not None:
        from viewer.formats._text.words import refuse_words

        places = np.full(len(words.bad), index)
        item = Phrase("matrix", index=index)
        refuse_words(source, words, words.bad, lambda _: item, "bindings", places)
        return _NEUTRAL, block.end + 1
    if len(values) != len(_NEUTRAL):
        source.refuse(
            "F002.width",
            word.start(),
            1,
            "bindings",
            [index],
            item=Phrase("matrix", index=index),
            expected=len(_NEUTRAL),
            found=len(values),
        )
        return _NEUTRAL, block.end + 1
    return values, block.end + 1
