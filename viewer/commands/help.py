"""Pages of the manual, and example scripts, in the terminal."""

from __future__ import annotations

import argparse
import sys

from viewer.commands import COMMANDS
from viewer.commands._usage import command_parser
from viewer.errors import ViewerError
from viewer.examples import EXAMPLES
from viewer.manual import PAGES, page_text
from viewer.resources import resource

_EXAMPLES = "examples"  # the topic of the scripts


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [TOPIC | COMMAND | examples [NAME]]"
    parser.add_argument(
        "topic",
        nargs="?",
        choices=[*PAGES, _EXAMPLES, *COMMANDS],
        metavar="TOPIC",
        help="a page of the manual, a command to list its options, or examples to list scripts "
        "for Python (default: list the topics)",
    )
    parser.add_argument(
        "example",
        nargs="?",
        choices=[*EXAMPLES],
        metavar="NAME",
        help="a script to print, after examples",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the topics, a page, a command's options, or a script."""
    topic: str | None = arguments.topic
    if arguments.example is not None:
        if topic != _EXAMPLES:
            raise ViewerError(f"expected one topic, found {topic} and {arguments.example}")
        script = resource("examples", f"{arguments.example}.py")
        print(script.read_text("utf-8"), end="")
    elif topic is None:
        print(_topics())
    elif topic == _EXAMPLES:
        print("viewer help examples NAME prints a script for Python:\n")
        print("\n".join(_rows(EXAMPLES)))
    elif topic in COMMANDS:
        command_parser(topic).print_help()
    else:
        _print_page(page_text(topic))
    return 0


def _topics() -> str:
    """Return the list of topics."""
    scripts = {_EXAMPLES: f"{len(EXAMPLES)} scripts for Python"}
    return "\n".join(
        [
            "viewer help TOPIC shows a page of the manual:",
            "",
            *_rows(PAGES | scripts),
            "",
            "viewer help COMMAND lists the options of a command:",
            f"  {', '.join(COMMANDS)}",
        ]
    )


def _rows(texts: dict[str, str]) -> list[str]:
    """Return a line for each name with its text."""
    width = max(map(len, texts)) + 2
    return [f"  {name:<{width}}{text}" for name, text in texts.items()]


def _print_page(text: str) -> None:
    """Print Markdown: formatted in a terminal, verbatim to files and pipes."""
    if sys.stdout is None or not sys.stdout.isatty():
        print(text, end="")
        return
    # This import is late because rich takes longer to import than the rest of this command to run.
    from rich.console import Console
    from rich.markdown import Markdown
    from rich.theme import Theme

    # The default style has a black background, which is hard to read on light terminals.
    console = Console(theme=Theme({"markdown.code": "bold cyan"}))
    with console.capture() as page:
        console.print(Markdown(text, hyperlinks=False))
    # The text is printed here so that a failed write is reported like any other.
    print(page.get(), end="")
