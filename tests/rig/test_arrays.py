import numpy as np
import pytest

from viewer.errors import RigError
from viewer.rig.arrays import frozen


def test_frozen_copies_writable_arrays():
    values = np.array([1.0, 2.0])
    kept = frozen("x", values, (2,))
    values[0] = 9.0
    assert kept.tolist() == [1.0, 2.0]
    assert values.flags.writeable


def test_frozen_copies_a_read_only_view_of_a_writable_array():
    base = np.array([1.0, 2.0, 3.0])
    view = base[:2]
    view.flags.writeable = False
    kept = frozen("x", view, (2,))
    base[0] = 9.0
    assert kept.tolist() == [1.0, 2.0]


def test_frozen_keeps_a_read_only_array():
    values = np.array([1.0, 2.0])
    values.flags.writeable = False
    assert frozen("x", values, (2,)) is values


def test_frozen_array_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        frozen("x", [1.0], (1,))[0] = 2.0


def test_frozen_converts_lists_and_types():
    assert frozen("x", [1, 2], (2,)).dtype == np.float64
    assert frozen("x", [1.0, 2.0], (2,), np.int32).dtype == np.int32
    assert frozen("x", np.array([1, 2], dtype=np.int64), (None,), np.int32).tolist() == [1, 2]


@pytest.mark.parametrize(
    ("values", "shape", "message"),
    [
        ([1.0, 2.0], (3,), "x: expected shape 3, found 2"),
        ([[1.0]], (None, 3), "x: expected shape any x 3, found 1 x 1"),
        (1.0, (1,), "x: expected shape 1, found a single number"),
        ([], (None, 3), "x: expected shape any x 3, found 0"),
        ([1.0, np.nan], (2,), "x: expected finite numbers, found nan at index 1"),
        ([[0.0, -np.inf]], (1, 2), "x: expected finite numbers, found -inf at index 0, 1"),
    ],
)
def test_error_of_frozen_states_the_name_and_the_value(values, shape, message):
    with pytest.raises(RigError) as caught:
        frozen("x", values, shape)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    "values", [[0.5], [2.0**40], [np.nan], np.array([2**40]), [-(2.0**31) - 1]]
)
def test_frozen_refuses_to_truncate_to_integers(values):
    with pytest.raises(RigError) as caught:
        frozen("parents", values, (1,), np.int32)
    assert str(caught.value) == "parents: expected whole numbers that fit int32"


@pytest.mark.parametrize("values", [["a"], [[1.0], [1.0, 2.0]], [object()]])
def test_frozen_refuses_non_numeric_arrays(values):
    with pytest.raises(RigError, match=r"^x: expected numbers, found "):
        frozen("x", values, (None,))
