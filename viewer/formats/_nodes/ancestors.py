"""Ancestors in a tree of nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from viewer.rig.arrays import Ints

__all__ = ["path_to_root", "with_ancestors"]


def path_to_root(parents: Sequence[int] | Ints, node: int) -> list[int]:
    """Return a node and its ancestors, ending with its root.

    >>> path_to_root([-1, 0, 1, 0], 2)
    [2, 1, 0]
    """
    path = [node]
    while (above := int(parents[path[-1]])) >= 0:
        path.append(above)
    return path


def with_ancestors(parents: Sequence[int], nodes: Iterable[int]) -> set[int]:
    """Return nodes and their ancestors; each node is visited once."""
    found: set[int] = set()
    for node in nodes:
        while node >= 0 and node not in found:
            found.add(node)
            node = parents[node]
    return found
