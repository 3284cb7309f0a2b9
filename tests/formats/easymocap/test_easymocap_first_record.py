"""An invalid first record, which becomes a gap and does not define the layout of later records."""

import json

import pytest
from formats.capture_files import body, noticed, opened, points, rows_of, write_frames

from viewer.diagnostics import Phrase
from viewer.phrases import one_of

INFINITE = json.loads("1e400")


def fault_in(parts, path):
    """Return the line and text of the only error."""
    ((key, line, values),) = noticed(parts, path)
    assert key == "F007.record"
    return line, values["problem"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shapes": [[], []]}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected 2 numbers, found an empty list among them"})),
        ({"shapes": [[None]]}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected 1 number, found None among them"})),
        ({"shapes": [[INFINITE]]}, ("F003.record", None, {"item": "person 0: shapes",
         "problem": "expected finite numbers, found inf"})),
        ({"shapes": "x"}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected numbers, found 'x'"})),
        ({"shapes": {}}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected numbers, found an empty dict"})),
        ({"expression": [["a"]]}, ("F002.record", None, {"item": "person 0: expression",
         "problem": "expected 1 number, found 'a' among them"})),
        ({"expression": [[INFINITE] * 3]}, ("F003.record", None, {"item": "person 0: expression",
         "problem": "expected finite numbers, found inf"})),
        ({"poses": [[None] * 69]}, ("F002.record", None, {"item": "person 0: poses",
         "problem": "expected 69 numbers, found None among them"})),
        ({"poses": [[INFINITE] * 165]}, ("F003.record", None, {"item": "person 0: poses",
         "problem": "expected finite numbers, found inf"})),
        ({"Th": [[1.0]], "shapes": [[1.0]]}, ("F002.record", None, {"item": "person 0: Th",
         "problem": "expected 3 numbers, found 1"})),
    ],
)  # fmt: skip
def test_number_of_values_is_that_of_valid_records(tmp_path, changes, message):
    others = {"expression": [[0.5] * 10]} if "expression" in changes else {}
    good = [body(0, **others), body(1, **others)]
    first = json.dumps([{**good[0], **changes}, good[1]], indent=1)
    (key, *_) = changes
    rows = [number for number, row in enumerate(first.splitlines(), 1) if f'"{key}":' in row]
    folder = write_frames(tmp_path / "smpl", {0: first, 1: good, 2: good})
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([1, 2], [0, 1, 2])
    assert fault_in(parts, folder / "000000.json") == (rows[0], message)


@pytest.mark.parametrize("key", ["handl", "handr"])
def test_number_of_hand_values_is_that_of_valid_records(tmp_path, key):
    good = body(0, 63, handl=[[0.5] * 6], handr=[[0.5] * 6])
    folder = write_frames(tmp_path / "smpl", {0: [{**good, key: [[None]]}], 1: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [1]
    line, (_, _, values) = fault_in(parts, folder / "000000.json")
    problem = "expected 1 number, found None among them"
    assert (line, values) == (1, {"item": f"person 0: {key}", "problem": problem})


def test_later_invalid_coefficients_do_not_determine_their_number(tmp_path):
    bare, bad, good = body(0, shapes=None), body(0, shapes=[[None]]), body(0)
    folder = write_frames(tmp_path / "smpl", {0: [bare], 1: [bad], 2: [good], 3: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 2, 3]
    first = next(found for part in parts for found in part.warnings)
    assert (first.path, first.line) == (folder / "000001.json", 1)
    assert first.values["problem"].values["item"] == "person 0: shapes"


@pytest.mark.parametrize(
    "rows", [[[]], [[None] * 4], [[INFINITE, 0.0, 0.0, 1.0]], [[1.0, 2.0]], [["a", 1, 2]], [[[]]]]
)
def test_number_of_keypoints_is_that_of_valid_records(tmp_path, rows):
    good, bad = [points(0), points(1)], points(0) | {"keypoints3d": rows}
    folder = write_frames(tmp_path / "keypoints3d", {0: [bad, good[1]], 1: good})
    _, parts, _ = opened(tmp_path)
    seen = [sorted(person for part in parts if person in part.points) for person in (0, 1)]
    assert seen == [[0] * len(seen[0]), [1] * len(parts)]
    counts = [part.points[0][1].points.shape[:2] for part in parts if 0 in part.points]
    assert sum(rows for rows, _ in counts) == 1 and {count for _, count in counts} == {25}
    line, (_, _, values) = fault_in(parts, folder / "000000.json")
    assert (line, values["item"]) == (1, "person 0: keypoints3d")
    assert values["problem"].sentence in (
        "expected rows of 3 or 4 numbers, found {found}",
        "expected rows of 3 or 4 numbers, found rows of different lengths",
        "expected rows of 3 or 4 finite numbers, found none",
    )


def test_undetected_keypoints_determine_the_number_of_keypoints(tmp_path):
    unseen = {"keypoints3d": [[0.0] * 4] * 25}
    write_frames(tmp_path / "keypoints3d", {0: [points(0) | unseen], 1: [points(0)]})
    _, parts, _ = opened(tmp_path)
    assert sum(len(part.points[0][1].points) for part in parts) == 2


def test_accepted_pose_lengths_are_listed(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0, poses=[[0.0] * 7])], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    _, (_, _, values) = fault_in(parts, folder / "000000.json")
    lengths = [9, 48, 63, 69, 72, 78, 87, 156, 165]
    problem = Phrase(
        "expected {expected} numbers, found {found}", expected=one_of(lengths), found=7
    )
    assert values == {"item": "person 0: poses", "problem": problem}


def test_empty_record_is_reported_without_keys(tmp_path):
    write_frames(tmp_path / "smpl", {0: [{}], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    problem = "expected poses or keypoints3d, found no keys"
    faults = [values.get("problem") for _, _, values in noticed(parts)]
    assert ("F002.record", None, {"item": "person 0", "problem": problem}) in faults


def test_unusual_number_of_pose_values_in_the_first_record_makes_it_a_gap(tmp_path):
    frames = {0: [body(0, 78)], **{frame: [body(0)] for frame in range(1, 12)}}
    folder = write_frames(tmp_path / "smpl", frames)
    capture, parts, _ = opened(tmp_path)
    assert (capture.model, rows_of(parts, 0)) == ("SMPL", [*range(1, 12)])
    problem = "expected 72 numbers, found 78"
    values = {"item": "person 0: poses", "problem": problem}
    assert fault_in(parts, folder / "000000.json") == (1, ("F002.record", None, values))


def test_omitted_coefficients_are_zero(tmp_path):
    short, long = [0.25, 0.5], [0.25, 0.5, 0.75, 1.0]
    people = {0: (short, long), 1: (long, short), 2: ([long], [short])}
    frames = {
        frame: [body(person, shapes=shapes[frame]) for person, shapes in people.items()]
        for frame in range(2)
    }
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert not noticed(parts)
    padded = [*short, 0.0, 0.0]
    for person, wanted in {0: [padded, long], 1: [long, padded], 2: [long, padded]}.items():
        rows = [row for part in parts for row in part.bodies[person].shape.tolist()]
        assert rows == wanted
