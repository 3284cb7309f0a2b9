"""Hierarchies as parent lists: cycles, depth-first order, ancestors and descendants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from viewer.rigs.arrays import Bools, Floats, Ints


def cycle_members(parents: Floats | Ints) -> Bools:
    """Return a mask of the joints that are their own ancestors; not of joints below a cycle."""
    count = len(parents)
    with np.errstate(invalid="ignore"):
        whole = np.where((parents >= 0) & (parents < count), parents, -1)
    above = np.where(whole == np.floor(whole), whole, -1).astype(np.int64)
    # Pointer doubling: every pass doubles the distance from each joint to the ancestor to which it
    # points. Joints that still point to an ancestor after log2(J) passes are in or below a cycle,
    # and that ancestor is in the cycle.
    for _ in range(count.bit_length()):
        above = np.where(above >= 0, above[above], -1)
    members: Bools = np.zeros(count, dtype=np.bool_)
    members[above[above >= 0]] = True
    return members


_PARENT = "{item}joint {joint}: expected a parent before it, found {found:g}"
_ROOT = "{item}joint 0: expected the root, whose parent is -1, found {found:g}"


def parent_faults(parents: Floats | Ints, many_roots: bool = False) -> list[tuple[int, str]]:
    """Return the joints whose parents in a file cannot be used, with the messages.

    Parents come before their children. Joint 0 is the root, whose parent is -1, and the only one
    unless ``many_roots``.

    >>> [(joint, text[:4]) for joint, text in parent_faults(np.array([-1, 2, 1, 0, -1, 7]))]
    [(1, 'S002'), (4, 'F002'), (5, 'S001')]
    """
    joints = np.arange(len(parents))
    with np.errstate(invalid="ignore"):
        valid = (parents >= 0) & (parents < joints) & (parents == np.floor(parents))
    valid |= (parents == -1) & (many_roots | (joints == 0))
    if valid.all():
        return []
    in_cycle, found = cycle_members(parents), []
    for joint in np.flatnonzero(~valid).tolist():
        if joint == 0 and not many_roots:
            text = f"{'S002' if in_cycle[0] else 'F002'}.root: {_ROOT}"
        elif parents[joint] == -1:
            text = "F002.roots: {item}expected one root, found joints 0 and {joint}"
        else:
            text = f"{'S002' if in_cycle[joint] else 'S001'}.parent: {_PARENT}"
        found.append((joint, text))
    return found


def depth_first(parents: Ints) -> Ints:
    """Return the joints (J,) in depth-first order: each before its children, siblings by index.

    >>> depth_first(np.array([-1, 0, 0, 1])).tolist()
    [0, 1, 3, 2]
    """
    children: list[list[int]] = [[] for _ in parents]
    stack: list[int] = []
    for joint, parent in enumerate(parents.tolist()):
        (children[parent] if parent >= 0 else stack).append(joint)
    stack.reverse()
    order = []
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(children[joint]))
    return np.array(order, dtype=np.int32)


def path_to_root(parents: Sequence[int] | Ints, node: int) -> list[int]:
    """Return a joint or node and its ancestors, ending with its root."""
    path = [node]
    while (above := int(parents[path[-1]])) >= 0:
        path.append(above)
    return path


def roots_of(parents: Ints) -> Ints:
    """Return the root of each node (N,), by pointer doubling, in O(N log N) for any depth."""
    above: Ints = np.where(parents < 0, np.arange(len(parents), dtype=np.int32), parents)
    while True:
        next_above = above[above]
        if np.array_equal(next_above, above):
            return above
        above = next_above


def descendants(parents: Ints, node: int) -> Bools:
    """Return whether each node is a given one or below it (N,), by pointer doubling."""
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
