"""Broken frame files, each of which is reported and becomes a gap while the others are read."""

import json
import os
import random

import numpy as np
import pytest
from faults import fault_of
from formats.capture_files import body, noticed, opened, points, rows_of, write_frames

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats import Source, easymocap
from viewer.formats._text.json_places import line_at, nearest_place
from viewer.phrases import listed, one_of


def gap(tmp_path, content, kind="smpl"):
    """Read three frames, the second of which is broken; return the messages about it."""
    good = points(0) if kind == "keypoints3d" else body(0)
    folder = write_frames(tmp_path / "smpl", {0: [good], 1: content, 2: [good]})
    _, parts, _ = opened(tmp_path)
    found = [person for part in parts for person in (*part.bodies, *part.points)]
    assert found[:1] == [0]
    return noticed(parts, folder / "000001.json"), parts


def refusal(path, **options):
    with pytest.raises(FormatError) as caught:
        easymocap.read(Source.open(path, **options))
    assert str(caught.value).isprintable()
    return fault_of(caught.value.diagnostic)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", ("F007.record", 1, {"problem": ("F002.json", None, {"reason": "Expecting value"})})),
        ("[\n{\n", ("F007.record", 3, {"problem": ("F002.json", None,
         {"reason": "Expecting property name enclosed in double quotes"})})),
        ("[1, 2", ("F007.record", 1, {"problem": ("F002.json", None,
         {"reason": "Expecting ',' delimiter"})})),
        ("null", ("F007.record", 1, {"problem": ("F002.capture-list", None,
         {"found": "None"})})),
        ("17", ("F007.record", 1, {"problem": ("F002.capture-list", None,
         {"found": "17"})})),
        ('{"id": 0}', ("F007.record", 1, {"problem": ("F002.capture-list", None,
         {"found": "a dict of 1 value"})})),
        ('{"annots":\n 3}', ("F007.record", 1, {"problem": ("F002.capture-list", None,
         {"found": "3"})})),
        ("\n[" * 100_000, ("F007.record", 100001, {"problem": ("F002.json-nesting", None, {})})),
        (f"[\n1{'0' * 5000}]", ("F007.record", 2, {"problem": ("F002.capture-digits", None,
         {"most": 4300})})),
        ('[{"id": 0, "poses": [1],\n"poses": [2]}]', ("F007.record", 2,
         {"problem": ("F002.json-twice", None, {"found": "poses"})})),
    ],
)  # fmt: skip
def test_broken_file_is_a_gap_for_all_people(tmp_path, content, message):
    warnings, parts = gap(tmp_path, content)
    assert warnings == [message]
    assert rows_of(parts, 0) == [0, 2]


def test_binary_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)]})
    (folder / "000001.json").write_bytes(b"[\n\xff\xfe]")
    (folder / "000002.json").write_bytes(b"\xef\xbb\xbf[]")  # a byte order mark is accepted
    _, parts, _ = opened(tmp_path)
    problem = ("F002.capture-text", None, {})
    found = noticed(parts, folder / "000001.json")
    assert found == [("F007.record", 2, {"problem": problem})]


def test_large_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: " " * 9000 + "[]"})
    parts = list(easymocap.read(Source.open(tmp_path, max_size=5000)).parts())
    problem = ("F001.too-large", None, {"most": 5000, "size": 9002})
    found = noticed(parts[1:2], folder / "000001.json")
    assert found == [("F007.record", None, {"problem": problem})]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may read every file")
def test_unreadable_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: []})
    (folder / "000001.json").chmod(0)
    _, parts, _ = opened(tmp_path)
    problem = ("F001.unreadable", None, {"reason": "Permission denied", "near": ""})
    found = noticed(parts[1:2], folder / "000001.json")
    assert found == [("F007.record", None, {"problem": problem})]


def test_removed_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: [body(0)]})
    capture = easymocap.read(Source.open(tmp_path))
    (folder / "000001.json").unlink()
    problem = ("F001.unreadable", None, {"reason": "No such file or directory", "near": ""})
    found = noticed(list(capture.parts()), folder / "000001.json")
    assert found == [("F007.record", None, {"problem": problem})]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes are not supported here")
