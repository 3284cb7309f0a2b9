"""Errors in ``.anim`` files, which are refused with their line or read with a warning."""

import numpy as np
import pytest
from faults import Fault, refusal_of
from formats.anim_text import GOOD, parse

from viewer.errors import FormatError


def test_unsorted_keys_are_sorted_with_a_warning() -> None:
    clip, warnings = parse(GOOD.replace("0 1 flat smooth 2", "3 1 flat smooth 2"))
    np.testing.assert_array_equal(clip.channels[0].times, [2, 3])
    assert warnings == [("C001.anim-sorted", 1, {"channel": 0, "late": 1, "before": 0})]


def test_channel_without_keys_is_reported_as_a_warning() -> None:
    _, warnings = parse("animation { range 0 1 numchannels 1 channel { keys 0 { } } }")
    assert warnings == [("C010.anim-no-keys", None, {"channel": 0})]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "balloon {",
            (
                "F002.anim-word",
                1,
                {
                    "where": "animation",
                    "found": b"balloon",
                    "begins": None,
                    "expected": "animation",
                    "looks": None,
                },
            ),
        ),
        (
            GOOD.replace("\n", "").replace("keys", "\nkeys").replace("flat", "steep"),
            (
                "F002.anim-tangent",
                2,
                {
                    "where": "channel 0, key 0",
                    "found": b"steep",
                    "begins": None,
                    "rules": ("flat", "linear", "smooth"),
                },
            ),
        ),
        (
            GOOD.replace("bounce", "jump"),
            (
                "F002.anim-mode",
                1,
                {
                    "where": "channel 0",
                    "found": b"jump",
                    "begins": None,
                    "modes": ("constant", "linear", "cycle", "cycle_offset", "bounce"),
                },
            ),
        ),
        (
            GOOD.replace("{ 0 1", "{ 0 nan"),
            (
                "F003.number",
                1,
                {
                    "where": "channel 0, key 0",
                    "found": b"nan",
                    "begins": None,
                    "item": "channel 0, key 0: value",
                },
            ),
        ),
        (
            GOOD.replace("keys 2", "keys 3"),
            (
                "F002.anim-keys",
                1,
                {
                    "where": "channel 0",
                    "found": 2,
                    "begins": None,
                    "expected": 3,
                },
            ),
        ),
        (
            GOOD.replace("keys 2", "keys 2000000000"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "channel 0",
                    "found": b"2000000000",
                    "begins": None,
                    "item": "channel 0: keys",
                    "left": len(GOOD.split("keys 2")[1]),
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels 2"),
            (
                "F002.anim-channels",
                1,
                {"where": "animation", "found": 1, "begins": None, "expected": 2},
            ),
        ),
        (
            GOOD.split("keys")[0],
            (
                "F002.anim-word",
                1,
                {
                    "where": "channel 0",
                    "found": None,
                    "begins": "channel 0 begins on line 1",
                    "expected": "}",
                    "looks": None,
                },
            ),
        ),
        (
            GOOD.replace("channel {", "\nchannel {").replace(" linear", "").split("-0.5")[0],
            (
                "F002.anim-tangent",
                2,
                {
                    "where": "channel 0, key 1",
                    "found": None,
                    "begins": "channel 0 begins on line 2",
                    "rules": ("flat", "linear", "smooth"),
                },
            ),
        ),
        (
            GOOD.replace("} }", "} keys 0 { } }", 1),
            (
                "F002.anim-keys-again",
                1,
                {"where": "channel 0", "found": b"keys", "begins": None},
            ),
        ),
        (
            GOOD.replace("numchannels 1 channel", "numchannels 1 chanel"),
            (
                "F002.anim-item",
                1,
                {"where": "animation", "found": b"chanel", "begins": None},
            ),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels -1"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "animation",
                    "found": b"-1",
                    "begins": None,
                    "item": "animation: numchannels",
                    "left": len(GOOD.split("numchannels 1")[1]),
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels 1.5"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "animation",
                    "found": b"1.5",
                    "begins": None,
                    "item": "animation: numchannels",
                    "left": len(GOOD.split("numchannels 1")[1]),
                },
            ),
        ),
        (
            GOOD.replace("range -1 4", "range -1 up"),
            (
                "F002.number",
                1,
                {
                    "where": "animation",
                    "found": b"up",
                    "begins": None,
                    "item": "animation: range",
                },
            ),
        ),
        ("", ("F002.kind", None, {"wanted": ".anim", "looks": "an empty file"})),
        (
            GOOD.replace("extrapolate", "extrapolates"),
            (
                "F002.anim-channel-item",
                1,
                {
                    "where": "channel 0",
                    "found": b"extrapolates",
                    "begins": None,
                },
            ),
        ),
        (
            "animation {\nrange 0",
            (
                "F002.anim-end",
                2,
                {
                    "where": "animation",
                    "found": None,
                    "begins": "animation begins on line 1",
                    "item": "animation: range",
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1 ", ""),
            ("F002.anim-no-count", 1, {"where": "animation", "found": 1, "begins": None}),
        ),
    ],
)
def test_malformed_files_are_refused_with_their_line(text: str, fault: Fault) -> None:
    assert refusal_of(lambda: parse(text)) == fault


def test_truncation_anywhere_is_an_error_or_a_warning() -> None:
    for length in range(len(GOOD)):
        try:
            _, warnings = parse(GOOD[:length])
        except FormatError as problem:
            assert str(problem).startswith("walk.anim")
        else:
            assert warnings, GOOD[:length]
