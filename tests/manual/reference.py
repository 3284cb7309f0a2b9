"""Reference tables of the manual, generated from the registries. Pages mark the position of a table
with ``<!-- table: NAME -->`` and ``<!-- end -->``. ``make manual`` writes the tables into the
pages, ``test_pages.py`` fails if one is out of date.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Formatter

import viewer
from viewer.app.features import KEYS, MOUSE
from viewer.commands import COMMANDS
from viewer.commands._usage import command_parser
from viewer.diagnostics import CODES, MESSAGES
from viewer.export import EXPORTERS
from viewer.formats import FORMATS
from viewer.media.video_kinds import VIDEOS
from viewer.phrases import counted
from viewer.rendering.gpu.program import SHADING
from viewer.rig.scalars import SCALARS
from viewer.rig.skinning import METHODS

FOLDER = Path(viewer.__file__).parent / "manual"

_BLOCK = re.compile(r"(<!-- table: (\w+) -->\n)(.*?)(<!-- end -->\n)", re.DOTALL)


def with_tables(text: str) -> str:
    """Return a page with its tables generated from the current registries."""
    return _BLOCK.sub(lambda block: f"{block[1]}\n{TABLES[block[2]]()}\n{block[4]}", text)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; bars within cells are escaped."""
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in r] for r in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def keys() -> str:
    return table(("key", "action"), [(key.label, key.text) for key in KEYS])


def mouse() -> str:
    return table(("mouse", "action"), MOUSE)


def codes() -> str:
    rows = [
        (name, code.severity, code.title, template(code.remedy)) for name, code in CODES.items()
    ]
    return table(("code", "severity", "finding", "remedy"), rows)


def messages() -> str:
    """Return a table of the templates of each code, with value names in braces."""
    rows = [(f"`{key}`", code_span(template(text))) for key, text in sorted_messages()]
    return table(("key", "message"), rows)


def code_span(text: str) -> str:
    """Return text as Markdown code, which may itself contain backticks."""
    return f"`` {text} ``" if "`" in text else f"`{text}`"


def sorted_messages() -> list[tuple[str, str]]:
    """Return keys and templates in the order of the codes, then by name."""
    place = {code: index for index, code in enumerate(CODES)}
    return sorted(MESSAGES.items(), key=lambda item: (place[item[0].partition(".")[0]], item[0]))


def template(text: str) -> str:
    """Return a message as users see it, with each value as its name in braces."""
    shown = ""
    for literal, name, spec, _ in Formatter().parse(text):
        shown += literal
        if name is None:
            continue
        kind, rest = (spec or "")[:1], (spec or "")[1:]
        value = f"{{{name}}}"
        if kind == "#":
            noun, _, many = rest.partition("|")
            noun, _, total = noun.partition("/")
            total = total and f" of {total}"
            verb = many.rpartition("|")[2]
            shown += " ".join(
                filter(None, (value + total, counted(2, noun).removeprefix("2 "), verb))
            )
        elif kind == "?":
            shown += rest.partition("|")[2]
        elif kind == "+" and "{}" in rest:
            shown += f"[{rest.replace('{}', value)}]"
        else:
            shown += value
    return shown


def readers() -> str:
    rows = [
        (
            kind.title,
            ", ".join(f"`{suffix}`" for suffix in kind.suffixes) + ", folder" * bool(kind.files),
        )
        for kind in FORMATS.values()
    ]
    return table(("opens", "files"), rows)


def writers() -> str:
    rows = [
        (
            kind.title,
            ", ".join("folder" if suffix == "/" else f"`{suffix}`" for suffix in kind.suffixes),
            "yes" if "pose" in kind.stores else "",
            "yes" if kind.stores_motion else "",
            f"`--as {name}`",
        )
        for name, kind in EXPORTERS.items()
    ]
    return table(("writes", "files", "one pose", "motion", "option"), rows)


def videos() -> str:
    rows = [
        (kind.title, f"`{suffix}`", "yes" if kind.has_alpha else "")
        for suffix, kind in VIDEOS.items()
    ]
    return table(("video", "file", "transparent"), rows)


def scalars() -> str:
    units = {"length": "figure units", "": ""}
    rows = [
        (f"`{name}`", kind.title, units.get(kind.unit, kind.unit), kind.needs)
        for name, kind in SCALARS.items()
    ]
    return table(("name", "quantity", "unit", "needs"), rows)


def methods() -> str:
    return table(
        ("method", "skinning"), [(f"`{name}`", kind.title) for name, kind in METHODS.items()]
    )


def shading() -> str:
    return table(("shading", "surface"), [(f"`{name}`", text) for name, text in SHADING.items()])


def commands() -> str:
    return table(
        ("command", "purpose"), [(f"`viewer {key}`", text) for key, text in COMMANDS.items()]
    )


def options() -> str:
    """Return a table for each group of options, with the commands that have them."""
    groups: dict[str, dict[tuple[str, str], list[str]]] = {}
    for command in COMMANDS:
        for group in command_parser(command)._action_groups:
            for action in group._group_actions:
                if action.dest != "help" and action.help != argparse.SUPPRESS:
                    row = _names(action), (action.help or "").replace("%%", "%")
                    rows = groups.setdefault(_title(group), {})
                    rows.setdefault(row, []).append(command)
    return "\n".join(
        f"## {title}\n\n"
        + table(
            ("option", "meaning", "commands"),
            [(name, text, ", ".join(of)) for (name, text), of in rows.items()],
        )
        for title, rows in groups.items()
    )


def _title(group: argparse._ArgumentGroup) -> str:
    """Return the title of a group as a heading, without the explanation after the colon."""
    title = (group.title or "").partition(":")[0]
    if title in ("options", "positional arguments"):
        return "Other"
    return f"{title[:1].upper()}{title[1:]}"


def _names(action: argparse.Action) -> str:
    """Return the spellings of an option with its value."""
    if not action.option_strings:
        return f"`{action.metavar or action.dest}`"
    value = action.metavar or ("" if action.nargs == 0 else action.dest.upper())
    if action.choices is not None:
        value = "|".join(map(str, action.choices))
    if value and action.nargs == "?":
        value = f"[{value}]"
    return ", ".join(
        f"`{name} {value}`" if value else f"`{name}`" for name in action.option_strings
    )


TABLES = {
    "codes": codes,
    "commands": commands,
    "keys": keys,
    "messages": messages,
    "methods": methods,
    "mouse": mouse,
    "options": options,
    "readers": readers,
    "scalars": scalars,
    "shading": shading,
    "videos": videos,
    "writers": writers,
}


def main() -> int:
    """Write the tables into the pages, and print which ones have changed."""
    for path in sorted(FOLDER.glob("*.md")):
        old = path.read_text("utf-8")
        new = with_tables(old)
        if new != old:
            path.write_text(new, "utf-8")
            print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
