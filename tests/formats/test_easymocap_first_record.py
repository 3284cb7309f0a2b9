"""A faulty record that comes first: it is a gap, and no measure for the others."""

import json

import pytest
from capture_files import body, opened, points, rows_of, write_frames

INFINITE = json.loads("1e400")


def warnings_of(parts):
    return [text for part in parts for text in part.warnings]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shapes": [[], []]}, "shapes: expected 2 numbers, found an empty list among them"),
        ({"shapes": [[None]]}, "shapes: expected 1 number, found"),
        ({"shapes": [[INFINITE]]}, "shapes: expected finite numbers, found inf"),
        ({"shapes": "x"}, "shapes: expected numbers, found 'x'"),
        ({"shapes": {}}, "shapes: expected numbers, found"),
        ({"expression": [["a"]]}, "expression: expected 1 number, found 'a' among them"),
        ({"expression": [[INFINITE] * 3]}, "expression: expected finite numbers, found inf"),
        ({"poses": [[None] * 69]}, "poses: expected 69 numbers, found"),
        ({"poses": [[INFINITE] * 165]}, "poses: expected finite numbers, found inf"),
        ({"Th": [[1.0]], "shapes": [[1.0]]}, "Th: expected 3 numbers, found 1"),
    ],
)
def test_width_comes_from_records_that_can_be_used(tmp_path, changes, message):
    others = {"expression": [[0.5] * 10]} if "expression" in changes else {}
    good = [body(0, **others), body(1, **others)]
    first = json.dumps([{**good[0], **changes}, good[1]], indent=1)
    (key, *_) = changes
    rows = [number for number, row in enumerate(first.splitlines(), 1) if f'"{key}":' in row]
    folder = write_frames(tmp_path / "smpl", {0: first, 1: good, 2: good})
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([1, 2], [0, 1, 2])
    (warning,) = warnings_of(parts)
    assert warning.startswith(f"{folder}/000000.json:{rows[0]}: person 0: {message}")


@pytest.mark.parametrize("key", ["handl", "handr"])
def test_width_of_hands_comes_from_records_that_can_be_used(tmp_path, key):
    good = body(0, 63, handl=[[0.5] * 6], handr=[[0.5] * 6])
    folder = write_frames(tmp_path / "smpl", {0: [{**good, key: [[None]]}], 1: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [1]
    (warning,) = warnings_of(parts)
    assert warning.startswith(f"{folder}/000000.json:1: person 0: {key}: expected 1 number, found")


def test_faulty_coefficients_that_come_late_are_no_measure_either(tmp_path):
    bare, bad, good = body(0, shapes=None), body(0, shapes=[[None]]), body(0)
    folder = write_frames(tmp_path / "smpl", {0: [bare], 1: [bad], 2: [good], 3: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 2, 3]
    assert warnings_of(parts)[0].startswith(f"{folder}/000001.json:1: person 0: shapes: ")


@pytest.mark.parametrize(
    "rows", [[[]], [[None] * 4], [[INFINITE, 0.0, 0.0, 1.0]], [[1.0, 2.0]], [["a", 1, 2]], [[[]]]]
)
def test_number_of_keypoints_comes_from_records_that_can_be_used(tmp_path, rows):
    good, bad = [points(0), points(1)], points(0) | {"keypoints3d": rows}
    folder = write_frames(tmp_path / "keypoints3d", {0: [bad, good[1]], 1: good})
    _, parts, _ = opened(tmp_path)
    seen = [sorted(person for part in parts if person in part.points) for person in (0, 1)]
    assert seen == [[0] * len(seen[0]), [1] * len(parts)]
    counts = [part.points[0][1].points.shape[:2] for part in parts if 0 in part.points]
    assert sum(rows for rows, _ in counts) == 1 and {count for _, count in counts} == {25}
    (warning,) = warnings_of(parts)
    where = f"{folder}/000000.json:1: person 0: keypoints3d: "
    assert warning.startswith(f"{where}expected rows of 3 or 4 ")


def test_keypoints_that_are_not_seen_are_a_measure(tmp_path):
    unseen = {"keypoints3d": [[0.0] * 4] * 25}
    write_frames(tmp_path / "keypoints3d", {0: [points(0) | unseen], 1: [points(0)]})
    _, parts, _ = opened(tmp_path)
    assert sum(len(part.points[0][1].points) for part in parts) == 2


def test_lengths_of_poses_are_listed_as_a_choice(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0, poses=[[0.0] * 7])], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    (warning,) = warnings_of(parts)
    wanted = "9, 48, 63, 69, 72, 78, 87, 156 or 165"
    assert warning.endswith(f"poses: expected {wanted} numbers, found 7")


def test_record_without_keys_has_no_keys(tmp_path):
    write_frames(tmp_path / "smpl", {0: [{}], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    assert [text for text in warnings_of(parts) if text.endswith("found no keys")]
