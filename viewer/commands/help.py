"""Pages of the manual in the terminal."""

from __future__ import annotations

import argparse
import sys

from viewer.commands import COMMANDS
from viewer.commands._usage import command_parser
from viewer.manual import PAGES, page_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [TOPIC | COMMAND]"
    parser.add_argument(
        "topic",
        nargs="?",
        choices=[*PAGES, *COMMANDS],
        metavar="TOPIC",
        help="a page of the manual, or a command to list its options (default: list the topics)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the topics, a page, or a command's options."""
    topic: str | None = arguments.topic
    if topic is None:
        print(_topics())
    elif topic in COMMANDS:
        command_parser(topic).print_help()
    else:
        _print_page(page_text(topic))
    return 0


def _topics() -> str:
    """Return the list of topics."""
    width = max(map(len, PAGES)) + 2
    lines = [f"  {name:<{width}}{text}" for name, text in PAGES.items()]
    return "\n".join(
        [
            "viewer help TOPIC shows a page of the manual:",
            "",
            *lines,
            "",
            "viewer help COMMAND lists the options of a command:",
            f"  {', '.join(COMMANDS)}",
        ]
    )


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
