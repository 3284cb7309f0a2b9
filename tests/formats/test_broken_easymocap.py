"""Broken frame files: each is named, becomes a gap, and the others are read."""

import json
import os
import random

import numpy as np
import pytest
from capture_files import body, opened, points, rows_of, write_frames

from viewer.errors import FormatError
from viewer.formats import Source, easymocap
from viewer.formats._json_places import line_at, nearest_place


def refusal(path, **options):
    with pytest.raises(FormatError) as caught:
        easymocap.open_capture(Source.open(path, **options))
    assert str(caught.value).isprintable()
    return str(caught.value)


def gap(tmp_path, content, kind="smpl"):
    """Read three frames, the second of which is broken; return what is said of it."""
    good = points(0) if kind == "keypoints3d" else body(0)
    folder = write_frames(tmp_path / "smpl", {0: [good], 1: content, 2: [good]})
    _, parts, _ = opened(tmp_path)
    found = [person for part in parts for person in (*part.bodies, *part.points)]
    assert found[:1] == [0]
    warnings = [text for part in parts for text in part.warnings]
    path = folder / "000001.json"
    assert all(text.isprintable() and text.startswith(str(path)) for text in warnings)
    return [text.removeprefix(str(path)) for text in warnings], parts


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", ":1: expected JSON, found a mistake: Expecting value"),
        ("[\n{\n", ":3: expected JSON, found a mistake: "
         "Expecting property name enclosed in double quotes"),
        ("[1, 2", ":1: expected JSON, found a mistake: Expecting ',' delimiter"),
        ("null", ":1: expected a list of people, found nothing"),
        ("17", ":1: expected a list of people, found 17"),
        ('{"id": 0}', ":1: expected a list of people, found 1 named value"),
        ('{"annots":\n 3}', ":1: expected a list of people, found 3"),
        ("\n[" * 100_000, ":100001: expected JSON, found too deep a nesting"),
        (f"[\n1{'0' * 5000}]", ":2: expected numbers of up to 4300 digits, found a longer one"),
        ('[{"id": 0, "poses": [1],\n"poses": [2]}]',
         ':2: expected every key once, found "poses" twice'),
    ],
)  # fmt: skip
def test_broken_file_is_a_gap_for_all(tmp_path, content, message):
    warnings, parts = gap(tmp_path, content)
    assert len(warnings) == 1 and warnings[0].startswith(message)
    assert rows_of(parts, 0) == [0, 2]


def test_file_that_is_no_text_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)]})
    (folder / "000001.json").write_bytes(b"[\n\xff\xfe]")
    (folder / "000002.json").write_bytes(b"\xef\xbb\xbf[]")  # a mark is fine
    _, parts, _ = opened(tmp_path)
    warning = f"{folder}/000001.json:2: expected text in UTF-8, found other bytes"
    assert [text for part in parts for text in part.warnings] == [warning]


def test_large_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: " " * 9000 + "[]"})
    parts = list(easymocap.read(Source.open(tmp_path, max_size=5000)).parts())
    wanted = f"{folder}/000001.json: expected at most 5000 bytes, found 9002 (--max-size)"
    assert parts[1].warnings == (wanted,)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root reads everything")
def test_unreadable_file_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: []})
    (folder / "000001.json").chmod(0)
    _, parts, _ = opened(tmp_path)
    assert parts[1].warnings == (f"{folder}/000001.json: cannot be read: Permission denied",)


