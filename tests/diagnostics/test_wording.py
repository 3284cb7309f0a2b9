"""Sentences of all diagnostics: their codes, and the values that calls supply for them."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from string import Formatter

from sources import parsed

import viewer
from viewer.batching.execution import attempt
from viewer.batching.items import Item
from viewer.diagnostics import CODES, Diagnostic, Phrase, described, wording
from viewer.diagnostics.record import note_found
from viewer.linting import Finding, describe
from viewer.phrases import Remedy, counted, in_window, listed, optional
from viewer.rigs.scene import Scene

ROOT = Path(viewer.__file__).parent
KEY = re.compile(r"([A-Z]\d{3}\.[a-z0-9-]+): (.+)", re.DOTALL)
CALLS = {"fault", "refuse", "warn", "found", "note", "Diagnostic"}
"""Functions that take a key with its sentence, and the values."""
PHRASES = {"Phrase", "InvalidValueError", "RecordError", "fail", "fault"}
"""Functions that take a sentence without a key, some of them after another argument."""
SHARED = {name: text for name, text in vars(wording).items() if name.isupper()}


@cache
def texts_and_calls() -> tuple[list[tuple[str, str]], list[tuple[str, ast.Call]]]:
    """Return all strings, and all calls with arguments, with their places: one walk for all."""
    texts, calls = list[tuple[str, str]](), list[tuple[str, ast.Call]]()
    for path in sorted(ROOT.rglob("*.py")):
        name = path.relative_to(ROOT)
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append((f"{name}:{node.lineno}", node.value))
            elif isinstance(node, ast.Call) and node.args:
                calls.append((f"{name}:{node.lineno}", node))
    return texts, calls


def sentences() -> Iterator[tuple[str, str, str]]:
    """Yield the place, key and sentence of every message."""
    for place, text in texts_and_calls()[0]:
        found = KEY.fullmatch(text)
        if found:
            yield place, found[1], found[2]


def names_in(sentence: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(sentence) if name is not None}


def test_every_message_has_a_known_code():
    keys = set()
    for place, key, sentence in sentences():
        assert key.partition(".")[0] in CODES, place
        keys.add(key)
        assert sentence.isprintable() and all(name.isidentifier() for name in names_in(sentence))
    assert len(keys) > 800


def test_every_call_has_a_sentence():
    bare = re.compile(r"[A-Z]\d{3}\.[a-z0-9-]+")
    wrong = [
        place
        for place, call in texts_and_calls()[1]
        for text in [getattr(call.args[0], "value", None)]
        if isinstance(text, str) and bare.fullmatch(text)
    ]
    assert wrong == []


def test_every_call_supplies_the_values_of_its_sentence():
    wrong, n_checked = [], 0
    for place, call in texts_and_calls()[1]:
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        text = next(filter(None, map(_text_of, call.args[:2])), None)
        if text is None or name not in (CALLS if KEY.match(text) else PHRASES):
            continue
        given = _names_of(call)
        if given is None:
            continue  # the values are forwarded
        n_checked += 1
        wanted = names_in(text.partition(": ")[2] if KEY.match(text) else text)
        if not wanted <= given:
            wrong.append(f"{place}: misses {sorted(wanted - given)}")
    assert wrong == [] and n_checked > 800


def _text_of(node: ast.expr) -> str | None:
    if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "wording":
        return SHARED[node.attr]
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _names_of(call: ast.Call) -> set[str] | None:
    """Return the names of the values of a call; None if they are not written there."""
    given = {word.arg: word.value for word in call.keywords}
    if None in given:
        return None
    values = given.get("values", call.args[5] if len(call.args) > 5 else None)
    if values is None:
        return {name for name in given if name}
    if not isinstance(values, ast.Dict) or None in values.keys:
        return None
    return {getattr(name, "value", "") for name in values.keys}


def test_messages_name_controls_in_the_window_and_options_elsewhere():
    note = Diagnostic(
        wording.NO_RATE, values={"rate": 30, "remedy": Remedy("the Timeline", "--fps")}
    )
    text = "no frame rate in the data: 30 fps assumed ({})"
    with in_window():
        assert str(note) == text.format("the Timeline")
    assert str(note) == text.format("--fps")
    assert note.values == {"rate": 30}


def test_data_names_options_even_while_a_window_is_open():
    note = Diagnostic(
        wording.NO_RATE, values={"rate": 30, "remedy": Remedy("the Timeline", "--fps")}
    )
    outer = Diagnostic("F004.capture: {problem}", values={"problem": note})
    found = Finding(Diagnostic("W001.sums: weights of {n}", values={"n": counted(1, "vertex")}))
    item = Item(0, ("a.npz",), "", "a")
    with in_window():
        assert "Timeline" in str(note) and "Timeline" in str(outer)
        assert "Skinning panel" in found.hint
        data = described(outer)
        (finding,) = describe([found], Scene([]))["findings"]
        ran = attempt(item, lambda item: {"is_noted": note_found(note)})
        assert "Timeline" in str(note)
    assert ran.values == {"is_noted": True} and ran.diagnostics == [described(note)]
    assert "--fps" in ran.diagnostics[0]["message"]
    assert "--fps" in data["values"]["problem"]["message"] and "--fps" in data["message"]
    assert finding["hint"] == found.hint == CODES["W001"].hint and "--normalize" in found.hint


def test_remedies_of_codes_name_no_options_in_the_window():
    for code in CODES.values():
        with in_window():
            hints = (code.hint, code.other_hint)
        assert not any(
            re.search(r"(?<!\S)\(?--[a-z]", hint) for hint in hints if "--gaps" not in hint
        )


def test_values_are_text_in_the_sentence_and_data_elsewhere():
    found = Diagnostic(
        "W006.joints: {n} no influence: {names}{more}",
        values={
            "n": counted(3, "joint", "has", "have"),
            "names": listed(["a", "b\n"], 1),
            "more": optional("; {}", ""),
        },
    )
    assert found.key == "W006.joints" and found.code == "W006"
    assert found.message == "3 joints have no influence: a and 1 more"
    assert found.values == {"n": 3, "names": ["a", "b\n"], "more": ""}
    assert found.sentence == "{n} no influence: {names}{more}"


def test_text_from_files_is_escaped_in_sentences():
    phrase = Phrase("joint {name}", name="a\nb")
    assert str(phrase) == "joint a\\nb" and phrase == "joint a\\nb"
    found = Diagnostic("F002.item: {item}: {found:g}", values={"item": phrase, "found": 2.0})
    assert found.message == "joint a\\nb: 2"


def test_empty_name_list_reads_as_none():
    assert listed([]) == "none" and listed([]).value == []
