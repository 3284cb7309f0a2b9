"""Templates of messages: ``str.format`` with a few specifications of our own.

=====================  ===========================================================================
``{word:quoted}``      a word in quotes; None is the end of the file
``{name:text}``        any text on one line, control characters escaped
``{names:list}``       the first few, and how many more
``{names:list60}``     the first 60, and how many more
``{names:all}``        every name
``{names:or}``         alternatives
``{n:#vertex}``        a count with its noun: ``3 vertices``
``{n:#vertex|is|are}`` the same with a verb that agrees
``{n:#frame/{all}}``   a count of a total: ``3 of 20 frames``; a verb may follow
``{n:?one|many}``      the first for 1, the second for other counts
``{near:+; {}}``       the rest of the specification, if the value is not empty; ``{}`` is the value
=====================  ===========================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from string import Formatter
from typing import Any

from viewer.phrases import counted, listed, one_of, printable, quoted


def rendered(template: str, values: Mapping[str, Any]) -> str:
    """Return a template with its values in place."""
    return _FORMATTER.vformat(template, (), values)


def fields(template: str) -> dict[str, str]:
    """Return the names of the values that a template shows, each with its specification."""
    found = {}
    for _, name, spec, _ in Formatter().parse(template):
        if name:
            found[name] = spec or ""
            found |= dict.fromkeys(fields(found[name]), "d")  # totals of counts
    return found


class _Formatter(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        """Return one value as its specification says."""
        kind, rest = format_spec[:1], format_spec[1:]
        if kind == "#":
            noun, one, many, *_ = [*rest.split("|"), "", ""]
            noun, _, total = noun.partition("/")
            return counted(value, noun, one, many, of=int(total) if total else None)
        if kind == "?":
            one, many = rest.split("|")
            return one if value == 1 else many
        if kind == "+":
            # An empty pair of braces in a specification has been filled with "" by now.
            return rest.replace("\0", printable(value, 300)) if value else ""
        if format_spec.startswith("list") and format_spec != "list":
            return listed(value, int(format_spec.removeprefix("list")))
        plain = _PLAIN.get(format_spec)
        return plain(value) if plain is not None else str(format(value, format_spec))

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        """Return a value by name; the empty name inside a specification is a placeholder."""
        return kwargs[key] if isinstance(key, str) and key else "\0"


def _word(word: bytes | str | None) -> str:
    return "the end of the file" if word is None else quoted(word)


_PLAIN: dict[str, Callable[[Any], str]] = {
    "quoted": _word,
    "text": printable,
    "list": listed,
    "all": lambda names: ", ".join(map(str, names)),
    "or": one_of,
}
_FORMATTER = _Formatter()
