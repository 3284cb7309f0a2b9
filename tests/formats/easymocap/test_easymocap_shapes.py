"""Coefficients missing in records, which are repeated from earlier records."""

import numpy as np
import pytest
from formats.capture_files import body, noticed, opened, rows_of, waves, write_frames
from numpy.testing import assert_array_equal

from viewer.formats.easymocap.bodies import hold, last_given

ROWS = np.array([[9.0, 9.0], [1.0, 2.0], [9.0, 9.0], [np.nan, 3.0], [9.0, 9.0]])
GIVEN = np.array([False, True, False, True, False])


def test_missing_rows_repeat_the_last_valid_row():
    expected = [[0.0, 0.0], [1.0, 2.0], [1.0, 2.0], [np.nan, 3.0], [1.0, 2.0]]
    assert_array_equal(hold(ROWS, GIVEN, None), expected)


def test_first_rows_use_the_previously_known_shape():
    assert_array_equal(hold(ROWS, GIVEN, np.array([7.0, 8.0]))[0], [7.0, 8.0])


def test_complete_rows_are_unchanged():
    assert hold(ROWS, np.ones(5, dtype=bool), None) is ROWS


def test_last_valid_row_is_remembered():
    assert_array_equal(last_given(ROWS, GIVEN), [1.0, 2.0])
    assert last_given(ROWS, np.zeros(5, dtype=bool)) is None
    assert last_given(np.zeros((0, 2)), np.zeros(0, dtype=bool)) is None


# Recordings with missing coefficients


def shapes_of(parts, person):
    """Return the shape of every row of a person, as stored in the records."""
    motions = [part.bodies[person] for part in parts if person in part.bodies]
    rows = [np.broadcast_to(motion.shape, (motion.n_rows, 10)) for motion in motions]
    return np.concatenate(rows)[:, 0].tolist()


def test_shapes_of_the_first_record_apply_to_all_records(tmp_path):
    bare = [body(0, shapes=None), body(1, shapes=None)]
    first = [body(0, shapes=[[2.0] * 10]), body(1, shapes=[[3.0] * 10])]
    folder = write_frames(tmp_path / "smpl", {0: first, **dict.fromkeys(range(1, 100), bare)})
    _, parts, _ = opened(tmp_path)
    assert len(parts) == 3 and rows_of(parts, 1) == list(range(100))
    assert shapes_of(parts, 0) == [2.0] * 100 and shapes_of(parts, 1) == [3.0] * 100
    assert all(part.bodies[0].shape.shape == (1, 10) for part in parts)
    assert noticed(parts, folder / "000001.json") == [
        ("F007.record-last", None, {"item": "shapes"})
    ]


def test_last_valid_shapes_are_repeated(tmp_path):
    def record(value):
        return [body(0, shapes=None if value is None else [[value] * 10])]

    values = [None, 1.0, None, 2.0, float("nan"), None, None, 4.0]
    write_frames(tmp_path / "smpl", {frame: record(value) for frame, value in enumerate(values)})
    _, parts, _ = opened(tmp_path)
    # The record with an invalid value is a gap, and its shape is not repeated.
    assert rows_of(parts, 0) == [0, 1, 2, 3, 5, 6, 7]
    found = [0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 4.0]
    rows = [part.bodies[0] for part in parts]
    assert rows[0].shape is None  # no earlier record has a shape
    assert shapes_of(parts[1:], 0) == found[1:]
    names = [found.path.name for part in parts for found in part.warnings]
    assert names == ["000001.json", "000004.json", "000002.json"]
    assert noticed(parts) == [
        ("F007.record-first", None, {"keys": ("shapes",)}),
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F003.record",
                    None,
                    {
                        "item": "person 0: shapes",
                        "problem": "expected finite numbers, found nan",
                    },
                )
            },
        ),
        ("F007.record-last", None, {"item": "shapes"}),
    ]


def test_person_without_shapes_gets_the_mean_body(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0), body(1, shapes=None)]})
    _, parts, _ = opened(tmp_path)
    assert_array_equal(parts[0].bodies[1].shape, np.zeros((1, 10)))
    assert_array_equal(parts[0].bodies[0].shape, [waves(10, seed=3)])
    assert tuple(noticed(parts[:1], folder / "000000.json")) == (
        ("F007.record-no-last", None, {"item": "shapes"}),
    )


def test_untracked_people_do_not_inherit_shapes(tmp_path):
    frames = {0: [body(-1, shapes=[[5.0] * 10])], 1: [body(-1, shapes=None)], 2: [body(-1)]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert shapes_of(parts, -1) == [5.0, 0.0, waves(10, seed=2)[0]]


def test_expression_is_repeated(tmp_path):
    said = {"expression": [[0.5] * 10]}
    frames = {0: [body(0, 87)], 1: [body(0, 87, **said)], 2: [body(0, 87)]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert parts[0].bodies[0].expression is None
    assert_array_equal(parts[1].bodies[0].expression, np.full((1, 10), 0.5))
    assert parts[1].bodies[0].n_rows == 2


def test_expression_may_start_within_a_part(tmp_path):
    frames = {frame: [body(0, 87), body(1, 87)] for frame in range(5)}
    frames[3] = [body(0, 87), body(1, 87, expression=[[0.5] * 10])]
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert_array_equal(parts[1].bodies[0].expression, np.zeros((1, 10)))
    assert parts[1].bodies[1].expression[:, 0].tolist() == [0.0, 0.0, 0.5, 0.5]


def test_record_without_poses_is_a_gap(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)], 1: [body(0, poses=None)], 2: [body(0)]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 2]


def test_invalid_record_without_shapes_does_not_affect_others(tmp_path):
    bare = body(0, shapes=None)
    frames = {0: [body(0, shapes=[[2.0] * 10])], 1: [bare], 2: [bare | {"Th": [[1, "x", 3]]}]}
    write_frames(tmp_path / "smpl", {**frames, 3: [bare]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 1, 3] and shapes_of(parts, 0) == [2.0] * 3


@pytest.mark.parametrize("key", ["shapes", "expression"])
@pytest.mark.parametrize("empty", [[], [[]]], ids=["list", "matrix"])
def test_empty_coefficients_are_treated_as_missing(tmp_path, key, empty):
    missing = write_frames(tmp_path / "a", {0: [body(0, **{key: None})], 1: [body(0)]})
    written = write_frames(tmp_path / "b", {0: [body(0, **{key: empty})], 1: [body(0)]})
    expected, found = (opened(folder)[1] for folder in (missing, written))
    assert rows_of(found, 0) == [0, 1]
    for part, other in zip(found, expected, strict=True):
        assert noticed([part]) == noticed([other])
        motion, wanted = part.bodies[0], other.bodies[0]
        assert (motion.expression is None) == (wanted.expression is None)
        if key == "shapes":
            assert_array_equal(motion.shape, wanted.shape)


def test_empty_shapes_repeat_the_last_value(tmp_path):
    frames = {0: [body(0, shapes=[[2.0] * 10])], 1: [body(0, shapes=[])], 2: [body(0, shapes=[[]])]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 1, 2] and shapes_of(parts, 0) == [2.0] * 3


@pytest.mark.parametrize("empty", [[], [[]]])
def test_hands_without_components_are_ignored(tmp_path, empty):
    write_frames(tmp_path / "smpl", {0: [body(0, 63, handl=empty, handr=[[0.5] * 6])]})
    _, parts, _ = opened(tmp_path)
    assert list(parts[0].bodies[0].hands) == ["right"]