def test_file_that_vanishes_is_a_gap(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], 1: [body(0)]})
    capture = easymocap.read(Source.open(tmp_path))
    (folder / "000001.json").unlink()
    texts = [text for part in capture.parts() for text in part.warnings]
    assert texts == [f"{folder}/000001.json: cannot be read: No such file or directory"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_pipe_among_the_frames_is_not_opened(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)]})
    os.mkfifo(folder / "000001.json")
    capture, _, warnings = opened(tmp_path)
    assert capture.n_frames == 1
    assert warnings == [f"{tmp_path}: 000001.json: expected files, found something else"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"poses": [[0.0] * 71]}, "poses: expected 72 numbers, found 71"),
        ({"poses": [[0.0] * 165]}, "poses: expected 72 numbers, found 165"),
        ({"poses": [[0.0] * 71 + ["1"]]}, "poses: expected 72 numbers, found '1' among them"),
        ({"poses": [[0.0] * 71 + [None]]}, "poses: expected 72 numbers, found nothing among them"),
        ({"poses": [[0.0] * 71 + [[1.0]]]},
         "poses: expected 72 numbers, found a list of 1 among them"),
        ({"poses": [[0.0] * 71 + [10**400]]},
         f"poses: expected 72 numbers, found 1{'0' * 38}… among them"),
        ({"poses": [[0.0] * 72] * 2}, "poses: expected 72 numbers, found 2"),
        ({"poses": "0" * 72}, f"poses: expected numbers, found '{'0' * 38}…"),
        ({"poses": None, "pose": 1},
         "expected poses or keypoints3d, found the keys id, Rh, Th, shapes, pose"),
        ({"poses": [[float("nan")] * 72]}, "poses: expected finite numbers, found nan"),
        ({"Th": [[0.0, 1e300, 0.0]]}, "Th: expected numbers up to 1e+09, found 1e+300"),
        ({"Rh": [[0.0, float("-inf"), 0.0]]}, "Rh: expected finite numbers, found -inf"),
        ({"Rh": None}, "Rh: expected numbers, found no such key"),
        ({"Th": 3}, "Th: expected numbers, found 3"),
        ({"Th": {"x": 1, "y": 2, "z": 3}}, "Th: expected numbers, found 3 named values"),
        ({"shapes": [[1.0] * 9]}, "shapes: expected 10 numbers, found 9"),
    ],
)  # fmt: skip
def test_broken_record_is_a_gap_for_one_person(tmp_path, changes, message):
    folder = write_frames(
        tmp_path / "smpl",
        {0: [body(0), body(1)], 1: [body(0, **changes), body(1)], 2: [body(0), body(1)]},
    )
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([0, 2], [0, 1, 2])
    warnings = [text for part in parts for text in part.warnings]
    assert warnings == [f"{folder}/000001.json:1: person 0: {message}"]
    assert parts[1].bodies[0].n_rows == 1
    assert np.isfinite(parts[1].bodies[0].vectors).all()


@pytest.mark.parametrize(
    ("person", "message"),
    [
        (1.5, "id: expected a whole number, found 1.5"),
        ("me", "id: expected a whole number, found 'me'"),
        (True, "id: expected a whole number, found True"),
        ([1], "id: expected a whole number, found a list of 1"),
        (1 << 40, "id: expected less than 2147483648, found 1099511627776"),
    ],
)
def test_person_without_a_number_is_left_out(tmp_path, person, message):
    warnings, _ = gap(tmp_path, [body(0, id=person)])
    assert warnings == [f":1: {message}"]


def test_whole_numbers_may_be_written_as_fractions(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(2.0)]})
    assert list(opened(tmp_path)[1][0].bodies) == [2]


def test_record_that_is_none_is_left_out(tmp_path):
    warnings, parts = gap(tmp_path, [None, 3, body(0)])
    assert warnings == [
        ":1: expected a person with names and values, found nothing",
        ":1: expected a person with names and values, found 3",
    ]
    assert rows_of(parts, 0) == [0, 1, 2]


def test_first_of_two_with_one_number_counts(tmp_path):
    warnings, parts = gap(tmp_path, [body(0, seed=1.0), body(0, seed=2.0)])
    assert warnings == [":1: person 0 is there twice: the first counts"]
    assert parts[1].bodies[0].translations[0, 0] == body(0, seed=1.0)["Th"][0][0]


def test_untracked_people_are_named_in_messages(tmp_path):
    warnings, _ = gap(tmp_path, [body(-1), body(-1, Th=[[float("nan"), 0.0, 0.0]])])
    assert warnings == [
        ': people without a track (id -1) are called "untracked" and numbered within each frame: '
        "nobody says who of them is who in the next",
        ":1: untracked 2: Th: expected finite numbers, found nan",
    ]


