"""EasyMocap keypoints with errors, and the lines of errors in records."""

import json

import pytest
from formats.capture_files import body, noticed, opened, points, write_frames
from formats.easymocap.capture_faults import gap

from viewer.formats._text.json_places import line_at, nearest_place


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
