"""Output names of a batch, from a template; name clashes are found before anything starts."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from string import Formatter

from viewer.batching.inputs import Inputs
from viewer.batching.items import Item
from viewer.errors import ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import counted, listed, printable

FIELDS = {
    "parent": "the input's folder, relative to the folder that all inputs share",
    "folder": "the input's folder, as it was given",
    "stem": "the input's name without its suffix",
    "name": "the input's name",
    "suffix": "the input's suffix without its dot",
    "index": "the input's number, from 0",
}
"""Fields of templates."""

_NUMBER = re.compile(r"0?[1-9]?[0-9]?d?")  # formats of ``{index}``
_LEFT = ("frame", "person")  # fields that commands replace, for numbered files
_OWN_FIELD = re.compile(rf"\{{({'|'.join(_LEFT)})([^{{}}]*)\}}")
_LONGEST = 300  # maximum length of a name in a message, characters


def template_of(output: str, suffix: str) -> str:
    """Return the template for output names; outputs in a folder get the suffix ``suffix``."""
    # The suffix is "folder" for outputs that are folders, and empty if a template is required.
    if _fields(output):
        if suffix:
            raise ViewerError(
                f"--to: expected a folder for -o, found the template {printable(output, _LONGEST)}"
            )
        return output
    if not suffix:
        raise ViewerError(
            f"-o {printable(output, _LONGEST)}: expected --to SUFFIX for the files in this folder, "
            "or a template such as {parent}/{stem}.bvh"
        )
    last = "" if suffix == "folder" else f".{suffix.lstrip('.')}"
    folder = output.replace("{", "{{").replace("}", "}}")
    return os.path.join(folder, "{parent}", "{stem}" + last)


def output_folder(output: str) -> str:
    """Return the common folder of all outputs of a folder or template; empty if it has none.

    >>> output_folder("out"), output_folder("out/a_{stem}.bvh"), output_folder("{stem}.bvh")
    ('out', 'out', '')
    """
    return os.path.dirname(output.partition("{")[0]) if _fields(output) else output


def _fields(template: str, option: str = "-o") -> list[str]:
    """Return the fields of a template; raise ViewerError for unknown ones."""
    try:
        found = [
            (name, spec or "", conversion)
            for _, name, spec, conversion in Formatter().parse(template)
            if name is not None
        ]
    except ValueError as problem:
        raise ViewerError(f"{option} {printable(template, _LONGEST)}: {problem}") from None
    for name, spec, conversion in found:
        if name not in (*FIELDS, *_LEFT):
            near = did_you_mean(name, FIELDS) or f"available fields: {', '.join(FIELDS)}"
            raise ViewerError(f"{option}: no field is called {{{printable(name, 40)}}}; {near}")
        if spec and name not in ("index", *_LEFT):
            raise ViewerError(
                f"{option}: expected {{{name}}} without a format, found {printable(spec, 40)}"
            )
        if conversion or (name == "index" and not _NUMBER.fullmatch(spec)):
            form = f"!{conversion}" if conversion else f":{spec}"
            wanted = "{index} or {index:05}" if name == "index" else f"{{{name}}}"
            raise ViewerError(f"{option}: expected {wanted}, found {{{name}{printable(form, 40)}}}")
    return [name for name, _, _ in found]


def items_of(inputs: Inputs, template: str = "") -> list[Item]:
    """Return the items in the order of the inputs; nothing is written without a template."""
    pieces = list(Formatter().parse(template))
    here = os.getcwd()
    items = []
    for index, path in enumerate(inputs.paths):
        name = _below(os.path.normpath(os.path.join(here, path)), inputs.base)
        output = _filled(pieces, index, path, name, path in inputs.folders) if template else ""
        items.append(Item(index, (path,), output, name))
    return items


def _below(full: str, base: str) -> str:
    """Return an absolute path relative to the shared folder."""
    if base and full.startswith(os.path.join(base, "")):
        return full[len(base) :].lstrip(os.sep).replace(os.sep, "/")
    return os.path.splitdrive(full)[1].lstrip(os.sep).replace(os.sep, "/")


def _filled(
    pieces: Sequence[tuple[str, str | None, str | None, str | None]],
    index: int,
    path: str,
    name: str,
    is_folder: bool,
) -> str:
    parent, last = os.path.split(name)
    # A folder's name has no suffix, even if it contains dots.
    stem, suffix = (last, "") if is_folder else os.path.splitext(last)
    values: dict[str, str | int] = {
        "parent": parent or ".",
        "folder": os.path.dirname(path) or ".",
        "stem": stem,
        "name": last,
        "suffix": suffix[1:],
        "index": index,
    }
    for name in ("parent", "folder", "stem", "name"):
        # The command would treat such a part of the output's name as its own field.
        values[name] = _OWN_FIELD.sub(r"(\1\2)", str(values[name]))
    text = ""
    for literal, field, spec, _ in pieces:
        text += literal
        if field in _LEFT:
            text += f"{{{field}:{spec}}}" if spec else f"{{{field}}}"
        elif field is not None:
            text += format(values[field], spec or "")
    return os.path.normpath(text)


def filled(template: str, item: Item) -> str:
    """Return a template with its fields replaced for one item, such as for a second output."""
    path = item.files[-1]
    pieces = list(Formatter().parse(template))
    return _filled(pieces, item.index, path, item.name, os.path.isdir(path))


def check_further_outputs(
    option: str, template: str, items: Sequence[Item], more_inputs: Iterable[str] = ()
) -> list[Item]:
    """Return the items of a second output of each; refuse names used twice or of an input."""
    _fields(template, option)
    further = [replace(item, output=filled(template, item)) for item in items]
    try:
        check_outputs([*items, *further], more_inputs)
    except ViewerError as problem:
        raise ViewerError(f"{option}: {problem}") from None
    return further


def check_outputs(items: Sequence[Item], more_inputs: Iterable[str] = ()) -> None:
    """Check that no two items have the same output and no output is an input."""
    # Names that differ only in case refer to the same file on some systems, and results are likely
    # to be copied to one of these.
    owners: dict[str, Item] = {}
    here = os.getcwd()
    clashes = []
    advice = "{parent}, {name} or {index}, such as 'out/{parent}/{name}.bvh'"
    for item in items:
        other = owners.setdefault(_identity(here, item.output), item) if item.output else item
        if other is not item:
            clashes.append(f"{_shown(item.output)} ({_shown(other.name)}, {_shown(item.name)})")
            if item.output != other.output:
                advice = (
                    "{index}: names that differ only in case or Unicode form are the same file on "
                    "some systems"
                )
    if clashes:
        raise ViewerError(
            f"{counted(len(clashes), 'output')} would be written twice: {listed(clashes, 10)}; "
            f"use a template with {advice}"
        )
    files = [file for item in items for file in item.files] + list(more_inputs)
    real = _RealPaths()
    inputs = {real.of(file) for file in files}
    replaced = [
        _shown(item.output) for item in items if item.output and real.of(item.output) in inputs
    ]
    if replaced:
        verb = "is an input" if len(replaced) == 1 else "are inputs"
        raise ViewerError(f"{counted(len(replaced), 'output')} {verb}: {listed(replaced, 10)}")


def check_summaries(
    files: Mapping[str, str], items: Sequence[Item], more_inputs: Iterable[str] = ()
) -> None:
    """Check that files about the batch, by option, differ from inputs, outputs and each other."""
    real, here = _RealPaths(), os.getcwd()
    given = {option: path for option, path in files.items() if path}
    if not given:
        return
    # Resolving a million paths takes seconds, so only paths with the same name are resolved.
    last = {os.path.basename(path).casefold() for path in given.values()}
    for option, path in given.items():
        folder = os.path.join(_identity(here, path), "")
        if any(item.output and _identity(here, item.output).startswith(folder) for item in items):
            raise ViewerError(f"{option}: {_shown(path)}: expected a file, found the output folder")

    def is_near(path: str) -> bool:
        return os.path.basename(path).casefold() in last

    read = (file for item in items for file in item.files)
    inputs = {real.of(file) for file in filter(is_near, (*read, *more_inputs))}
    owners = {
        _identity(here, item.output): f"the output of {item.name}"
        for item in items
        if is_near(item.output)
    }
    for option, path in given.items():
        found = "an input" if real.of(path) in inputs else owners.get(_identity(here, path))
        if found is not None:
            raise ViewerError(
                f"{option}: {_shown(path)}: expected a separate file, found {_shown(found)}"
            )
        owners[_identity(here, path)] = f"the file of {option}"


def _identity(folder: str, path: str) -> str:
    path = os.path.normpath(os.path.join(folder, path))
    return (path if path.isascii() else unicodedata.normalize("NFC", path)).casefold()


class _RealPaths:
    """Real paths; each folder is resolved only once."""

    def __init__(self) -> None:
        self._folders: dict[str, str] = {}

    def of(self, path: str) -> str:
        if os.path.islink(path):
            return os.path.realpath(path)
        folder, name = os.path.split(path)
        if folder not in self._folders:
            self._folders[folder] = os.path.realpath(folder or ".")
        return os.path.join(self._folders[folder], name)


def _shown(path: str | Path) -> str:
    return printable(path, _LONGEST)
