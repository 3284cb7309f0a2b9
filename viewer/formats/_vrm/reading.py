"""VRM properties of a glTF file: bones, expressions, springs, constraints, views and permissions.

Specifications: ``github.com/vrm-c/vrm-specification``, ``VRM`` 0.0 and ``VRMC_vrm`` 1.0. Version 0
is upgraded; what it says in its own words, such as its permissions, is shown as it is.
Constraints of nodes are ``VRMC_node_constraint`` 1.0::

    extensions.VRMC_node_constraint.constraint
        roll      source (node), rollAxis ("X", "Y" or "Z"), weight
        aim       source, aimAxis ("PositiveX", "NegativeX", …), weight
        rotation  source, weight
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from viewer.formats._scene_graph.content import NodeExpression, NodeFile, NodeTree
from viewer.formats._scene_graph.surfaces import part_name
from viewer.formats._source import Source
from viewer.formats._vrm.bones import read_humanoid
from viewer.formats._vrm.checks import check_character
from viewer.formats._vrm.materials import modern_binds
from viewer.formats._vrm.parts import is_index, list_in, part, value_of
from viewer.formats._vrm.springs import read_springs
from viewer.formats._vrm.upgrade import NamedExpression, nodes_with_mesh, upgrade
from viewer.phrases import listed, quoted
from viewer.rigs.arrays import Floats
from viewer.rigs.constraints.constraint import Constraint, ConstraintKind
from viewer.rigs.expressions import OVERRIDES, PROCEDURAL
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.mesh import PartView

_OVERRIDES = {"mouth": "overrideMouth", "blink": "overrideBlink", "look": "overrideLookAt"}

_KEYS = ("VRM", "VRMC_vrm")  # by version
_SINGLE = {"node", "center", "firstPersonBone"}
_LISTS = {"bones"}

_VIEWS: dict[str, PartView] = {
    "auto": "auto",
    "both": "both",
    "thirdpersononly": "third-person",
    "firstpersononly": "first-person",
}

# Heading of each property, and the property's names in versions 1.0 and 0.x.
_META = {
    "title": ("name", "title"),
    "authors": ("authors", "author"),
    "model version": ("version",),
    "copyright": ("copyrightInformation",),
    "contact": ("contactInformation",),
    "references": ("references", "reference"),
    "licence": ("licenseUrl", "licenseName"),
    "other licence": ("otherLicenseUrl",),
    "licences of others": ("thirdPartyLicenses",),
    "other permissions": ("otherPermissionUrl",),
    "may be used by": ("avatarPermission", "allowedUserName"),
    "commercial use": ("commercialUsage", "commercialUssageName"),
    "credit": ("creditNotation",),
    "redistribution": ("allowRedistribution",),
    "modification": ("modification",),
    "violent use": ("allowExcessivelyViolentUsage", "violentUssageName"),
    "sexual use": ("allowExcessivelySexualUsage", "sexualUssageName"),
    "political or religious use": ("allowPoliticalOrReligiousUsage",),
    "antisocial use": ("allowAntisocialOrHateUsage",),
}
_LONGEST = 200  # maximum number of characters of a property


def with_vrm(file: NodeFile, source: Source) -> NodeFile:
    """Return a file with the humanoid, expressions, constraints and springs of its extensions."""
    given, old = file.extensions, None
    ends: Mapping[int, Floats] = {}
    file = replace(
        file,
        constraints=read_constraints(file.tree, source),
        named_nodes=_named_nodes(given, file.tree.n_nodes),
    )
    version = next((n for n in (1, 0) if isinstance(given.get(_KEYS[n]), dict)), None)
    if version == 0:
        old = upgrade(file, source)
        # Springs of a 0.x file are those of its ``secondaryAnimation``.
        replaced = ("VRM", "VRMC_springBone")
        others = {name: told for name, told in given.items() if name not in replaced}
        unused = ["VRMC_springBone"] if "VRMC_springBone" in given else []
        file = replace(
            file,
            extensions={**others, **old.extensions},
            toon=old.toon,
            old_members=(*old.lost, *unused),
        )
        ends = old.ends
    file = replace(file, springs=read_springs(file, source, ends))
    if version is None:
        return replace(file, facts=_contents(file))
    told, pointer = given[_KEYS[version]], f"/extensions/{_KEYS[version]}"
    check_character(source, given, version, file.tree.parents)
    humanoid = read_humanoid(source, file, told, version, pointer)
    if old is None:
        kinds = [part(told, "expressions", kind) for kind in ("preset", "custom")]
        items = [item for kind in kinds if isinstance(kind, dict) for item in kind.items()]
        named = [NamedExpression(str(n), "", one, []) for n, one in items if isinstance(one, dict)]
        at = f"{pointer}/expressions"
    else:
        named, at = old.expressions, f"{pointer}/blendShapeMaster/blendShapeGroups"
    expressions = _expressions(source, file, named, at)
    views = {**_read_part_views(file, told, version, pointer, source), **file.part_views}
    file = replace(file, humanoid=humanoid, expressions=expressions, part_views=views)
    return replace(file, facts=(*_facts(told), *_contents(file)))


def _named_nodes(extensions: Mapping[str, object], n_nodes: int) -> frozenset[int]:
    """Return all nodes that ``VRM``, ``VRMC_vrm`` and ``VRMC_springBone`` of the root name."""
    found: set[int] = set()
    stack: list[object] = [extensions.get(name) for name in ("VRM", "VRMC_vrm", "VRMC_springBone")]
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


def _expressions(
    source: Source, file: NodeFile, named: list[NamedExpression], pointer: str
) -> tuple[NodeExpression, ...]:
    """Return the expressions that change shapes or materials; report changes without effect."""
    found, undrawn = [], list[str]()
    for each in named:
        binds = _binds(source, file, each.told, pointer)
        changes, lost = modern_binds(each.told, len(file.materials))
        undrawn += [f"{each.name}: {one}" for one in (*each.undrawn, *lost)]
        if not binds and not changes:
            continue
        effects = {kind: each.told.get(key) for kind, key in _OVERRIDES.items()}
        known = {
            kind: effect if effect in OVERRIDES else "none" for kind, effect in effects.items()
        }
        kinds = (kind for kind, names in PROCEDURAL.items() if each.name in names)
        found.append(
            NodeExpression(
                each.name,
                binds,
                is_binary=each.told.get("isBinary") is True,
                kind=next(kinds, ""),
                overrides=known,
                preset=each.preset,
                materials=tuple(changes),
            )
        )
    if undrawn:
        source.warn(
            "F007.vrm-materials: material changes by expressions have no effect: {names}",
            pointer,
            names=listed(undrawn, 12),
        )
    return tuple(found)


def _binds(
    source: Source, file: NodeFile, told: Mapping[str, object], pointer: str
) -> tuple[tuple[int, int, float], ...]:
    """Return node, morph target and weight of each bind of an expression."""
    binds: list[tuple[int, int, float]] = []
    for each in list_in(told, "morphTargetBinds"):
        node, index, told_weight = (part(each, name) for name in ("node", "index", "weight"))
        weight = None if told_weight is None else value_of(told_weight, 0.0)
        mesh = int(file.tree.meshes[node]) if is_index(node, file.tree.n_nodes) else -1
        n_targets = len(file.meshes[mesh].target_names) if mesh >= 0 else 0
        if not is_index(index, n_targets) or weight is None:
            source.warn(
                "G006.bind: expected a morph target and its weight, found target {found}: ignored",
                pointer,
                found=index,
            )
            continue
        binds.append((node, index, weight))
    return tuple(binds)


def _read_part_views(
    file: NodeFile, told: Mapping[str, object], version: int, pointer: str, source: Source
) -> dict[int, PartView]:
    """Return the view in which each annotated mesh is drawn; invalid ones are reported."""
    # Version 0 annotates meshes (``firstPersonFlag: "FirstPersonOnly"``), version 1 nodes.
    annotations = list_in(told, "firstPerson", "meshAnnotations")
    found: dict[int, PartView] = {}
    for index, each in enumerate(annotations):
        view = part(each, "firstPersonFlag" if version == 0 else "type")
        known = _VIEWS.get(view.lower()) if isinstance(view, str) else None
        if version == 0:
            nodes = nodes_with_mesh(file, part(each, "mesh"))
        else:
            node = part(each, "node")
            has_mesh = is_index(node, file.tree.n_nodes) and file.tree.meshes[node] >= 0
            nodes = [node] if has_mesh else []
        if known is None or not nodes:
            at = f"{pointer}/firstPerson/meshAnnotations/{index}"
            source.warn(
                "G006.first-person: expected a mesh and auto, both, thirdPersonOnly or "
                "firstPersonOnly, found {found}: ignored",
                at,
                found=quoted(str(view)),
            )
            continue
        found.update(dict.fromkeys(nodes, known))
    return found


def _facts(told: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """Return the properties of the model for ``viewer info``, each a heading and a text."""
    meta = told.get("meta")
    facts = [("VRM", _shortened(str(told.get("specVersion") or "0.x")))]
    for heading, keys in _META.items():
        value = next((part(meta or {}, key) for key in keys if part(meta or {}, key)), None)
        if value is None and any(part(meta or {}, key) is False for key in keys):
            value = False
        if isinstance(value, bool):
            facts.append((heading, "allowed" if value else "not allowed"))
        elif isinstance(value, list):
            facts.append((heading, _shortened(", ".join(map(str, value)))))
        elif value:
            facts.append((heading, _shortened(str(value))))
    return tuple(facts)


def _contents(file: NodeFile) -> tuple[tuple[str, str], ...]:
    """Return facts about parts that are drawn in only one view, and about constraints."""
    names = file.tree.names
    shown = {f"{each.replace('-', ' ')} only": each for each in ("first-person", "third-person")}
    facts = [
        (heading, ", ".join(part_name(file, node) for node, view in file.part_views.items()
                            if view == wanted))
        for heading, wanted in shown.items()
    ]  # fmt: skip
    facts.append((
        "constraints",
        ", ".join(f"{names[c.joint]} by {names[c.source]} ({c.kind})" for c in file.constraints),
    ))  # fmt: skip
    if (springs := file.springs) is not None:
        counts = (
            (springs.n_chains, "chain"),
            (springs.n_joints, "joint"),
            (springs.colliders.n_colliders, "collider"),
        )
        words = (f"{count} {word}{'s' * (count != 1)}" for count, word in counts if count)
        facts.append(("springs", ", ".join(words)))
    return tuple((heading, _shortened(text)) for heading, text in facts if text)


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


# Constraints

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