def test_pipe_among_the_frames_is_ignored(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)]})
    os.mkfifo(folder / "000001.json")
    capture, _, warnings = opened(tmp_path)
    assert capture.n_frames == 1
    assert warnings == [("F007.capture-no-files", None, {"names": ["000001.json"]})]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"poses": [[0.0] * 71]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": "expected 72 numbers, found 71"})})),
        ({"poses": [[0.0] * 165]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": "expected 72 numbers, found 165"})})),
        ({"poses": [[0.0] * 71 + ["1"]]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": "expected 72 numbers, found '1' among them"})})),
        ({"poses": [[0.0] * 71 + [None]]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": "expected 72 numbers, found None among them"})})),
        ({"poses": [[0.0] * 71 + [[1.0]]]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses",
          "problem": "expected 72 numbers, found a list of length 1 among them"})})),
        ({"poses": [[0.0] * 71 + [10**400]]}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": ("expected 72 numbers, found "
        "100000000000000000000000000000000000000… among them")})})),
        ({"poses": [[0.0] * 72] * 2}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": "expected 72 numbers, found 2"})})),
        ({"poses": "0" * 72}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: poses", "problem": ("expected numbers, found "
        "'00000000000000000000000000000000000000…")})})),
        ({"poses": None, "pose": 1}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0", "problem": ("expected poses or keypoints3d, found keys id, Rh, Th, "
        "shapes, pose")})})),
        ({"poses": [[float("nan")] * 72]}, ("F007.record", 1, {"problem": ("F003.record", None,
         {"item": "person 0: poses", "problem": "expected finite numbers, found nan"})})),
        ({"Th": [[0.0, 1e300, 0.0]]}, ("F007.record", 1, {"problem": ("F003.record", None,
         {"item": "person 0: Th", "problem": "expected numbers within ±1e+09, found 1e+300"})})),
        ({"Rh": [[0.0, float("-inf"), 0.0]]}, ("F007.record", 1, {"problem": ("F003.record", None,
         {"item": "person 0: Rh", "problem": "expected finite numbers, found -inf"})})),
        ({"Rh": None}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: Rh", "problem": "expected numbers, found no value"})})),
        ({"Th": 3}, ("F007.record", 1, {"problem": ("F002.record", None, {"item": "person 0: Th",
         "problem": "expected numbers, found 3"})})),
        ({"Th": {"x": 1, "y": 2, "z": 3}}, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: Th", "problem": "expected numbers, found a dict of 3 values"})})),
    ],
)  # fmt: skip
def test_broken_record_is_a_gap_for_one_person(tmp_path, changes, message):
    folder = write_frames(
        tmp_path / "smpl",
        {0: [body(0), body(1)], 1: [body(0, **changes), body(1)], 2: [body(0), body(1)]},
    )
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([0, 2], [0, 1, 2])
    assert noticed(parts, folder / "000001.json") == [message]
    assert parts[1].bodies[0].n_rows == 1
    assert np.isfinite(parts[1].bodies[0].vectors).all()


@pytest.mark.parametrize(
    ("person", "message"),
    [
        (1.5, ("F007.record", 1, {"problem": ("F002.record", None, {"item": "id",
         "problem": "expected an integer or a name, found 1.5"})})),
        (True, ("F007.record", 1, {"problem": ("F002.record", None, {"item": "id",
         "problem": "expected an integer or a name, found True"})})),
        ([1], ("F007.record", 1, {"problem": ("F002.record", None, {"item": "id",
         "problem": "expected an integer or a name, found a list of length 1"})})),
        (1 << 40, ("F007.record", 1, {"problem": ("F002.record", None, {"item": "id",
         "problem": "expected an id below 2147483648, found 1099511627776"})})),
    ],
)  # fmt: skip
def test_person_without_a_number_is_left_out(tmp_path, person, message):
    warnings, _ = gap(tmp_path, [body(0, id=person)])
    assert warnings == [message]


def test_whole_numbers_may_be_written_with_a_fraction(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(2.0)]})
    assert list(opened(tmp_path)[1][0].bodies) == [2]


def test_value_that_is_not_a_record_is_left_out(tmp_path):
    warnings, parts = gap(tmp_path, [None, 3, body(0)])
    assert warnings == [
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F002.record",
                    None,
                    {"item": "", "problem": "expected a person with named values, found None"},
                )
            },
        ),
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F002.record",
                    None,
                    {"item": "", "problem": "expected a person with named values, found 3"},
                )
            },
        ),
    ]
    assert rows_of(parts, 0) == [0, 1, 2]


def test_first_of_two_records_with_one_id_is_used(tmp_path):
    warnings, parts = gap(tmp_path, [body(0, seed=1.0), body(0, seed=2.0)])
    assert warnings == [
        ("F007.record", 1, {"problem": ("F002.record-twice", None, {"item": "person 0"})})
    ]
    assert parts[1].bodies[0].translations[0, 0] == body(0, seed=1.0)["Th"][0][0]


def test_messages_identify_untracked_people(tmp_path):
    warnings, _ = gap(tmp_path, [body(-1), body(-1, Th=[[float("nan"), 0.0, 0.0]])])
    assert warnings == [
        ("F007.record-untracked", None, {}),
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F003.record",
                    None,
                    {"item": "untracked 2: Th", "problem": "expected finite numbers, found nan"},
                )
            },
        ),
    ]