def test_two_numbers_of_one_person_are_noticed(tmp_path):
    warnings, parts = gap(tmp_path, [body(0, personID=4), body(1, personID=1)])
    assert warnings == [": people whose id and personID differ: id counts everywhere"]
    assert rows_of(parts, 1) == [1]


def test_keypoints_that_are_no_numbers_are_not_seen(tmp_path):
    record = points(0)
    rows = record["keypoints3d"]
    rows[1][3], rows[2][0], rows[3][3] = -0.5, float("nan"), float("nan")
    rows[4] = [float("nan")] * 3 + [0.0]
    folder = write_frames(tmp_path / "keypoints3d", {0: [record]})
    _, parts, _ = opened(tmp_path)
    assert parts[0].warnings == (
        f"{folder}/000000.json:1: person 0: 3 keypoints without finite numbers, or of a confidence "
        "below 0, count as not seen",
    )
    found = parts[0].points[0][1].points[0]
    assert not found[1:5].any() and found[5:, 3].all()


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([[0.0] * 4] * 24, "keypoints3d: expected 25 keypoints, found 24"),
        ([[0.0] * 4] * 24 + [[0.0] * 5], "keypoints3d: expected rows of 3 or 4 numbers, "
         "found others"),
        ([[0.0] * 4] * 24 + [["1"] * 4], "keypoints3d: expected rows of 3 or 4 numbers, "
         "found others"),
        ([0.0] * 25, "keypoints3d: expected rows of 3 or 4 numbers, found others"),
        (3, "keypoints3d: expected 25 keypoints, found 3"),
    ],
)  # fmt: skip
def test_broken_keypoints_are_a_gap(tmp_path, rows, message):
    warnings, parts = gap(tmp_path, [{"id": 0, "keypoints3d": rows}], "keypoints3d")
    assert warnings == [f":1: person 0: {message}"]
    assert len(parts[1].points[0][1].points) == 1


def test_keypoints_that_nobody_saw_are_noticed_at_the_end(tmp_path):
    unseen = points(3)
    unseen["keypoints3d"] = [[0.0] * 4] * 25
    late = {
        frame: [unseen, points(4) if frame == 70 else unseen | {"id": 4}] for frame in range(80)
    }
    folder = write_frames(tmp_path / "take" / "keypoints3d", late)
    _, parts, _ = opened(folder)
    assert [part.warnings for part in parts[:-1]] == [()] * (len(parts) - 1)
    assert parts[-1].warnings == (
        "take: no keypoint of person 3 is ever seen: every confidence is 0",
    )


def test_many_faults_are_counted(tmp_path):
    broken = dict.fromkeys(range(1, 31), "[")
    write_frames(tmp_path / "smpl", {0: [body(0)], **broken, 31: [body(0)]})
    _, parts, _ = opened(tmp_path)
    warnings = [text for part in parts for text in part.warnings]
    assert len(warnings) == 21
    assert warnings[-1] == f"{tmp_path.name}: 10 more faults in frame files"


# Nothing to read


def test_only_broken_files_are_refused(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: "[", 1: "3"})
    wanted = f"{tmp_path}: expected people, found none in 2 frames; the first: "
    assert refusal(tmp_path).startswith(f"{wanted}{folder}/000000.json:1: expected JSON, found")


def test_code_of_vposer_is_refused(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0, 32)]})
    assert refusal(tmp_path / "smpl" / "000000.json") == (
        f"{tmp_path}/smpl/000000.json:1: person 0: poses: expected rotations, found 32 numbers, a "
        "code of VPoser that only its network can decode: write full poses in EasyMocap"
    )


def test_unknown_length_is_refused_with_those_known(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0, 90)]})
    assert refusal(tmp_path / "smpl" / "000000.json").endswith(
        "person 0: poses: expected 9, 48, 63, 69, 72, 78, 87, 156 or 165 numbers, found 90"
    )


def test_nobody_is_refused(tmp_path):
    write_frames(tmp_path / "smpl", {0: [], 1: []})
    assert refusal(tmp_path) == f"{tmp_path}: expected people, found none in 2 frames"


