"""Options made from fields of a settings class, and settings made from options."""

from __future__ import annotations  # as in all of viewer: the types of fields are read as text

import pytest

from viewer.commands._settings import add_settings, settings_of, stated
from viewer.commands._usage import Parser
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError


@dataclass(frozen=True)
class Kite:
    """Settings of every sort that commands have."""

    tail: float = setting(1.5, "length (default: {default})", limits=(0.0, 9.0), metavar="M")
    knots: int | None = setting(None, "number of knots")
    colour: str = setting("", "colour{usual}", choices=("red", "blue"), usual=" (default: white)")
    shape: str = setting("delta", "shape (default: {default})", given=None)
    flies: bool = setting(True, "stay on the ground")
    loops: bool = setting(False, "fly loops")
    lines: list[str] = setting([], "a line; may be repeated")
    angle: float = setting(
        0.5, "angle", flag="--tilt", given=30.0, read=lambda degrees: degrees / 60
    )
    spare: int = 7


def parsed(*words: str) -> Kite:
    parser = Parser()
    add_settings(parser, Kite)
    return settings_of(Kite, parser.parse_args(words))


def test_settings_without_options_are_the_defaults():
    assert parsed() == Kite()


def test_options_become_settings():
    words = "--tail 2 --knots 3 --colour red --no-flies --loops --lines a --lines b --tilt 90"
    wanted = Kite(2.0, 3, "red", flies=False, loops=True, lines=["a", "b"], angle=1.5)
    assert parsed(*words.split()) == wanted


def test_fields_without_an_option_are_given():
    parser = Parser()
    add_settings(parser, Kite, "tail")
    arguments = parser.parse_args(["--tail", "3"])
    assert settings_of(Kite, arguments, spare=8) == Kite(3.0, spare=8)


def test_help_states_each_default_once():
    parser = Parser()
    add_settings(parser, Kite)
    text = parser.format_help()
    assert "--tail M" in text and "length (default: 1.5)" in text
    assert "colour (default: white)" in text and "shape (default: delta)" in text
    assert "spare" not in text


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--tail", "9.5"), "--tail: expected 0 to 9, found 9.5"),
        (("--tail", "nan"), "expected a finite number, found nan"),
        (("--knots", "2.5"), 'expected an integer, found "2.5"'),
        (("--colour", "green"), "expected one of red, blue"),
    ],
)
def test_wrong_values_are_refused(words, text):
    with pytest.raises(ViewerError, match=text):
        parsed(*words)


def test_stated_fields_are_those_whose_option_was_given():
    parser = Parser()
    add_settings(parser, Kite)
    assert stated(Kite, parser.parse_args([])) == set()
    assert stated(Kite, parser.parse_args(["--shape", "delta", "--knots", "0"])) == {
        "shape",
        "knots",
    }
