"""Formatting of all messages, and the values that calls supply for their templates."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import pytest

import viewer
from viewer.batching.execution import attempt
from viewer.batching.items import Item
from viewer.diagnostics import CODES, MESSAGES, Diagnostic, Phrase, described, wording
from viewer.diagnostics.record import note_found
from viewer.diagnostics.template import fields, in_window, rendered
from viewer.diagnostics.wording import PHRASES
from viewer.lint import Finding, describe
from viewer.rig.scene import Scene

ROOT = Path(viewer.__file__).parent
CALLS = {
    "fault": {"offset"},
    "refuse": {"offset", "count", "part", "places"},
    "warn": {"offset", "count", "part", "places"},
    "found": {"part", "severity", "vertices", "triangles", "joints", "frames", "times", "seek",
              "at"},
    "Phrase": set(),
    "note": {"path", "line", "part", "places"},
}  # fmt: skip
"""Functions that take a key and values, and their other keywords."""


def sample(spec: str) -> Any:
    """Return a sample value that a format specification accepts."""
    if spec[:1] in "#?" and spec:
        return 3
    if spec == "word":
        return b"x"
    if spec.startswith("list") or spec in ("all", "axes", "or"):
        return ["first", "second\n"]
    if re.fullmatch(r"[+,z.\d]*[efg%]", spec):
        return 1.5
    if spec in ("text", "name", "quoted") or spec.startswith("+"):
        return "x\ny"  # the value may come from a file
    return 3 if spec in ("d", "bytes") else "x"


@pytest.mark.parametrize("key", MESSAGES)
def test_every_message_renders_on_one_line(key: str) -> None:
    values = {name: sample(spec) for name, spec in fields(MESSAGES[key]).items()}
    assert key.partition(".")[0] in CODES
    found = Diagnostic(key, Path("a.skin"), 7, values=values)
    line = str(found)
    assert line.startswith("a.skin:7: ") and len(line) > len("a.skin:7: ")
    assert "{" not in line.replace('"{"', "") and line.isprintable()


@pytest.mark.parametrize("key", PHRASES)
def test_every_phrase_renders(key: str) -> None:
    values = {name: sample(spec) for name, spec in fields(PHRASES[key]).items()}
    assert "{" not in str(Phrase(key, **values)).replace('"{"', "")


def test_messages_name_controls_in_the_window_and_options_elsewhere() -> None:
    texts = {**MESSAGES, **PHRASES, **{f"{key}.hint": code.remedy for key, code in CODES.items()}}
    differ = 0
    for key, text in texts.items():
        values = {name: sample(spec) for name, spec in fields(text).items()}
        with in_window():
            shown = rendered(text, values)
        differ += shown != rendered(text, values)
        assert not re.search(r"(?<!\S)\(?--[a-z]", shown) or is_about_options(key, text), key
    assert differ > 40
    rate = "no frame rate in the data: 30 fps assumed ({} sets it)"
    note = Diagnostic("F007.no-rate", values={"rate": 30})
    with in_window():
        assert str(note) == rate.format("Frames per second in the Timeline")
    assert str(note) == rate.format("--fps")


def test_data_names_options_even_while_a_window_is_open() -> None:
    note = Diagnostic("F007.no-rate", values={"rate": 30})
    outer = Diagnostic("F004.capture", values={"problem": note})
    found = Finding(Diagnostic("W001.sums", values={"n": 1, "vertex": 0, "sum": 0.5, "error": 0.5}))
    item = Item(0, ("a.npz",), "", "a")
    with in_window():
        assert "Timeline" in str(note) and "Skinning panel" in found.hint
        data = described(outer)
        (finding,) = describe([found], Scene([]))["findings"]
        ran = attempt(item, lambda item: {"is_noted": note_found(note)})
        assert "Timeline" in str(note)
    assert ran.values == {"is_noted": True} and ran.diagnostics == [described(note)]
    assert "--fps" in ran.diagnostics[0]["message"]
    assert "--fps" in data["values"]["problem"]["message"] and "--model" in data["message"]
    assert finding["hint"] == found.hint == CODES["W001"].hint and "--normalize" in found.hint


def is_about_options(key: str, text: str) -> bool:
    """Return whether a message is about an option that the user has given, or one of a tool."""
    given = text.startswith("--") or "has no effect" in text
    return given or key in ("F002.mhr-folder", "F002.submission-several", "F002.submission-folders")


def calls() -> list[tuple[str, str, set[str]]]:
    """Return (location, key, value names) for every call with a literal key."""
    found = []
    for path in sorted(ROOT.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(rf"\b(?:{'|'.join(CALLS)})\(", text):
            continue
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            first = node.args[0]
            if name not in CALLS or not isinstance(first, ast.Constant):
                continue
            if not isinstance(first.value, str) or any(word.arg is None for word in node.keywords):
                continue  # the values are forwarded
            known = PHRASES if name == "Phrase" else MESSAGES
            if first.value in known:
                names = {word.arg for word in node.keywords if word.arg} - CALLS[name]
                found.append((f"{path.relative_to(ROOT)}:{node.lineno}", first.value, names))
    return found


def test_every_call_supplies_the_values_of_its_template() -> None:
    wrong = []
    for place, key, names in calls():
        wanted = set(fields({**MESSAGES, **PHRASES}[key]))
        if not wanted <= names:
            wrong.append(f"{place}: {key} misses {sorted(wanted - names)}")
    assert wrong == []


def test_every_key_is_in_only_one_table() -> None:
    for name in ("CODES", "MESSAGES", "PHRASES"):
        keys = [key for table in wording.TABLES for key in getattr(table, name, ())]
        assert len(keys) == len(set(keys)) > 0


def test_sign_in_a_format_is_not_a_condition() -> None:
    assert rendered("{change:+z.0f} %{more:+; {}}", {"change": 4.0, "more": ""}) == "+4 %"
    assert rendered("{change:+z.0f} %{more:+; {}}", {"change": 0.0, "more": "a"}) == "+0 %; a"


def test_value_inside_its_condition_has_its_own_format() -> None:
    template = "lit{names:+; not drawn: {:list}}"
    assert rendered(template, {"names": ["scroll", "grade"]}) == "lit; not drawn: scroll, grade"
    long = rendered(template, {"names": [*"abcdefgh"]})
    assert long == "lit; not drawn: a, b, c, d, e, f and 2 more"
    assert rendered(template, {"names": []}) == "lit"


def test_empty_name_list_renders_as_none() -> None:
    assert rendered("{names:all}, {names:list}", {"names": []}) == "none, none"
