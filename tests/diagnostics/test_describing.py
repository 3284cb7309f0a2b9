"""Description of diagnostics as JSON."""

import json
from pathlib import Path

import numpy as np
import pytest

from viewer.diagnostics import Diagnostic, Phrase, described
from viewer.phrases import counted


def test_description_contains_all_data_of_a_diagnostic():
    values = {"n": np.int64(2), "joint": "hip", "weight": np.float32(-0.5), "vertex": 7}
    places = np.array([3, 7], dtype=np.int32)
    found = Diagnostic(
        "W002.negative: {n} (first: {weight:g} at vertex {vertex} for joint {joint})",
        Path("a.skin"),
        4,
        "weights",
        places,
        values | {"n": counted(2, "negative weight")},
        count=2,
        is_refusal=True,
    )
    assert described(found) == {
        "code": "W002",
        "key": "W002.negative",
        "severity": "error",
        "message": (
            "2 negative weights (first: -0.5 at vertex 7 for joint hip); first of 2 (vertices 3, 7)"
        ),
        "file": "a.skin",
        "line": 4,
        "part": "weights",
        "places": [3, 7],
        "n_places": 2,
        "pointer": "",
        "count": 2,
        "values": {"n": 2, "joint": "hip", "weight": -0.5, "vertex": 7},
    }


def test_values_of_every_kind_can_be_written_as_json():
    inner = Diagnostic("F001.no-file: found {found}", values={"found": "a folder"})
    values = {
        "found": b"up\xff\n",
        "ratio": float("inf"),
        "levels": [Phrase("{height} for {seconds:g} s", height=0.5, seconds=2.0)] * 120,
        "problem": inner,
        "path": Path("a b"),
        "nothing": None,
    }
    told = described(Diagnostic("C013.no-height: no height", values=values))["values"]
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert told["found"] == "up\ufffd\\n" and told["ratio"] == "inf" and told["path"] == "a b"
    assert len(told["levels"]) == 100 and told["nothing"] is None
    assert told["levels"][0] == {
        "text": "0.5 for 2 s",
        "values": {"height": 0.5, "seconds": 2.0},
    }
    assert told["problem"]["code"] == "F001"


def test_long_location_lists_are_truncated_but_counted():
    found = Diagnostic(
        "C013.no-height: no height", part="joints", places=np.arange(300, dtype=np.int32)
    )
    told = described(found)
    assert told["places"] == list(range(100)) and told["n_places"] == 300


def test_json_pointer_is_the_location_of_a_diagnostic():
    found = Diagnostic("F002.unknown-folder: no files", Path("a.glb"), pointer="/skins/0/joints/3")
    assert found.place == "a.glb#/skins/0/joints/3"
    assert described(found)["pointer"] == "/skins/0/joints/3"


def test_message_without_a_sentence_is_refused():
    with pytest.raises(ValueError, match=r"F002\.unknown-folder"):
        Diagnostic("F002.unknown-folder")
