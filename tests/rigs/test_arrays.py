"""Arrays: fixed copies, kept results, numbers as text, and checks of values."""

import gc
import math
import threading
import weakref

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.app.core.widgets import plain_zero
from viewer.errors import RigError
from viewer.rigs.arrays import frozen
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box
from viewer.rigs.number_text import angle_text, number_text, short_number
from viewer.rigs.pose import rest_pose


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


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ("a", "'a'"),
        (["a", "b"], r"\['a', 'b'\]"),
        ([[1.0], [1.0, 2.0]], "rows of different lengths"),
        ([object()], "<object object at .*>"),
    ],
)
def test_frozen_refuses_non_numeric_arrays(values, found):
    with pytest.raises(RigError, match=rf"^x: expected numbers, found {found}$"):
        frozen("x", values, (None,))


class Owner:
    """An object that supports weak references."""


def test_result_is_computed_once():
    memo: Memo[Owner, list[int]] = Memo()
    owner, made = Owner(), []
    for _ in range(3):
        assert memo.get(owner, "a", lambda: made.append(1) or [7]) == [7]
    assert made == [1]


def test_oldest_result_is_evicted():
    memo: Memo[Owner, int] = Memo(kept=2)
    owner, made = Owner(), []

    def get(key: int) -> int:
        return memo.get(owner, key, lambda: made.append(key) or key)

    assert [get(key) for key in (1, 2, 3, 3, 2, 1)] == [1, 2, 3, 3, 2, 1]
    assert made == [1, 2, 3, 1]


def test_results_are_freed_with_their_owner():
    memo: Memo[Owner, Owner] = Memo()
    owner = Owner()
    gone = weakref.ref(memo.get(owner, "a", Owner))
    assert gone() is not None
    del owner
    gc.collect()
    assert gone() is None


def test_threads_that_evict_results_of_other_threads_get_correct_results():
    """The memo stores one result; a second thread requests another while the first is computed."""
    memo: Memo[Owner, str] = Memo(kept=1)
    owner, inside, go = Owner(), threading.Event(), threading.Event()
    found: list[str] = []

    def slow() -> str:
        inside.set()
        go.wait(60)
        return "slow"

    thread = threading.Thread(target=lambda: found.append(memo.get(owner, "slow", slow)))
    thread.start()
    inside.wait(60)
    assert memo.get(owner, "quick", lambda: "quick") == "quick"
    go.set()
    thread.join()
    assert found == ["slow"]
    assert memo.get(owner, "slow", lambda: "again") == "slow"


def test_threads_alternating_constantly_never_fail():
    memo: Memo[Owner, int] = Memo(kept=1)
    owner = Owner()
    wrong: list[int] = []

    def ask(first: int) -> None:
        for step in range(3000):
            key = (first + step) % 3
            if memo.get(owner, key, lambda key=key: key) != key:
                wrong.append(key)

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@pytest.mark.parametrize(
    ("value", "spec", "text"),
    [
        (-0.0, "g", "0"),
        (-0.0, ".3f", "0.000"),
        (-0.00049, ".3f", "0.000"),
        (-0.00051, ".3f", "-0.001"),
        (-0.4, ",.0f", "0"),
        (-0.0, "+.3g", "+0"),
        (-0.0, ">8.2f", "    0.00"),
        (-0.0, ".2e", "0.00e+00"),
        (-1e-300, "g", "-1e-300"),
        (-math.inf, "g", "-inf"),
        (math.nan, "g", "nan"),
        (-30.0, ".0f", "-30"),
    ],
)
def test_zero_has_no_minus_sign(value, spec, text):
    assert number_text(value, spec) == text


def test_angles_use_the_shown_unit():
    assert angle_text(math.pi / 2, in_degrees=True) == "90.0\N{DEGREE SIGN}"
    assert angle_text(0.5, in_degrees=False) == "0.500 rad"
    assert angle_text(-1e-6, in_degrees=True, sign="+") == "+0.0\N{DEGREE SIGN}"
    assert angle_text(-1e-6, in_degrees=False) == "0.000 rad"


