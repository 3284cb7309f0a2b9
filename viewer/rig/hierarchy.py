"""Joint hierarchies as parent lists: cycles, and depth-first order."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints


def cycle_members(parents: Floats | Ints) -> Bools:
    """Return a mask of the joints that are their own ancestors.

    Pointer doubling: every pass doubles the distance from each joint to the ancestor to which it
    points. Joints that still point to an ancestor after log2(J) passes are in or below a cycle, and
    that ancestor is in the cycle.

    ``parents``: (J,), parents as listed in a file; a value that is not a joint index means no
    parent. Returns (J,), true for joints in a cycle, False for joints below one.

    >>> cycle_members(np.array([-1, 2, 1, 2])).tolist()
    [False, True, True, False]
    """
    count = len(parents)
    with np.errstate(invalid="ignore"):
        whole = np.where((parents >= 0) & (parents < count), parents, -1)
    above = np.where(whole == np.floor(whole), whole, -1).astype(np.int64)
    for _ in range(count.bit_length()):
        above = np.where(above >= 0, above[above], -1)
    members: Bools = np.zeros(count, dtype=np.bool_)
    members[above[above >= 0]] = True
    return members


def depth_first(parents: Ints) -> Ints:
    """Return the joints in depth-first order: each before its children, siblings by index.

    ``parents``: (J,), smaller than the joint's own index; -1 for a root. Returns (J,) int32, joint
    indices.

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
