"""Options of commands, made from the fields of settings classes, and settings made from options.

Each field made by ``setting`` is one option: its name with dashes is the option's, its annotation
is the option's type, its default is the option's default. Flags are fields that are False, or
True: then the option is ``--no-NAME``. Lists are options that may be repeated. Metadata changes
that: ``flag`` is another option string; ``given`` the option's own default, if it is not the
field's (None: the field's default applies unless the option is given); ``read`` the function from
the option's value to the field's; ``limits`` the lowest and highest value; ``usual`` the text for
``{usual}`` in the help, if the default depends on the command. ``type``, ``choices``,
``dest``, ``metavar``, ``nargs``, ``const`` and ``action`` are those of ``argparse``.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import Field, fields
from typing import Any, TypeVar

from viewer.errors import ViewerError

_Settings = TypeVar("_Settings")


def number(text: str) -> float:
    """Return a finite number; argparse prefixes the error with the option."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, found {text}")
    return value


_TYPES: dict[str, Callable[[str], object]] = {"float": number, "int": int}
"""Parsers of options, by the first word of their field's annotation."""
_OWN = ("flag", "given", "help", "limits", "read", "usual")
"""Metadata that is not passed on to ``argparse``."""


def add_settings(
    group: argparse.ArgumentParser | argparse._ArgumentGroup,
    kind: type,
    *names: str,
    **changes: Any,
) -> None:
    """Add options of fields, by default all; ``changes``: metadata that differ for this command."""
    known = _options(kind)
    for name in names or known:
        each = known[name]
        facts = {**each.metadata, **changes}
        default = each.default_factory() if callable(each.default_factory) else each.default
        is_number = isinstance(default, int | float) and not isinstance(default, bool)
        shown = f"{default:g}" if is_number else str(default)
        text = facts["help"].replace("{default}", shown).replace("{usual}", facts.get("usual", ""))
        how = {key: value for key, value in facts.items() if key not in _OWN}
        if isinstance(default, bool) and "choices" not in how and "action" not in how:
            group.add_argument(_flag(each), action="store_true", help=text, **how)
            continue
        if isinstance(default, list):
            how.setdefault("action", "append")
        # The annotation is text if its module postpones the evaluation.
        annotation = each.type.__name__ if isinstance(each.type, type) else str(each.type)
        parser = _TYPES.get(annotation.partition(" ")[0])
        if parser is not None and not {"type", "choices", "action"} & {*how}:
            how["type"] = parser
        given = facts.get("given", None if default in ("", ()) else default)
        group.add_argument(_flag(each), default=given, help=text, **how)


def settings_of(kind: type[_Settings], arguments: argparse.Namespace, **given: Any) -> _Settings:
    """Return the settings that options state; ``given`` are fields that no option states alone."""
    values = dict(given)
    for name, each in _options(kind).items():
        value = getattr(arguments, _destination(each), None)
        if name in values or value is None:
            continue
        if "limits" in each.metadata:
            low, high = each.metadata["limits"]
            if not low <= value <= high:
                wanted = f"{low:g} to {high:g}" if high < math.inf else f"{low:g} or more"
                raise ViewerError(f"{_flag(each)}: expected {wanted}, found {value:g}")
        if "read" in each.metadata:
            value = each.metadata["read"](value)
        elif each.default is True:
            value = not value
        values[name] = value
    return kind(**values)


def stated(kind: type, arguments: argparse.Namespace) -> set[str]:
    """Return the fields whose options are given, of those whose option has no default."""
    return {
        name
        for name, each in _options(kind).items()
        if getattr(arguments, _destination(each), None) is not None
        and each.metadata.get("given", each.default) in (None, "")
    }


def changed(kind: type, arguments: argparse.Namespace) -> list[str]:
    """Return the options of the fields whose value is not the default one."""
    found: object = settings_of(kind, arguments)
    usual = kind()
    return [
        _flag(each)
        for name, each in _options(kind).items()
        if getattr(found, name) != getattr(usual, name)
    ]


def destinations(kind: type, without: str = "") -> list[str]:
    """Return the names of the fields' options among the arguments, in the order of the fields."""
    return [_destination(each) for name, each in _options(kind).items() if name != without]


def _options(kind: type) -> dict[str, Field[Any]]:
    """Return the fields that are options, by name."""
    return {each.name: each for each in fields(kind) if each.metadata}


def _flag(each: Field[Any]) -> str:
    """Return the option of a field."""
    usual = f"--{'no-' * (each.default is True)}{each.name.replace('_', '-')}"
    return str(each.metadata.get("flag", usual))


def _destination(each: Field[Any]) -> str:
    """Return the name of a field's option among the arguments."""
    return str(each.metadata.get("dest", _flag(each).lstrip("-").replace("-", "_")))
