from pathlib import Path

import pytest

from viewer import errors
from viewer.diagnostics import Diagnostic, wording
from viewer.errors import FormatError, OutputError, RenderError, ViewerError
from viewer.phrases import counted, printable


def wrong(path, line=None):
    values = {"expected": counted(3, "number"), "found": 2, "item": "positions"}
    return FormatError(Diagnostic(wording.WIDTH, Path(path), line, values=values))


@pytest.mark.parametrize("name", [name for name in errors.__all__ if name.endswith("Error")])
def test_every_error_is_a_viewer_error(name):
    assert issubclass(getattr(errors, name), ViewerError)


def test_exit_codes_distinguish_input_graphics_and_output_errors():
    assert (FormatError.exit_code, RenderError.exit_code, OutputError.exit_code) == (2, 4, 5)
    assert errors.RigError.exit_code == errors.UnsupportedFormatError.exit_code == 2


def test_format_error_begins_with_file_and_line():
    error = wrong("dir/tube.skin", 41)
    assert str(error) == "dir/tube.skin:41: positions: expected 3 numbers, found 2"
    assert (str(error.path), error.line) == ("dir/tube.skin", 41)
    assert str(wrong("a b.skel")) == "a b.skel: positions: expected 3 numbers, found 2"


def test_format_error_shows_a_path_with_control_characters_on_one_line():
    assert str(wrong("a\nb\udcff\x1b[0m{}%s")).startswith(
        "a\\nb\\udcff\\x1b[0m{}%s: positions: expected"
    )


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain text", "plain text"),
        ("tab\tcr\rlf\n", "tab\\tcr\\rlf\\n"),
        ("\0\x85\u2028\xa0", "\\x00\\x85\\u2028\\xa0"),
        ("\ud800\udcff", "\\ud800\\udcff"),
        ("caf\u00e9 \u65e5\u672c", "caf\u00e9 \u65e5\u672c"),
        ("back\\slash", "back\\slash"),
        (12, "12"),
    ],
)
def test_printable_escapes_unprintable_characters(text, shown):
    assert printable(text) == shown


def test_printable_truncates_long_text():
    assert printable("x" * 200) == "x" * 200
    assert printable("x" * 201) == "x" * 199 + "…"
    assert printable("abcdef", 3) == "ab…"


@pytest.mark.parametrize("kind", [errors.RigError, errors.UnsupportedFormatError])
def test_names_in_messages_stay_on_one_line(kind):
    assert str(kind("joint a\nb\x1b: x")) == "joint a\\nb\\x1b: x"
    assert len(str(kind("x" * 5000))) == 1000


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (OSError(28, "No space left on device", "a.glb"), "No space left on device"),
        (ValueError("embedded null byte"), "embedded null byte"),
        (OSError("not\nopen"), "not\\nopen"),
        (TimeoutError(), "TimeoutError"),
    ],
)
def test_files_that_cannot_be_written_have_a_reason(problem, reason):
    assert str(OutputError.at("dir/a.glb", problem)) == f"dir/a.glb: {reason}"
