"""The command line: subcommands, error messages and exit codes."""

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import os
import sys
from collections.abc import Sequence

import viewer
from viewer.commands import COMMANDS
from viewer.commands._usage import (
    Parser,
    checked_code,
    command_module,
    command_parser,
    guard_of,
    is_plugged_command,
)
from viewer.errors import FormatError, ViewerError
from viewer.interrupts import Interrupted, deferred, watched
from viewer.phrases import printable
from viewer.plugins import added_to, without_plugins
from viewer.streams import standard_streams

_EPILOG = """\
Without a command, FILES open in a window; without files, the bundled figure does.
"viewer COMMAND --help" lists a command's options, and "viewer help" lists the manual's pages.

exit codes: 0 success, 1 lint findings or diff above the tolerance, 2 bad input, 4 no usable OpenGL,
5 output could not be written, 129 terminal closed, 130 interrupted (Ctrl-C), 143 terminated; a
signal that arrives after all output is written does not change the exit code
"""

_DOWNWARD = ("-y", "-z")  # values of --up and --front; they are not options


@standard_streams()
def run(arguments: Sequence[str]) -> int:
    """Run one command, given without the program's name, and return its exit code.

    The code is 0, that of the ``ViewerError``, or 128 plus the signal number. Signals end the
    command as they would end the program; afterwards, the caller's handlers are restored.
    """
    try:
        with watched():
            return _attempt(list(arguments))
    except Interrupted as stop:
        return _fail(str(stop), stop.exit_code)
    except KeyboardInterrupt:  # raised by other code, not by a signal
        return _fail("interrupted", 130)


def _attempt(arguments: list[str]) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names with characters that the terminal cannot encode must not cause a failure.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _dispatch(arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except FormatError as problem:
        # As in compiler output, path and line come first, so that editors can jump there.
        return _fail(printable(problem, 2000), problem.exit_code, prefix="")
    except ViewerError as problem:
        return _fail(printable(problem, 2000), problem.exit_code)
    except BrokenPipeError:
        # The reader of the output has exited (``viewer info x | head -1``): no error.
        _drop_output()
        return 0
    except OSError as problem:
        _drop_output()
        return _fail(f"output could not be written: {problem.strerror or problem}", 5)
    except MemoryError:
        return _fail("not enough memory", 2)


def _dispatch(arguments: list[str]) -> int:
    own = arguments[: arguments.index("--")] if "--" in arguments else arguments
    if "--no-plugins" in own:
        arguments.remove("--no-plugins")
        with without_plugins():
            return _dispatch(arguments)
    if arguments and arguments[0] in ("-h", "--help"):
        _overview().print_help()
        return 0
    if arguments and arguments[0] == "--version":
        print(f"viewer {viewer.__version__}")
        return 0
    name = "view"
    if (arguments and arguments[0] in COMMANDS) or (arguments and is_plugged_command(arguments[0])):
        name = arguments.pop(0)
    parser = command_parser(name, arguments)
    # Everything after "--" is a file, even if it looks like an option.
    end = arguments.index("--") if "--" in arguments else len(arguments)
    before_end = protect_numbers(arguments[:end])
    parser.check_options(before_end)
    with deferred():
        # argparse restores its actions at the end, which fails if a signal ended the beginning.
        parsed = parser.parse_intermixed_args(before_end)
    if arguments[end + 1 :]:
        parsed.files = [*getattr(parsed, "files", []), *arguments[end + 1 :]]
    command = command_module(name)
    if not gc.isenabled():  # suspended at start-up; imported modules are excluded
        gc.freeze()
        gc.enable()
    if getattr(parsed, "no_cache", False):
        from viewer.media.array_cache import without_cache

        with without_cache():
            return command.run(parsed)
    with guard_of(name):
        code = command.run(parsed)
    return checked_code(name, code)


def protect_numbers(arguments: list[str]) -> list[str]:
    """Join ``--option -1`` to ``--option=-1``: argparse treats ``-1,2`` and ``-z`` as options."""
    joined: list[str] = []
    for argument in arguments:
        is_number = len(argument) > 1 and argument[0] == "-" and argument[1] in "0123456789."
        is_negative = is_number or argument in _DOWNWARD
        if is_negative and joined and joined[-1].startswith("--") and "=" not in joined[-1]:
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _overview() -> argparse.ArgumentParser:
    parser = Parser(
        prog="viewer",
        description="View, check and convert skinned characters.",
        epilog=_EPILOG,
        usage="viewer [COMMAND] [FILES ...] [options]",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="print the version")
    parser.add_argument(
        "--no-plugins", action="store_true", help="ignore installed plug-ins, for any command"
    )
    group = parser.add_argument_group("commands")
    for name, text in COMMANDS.items():
        # Commands are added like arguments, so that argparse aligns them.
        group.add_argument(name, nargs="?", help=text, metavar=name)
    plugged = added_to("commands", COMMANDS)
    if plugged:
        group = parser.add_argument_group("commands of plug-ins")
        for plugin in plugged:
            shown = printable(plugin.name, 60)
            text = plugin.distribution.replace("%", "%%")
            group.add_argument(shown, nargs="?", help=text, metavar=shown)
    return parser


def _fail(message: str, code: int, prefix: str = "viewer: ") -> int:
    with contextlib.suppress(OSError):  # the terminal may be closed
        print(f"{prefix}{message}", file=sys.stderr)
    return code


def _drop_output() -> None:
    """Discard the remaining output, or Python would report an error at exit."""
    if sys.stdout is not None:
        with contextlib.suppress(io.UnsupportedOperation):  # not a real file, as in tests
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
