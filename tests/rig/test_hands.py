"""Hand poses from principal components, and back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rig.hands import Hand, hand_coefficients, hand_vectors

COMPONENTS = [[1.0, 0, 0, 0, 2, 0], [0, 3, 0, 0, 0, 0], [0, 0, 0, 1, 0, -1]]
MEAN = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
HAND = Hand("left", [7, 8], COMPONENTS, MEAN)


def test_vectors_are_the_mean_plus_the_weighted_components():
    # 2 (1,0,0, 0,2,0) - 1 (0,3,0, 0,0,0), by hand.
    found = hand_vectors(HAND, np.array([2.0, -1.0]), flat=False)
    assert_allclose(found, [[2.1, -2.8, 0.3], [0.4, 4.5, 0.6]], atol=1e-15)


def test_flat_hand_omits_the_mean():
    assert hand_vectors(HAND, np.array([2.0, -1.0]), flat=True).tolist() == [[2, -3, 0], [0, 4, 0]]


def test_empty_coefficients_return_the_mean_hand():
    assert hand_vectors(HAND, np.zeros(0), flat=False).ravel().tolist() == MEAN
    assert hand_vectors(HAND, np.zeros(0), flat=True).tolist() == [[0, 0, 0]] * 2


def test_more_coefficients_than_components_are_refused():
    with pytest.raises(RigError) as caught:
        hand_vectors(HAND, np.zeros(4), flat=True)
    assert str(caught.value) == "expected at most 3 hand coefficients, found 4"


@pytest.mark.parametrize("flat", [True, False])
def test_coefficients_round_trip(flat):
    rng = np.random.default_rng(0)
    components = rng.normal(size=(20, 45))  # not orthogonal
    hand = Hand("right", np.arange(15), components, rng.normal(size=45))
    for count in (0, 1, 6, 20):
        wanted = rng.normal(size=count)
        vectors = hand_vectors(hand, wanted, flat)
        assert_allclose(hand_coefficients(hand, vectors, flat, count), wanted, atol=1e-12)


def test_coefficients_represent_the_nearest_hand():
    # For (5, 7, 0, 0, 0, 0), the coefficient of component 0, of length sqrt 5, is 5 / 5, and that
    # of component 1 is 7 / 3.
    vectors = np.array([[5.0, 7, 0], [0, 0, 0]])
    assert_allclose(hand_coefficients(HAND, vectors, True, 1), [1.0], atol=1e-14)
    assert_allclose(hand_coefficients(HAND, vectors, True, 2), [1.0, 7 / 3], atol=1e-14)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (([[0.0] * 5], MEAN), "hands_components: expected shape any x 6, found 1 x 5"),
        ((COMPONENTS, MEAN[:5]), "hands_mean: expected shape 6, found 5"),
        (([[np.nan] * 6], MEAN), "hands_components: expected finite numbers, found nan at index 0"),
    ],
)
def test_hand_refuses_inconsistent_parts(parts, message):
    with pytest.raises(RigError) as caught:
        Hand("left", [7, 8], *parts)
    assert str(caught.value).startswith(message)
