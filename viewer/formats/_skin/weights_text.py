"""Text of the ``skinweights`` section of a ``.skin`` file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.formats._text.decimals import integers, shortest
from viewer.formats._text.number_text import joined
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skin import Skin

__all__ = ["weights_lines"]

_AT_ONCE = 2048  # number of vertices that are formatted together
_SEPARATORS = (b" ", b"\n  ")


def weights_lines(skin: Skin) -> Iterator[bytes]:
    """Yield the lines of the section in parts: a count, and pairs of a joint and a weight."""
    for first in range(0, skin.n_vertices, _AT_ONCE):
        starts = skin.starts[first : first + _AT_ONCE + 1]
        used = slice(int(starts[0]), int(starts[-1]))
        text = _text(starts - starts[0], skin.joints[used], skin.weights[used])
        # The separator of lines ends with the indentation of the next line.
        yield b"  " + text[:-2]


def _text(starts: Ints, joints: Ints, weights: Floats) -> bytes:
    """Return lines of a count followed by pairs of a joint and a weight."""
    counts = np.diff(starts)
    heads = 2 * starts[:-1] + np.arange(len(counts))
    is_count = np.zeros(2 * len(joints) + len(counts), dtype=np.bool_)
    is_count[heads] = True
    pairs = np.flatnonzero(~is_count)
    whole = np.zeros(len(is_count), dtype=np.int64)
    whole[heads], whole[pairs[0::2]] = counts, joints
    numbers = integers(whole)
    numbers.put(shortest(weights), pairs[1::2])
    which = np.zeros(len(is_count), dtype=np.uint8)
    which[heads[1:] - 1] = which[-1] = 1
    return joined(numbers, _SEPARATORS, which)