def test_conflicting_ids_of_one_person_are_reported(tmp_path):
    warnings, parts = gap(tmp_path, [body(0, personID=4), body(1, personID=1)])
    assert warnings == [("F007.record-ids", None, {})]
    assert rows_of(parts, 1) == [1]


def test_errors_beyond_the_first_twenty_are_counted(tmp_path):
    broken = dict.fromkeys(range(1, 31), "[")
    write_frames(tmp_path / "smpl", {0: [body(0)], **broken, 31: [body(0)]})
    _, parts, _ = opened(tmp_path)
    warnings = noticed(parts)
    assert len(warnings) == 21
    assert warnings[-1] == ("F007.records", None, {"name": tmp_path.name, "n": 10})


# Captures without readable frames


def test_capture_of_broken_files_only_is_refused(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: "[", 1: "3"})
    with pytest.raises(FormatError) as caught:
        easymocap.read(Source.open(tmp_path))
    key, _, values = fault_of(caught.value.diagnostic)
    assert (caught.value.path, key, values["n"]) == (tmp_path, "F002.capture-people-fault", 2)
    assert values["problem"][:2] == ("F002.json", 1)
    assert f"{folder}/000000.json:1: expected JSON, found" in str(caught.value)


def test_vposer_latent_code_is_refused(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0, 32)]})
    problem = (
        "expected rotations, found 32 numbers, a VPoser latent "
        "vector, which needs the VPoser network to decode: export "
        "full poses from EasyMocap"
    )
    fault = ("F002.record", 1, {"item": "person 0: poses", "problem": problem})
    assert refusal(tmp_path / "smpl" / "000000.json") == fault


def test_unknown_pose_length_is_refused_with_the_known_lengths(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0, 90)]})
    lengths = [9, 48, 63, 69, 72, 78, 87, 156, 165]
    problem = Phrase(
        "expected {expected} numbers, found {found}", expected=one_of(lengths), found=90
    )
    fault = ("F002.record", 1, {"item": "person 0: poses", "problem": problem})
    assert refusal(tmp_path / "smpl" / "000000.json") == fault


def test_capture_without_people_is_refused(tmp_path):
    write_frames(tmp_path / "smpl", {0: [], 1: []})
    assert refusal(tmp_path) == ("F002.capture-people", None, {"n": 2})


def test_folder_without_frames_is_refused(tmp_path):
    (tmp_path / "smpl").mkdir()
    assert refusal(tmp_path) == (("F002.capture-frames", None, {}))


def test_two_dimensional_points_are_refused(tmp_path):
    write_frames(tmp_path / "annots", {0: {"annots": [{"personID": 0, "keypoints": [[1, 2, 1]]}]}})
    found = refusal(tmp_path / "annots")[2]["problem"]
    wanted, keys = ("poses", "keypoints3d"), ["personID", "keypoints"]
    problem = Phrase(
        "expected {expected}, found keys {keys}", expected=one_of(wanted), keys=listed(keys, 8)
    )
    assert found == ("F002.record", 1, {"item": "person 0", "problem": problem})


@pytest.mark.slow
def test_mutated_records_are_read_or_refused_in_one_line(tmp_path):
    record = body(0, 78) | points(0, 17) | {"expression": [[0.5] * 10]}
    good = json.dumps([record, body(-1, 78)])
    pieces = [
        "[",
        "]",
        "{",
        "}",
        '"',
        ",",
        ":",
        "null",
        "NaN",
        "1e999",
        "-1",
        '"id"',
        "[[]]",
        "true",
    ]
    folder, path = write_frames(tmp_path / "smpl", {0: good}), tmp_path / "smpl" / "000001.json"
    rng = random.Random(4)
    for _ in range(200):
        text = list(good)
        for _ in range(rng.choice((1, 1, 2, 5))):
            start = rng.randrange(len(text))
            text[start : start + rng.choice((0, 1, 3, 40, 400))] = rng.choice(pieces)
        path.write_text("".join(text))
        _, parts, _ = opened(tmp_path)
        assert 0 in parts[0].bodies
        for part in parts:
            lines = [*map(str, part.warnings)]
            assert all(line.isprintable() and str(folder) in line for line in lines)
            assert all(np.isfinite(motion.vectors).all() for motion in part.bodies.values())
            assert all(np.isfinite(clip.points).all() for _, clip in part.points.values())
        try:
            list(easymocap.read(Source.open(path)).parts())
        except FormatError as problem:
            assert str(problem).isprintable()


