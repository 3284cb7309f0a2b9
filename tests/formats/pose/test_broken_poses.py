"""Pose files with errors, which are refused with code, location and values."""

from pathlib import Path

import numpy as np
import pytest
from faults import INF, NAN, fault_of
from formats.pose.pose_texts import read

from viewer.errors import FormatError
from viewer.formats import Source, pose


def text_refusal(text, name="a.json"):
    with pytest.raises(FormatError) as caught:
        pose.read(Source(name, text if isinstance(text, bytes) else text.encode()))
    assert str(caught.value).isprintable()
    assert caught.value.path == Path(name)
    key, line, values = fault_of(caught.value.diagnostic)
    # Python's wording of errors differs between versions.
    return key, line, {} if key == "F002.json" else values


# Broken


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", ("F002.json", 1, {})),
        ('{"dofs":\n\n {"a.x": 1,}}', ("F002.json", 3, {})),
        ('{"comment": "größe",\n"äöü": 1\n "betas": [1]}', ("F002.json", 3, {})),
        ('{"comment": "\udcff\udcfe\udcff\udcfe",\n\n"betas" [1]}', ("F002.json", 3, {})),
        ('{"betas": [1]} {}', ("F002.json", 1, {})),
        ('{"betas": [NaN]}', ("F002.json-constant", 1, {"found": "NaN"})),
        ('{"betas": [-Infinity]}', ("F002.json-constant", 1, {"found": "-Infinity"})),
        ('{"betas": [1e999]}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        ('{"betas": [1, -1e39]}', ("F003.pose-number", 1, {"item": "betas", "found": -1e39})),
        ('{"betas": ["1"]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "'1'"})),
        ('{"betas": [[1], [1, 2]]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "ragged lists"})),
        ('{"betas": [true]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "True"})),
        ('{"betas": {"a": 1}}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "a dict of 1 value"})),
        ('{"betas": "none"}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "'none'"})),
        (f'{{"betas": [1{"0" * 400}]}}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        (f'{{"betas": [1{"0" * 5000}]}}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        ('{"betas": ' + "[" * 200 + "]" * 200 + "}", ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "ragged lists"})),
        ('{"betas": ' + "[" * 100_000 + "]" * 100_000 + "}", ("F002.json-nesting", 1, {})),
        ('{"a":' * 100_000, ("F002.json-nesting", 1, {})),
        ('{"dofs": {"a.x": "1"}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "'1'"})),
        ('{"dofs": {"a.x": 1e999}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "inf"})),
        ('{"dofs": {"a.x": true}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "True"})),
        ('{"dofs": {"a.x": [1]}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "a list of length 1"})),
        ('{"dofs": [1, 2]}', ("F002.pose-dofs", 1, {"found": "a list of length 2"})),
        ('{"betas": [1], "use_pca": "yes"}', ("F002.pose-array", 1, {"item": "use_pca",
         "expected": "true or false", "found": "'yes'"})),
        ('{"viewer_pose": 2, "dofs": {"a.x": 1}}', ("F002.pose-array", 1, {"item": "viewer_pose",
         "expected": 1, "found": "2"})),
        ('{"viewer_pose": [1], "dofs": {"a.x": 1}}', ("F002.pose-array", 1,
         {"item": "viewer_pose", "expected": 1, "found": "a list of length 1"})),
        ('{"translation": [1, 2]}', ("F002.pose-three", 1, {"item": "translation", "found": 2})),
        ('{"scale": [1, 2]}', ("F002.pose-single", 1, {"item": "scale", "found": 2})),
        ('{"figure": "a", "gender": "male"}', ("F002.pose-keys", 1, {"keys": ["figure", "gender"],
         "near": ""})),
        ("{}", ("F002.pose-no-keys", 1, {})),
        ('{"poses": [[1, 2, 3, 4], [1, 2, 3, 4]]}', ("F002.pose-frames", 1, {"item": "poses",
         "found": 2})),
        ('{"body_pose": [[1, 2, 3, 4], [1, 2, 3, 4]]}', ("F002.pose-frames", 1,
         {"item": "body_pose", "found": 2})),
        ('{"global_orient": [[0, 0, 1], [0, 0, 1]]}', ("F002.pose-frames", 1,
         {"item": "global_orient", "found": 2})),
        ('{"transl": [[0, 0, 1], [0, 0, 1]]}', ("F002.pose-frames", 1, {"item": "transl",
         "found": 2})),
        ("[1, 2, 3]", ("F002.pose-object", 1, {"found": "a list of length 3"})),
        ("\n[]", ("F002.pose-object", 2, {"found": "an empty list"})),
        ("null", ("F002.pose-object", 1, {"found": "null"})),
        ("true", ("F002.pose-object", 1, {"found": "true"})),
        ("1 2 3", ("F002.json", 1, {})),
        ("", ("F002.json", 1, {})),
        # The line is that of the value, not that of its key.
        ('{"betas":\n[1,\n2,\nNaN]}', ("F002.json-constant", 4, {"found": "NaN"})),
        ('{"comment": "a NaN",\n"betas":\n[1,\n2, 1e999]}', ("F003.pose-number", 4,
         {"item": "betas", "found": INF})),
        ('{"betas": [1],\n"global_orient":\n[[0,\n0,\n"x"]]}', ("F002.pose-array", 5,
         {"item": "global_orient", "expected": "numbers",
         "found": "'x'"})),
        ('{"dofs": {\n"a.x": 1,\n"b.x": null}}', ("F002.pose-dof", 3, {"item": "b.x",
         "found": "None"})),
        ('{"dofs": {\n"a.x": 1,\n"a.x": 2}}', ("F002.json-twice", 3, {"found": "a.x"})),
        ('{"betas": [1],\r\n"dofs": {},\r\n"betas": [2]}', ("F002.json-twice", 3,
         {"found": "betas"})),
        ('{"comment": {"dofs": 1,\n"größe": [{"dofs": 3}]},\n"dofs":\n3}', ("F002.pose-dofs", 4,
         {"found": "3"})),
        ('{"scale": 1,\n"viewer_pose":\n2}', ("F002.pose-array", 3, {"item": "viewer_pose",
         "expected": 1, "found": "2"})),
        ('{\n"dof": {"a.x": 1}}', ("F002.pose-keys", 2, {"keys": ["dof"],
         "near": "did you mean dofs?"})),
        ("\n\n[1, 2]", ("F002.pose-object", 3, {"found": "a list of length 2"})),
        ('{"a":\n' * 499 + "[\n[\n" * 40_000, ("F002.json-nesting", 80499, {})),
    ],
)  # fmt: skip
def test_broken_json_is_refused(text, message):
    assert text_refusal(text.encode("utf-8", "surrogateescape")) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 up\n4", ("F002.number", 1, {"item": "word 2", "found": b"up"})),
        ("1 2\n\n3 nan 5 6", ("F003.number", 3, {"item": "word 3",
         "found": b"nan"})),
        ("1 2\r\n\r\n3 1e999", ("F003.too-large", 3, {"item": "word 3",
         "found": b"1e999"})),
        ("1\n2\n3,5", ("F002.number", 3, {"item": "word 2", "found": b"3,5"})),
        ("", ("F002.pose-empty", None, {"found": "an empty file"})),
        (" \n ", ("F002.pose-empty", None, {"found": "only white space"})),
    ],
)  # fmt: skip
def test_broken_text_is_refused_with_its_line(text, message):
    assert text_refusal(text, "a.txt") == message


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3))}, ("F002.pose-frames", None,
         {"item": "trans", "found": 3})),
        ({"poses": np.zeros((3, 156))}, ("F002.pose-frames", None, {"item": "poses", "found": 3})),
        ({"poses": np.zeros((3, 24, 3))}, ("F002.pose-frames", None, {"item": "poses",
         "found": 3})),
        ({"betas": np.full(10, np.nan)}, ("F003.pose-number", None, {"item": "betas",
         "found": NAN})),
        ({"betas": np.array(["a"])}, ("F002.pose-array", None, {"item": "betas",
         "expected": "numbers", "found": "1 strings"})),
        ({"betas": np.array([None])}, ("F002.pose-array", None, {"item": "betas",
         "expected": "numbers", "found": "an unsupported value (object array)"})),
        ({"dofs": np.zeros(2)}, ("F002.pose-dofs", None, {"found": "2 float64"})),
        ({"dofs": np.zeros(2), "dof_names": np.array(["a.x"])}, ("F002.pose-names", None,
         {"item": "dof_names", "expected": 2, "found": 1})),
        ({"dofs": np.zeros(()), "dof_names": np.array("a.x")}, ("F002.pose-names", None,
         {"item": "dof_names", "expected": 1, "found": 1})),
        ({"dofs": np.zeros(2), "dof_names": np.zeros(2)}, ("F002.pose-array", None,
         {"item": "dof_names", "expected": "names", "found": "2 float64"})),
        ({"dofs": np.array([np.inf]), "dof_names": np.array(["a.x"])}, ("F002.pose-dof", None,
         {"item": "a.x", "found": "inf"})),
        ({"viewer_pose": np.array([1, 2]), "betas": np.zeros(1)}, ("F002.pose-array", None,
         {"item": "viewer_pose", "expected": 1, "found": "a list of length 2"})),
    ],
)  # fmt: skip
def test_broken_archive_is_refused(tmp_path, arrays, message):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    with pytest.raises(FormatError) as caught:
        read(path)
    assert caught.value.path == path
    assert fault_of(caught.value.diagnostic) == message
