"""Constraints of nodes, ``VRMC_node_constraint`` 1.0.

::

    extensions.VRMC_node_constraint.constraint
        roll      source (node), rollAxis ("X", "Y" or "Z"), weight
        aim       source, aimAxis ("PositiveX", "NegativeX", …), weight
        rotation  source, weight
"""

from __future__ import annotations

from viewer.formats._scene_graph.content import NodeTree
from viewer.formats._source import Source
from viewer.formats._vrm.parts import is_index, part, value_of
from viewer.phrases import listed
from viewer.rigs.constraints.constraint import Constraint, ConstraintKind
from viewer.rigs.hierarchy import path_to_root

_EXTENSION = "VRMC_node_constraint"
_KINDS: tuple[ConstraintKind, ...] = ("roll", "aim", "rotation")
_POSITIVE = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
_AIM = {
    f"{sign}{name}": (factor * x, factor * y, factor * z)
    for name, (x, y, z) in _POSITIVE.items()
    for sign, factor in (("Positive", 1.0), ("Negative", -1.0))
}
_AXES = {"roll": ("rollAxis", _POSITIVE), "aim": ("aimAxis", _AIM)}


def read_constraints(tree: NodeTree, source: Source) -> tuple[Constraint, ...]:
    """Return the valid constraints of all nodes in order of evaluation; joints are node indices."""
    found: dict[int, Constraint] = {}
    for node, extensions in tree.extensions.items():
        told = part(extensions, _EXTENSION, "constraint")
        if told is None:
            continue
        constraint = _constraint(tree, node, told)
        if isinstance(constraint, str):
            pointer = f"{_pointer(node)}/constraint"
            source.warn(
                "G006.constraint: invalid constraint ignored: expected {expected}",
                pointer,
                expected=constraint,
            )
        elif constraint.weight > 0.0:
            found[node] = constraint
    return _ordered(tree, found, source)


def _pointer(node: int) -> str:
    return f"/nodes/{node}/extensions/{_EXTENSION}"


def _constraint(tree: NodeTree, node: int, told: object) -> Constraint | str:
    """Return the constraint of a node, or a description of the expected value."""
    kinds = [kind for kind in _KINDS if part(told, kind) is not None]
    if len(kinds) != 1:
        return "one of roll, aim and rotation"
    kind = kinds[0]
    given = part(told, kind, "source")
    if not is_index(given, tree.n_nodes) or given == node:
        return "the index of another node as source"
    axis = (0.0, 0.0, 0.0)
    if kind in _AXES:
        member, axes = _AXES[kind]
        name = part(told, kind, member)
        if not isinstance(name, str) or name not in axes:
            return f"{member} {', '.join(axes)}"
        axis = axes[name]
    weight = value_of(part(told, kind, "weight"), 1.0)
    if weight is None:
        return "a weight from 0 to 1"
    return Constraint(node, given, kind, axis, min(max(weight, 0.0), 1.0))


def _ordered(
    tree: NodeTree, found: dict[int, Constraint], source: Source
) -> tuple[Constraint, ...]:
    """Return the constraints, each after those on which it depends (depth first)."""
    needed = {node: _needed(tree, found, each) for node, each in found.items()}
    ordered: dict[int, Constraint] = {}
    for first in found:
        # The path from the first constraint to the current one, each with dependencies still to
        # visit.
        path = {first: iter(needed[first])} if first not in ordered else {}
        while path:
            node = next(reversed(path))
            following = next(path[node], None)
            if following is None:
                ordered[node] = found[node]
                del path[node]
            elif following in path:
                nodes = [*path]
                cycle = nodes[nodes.index(following) :]
                source.refuse(
                    "F002.constraint-cycle: expected constraints without cycles, found a cycle of "
                    "nodes {nodes}",
                    _pointer(following),
                    nodes=listed(cycle, 12),
                )
            elif following not in ordered:
                path[following] = iter(needed[following])
    return tuple(ordered.values())


def _needed(tree: NodeTree, found: dict[int, Constraint], each: Constraint) -> list[int]:
    """Return the constrained nodes on which a constraint depends."""
    if each.kind != "aim":
        return [each.source] if each.source in found else []
    # The positions of both nodes depend on their ancestors, not on their own rotations.
    one, other = (path_to_root(tree.parents, node)[1:] for node in (each.joint, each.source))
    above = [*one, *other]
    return [node for node in dict.fromkeys(above) if node in found]
