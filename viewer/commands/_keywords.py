"""Keyword arguments of Python functions as options of the command that does the same.

The parser of the command is the only definition of the options: ``max_speed=3`` is read like
``--max-speed 3``, with the same limits, choices and defaults.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np

from viewer.commands._usage import FILES_BEFORE, Parser
from viewer.errors import FormatError, ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import all_of, printable

_OPTION = re.compile(r"viewer [a-z]+ --[a-z-]+|--([a-z]+(?:-[a-z]+)*)")  # commands stay


class _KeywordParser(Parser):
    """Parser whose errors name keyword arguments."""

    def error(self, message: str) -> NoReturn:
        """Raise ViewerError without advice about the command line."""
        raise ViewerError(message.removeprefix("argument ").replace(FILES_BEFORE, ""))


def paths_of(name: str, what: object, kinds: str = "a scene, an actor or paths") -> list[str]:
    """Return paths or names of models: one, or a sequence of them.

    ``name``, ``kinds``: the function or argument, and what it takes, for errors.
    """
    found = [*what] if isinstance(what, list | tuple) else [what]
    if not found:  # the commands would open the bundled figure
        raise ViewerError(f"{name}: expected {kinds}, found an empty {type(what).__name__}")
    for each in found:
        if not isinstance(each, str | Path):
            raise ViewerError(f"{name}: expected {kinds}, found {type(each).__name__}")
    return [*map(str, found)]


def arguments_of(
    function: str,
    add_arguments: Callable[[argparse.ArgumentParser], None],
    options: Mapping[str, object],
    without: Sequence[str] = (),
    positional: Sequence[str] = (),
) -> argparse.Namespace:
    """Return the arguments of a command for keyword arguments of a function.

    ``without``: options that the function has no use for; ``positional``: words for what the
    command takes without an option. ViewerError for an unknown name, which lists those allowed, or
    a wrong value.
    """
    parser = _KeywordParser(prog=function, add_help=False)
    add_arguments(parser)
    known = _known(parser, without)
    words = [*positional]
    for name, value in options.items():
        if name not in known:
            near = did_you_mean(name, known)
            listed = f"allowed: {all_of(sorted(known))}"
            raise ViewerError(
                f"{function}: no option is called {printable(name, 60)}; "
                f"{f'{near} ' if near else ''}{listed}"
            )
        if value is not None:
            words += _words(name, *known[name], value)
    with without_dashes():
        return parser.parse_intermixed_args(words)


def _known(
    parser: argparse.ArgumentParser, without: Sequence[str]
) -> dict[str, tuple[argparse.Action, str]]:
    """Return actions and option strings by keyword; ``--no-fit`` is ``fit``."""
    found = {}
    for action in parser._actions:  # argparse has no public name for this table
        if action.help == argparse.SUPPRESS:
            continue
        for flag in action.option_strings:
            name = flag.removeprefix("--").replace("-", "_")
            if flag.startswith("--") and name not in without:
                found[name.removeprefix("no_")] = action, flag
    return found


def _words(name: str, action: argparse.Action, flag: str, value: object) -> list[str]:
    """Return the words of the command line for a value."""
    if action.nargs == 0:
        if not isinstance(value, bool | np.bool_):
            raise ViewerError(f"{name}: expected True or False, found {printable(value, 60)}")
        return [flag] if bool(value) != flag.startswith("--no-") else []
    if isinstance(value, bool | np.bool_):
        if {*(action.choices or ())} == {"on", "off"}:
            return [f"{flag}={'on' if value else 'off'}"]
        if value and action.nargs == "?":
            return [flag]
        if value or action.nargs != "?":
            raise ViewerError(f"{name}: expected a value, found {value}")
        return []
    # An option that may be repeated takes a list; numbers are one value, as in A,B.
    values: Sequence[object] = [value]
    if type(action).__name__ == "_AppendAction" and isinstance(value, list | tuple):
        values = [value] if all(isinstance(each, int | float) for each in value) else value
    return [f"{flag}={_text(name, each)}" for each in values]


def _text(name: str, value: object) -> str:
    """Return a value as on the command line."""
    if isinstance(value, str | Path):
        return str(value)
    if isinstance(value, int | float | np.integer | np.floating):
        return repr(value.item() if isinstance(value, np.generic) else value)
    if isinstance(value, range):
        step = f":{value.step}" if value.step != 1 else ""
        return f"{value.start}:{value.stop}{step}"
    if isinstance(value, list | tuple | np.ndarray):
        return ",".join(_text(name, each) for each in value)
    raise ViewerError(
        f"{name}: expected a number, a text or a list of numbers, found {type(value).__name__}"
    )


@contextmanager
def without_dashes(**names: str) -> Iterator[None]:
    """Name settings in errors as in Python: messages of the command name its options.

    ``names``: arguments with another name than the option.
    """
    try:
        yield
    except ViewerError as problem:
        text = str(problem).removeprefix("--scalar ")

        def name_of(found: re.Match[str]) -> str:
            name = (found[1] or found[0]).replace("-", "_")
            return found[0] if found[1] is None else names.get(name, name)

        named = _OPTION.sub(name_of, text)
        if named == str(problem) or isinstance(problem, FormatError):
            raise
        raise type(problem)(named) from None
