"""Shell completion of commands, options and file names."""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import Any

from viewer.commands import COMMANDS
from viewer.commands._batch.jobs import JOBS, add_all_arguments
from viewer.commands._usage import Parser

__all__ = ["add_arguments", "command_line", "run"]

_SHELLS = ("bash", "zsh", "tcsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s bash|zsh|tcsh|fish"
    parser.add_argument(
        "shell", choices=_SHELLS, help="the shell; see below for where to put its script"
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        "bash: viewer completion bash > ~/.local/share/bash-completion/completions/viewer\n"
        "zsh:  viewer completion zsh > a file _viewer in a folder of $fpath\n"
        "tcsh: viewer completion tcsh > a file that ~/.tcshrc sources\n"
        "fish: viewer completion fish > ~/.config/fish/completions/viewer.fish"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    print(shtab.complete(command_line(), arguments.shell))
    return 0


def command_line() -> argparse.ArgumentParser:
    """Return the whole command line as one parser; file arguments are marked for completion."""
    whole = Parser(prog="viewer", description="View, check and convert skinned characters.")
    whole.add_argument("--version", action="store_true", help="print the version")
    commands: Any = whole.add_subparsers(dest="command", parser_class=Parser)
    for name, text in COMMANDS.items():
        parser = commands.add_parser(name, help=text, description=text)
        if name == "batch":
            jobs: Any = parser.add_subparsers(dest="job", parser_class=Parser)
            for job, kind in JOBS.items():
                inner = jobs.add_parser(job, help=kind.title, description=kind.title)
                add_all_arguments(inner, job)
                _complete_files(inner)
        else:
            import_module(f"viewer.commands.{name}").add_arguments(parser)
            _complete_files(parser)
    return whole


def _complete_files(parser: argparse.ArgumentParser) -> None:
    """Mark the arguments whose values are files."""
    import shtab

    for action in parser._actions:  # argparse has no public name for this action
        if _names_a_file(action):
            action.complete = shtab.FILE  # type: ignore[attr-defined]


def _names_a_file(action: argparse.Action) -> bool:
    """Return whether the value of an argument is a file or folder."""
    if action.choices is not None or action.nargs == 0:
        return False
    metavar = str(action.metavar or "")
    return not action.option_strings or metavar.startswith(("FILE", "FOLDER", "FIGURE", "OTHER"))
