"""Skins for engines with few influences: merged, sorted, pruned and normalised."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rigs.skin import (
    Skin,
    limit_influences,
    normalized,
    skin_from_entries,
    skin_from_lists,
    strongest_first,
    weight_sums,
)
from viewer.rigs.skinning import Skinning, skin_used

BIND = np.tile(np.eye(4), (6, 1, 1))


def rows(skin: Skin) -> list[list[tuple[int, float]]]:
    """Return the (joint, weight) pairs of each vertex."""
    pairs = list(zip(skin.joints.tolist(), skin.weights.tolist(), strict=True))
    return [pairs[a:b] for a, b in zip(skin.starts[:-1], skin.starts[1:], strict=True)]


def skin(*influences) -> Skin:
    return skin_from_lists(influences, BIND)


def test_strongest_influences_are_first_and_ties_keep_their_order():
    mixed = skin([(0, 0.25), (3, 0.5), (1, 0.25), (2, 0.5)], [], [(5, -1.0), (4, 0.0)])
    assert rows(strongest_first(mixed)) == [
        [(3, 0.5), (2, 0.5), (0, 0.25), (1, 0.25)],
        [],
        [(4, 0.0), (5, -1.0)],
    ]


def test_limit_keeps_the_strongest_and_normalises_them():
    cut = limit_influences(skin([(0, 0.125), (1, 0.5), (2, 0.25), (3, 0.125)]), 2)
    assert rows(cut) == [[(1, 0.5 / 0.75), (2, 0.25 / 0.75)]]


def test_influences_of_one_joint_are_summed_before_pruning():
    # Joint 4 has 0.25 + 0.25, which is more than the 0.375 of joint 1.
    cut = limit_influences(skin([(4, 0.25), (1, 0.375), (4, 0.25), (0, 0.125)]), 1)
    assert rows(cut) == [[(4, 1.0)]]


def test_limit_only_normalises_vertices_with_fewer_influences():
    cut = limit_influences(skin([(2, 0.5)], [], [(0, 0.25), (1, 0.25)]), 4)
    assert rows(cut) == [[(2, 1.0)], [], [(0, 0.5), (1, 0.5)]]


def test_limit_keeps_bindings_and_the_number_of_vertices():
    bind = np.random.default_rng(0).normal(size=(6, 4, 4))
    cut = limit_influences(skin_from_lists([[(0, 1.0)], [], [(1, 2.0)]], bind), 1)
    assert cut.n_vertices == 3
    assert np.array_equal(cut.inverse_bind, bind)


def test_weights_summing_to_zero_cannot_be_normalised():
    cancelled = skin([(0, 1.0), (1, -1.0)], [(2, 0.0)], [])
    assert rows(normalized(cancelled)) == rows(cancelled)


def test_normalized_weights_sum_to_one():
    raw = skin([(0, 0.5), (1, 1.5)], [(2, 0.998)], [(3, -2.0)], [(0, 0.25), (0, 0.25)])
    scaled = normalized(raw)
    assert rows(scaled)[0] == [(0, 0.25), (1, 0.75)]
    assert rows(scaled)[3] == [(0, 0.5), (0, 0.5)]
    assert_allclose(weight_sums(scaled), 1.0, atol=1e-15)


@pytest.mark.parametrize("count", [1, 2, 4, 7, 100])
def test_limit_matches_a_plain_loop(count):
    rng = np.random.default_rng(count)
    influences = [
        [(int(rng.integers(6)), float(rng.uniform(0.01, 1))) for _ in range(rng.integers(0, 9))]
        for _ in range(60)
    ]
    for found, pairs in zip(
        rows(limit_influences(skin(*influences), count)), influences, strict=True
    ):
        sums = np.zeros(6)
        for joint, weight in pairs:
            sums[joint] += weight
        kept = np.argsort(-sums, kind="stable")[:count]
        expected = np.zeros(6)
        expected[kept] = sums[kept]
        expected /= expected.sum() or 1.0
        dense = np.zeros(6)
        for joint, weight in found:
            assert dense[joint] == 0.0
            dense[joint] = weight
        assert_allclose(dense, expected, atol=1e-15)
        assert [weight for _, weight in found] == sorted((w for _, w in found), reverse=True)


def test_unsorted_entries_are_converted_to_rows_in_the_order_of_entries():
    built = skin_from_entries(4, [2, 0, 2, 3, 0], [5, 1, 0, 2, 4], [0.1, 0.2, 0.3, 0.4, 0.5], BIND)
    assert rows(built) == [[(1, 0.2), (4, 0.5)], [], [(5, 0.1), (0, 0.3)], [(2, 0.4)]]


def test_skin_that_needs_no_change_is_returned_unchanged():
    stored = skin([(0, 0.5)])
    assert skin_used(stored, Skinning()) is stored


def test_limited_and_normalised_skins_are_cached():
    stored = skin([(0, 0.5), (1, 0.125)])
    assert rows(skin_used(stored, Skinning(normalize=True))) == [[(0, 0.8), (1, 0.2)]]
    assert rows(skin_used(stored, Skinning(max_influences=1))) == [[(0, 1.0)]]
    cut = skin_used(stored, Skinning(max_influences=1, normalize=True))
    assert skin_used(stored, Skinning("dqs", max_influences=1, normalize=True)) is cut
