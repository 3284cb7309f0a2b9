"""Reference tables of the manual, generated from the registries. Pages mark the position of a table
with ``<!-- table: NAME -->`` and ``<!-- end -->``. ``make manual`` writes the tables into the
pages, ``test_pages.py`` fails if one is out of date.
"""

import argparse
import ast
import re
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import viewer
from viewer import schemas
from viewer.app.features import KEYS, MOUSE
from viewer.commands import COMMANDS
from viewer.commands._usage import command_parser
from viewer.diagnostics import CODES
from viewer.exporters import EXPORTERS
from viewer.formats import FORMATS
from viewer.media.video_kinds import VIDEOS
from viewer.rendering.gpu.program import SHADING
from viewer.rigs.scalars import SCALARS
from viewer.rigs.skinning import METHODS

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
    rows = [(name, code.severity, code.title, code.hint) for name, code in CODES.items()]
    return table(("code", "severity", "finding", "remedy"), rows)


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
    rows = [(f"`viewer {name}`", text) for name, text in COMMANDS.items()]
    return table(("command", "purpose"), rows)


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


def json_keys(kind: str) -> str:
    """Return a table for each class of a kind of JSON data, the whole first."""
    classes = {node.name: node for node in ast.parse(Path(schemas.__file__).read_text("utf-8")).body
               if isinstance(node, ast.ClassDef)}  # fmt: skip
    wanted, shown = [schemas.KINDS[kind].__name__], list[str]()
    for name in wanted:  # the list grows
        body, rows = classes[name].body, []
        for place, node in enumerate(body):
            if not isinstance(node, ast.AnnAssign):
                continue
            after = body[place + 1] if place + 1 < len(body) else None
            is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            text = " ".join(str(after.value.value).split()) if is_text else ""
            typed = ast.unparse(node.annotation)
            wanted += [other for other in classes if re.search(rf"\b{other}\b", typed)
                       and other not in wanted]  # fmt: skip
            is_optional = typed.startswith("NotRequired[")
            key = f"`{ast.unparse(node.target)}`" + " (not always)" * is_optional
            rows.append((key, _json_type(node.annotation), text))
        title = ast.get_docstring(classes[name]) or ""
        head = f"**{name.removesuffix('Data').lower()}**: {title[0].lower()}{title[1:]}\n\n"
        shown.append(head + table(("key", "value", "meaning"), rows))
    return "\n".join(shown).replace("``", "`")


_JSON = {
    **{"str": "text", "int": "integer", "float": "number", "bool": "true or false"},
    **{"None": "null", "Any": "anything", "Severity": "note, warning or error"},
}


def _json_type(node: ast.expr) -> str:
    """Return an annotation in words: ``list[float] | None`` is "list of number, or null"."""
    if isinstance(node, ast.BinOp):
        return f"{_json_type(node.left)}, or {_json_type(node.right)}"
    if isinstance(node, ast.Constant):
        return _JSON[str(node.value)] if node.value is None else str(node.value)
    if isinstance(node, ast.Tuple):
        return ", ".join(map(_json_type, node.elts))
    if not isinstance(node, ast.Subscript):
        name = ast.unparse(node)
        return _JSON.get(name, name.removesuffix("Data").lower())
    inner = node.slice
    match ast.unparse(node.value):
        case "list":
            return f"list of {_json_type(inner).replace(', or ', ' or ')}"
        case "dict" if isinstance(inner, ast.Tuple):
            return f"object of {_json_type(inner.elts[1])}"
        case _:
            return _json_type(inner)


TABLES = {
    "batch_json": partial(json_keys, "batch/1"),
    "codes": codes,
    "commands": commands,
    "diff_json": partial(json_keys, "diff/1"),
    "info_json": partial(json_keys, "info/1"),
    "keys": keys,
    "lint_json": partial(json_keys, "lint/1"),
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
