"""One-line usage errors: unknown names are reported first, with the nearest known name."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from typing import TYPE_CHECKING, Any, NoReturn

from viewer.commands import COMMANDS
from viewer.errors import ViewerError
from viewer.phrases import all_of, printable
from viewer.plugins import plugin_of, plugins_of

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

_NUMBER = re.compile(r"-\.?\d")  # start of a value or file name, not of an option
_NAME = re.compile(r"[^\W_][\w-]*")  # a possible command; most files have a suffix or a folder
_WORD = re.compile(r"[^\W\d_]+")  # one that may be misspelt
FILES_BEFORE = ", or no value and the files before the option"
"""Remedy if a file is read as the value of an option that may have none."""
_LONGEST = 60  # maximum length of a name in a message, characters


class Parser(argparse.ArgumentParser):
    """Argument parser that reports a usage error in one line, like every other error."""

    _width: int | None = 80  # columns of text that is not shown; None: width of the terminal

    def error(self, message: str) -> NoReturn:
        """Raise ViewerError instead of exiting as ``argparse`` does."""
        raise ViewerError(f"{message} ({self.prog} --help lists the options)")

    def format_usage(self) -> str:
        """Return an empty text: ``argparse`` formats the usage for errors, which do not show it."""
        return ""

    def format_help(self) -> str:
        """Return the help, as wide as the terminal."""
        self._width = None
        return super().format_help()

    def _get_formatter(self) -> argparse.HelpFormatter:
        # argparse checks each new option with a formatter, which would ask for the terminal's width
        # and import shutil for that.
        return self.formatter_class(prog=self.prog, width=self._width)  # type: ignore[call-arg]

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help, or raise if it cannot be printed."""
        # ``argparse`` ignores that, and prints to the error stream if the output is closed.
        print(self.format_help(), end="", file=file)
        if sys.stdout is not None:
            sys.stdout.flush()  # argparse exits next

    def check_options(self, arguments: Iterable[str]) -> None:
        """Raise for an unknown option before ``--``, naming the nearest options."""
        # ``argparse`` would first report a missing argument, possibly the mistyped one.
        from viewer.near_names import near_names, question

        known = self._option_string_actions  # argparse has no public name for this table
        for argument in arguments:
            name = argument.partition("=")[0]
            # argparse treats arguments with spaces as values, and "-" as a file.
            if len(name) < 2 or name[0] != "-" or " " in argument or _NUMBER.match(name):
                continue
            if name[:2] in known or any(option.startswith(name) for option in known):
                continue
            # Leading dashes would make all options similar.
            bare = {option.lstrip("-"): option for option in known}
            near = question(
                [bare[one] for one in near_names(name.lstrip("-"), bare)]
                or [
                    f"{option} {name.lstrip('-')}"
                    for option, action in known.items()
                    if action.choices is not None and name.lstrip("-") in action.choices
                ]
            )
            near = near or _elsewhere(name)
            self.error(f"unknown option {printable(name, _LONGEST)}{f'; {near}' if near else ''}")

    def _get_value(self, action: argparse.Action, arg_string: str) -> object:
        """Return the value of an option; argparse would name the function that reads it."""
        try:
            return super()._get_value(action, arg_string)
        except argparse.ArgumentError as problem:
            if not str(problem.message).startswith("invalid "):
                raise
            wanted = "an integer" if action.type is int else "a number"
            wanted = str(action.metavar) if "|" in str(action.metavar) else wanted
            found = printable(arg_string, _LONGEST)
            raise argparse.ArgumentError(action, f'expected {wanted}, found "{found}"') from None

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Raise for a value that is not one of an option's choices; suggest the nearest."""
        from viewer.near_names import did_you_mean

        if action.choices is None or value in action.choices:
            return
        choices = [str(choice) for choice in action.choices]
        near = did_you_mean(str(value), choices)
        wrong = f'expected one of {", ".join(choices)}, found "{printable(value, _LONGEST)}"'
        raise argparse.ArgumentError(action, f"{wrong}; {near}" if near else wrong)


def _elsewhere(option: str) -> str:
    """Return which commands have an option that another one lacks; empty if none has."""
    having = [
        f"viewer {name}"
        for name in COMMANDS
        if option in command_parser(name)._option_string_actions
    ]
    if not having:
        return ""
    return f"it is an option of {all_of(having)}"


def command_parser(name: str, words: Sequence[str] = ()) -> Parser:
    """Return the parser of a command; the first word selects the options of ``parser_of``."""
    module = command_module(name)
    own: Parser | None = module.parser_of(words) if words and hasattr(module, "parser_of") else None
    if own is not None:
        return own
    text = COMMANDS.get(name, "a command of a plug-in")
    parser = Parser(prog=f"viewer {name}", description=text)
    with guard_of(name):
        module.add_arguments(parser)
        if parser.usage is None:  # argparse would show that of errors, which is empty
            usage = argparse.ArgumentParser.format_usage(parser).removeprefix("usage: ")
            parser.usage = usage.strip().replace("%", "%%")
    return parser


def command_module(name: str) -> Any:
    """Return the module of a command: a key of ``COMMANDS``, or the name of a plug-in."""
    if name in COMMANDS:
        return import_module(f"viewer.commands.{name.replace('-', '_')}")
    plugin = plugin_of("commands", name)
    assert plugin is not None  # as ``is_plugged_command`` has found it
    return plugin.load()


def guard_of(name: str) -> AbstractContextManager[None]:
    """Return a context in which exceptions of a plug-in's command are errors of one line."""
    plugin = None if name in COMMANDS else plugin_of("commands", name)
    return nullcontext() if plugin is None else plugin.guarded("failed", may_exit=True)


def checked_code(name: str, code: object) -> int:
    """Return what a command's ``run`` returned: an exit code, or None, which is 0."""
    if isinstance(code, int | None):
        return code or 0
    plugin = plugin_of("commands", name)
    assert plugin is not None  # type checkers see to this program's commands
    raise plugin.error(f"expected an exit code from run, found {type(code).__name__}")


def is_plugged_command(word: str) -> bool:
    """Return whether a first argument is a plug-in's command; raise if it is a misspelt one."""
    from viewer.models import resolve
    from viewer.near_names import did_you_mean

    if not _NAME.fullmatch(word) or os.path.lexists(resolve(word)):
        return False
    if plugin_of("commands", word) is not None:
        return True
    known = [*COMMANDS, *(found.name for found in plugins_of("commands"))]
    near = did_you_mean(word, known) if _WORD.fullmatch(word.replace("-", "")) else ""
    if near:
        raise ViewerError(
            f'no command and no file is called "{printable(word, _LONGEST)}"; {near} '
            "(viewer --help lists the commands)"
        )
    return False


def require_files(files: Sequence[str], body: bool, command: str) -> None:
    """Raise if no files are given to a command that does not default to the bundled figure."""
    if not files and not body:
        raise ViewerError(
            f"expected FILES, found none (viewer {command} --help lists what can be opened)"
        )