def test_non_finite_keypoints_are_undetected(tmp_path):
    record = points(0)
    rows = record["keypoints3d"]
    rows[1][3], rows[2][0], rows[3][3] = -0.5, float("nan"), float("nan")
    rows[4] = [float("nan")] * 3 + [0.0]
    folder = write_frames(tmp_path / "keypoints3d", {0: [record]})
    _, parts, _ = opened(tmp_path)
    assert tuple(noticed(parts[:1], folder / "000000.json")) == (
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F002.record",
                    None,
                    {
                        "item": "person 0",
                        "problem": (
                            "3 keypoints with non-finite numbers or negative "
                            "confidence, treated as not visible"
                        ),
                    },
                )
            },
        ),
    )
    found = parts[0].points[0][1].points[0]
    assert not found[1:5].any() and found[5:, 3].all()


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([[0.0] * 4] * 24, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: keypoints3d", "problem": "expected 25 keypoints, found 24"})})),
        ([[0.0] * 4] * 24 + [[0.0] * 5], ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: keypoints3d",
          "problem": ("expected rows of 3 or 4 numbers, found rows of different "
        "lengths")})})),
        ([[0.0] * 4] * 24 + [["1"] * 4], ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: keypoints3d",
          "problem": ("expected rows of 3 or 4 numbers, found rows of different "
        "lengths")})})),
        ([0.0] * 25, ("F007.record", 1, {"problem": ("F002.record", None,
         {"item": "person 0: keypoints3d",
          "problem": ("expected rows of 3 or 4 numbers, found rows of different "
        "lengths")})})),
        (3, ("F007.record", 1, {"problem": ("F002.record", None, {"item": "person 0: keypoints3d",
         "problem": "expected 25 keypoints, found 3"})})),
    ],
)  # fmt: skip
def test_broken_keypoints_are_a_gap(tmp_path, rows, message):
    warnings, parts = gap(tmp_path, [{"id": 0, "keypoints3d": rows}], "keypoints3d")
    assert warnings == [message]
    assert len(parts[1].points[0][1].points) == 1


def test_keypoints_that_are_never_detected_are_reported_at_the_end(tmp_path):
    unseen = points(3)
    unseen["keypoints3d"] = [[0.0] * 4] * 25
    late = {
        frame: [unseen, points(4) if frame == 70 else unseen | {"id": 4}] for frame in range(80)
    }
    folder = write_frames(tmp_path / "take" / "keypoints3d", late)
    _, parts, _ = opened(folder)
    assert noticed(parts[:-1]) == []
    assert tuple(noticed(parts[-1:])) == (
        ("F007.record-unseen", None, {"name": "take", "people": ["person 3"]}),
    )


# Lines


PEOPLE = [body(3, 9), body(4, 9)]


@pytest.mark.parametrize("wrapper", ["", "annots"])
@pytest.mark.parametrize(
    ("key", "value"),
    [("poses", [1.0]), ("Th", [[1.0, float("nan"), 0.0]]), ("shapes", "x"), ("Rh", None)],
)
def test_line_of_an_invalid_key_is_reported(tmp_path, wrapper, key, value):
    people = [PEOPLE[0], {**PEOPLE[1], key: value}]
    content = {"note": [{"poses": 1}], wrapper: people} if wrapper else people
    text = json.dumps(content, indent=1)
    # The error is at the second occurrence of the key, because both people have it.
    rows = [number for number, row in enumerate(text.splitlines(), 1) if f'"{key}":' in row]
    write_frames(tmp_path / "smpl", {0: PEOPLE, 1: text})
    _, parts, _ = opened(tmp_path / "smpl")
    ((_, line, values),) = noticed(parts, tmp_path / "smpl" / "000001.json")
    assert (line, values["problem"][2]["item"]) == (rows[-1], f"person 4: {key}")


def test_line_of_the_record_is_reported_for_a_missing_key(tmp_path):
    people = [PEOPLE[0], {key: value for key, value in PEOPLE[1].items() if key != "Th"}]
    text = json.dumps(people, indent=1)
    begins = [number for number, row in enumerate(text.splitlines(), 1) if row == " {"]
    write_frames(tmp_path / "smpl", {0: PEOPLE, 1: text})
    _, parts, _ = opened(tmp_path / "smpl")
    ((_, line, values),) = noticed(parts, tmp_path / "smpl" / "000001.json")
    assert (line, values["problem"][2]["item"]) == (begins[1], "person 4: Th")


@pytest.mark.parametrize(
    ("text", "place", "line"),
    [
        ('{"a": 1,\n"b": 2}', ("b",), 2),
        ('{"a": {"b": 1},\n"b": 2}', ("b",), 2),  # not the key of the inner object
        ('{"a": "b",\n"b": 2}', ("b",), 2),  # not a value equal to the key
        ("[[1,\n2],\n[3]]", (1, 0), 3),
        ('["}",\n"\\"]",\n3]', (2,), 3),  # brackets and quotes in strings
        ('[{"a": []},\n{"a": 1}]', (1, "b"), 2),  # the line of the record
        ("[]", (0,), None),
    ],
)
def test_text_positions_map_to_lines(text, place, line):
    offset = nearest_place(text, place)
    assert (None if offset is None else line_at(text, offset)) == line
