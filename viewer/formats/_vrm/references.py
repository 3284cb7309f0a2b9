"""Nodes to which the extensions of a VRM file refer, so that none of them is removed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viewer.formats._vrm.json_parts import is_index

__all__ = ["named_nodes"]

_SINGLE = {"node", "center", "firstPersonBone"}
_LISTS = {"bones"}


def named_nodes(extensions: Mapping[str, Any], n_nodes: int) -> frozenset[int]:
    """Return all nodes that ``VRM``, ``VRMC_vrm`` and ``VRMC_springBone`` name.

    Parameters
    ----------
    extensions : mapping
        Extensions of the root, as parsed from JSON.
    n_nodes : int
        Number of nodes; other indices are ignored.

    >>> told = {"VRM": {"secondaryAnimation": {"boneGroups": [{"bones": [1, 9], "center": 2}]}}}
    >>> sorted(named_nodes(told, 3))
    [1, 2]
    """
    found: set[int] = set()
    stack: list[Any] = [extensions.get(name) for name in ("VRM", "VRMC_vrm", "VRMC_springBone")]
    while stack:
        told = stack.pop()
        if isinstance(told, list):
            stack += told
        elif isinstance(told, dict):
            for name, value in told.items():
                given = value if name in _LISTS and isinstance(value, list) else [value]
                if name in _SINGLE or name in _LISTS:
                    found.update(each for each in given if is_index(each, n_nodes))
                else:
                    stack.append(value)
    return frozenset(found)
