"""Node constraints of a figure as ``VRMC_node_constraint`` 1.0."""

from __future__ import annotations

from typing import Any

from viewer.rig.constraints.constraint import Constraint

__all__ = ["constraint_items"]

_AXES = "XYZ"


def constraint_items(
    constraints: tuple[Constraint, ...], joints: list[int]
) -> dict[int, dict[str, Any]]:
    """Return the extension of each constrained node.

    ``constraints``: those of a skeleton.
    ``joints`` (J,): nodes of its joints.
    """
    return {
        joints[each.joint]: {"specVersion": "1.0", "constraint": {each.kind: _item(each, joints)}}
        for each in constraints
    }


def _item(each: Constraint, joints: list[int]) -> dict[str, Any]:
    item: dict[str, Any] = {"source": joints[each.source], "weight": each.weight}
    axis = max(range(3), key=lambda index: abs(each.axis[index]))
    if each.kind == "roll":
        item["rollAxis"] = _AXES[axis]
    elif each.kind == "aim":
        item["aimAxis"] = ("Positive" if each.axis[axis] > 0.0 else "Negative") + _AXES[axis]
    return item
