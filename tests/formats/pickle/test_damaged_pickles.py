"""Truncated, modified or random pickles, each of which is read or refused in one line."""

import pickle
import random

import numpy as np
import pytest
from formats.pickle.pickle_costs import self_contained
from formats.pickle_bytes import (
    array,
    created,
    finished,
    mapping,
    matrix,
    named,
    opened,
    saved,
    text,
    whole,
)

from viewer.errors import FormatError

pytestmark = pytest.mark.slow
SMALL = saved(
    v=array(np.arange(4.0)),
    J=matrix(),
    s=created("chumpy.ch", "Ch", mapping(x=array(np.ones((2, 2), np.float32)))),
    t=text("lbs"),
    n=b"](" + whole(70_000) + whole(-3) + b"F1.5\nI01\ne",
)
MODERN = pickle.dumps(
    {"v": np.asfortranarray(np.ones((2, 3))), "s": np.float32(2), "t": ["a", (1, {"b": b"c"})]}, 5
)
TEXT = pickle.dumps({"v": np.arange(3), "t": "grün", "n": [1.5, 1 << 40, True, None]}, 0)


@pytest.mark.parametrize("data", [SMALL, MODERN, TEXT], ids=["2", "5", "0"])
def test_file_truncated_anywhere_is_read_or_refused_in_one_line(data):
    self_contained(data)
    for length in range(len(data)):
        with pytest.raises(FormatError) as caught:
            opened(data[:length])
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("data", [SMALL, MODERN, TEXT], ids=["2", "5", "0"])
def test_file_with_any_byte_changed_is_read_or_refused_in_one_line(data):
    for place in range(len(data)):
        for change in (0x01, 0x80) if place % 2 else (0x20, 0xFF):
            self_contained(data[:place] + bytes([data[place] ^ change]) + data[place + 1 :])


@pytest.mark.parametrize("data", [SMALL, MODERN, TEXT], ids=["2", "5", "0"])
def test_file_with_random_damage_is_read_or_refused_in_one_line(data):
    dice = random.Random(len(data))
    for _ in range(750):
        damaged = bytearray(data)
        for _ in range(dice.randint(1, 4)):
            place = dice.randrange(len(damaged))
            length = dice.choice([1, 1, 1, 2, 8, 30])
            piece = dice.choice([dice.randbytes(length), data[place:][:length] * 2, b""])
            damaged[place : place + dice.randint(0, length)] = piece
            damaged = damaged or bytearray(b".")
        self_contained(bytes(damaged))


def test_random_opcodes_are_read_or_refused_in_one_line():
    dice = random.Random(1)
    steps = b"(0123NKMJ)]}taeuslbdR\x81\x85\x86\x87\x88\x93qhj\x94\x95co"
    names = [named("numpy", "dtype"), named("chumpy.ch", "Ch"), named("numpy", "ndarray")]
    pieces = [*(bytes([step]) for step in steps), *names, text("f8"), array(np.ones(1)), b"h\0q\0"]
    for _ in range(3000):
        self_contained(finished(b"".join(dice.choices(pieces, k=dice.randint(1, 30)))))
