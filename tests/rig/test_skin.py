import numpy as np
import pytest

from viewer.errors import RigError
from viewer.rig.skin import Skin, has_influence, influence_counts, skin_from_lists, weight_sums

TWO = np.tile(np.eye(4), (2, 1, 1))
MIXED = skin_from_lists([[(0, 0.5), (1, 0.25)], [], [(1, 0.0)], [(1, 1.0), (1, -1.0)]], TWO)


def build(starts=(0, 1), joints=(0,), weights=(1.0,), inverse_bind=TWO) -> Skin:
    return Skin(np.array(starts), np.array(joints), np.array(weights), inverse_bind)


def test_skin_from_lists_keeps_order_and_counts():
    assert MIXED.starts.tolist() == [0, 2, 2, 3, 5]
    assert MIXED.joints.tolist() == [0, 1, 1, 1, 1]
    assert MIXED.weights.tolist() == [0.5, 0.25, 0.0, 1.0, -1.0]
    assert (MIXED.n_vertices, MIXED.n_joints) == (4, 2)


def test_influence_counts_include_zero_weights():
    assert influence_counts(MIXED).tolist() == [2, 0, 1, 2]


def test_weight_sums_are_as_stored():
    assert weight_sums(MIXED).tolist() == [0.75, 0.0, 0.0, 0.0]


def test_has_influence_needs_a_nonzero_weight():
    assert has_influence(MIXED).tolist() == [True, False, False, True]


def test_skin_of_no_vertices_is_empty():
    empty = skin_from_lists([], TWO)
    assert empty.n_vertices == 0
    assert weight_sums(empty).tolist() == []
    assert has_influence(empty).tolist() == []


def test_skin_of_vertices_without_influence_may_have_no_joints():
    assert skin_from_lists([[], []], np.zeros((0, 4, 4))).n_joints == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": [1.0, 2.0]}, "weights: expected shape 1, found 2"),
        ({"weights": [np.nan]}, "weights: expected finite numbers, found nan at index 0"),
        ({"inverse_bind": np.eye(4)}, "inverse_bind: expected shape any x 4 x 4, found 4 x 4"),
        ({"starts": []}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [1, 1]}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [0, 1, 0]}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [0, 2]}, "starts: expected to end at 1, found 2"),
        ({"joints": [2]}, "joints: expected indices 0 to 1, found 2 to 2"),
        ({"joints": [-1]}, "joints: expected indices 0 to 1, found -1 to -1"),
    ],
)
def test_skin_refuses_inconsistent_parts(changes, message):
    with pytest.raises(RigError) as caught:
        build(**changes)
    assert str(caught.value) == message


def test_skin_arrays_cannot_be_changed():
    for name in ("starts", "joints", "weights", "inverse_bind"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(MIXED, name)[0] = 0
