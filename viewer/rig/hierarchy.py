"""Lists of parents: cycles in them, and joints in depth-first order."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["cycle_members", "depth_first"]


def cycle_members(parents: Floats | Ints) -> Bools:
    """Return which joints are their own ancestors.

    Every pass doubles how far each joint looks up, so after log2(J) passes those that still see
    an ancestor are in a cycle or below one; what they see is in it.

    Parameters
    ----------
    parents : (J,)
        As a file lists them; what is no index of a joint counts as no parent.

    Returns
    -------
    (J,)
        True in cycles, False for joints that hang below one.

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
    """Return joints as a file that nests them lists them: each before its children, these by index.

    Parameters
    ----------
    parents : (J,)
        Smaller than the joint's own index; -1 for a root.

    Returns
    -------
    (J,) int32
        Indices of joints.

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
