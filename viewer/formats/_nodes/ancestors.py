"""Ancestors in a tree of nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from viewer.rig.arrays import Bools, Ints

__all__ = ["descendants", "path_to_root", "roots_of", "with_ancestors"]


def path_to_root(parents: Sequence[int] | Ints, node: int) -> list[int]:
    """Return a node and its ancestors, ending with its root.

    >>> path_to_root([-1, 0, 1, 0], 2)
    [2, 1, 0]
    """
    path = [node]
    while (above := int(parents[path[-1]])) >= 0:
        path.append(above)
    return path


def roots_of(parents: Ints) -> Ints:
    """Return the root of each node (N,), by pointer doubling, in O(N log N) for any depth.

    >>> roots_of(np.array([-1, 0, 1, -1], dtype=np.int32)).tolist()
    [0, 0, 0, 3]
    """
    above: Ints = np.where(parents < 0, np.arange(len(parents), dtype=np.int32), parents)
    while True:
        next_above = above[above]
        if np.array_equal(next_above, above):
            return above
        above = next_above


def descendants(parents: Ints, node: int) -> Bools:
    """Return whether each node is a given one or below it: (N,), by pointer doubling.

    >>> descendants(np.array([-1, 0, 1, 0], dtype=np.int32), 1).tolist()
    [False, True, True, False]
    """
    above: Ints = np.where(parents < 0, np.arange(len(parents), dtype=np.int32), parents)
    found: Bools = np.arange(len(parents)) == node
    while True:
        next_above = above[above]
        found = found | found[above]
        if np.array_equal(next_above, above):
            return found
        above = next_above


def with_ancestors(parents: Sequence[int], nodes: Iterable[int]) -> set[int]:
    """Return nodes and their ancestors; each node is visited once."""
    found: set[int] = set()
    for node in nodes:
        while node >= 0 and node not in found:
            found.add(node)
            node = parents[node]
    return found
