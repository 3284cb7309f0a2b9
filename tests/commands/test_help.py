"""Help texts, with all options explained in groups that follow the order of work."""

import argparse
import io
import re
import sys

import pytest

from viewer.cli import run
from viewer.commands import COMMANDS, _progress
from viewer.commands._printing import print_line, table_lines
from viewer.commands._progress import Progress, shown_progress
from viewer.commands._usage import command_module
from viewer.manual import PAGES, page_text
from viewer.progress import report


def parser_of(command: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=f"viewer {command}")
    command_module(command).add_arguments(parser)
    return parser


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_documented(command):
    for action in parser_of(command)._actions:
        assert action.help and len(action.help) > 8, action.option_strings


@pytest.mark.parametrize(
    ("command", "titles"),
    [
        (
            "render",
            "files, output, captures and BVH, clean-up, frames, videos, shape and pose, camera, "
            "display, skinning",
        ),
        (
            "convert",
            "files, output, writing motions, writing VRM characters, writing HTML pages, frames, "
            "captures and BVH, clean-up, faults, shape and pose, skinning",
        ),
        (
            "view",
            "files, window, captures and BVH, clean-up, frames, shape and pose, camera, display, "
            "skinning",
        ),
    ],
)
def test_option_groups_follow_the_order_of_work(command, titles):
    groups = [group for group in parser_of(command)._action_groups if group._group_actions]
    assert groups[0].title == "options"
    assert [action.dest for action in groups[0]._group_actions] == ["help"]
    found = [group.title for group in groups[1:]]
    wanted = titles.split(", ")
    assert len(found) == len(wanted)
    assert all(title.startswith(start) for title, start in zip(found, wanted, strict=True)), found


USAGES = {
    "view": "[FILES ...] [options]",
    "serve": "[FILES ...] [options]",
    "render": "[FILES ...] -o FILE [options]",
    "convert": "[FILES ...] -o FILE [options]",
    "batch": "JOB PATHS [-o OUT] [options of the job] [options]",
    "rig": "TARGET [-o FILE] [options]",
    "info": "FILES ... [options]",
    "diff": "REFERENCE OTHER ... [options]",
    "lint": "FILES ... [options]",
    "models": "[list | names | add NAME] [options]",
    "new-plugin": "NAME [-o FOLDER]",
    "doctor": "[--bench]",
    "help": "[TOPIC | COMMAND | examples [NAME]]",
    "completion": "bash|zsh|tcsh|fish",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_help_begins_with_usage_in_one_line(command, capsys):
    with pytest.raises(SystemExit):
        run([command, "--help"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [f"usage: viewer {command} {USAGES[command]}", ""]


class Terminal(io.StringIO):
    """Standard output that appears to be a terminal."""

    def isatty(self) -> bool:
        return True


def test_help_without_a_topic_lists_all_topics_and_commands(capsys):
    assert run(["help"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {topic} " in printed and text in printed for topic, text in PAGES.items())
    assert ", ".join(COMMANDS) in printed


def test_pages_are_written_verbatim_to_a_pipe(capsys):
    assert run(["help", "keys"]) == 0
    assert capsys.readouterr().out == page_text("keys")


def test_tables_are_formatted_in_a_terminal(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["help", "keys"]) == 0
    printed = terminal.getvalue()
    assert "\x1b[" in printed, "no style"
    assert "| R |" not in printed and "---" not in printed, "Markdown remains"
    assert "reset the pose to the file's pose" in printed


def test_help_for_a_command_lists_its_options(capsys):
    assert run(["help", "diff"]) == 0
    assert capsys.readouterr().out.startswith("usage: viewer diff")


@pytest.mark.parametrize("width", [60, 140])
def test_help_for_a_command_is_as_wide_as_the_terminal(capsys, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    assert run(["help", "diff"]) == 0
    lengths = [len(line) for line in capsys.readouterr().out.splitlines()]
    assert width - 20 < max(lengths) < width


def test_unknown_topic_suggests_the_nearest_in_one_line(capsys):
    assert run(["help", "captres"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1
    assert "did you mean captures?" in printed.err and "troubleshooting" in printed.err


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