def test_folder_without_frames_is_refused(tmp_path):
    (tmp_path / "smpl").mkdir()
    assert refusal(tmp_path) == (
        f"{tmp_path}: expected frame files (smpl_full, smplfull, smpl, keypoints3d: "
        "000000.json …), found none"
    )


def test_points_in_the_plane_are_refused(tmp_path):
    write_frames(tmp_path / "annots", {0: {"annots": [{"personID": 0, "keypoints": [[1, 2, 1]]}]}})
    assert refusal(tmp_path / "annots").endswith(
        "person 0: expected poses or keypoints3d, found the keys personID, keypoints"
    )


def test_mutations_are_read_or_refused_in_one_line(tmp_path):
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
    for _ in range(400):
        text = list(good)
        for _ in range(rng.choice((1, 1, 2, 5))):
            start = rng.randrange(len(text))
            text[start : start + rng.choice((0, 1, 3, 40, 400))] = rng.choice(pieces)
        path.write_text("".join(text))
        _, parts, _ = opened(tmp_path)
        assert 0 in parts[0].bodies
        for part in parts:
            assert all(line.isprintable() and str(folder) in line for line in part.warnings)
            assert all(np.isfinite(motion.vectors).all() for motion in part.bodies.values())
            assert all(np.isfinite(clip.points).all() for _, clip in part.points.values())
        try:
            list(easymocap.read(Source.open(path)).parts())
        except FormatError as problem:
            assert str(problem).isprintable()


# Lines


PEOPLE = [body(3, 9), body(4, 9)]


@pytest.mark.parametrize("wrapper", ["", "annots"])
@pytest.mark.parametrize(
    ("key", "value"),
    [("poses", [1.0]), ("Th", [[1.0, float("nan"), 0.0]]), ("shapes", "x"), ("Rh", None)],
)
def test_the_line_of_the_key_at_fault_is_named(tmp_path, wrapper, key, value):
    people = [PEOPLE[0], {**PEOPLE[1], key: value}]
    content = {"note": [{"poses": 1}], wrapper: people} if wrapper else people
    text = json.dumps(content, indent=1)
    # The second of the keys that is written so, as both people have it.
    rows = [number for number, row in enumerate(text.splitlines(), 1) if f'"{key}":' in row]
    write_frames(tmp_path / "smpl", {0: PEOPLE, 1: text})
    _, parts, _ = opened(tmp_path / "smpl")
    (warning,) = [text for part in parts for text in part.warnings]
    assert warning.startswith(f"{tmp_path}/smpl/000001.json:{rows[-1]}: person 4: {key}: ")


def test_the_line_of_a_record_is_named_where_a_key_is_missing(tmp_path):
    people = [PEOPLE[0], {key: value for key, value in PEOPLE[1].items() if key != "Th"}]
    text = json.dumps(people, indent=1)
    begins = [number for number, row in enumerate(text.splitlines(), 1) if row == " {"]
    write_frames(tmp_path / "smpl", {0: PEOPLE, 1: text})
    _, parts, _ = opened(tmp_path / "smpl")
    (warning,) = [text for part in parts for text in part.warnings]
    assert warning.startswith(f"{tmp_path}/smpl/000001.json:{begins[1]}: person 4: Th: ")


@pytest.mark.parametrize(
    ("text", "place", "line"),
    [
        ('{"a": 1,\n"b": 2}', ("b",), 2),
        ('{"a": {"b": 1},\n"b": 2}', ("b",), 2),  # not the one inside
        ('{"a": "b",\n"b": 2}', ("b",), 2),  # nor a value of that name
        ("[[1,\n2],\n[3]]", (1, 0), 3),
        ('["}",\n"\\"]",\n3]', (2,), 3),  # brackets and quotes in texts
        ('[{"a": []},\n{"a": 1}]', (1, "b"), 2),  # its record
        ("[]", (0,), None),
    ],
)
def test_places_in_a_text_have_a_line(text, place, line):
    offset = nearest_place(text, place)
    assert (None if offset is None else line_at(text, offset)) == line
