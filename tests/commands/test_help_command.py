"""``viewer help``: topics, pages as text or formatted, options of a command, and unknown topics."""

import io
import sys

import pytest

from viewer.cli import run
from viewer.commands import COMMANDS
from viewer.manual import PAGES, page_text


class Terminal(io.StringIO):
    """Standard output that appears to be a terminal."""

    def isatty(self) -> bool:
        return True


def test_help_without_a_topic_lists_all_topics_and_commands(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["help"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {topic} " in printed and text in printed for topic, text in PAGES.items())
    assert ", ".join(COMMANDS) in printed


def test_pages_are_written_verbatim_to_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["help", "keys"]) == 0
    assert capsys.readouterr().out == page_text("keys")


def test_tables_are_formatted_in_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["help", "keys"]) == 0
    printed = terminal.getvalue()
    assert "\x1b[" in printed, "no style"
    assert "| R |" not in printed and "---" not in printed, "Markdown remains"
    assert "reset the pose to the file's pose" in printed


def test_help_for_a_command_lists_its_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["help", "diff"]) == 0
    assert capsys.readouterr().out.startswith("usage: viewer diff")


@pytest.mark.parametrize("width", [60, 140])
def test_help_for_a_command_is_as_wide_as_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert run(["help", "diff"]) == 0
    lengths = [len(line) for line in capsys.readouterr().out.splitlines()]
    assert width - 20 < max(lengths) < width


def test_unknown_topic_suggests_the_nearest_in_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["help", "captres"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1
    assert "did you mean captures?" in printed.err and "troubleshooting" in printed.err
