"""Help texts, with all options explained in groups that follow the order of work."""

import argparse
from importlib import import_module

import pytest

from viewer.cli import run
from viewer.commands import COMMANDS


def parser_of(command: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=f"viewer {command}")
    import_module(f"viewer.commands.{command}").add_arguments(parser)
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
            "files, output, writing motions, writing VRM characters, frames, captures and BVH, "
            "clean-up, shape and pose, skinning",
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
    "render": "[FILES ...] -o FILE [options]",
    "convert": "[FILES ...] -o FILE [options]",
    "batch": "JOB PATHS [-o OUT] [options of the job] [options]",
    "rig": "TARGET [-o FILE] [options]",
    "info": "FILES ... [options]",
    "diff": "REFERENCE OTHER ... [options]",
    "lint": "FILES ... [options]",
    "models": "[list | names | add NAME] [options]",
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
