"""Cycles among parents, compared with a traversal from every joint."""

import numpy as np
import pytest

from viewer.rig.hierarchy import cycle_members


def walks_back(parents: list[int], joint: int) -> bool:
    """Return whether the chain of parents of a joint returns to the joint."""
    at = joint
    for _ in parents:
        at = parents[at] if 0 <= at < len(parents) else -1
        if at == joint:
            return True
    return False


@pytest.mark.parametrize("seed", range(20))
def test_cycle_members_are_their_own_ancestors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parents = rng.integers(-1, 30, 30)
    expected = [walks_back(parents.tolist(), joint) for joint in range(30)]
    assert cycle_members(parents).tolist() == expected


def test_invalid_index_counts_as_no_parent() -> None:
    parents = np.array([-1.0, 0.5, np.nan, 99.0, -7.0, 5.0])
    assert cycle_members(parents).tolist() == [False] * 5 + [True]


def test_long_cycle_is_found() -> None:
    parents = np.roll(np.arange(1000), 1)
    assert cycle_members(parents).all()
    parents[0] = -1
    assert not cycle_members(parents).any()