def test_short_numbers_keep_three_digits():
    assert [short_number(x) for x in (-0.0, -0.01234, 1234.5)] == ["0", "-0.0123", "1,234"]


@pytest.mark.parametrize(
    ("value", "text", "shown"),
    [
        (-0.0, "%.2f", 0.0),
        (-0.004, "%.2f", 0.0),
        (-0.006, "%.2f", -0.006),
        (-0.04, "%.1f\N{DEGREE SIGN}", 0.0),
        (-0.4, "%.0f\N{DEGREE SIGN}", 0.0),
        (0.001, "%.2f", 0.001),
        (-0.0, "%.6g", 0.0),
        (-1e-9, "%.6g", -1e-9),
        (-math.inf, "%.2f", -math.inf),
        (-0.00004, "%.4f rad", 0.0),
    ],
)
def test_widgets_get_zero_instead_of_negative_zero(value, text, shown):
    found = plain_zero(value, text)
    assert found == shown and math.copysign(1.0, found) == (-1.0 if shown < 0.0 else 1.0)


PRINTED = 6e-7  # the values are printed with six decimals


def load(shared, name):
    return viewer.load(shared / f"{name}.skel", shared / f"{name}.skin").actors[0].figure


def test_robot_knee_has_the_check_values(shared):
    robot = viewer.load(shared / "test.skel").actors[0].figure.skeleton
    pose = rest_pose(robot)
    assert robot.names[5] == "knee_r"
    assert pose.dofs[-3:].tolist() == [-2, 0, 0]
    knee = world_matrices(robot, pose)[5]
    assert_allclose(knee[:3, 3], [0.0995, -0.6, -0.009983], atol=PRINTED)
    assert_allclose(knee[0, :3], [0.995004, -0.090778, -0.041545], atol=PRINTED)


def test_wasp_with_all_dofs_zero_has_the_check_values(shared):
    wasp = load(shared, "wasp")
    pose = rest_pose(wasp.skeleton)
    pose.dofs[:] = 0.0
    box = bounding_box(viewer.deform(wasp, pose)[0])
    low, high = [-0.35046, -2.05614, -0.84758], [0.35046, 0.54019, 2.2216]
    assert_allclose(box, [low, high], atol=PRINTED)


def test_wasp_in_its_file_pose_has_the_check_values(shared):
    wasp = load(shared, "wasp")
    positions, _ = viewer.deform(wasp, rest_pose(wasp.skeleton))
    low, high = [-1.149258, -0.962391, -0.84758], [1.149702, 0.611065, 2.006119]
    assert_allclose(bounding_box(positions), [low, high], atol=PRINTED)
    assert_allclose(positions[693], [-0.194991, 0.027316, -0.187903], atol=PRINTED)


def test_tube_in_its_file_pose_has_the_check_values(shared):
    tube = load(shared, "tube")
    positions, normals = viewer.deform(tube, rest_pose(tube.skeleton))
    assert_allclose(positions[0], [0.474766, -0.186004, 0], atol=PRINTED)
    assert_allclose(normals[0], [0.540302, 0.841471, 0], atol=PRINTED)
    low, high = [-0.141612, -0.354298, -0.1], [0.474766, 0.5, 0.1]
    assert_allclose(bounding_box(positions), [low, high], atol=PRINTED)


@pytest.mark.parametrize(("name", "move"), [("wasp", [0, -0.95, 0.15]), ("tube", [0, 0.5, 0])])
def test_all_skinning_matrices_are_the_same_translation_at_zero_dofs(shared, name, move):
    figure = load(shared, name)
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 0.0
    palette = world_matrices(figure.skeleton, pose) @ figure.skin.inverse_bind
    expected = np.eye(4)
    expected[:3, 3] = move
    # Spread given in the specification.
    assert_allclose(palette, np.tile(expected, (len(palette), 1, 1)), atol=1e-5)


@pytest.mark.parametrize("name", ["wasp", "tube", "test"])
def test_real_files_load_without_a_warning(shared, name):
    files = [shared / f"{name}{suffix}" for suffix in (".skel", ".skin")]
    assert viewer.load(*(file for file in files if file.exists())).warnings == ()
