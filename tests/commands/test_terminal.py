"""Progress, tables and colours in a terminal and in a pipe."""

import io
import re

import pytest

from viewer.commands import _progress
from viewer.commands._printing import print_line, table_lines
from viewer.commands._progress import Progress, shown_progress
from viewer.progress import report


class Terminal(io.StringIO):
    """A stream that appears to be a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch) -> Terminal:
    monkeypatch.setattr(_progress, "_FIRST", 0.0)
    monkeypatch.setattr(_progress, "_EVERY", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("NO_COLOR", raising=False)
    return Terminal()


def test_progress_shows_title_and_count_and_is_erased(terminal, monkeypatch):
    monkeypatch.setattr("sys.stderr", terminal)
    with Progress("reading [b]walk[/b]") as progress:
        progress.receive(300, 1200, "", "")
        progress.receive(1200, 1200, "", "comparing")
    text = terminal.getvalue()
    assert "reading [b]walk[/b]" in text and " 300/1200" in text
    assert "comparing" in text and "1200/1200" in text
    assert text.endswith("\x1b[2K")  # the line is erased


def test_reported_work_is_shown_with_its_unit_and_without_a_known_total(terminal, monkeypatch):
    monkeypatch.setattr("sys.stderr", terminal)
    with shown_progress("converting"):
        report(0, 430, "MB", "reading big.skin")
        report(120, 430, "MB")
        report(7, 0, "MB", "writing big.obj")
    text = re.sub(r"\x1b\[[0-9;]*m", "", terminal.getvalue())
    assert "reading big.skin" in text and "120/430 MB" in text
    assert "writing big.obj" in text and "7/? MB" in text
    assert text.endswith("\x1b[2K")


def test_progress_is_silent_in_pipes_and_for_short_jobs(terminal, monkeypatch):
    monkeypatch.setattr("sys.stderr", pipe := io.StringIO())
    with Progress("reading") as progress:
        progress.receive(1, 2, "", "")
    assert pipe.getvalue() == ""
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(_progress, "_FIRST", 60.0)
    with Progress("reading") as progress:
        progress.receive(1, 2, "", "")
    assert terminal.getvalue() == ""


def test_lines_are_coloured_only_in_a_terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr("sys.stdout", pipe := io.StringIO())
    print_line(("missing ", "red"), "[x] " + 200 * "a")
    assert pipe.getvalue() == "missing [x] " + 200 * "a" + "\n"
    print_line(("missing ", "red"), "[x] " + 200 * "a", file=(screen := Terminal()))
    assert screen.getvalue() == "\x1b[31mmissing \x1b[0m[x] " + 200 * "a" + "\n"


def test_tables_are_as_wide_as_their_cells_without_trailing_spaces():
    rows = [["", "joints", "result"], ["a" * 150, "1 mm", ""], ["[red]b", "-", "DIFFERS"]]
    assert table_lines(rows, right=[1]) == [
        f"{'':150}  joints  result",
        f"{'a' * 150}    1 mm",
        f"{'[red]b':150}       -  DIFFERS",
    ]
