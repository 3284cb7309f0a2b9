"""Nodes of a glTF document: their tree, transforms, scenes, cameras and skins.

A matrix is decomposed into translation, rotation and scale if their product equals it up to
rounding; otherwise, the node keeps the matrix. Invalid cameras are replaced with a warning, because
a figure can be shown without them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from viewer.errors import FormatError
from viewer.formats._scene_graph.content import (
    NodeCamera,
    NodeMesh,
    NodeSkin,
    NodeTree,
)
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element, Table, member_indices, member_rows
from viewer.phrases import counted, listed, quoted, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.hierarchy import cycle_members, roots_of
from viewer.rigs.inspection.faults import UNIT_ROTATION
from viewer.rigs.units import METRES, UNIT_NAMES

_TINY = 1e-12  # minimum length of a quaternion with a direction

# Relative error of T R S compared with the matrix: the rounding of a few products in float32.
_EXACT = 1e-6

# Maximum deviation of the last row of a matrix from 0 0 0 1 that is due to rounding: of nodes, and
# of inverse bind matrices.
_LAST_ROW = 1e-5
_BINDING_LAST_ROW = 1e-4

_ANGLE = math.radians(45.0)  # vertical field of view that replaces an invalid one

_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
_EMPTY = NodeSkin("", np.zeros(0, dtype=np.int32), np.zeros((0, 4, 4)))

Z_TO_Y = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""Rotation of the nodes that convert figures with z up, a quaternion (x, y, z, w)."""


def read_tree(document: Document) -> NodeTree:
    """Return all nodes of a document."""
    table = document.table("nodes")
    for place in range(len(table)):
        if type(table.items[place]) is not dict:
            table[place]  # raises the error for an item that is not an object
    parents = _parents(table)
    translations, rotations, scales, matrices = _transforms(table)
    return NodeTree(
        names=tuple(_names(table)),
        parents=parents,
        translations=translations,
        rotations=rotations,
        scales=scales,
        matrices=matrices,
        meshes=_members(document, "mesh", "meshes"),
        skins=_members(document, "skin", "skins"),
        cameras=_members(document, "camera", "cameras"),
        shape_weights=_weights(table),
        extras=_kept(table, "extras"),
        extensions=_kept(table, "extensions"),
    )


def _names(table: Table) -> list[str]:
    names = [values.get("name", "") for values in table.items]
    if set(map(type, names)) - {str}:
        return [table[place].text("name") for place in range(len(names))]
    return names


def _members(document: Document, name: str, what: str) -> Ints:
    return member_indices(document.table("nodes"), name, len(document.table(what)), what)


def _weights(table: Table) -> dict[int, Any]:
    """Return the morph target weights of the nodes that have any."""
    places = [place for place, values in enumerate(table.items) if "weights" in values]
    return {place: table[place].numbers("weights") for place in places}


def _kept(table: Table, name: str) -> dict[int, Any]:
    """Return the parsed values of a member, for the nodes that have it."""
    return {place: values[name] for place, values in enumerate(table.items) if name in values}


def _parents(table: Table) -> Ints:
    """Return each node's parent: (N,) int32, -1 for a root."""
    count = len(table)
    parents = [-1] * count
    for place, values in enumerate(table.items):
        if "children" not in values:
            continue
        for index, child in enumerate(table[place].indices("children", count, "nodes")):
            if parents[child] == place:
                table[place].warn(
                    "G003.child-twice: node {found} is listed more than once",
                    "children",
                    found=child,
                )
            elif parents[child] >= 0:
                pointer = table[place].at("children", index)
                other = parents[child]
                table.source.refuse(
                    "F002.gltf-parents: expected one parent per node, found node {found} below "
                    "nodes "
                    "{other} and this one",
                    pointer,
                    found=child,
                    other=other,
                )
            else:
                parents[child] = place
    result = np.array(parents, dtype=np.int32)
    _check_cycles(table, result)
    return result


def _check_cycles(table: Table, parents: Ints) -> None:
    """Refuse nodes that are their own ancestors; if errors are only recorded, break the cycles."""
    members = cycle_members(parents)
    left = np.nonzero(members)[0].tolist()
    seen: set[int] = set()
    for first in left:
        if first in seen:
            continue
        cycle = [first]
        while (above := int(parents[cycle[-1]])) != first:
            cycle.append(above)
        seen.update(cycle)
        pointer = table[int(parents[first])].at("children")
        table.source.refuse(
            "F002.gltf-cycle: expected a tree, found a cycle of nodes: {nodes}",
            pointer,
            nodes=listed([*reversed(cycle)]),
        )
        parents[first] = -1


def _transforms(table: Table) -> tuple[Floats, Floats, Floats, dict[int, Floats]]:
    """Return translations, rotations and scales, and matrices that shear, as in ``NodeTree``."""
    count = len(table)
    translations, scales = np.zeros((count, 3)), np.ones((count, 3))
    rotations = np.tile(_NO_ROTATION, (count, 1))
    for name, rows in (("translation", translations), ("scale", scales)):
        places, values = member_rows(table, name, 3)
        rows[places] = values
    places, values = member_rows(table, "rotation", 4)
    rotations[places] = _unit(table, places, values)
    places, columns = member_rows(table, "matrix", 16)
    if not len(places):
        return translations, rotations, scales, {}
    for place in places.tolist():
        others = {"translation", "rotation", "scale"} & table.items[place].keys()
        if others:
            table[place].warn(
                "G003.matrix-and: matrix used, {names} ignored",
                "matrix",
                names=listed(sorted(others)),
            )
    matrices = columns.reshape(-1, 4, 4).transpose(0, 2, 1)
    odd = (np.abs(matrices[:, 3] - (0.0, 0.0, 0.0, 1.0)) > _LAST_ROW).any(axis=1)
    if odd.any():
        first = int(odd.argmax())
        row = " ".join(f"{value:g}" for value in matrices[first, 3])
        raise table[int(places[first])].fault(
            "F002.gltf-affine: expected 0 0 0 1 as the last row, found {found}", "matrix", found=row
        )
    turned, stretched, is_exact = _decomposed(matrices[:, :3, :3])
    exact, left = places[is_exact], places[~is_exact]
    translations[exact] = matrices[is_exact, :3, 3]
    rotations[exact], scales[exact] = turned[is_exact], stretched[is_exact]
    translations[left], rotations[left], scales[left] = 0.0, _NO_ROTATION, 1.0
    sheared = matrices[~is_exact]
    sheared[:, 3] = 0.0, 0.0, 0.0, 1.0
    return translations, rotations, scales, dict(zip(left.tolist(), sheared, strict=True))


def _unit(table: Table, places: Ints, rotations: Floats) -> Floats:
    """Return quaternions of unit length; those without a direction become the identity."""
    lengths = np.linalg.norm(rotations, axis=1)
    odd = np.abs(lengths - 1.0) > UNIT_ROTATION
    if odd.any():
        first = int(odd.argmax())
        pointer = table[int(places[first])].at("rotation")
        n = int(odd.sum())
        table.source.warn(
            "G003.rotation: {n} not of unit length (first: {found}): normalised",
            pointer,
            n=counted(n, "rotation"),
            found=rounded(float(lengths[first]), 6),
        )
    is_zero = lengths < _TINY
    rotations = np.where(is_zero[:, None], _NO_ROTATION, rotations)
    return rotations / np.where(is_zero, 1.0, lengths)[:, None]


def _decomposed(linear: Floats) -> tuple[Floats, Floats, np.ndarray]:
    """Return rotations (N, 4), scales (N, 3), x < 0 for a reflection, and which are exact."""
    scales = np.linalg.norm(linear, axis=1)
    scales[:, 0] *= np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)
    # Columns of length 0 are replaced so that the matrix is a rotation.
    columns = linear / np.where(scales == 0.0, 1.0, scales)[:, None, :]
    turns, _ = nearest_rotations(columns)
    rotations = matrix_to_quaternion(turns)
    again = quaternion_to_matrix(rotations) * scales[:, None, :]
    sizes = np.abs(linear).max(axis=(1, 2))
    is_exact = np.abs(again - linear).max(axis=(1, 2)) <= _EXACT * sizes
    return rotations, scales, is_exact


def in_own_axes(
    tree: NodeTree, roots: tuple[int, ...], moved: AbstractSet[int]
) -> tuple[NodeTree, tuple[int, ...], Up, str]:
    """Return the nodes of a file of this program without those that only convert to metres, y up.

    Such nodes are the topmost ones of figures that were written from other axes or units (see
    ``viewer.exporters.gltf.nodes``). The up axis and the unit from which they convert are returned
    with the nodes; ``"y"`` and ``"m"`` with all nodes unless every figure has the same. Nodes in
    ``moved`` are animated.
    """
    kept: tuple[NodeTree, tuple[int, ...], Up, str] = tree, roots, "y", "m"
    skinned = (tree.meshes >= 0) & (tree.skins >= 0)
    tops = [root for root in roots if not skinned[root]]
    if (tree.cameras >= 0).any() or not moved.isdisjoint(tops):
        return kept
    # Among several figures, a node with the figure's name may be above.
    nodes = [_below_bare(tree, top) for top in tops]
    found = {_conversion(tree, node) for node in nodes}
    own = found.pop() if len(found) == 1 and moved.isdisjoint(nodes) else None
    if own is None:
        return kept
    is_freed = np.isin(tree.parents, nodes)
    freed = replace(tree, parents=np.where(is_freed, -1, tree.parents).astype(np.int32))
    shown = (root for root in roots if skinned[root])
    return freed, (*np.flatnonzero(is_freed).tolist(), *shown), *own


def _below_bare(tree: NodeTree, node: int) -> int:
    """Return the only child of a node that does nothing but name it; other nodes themselves."""
    below = np.flatnonzero(tree.parents == node)
    is_bare = len(below) == 1 and _does_only(tree, node, _NO_ROTATION, 1.0)
    return int(below[0]) if is_bare else node


def _conversion(tree: NodeTree, node: int) -> tuple[Up, str] | None:
    """Return the up axis and unit from which a node without other contents converts, if it does."""
    names = tree.names[node].split(", ")
    up: Up = "z" if names[0] == "z up" else "y"
    units = [unit for unit, name in UNIT_NAMES.items() if name in names] or ["m"]
    if len(names) != (up == "z") + (units[0] != "m"):
        return None
    rotation = Z_TO_Y if up == "z" else _NO_ROTATION
    return (up, units[0]) if _does_only(tree, node, rotation, METRES[units[0]]) else None


def _does_only(tree: NodeTree, node: int, rotation: Sequence[float], scale: float) -> bool:
    """Return whether a node only rotates and scales what is below it."""
    transform = np.concatenate([tree.translations[node], tree.rotations[node], tree.scales[node]])
    expected = np.concatenate([np.zeros(3), rotation, np.full(3, scale)])
    if node in tree.matrices or node in tree.extras or node in tree.extensions:
        return False
    return tree.meshes[node] < 0 and bool(np.allclose(transform, expected, 1e-6, 0.0))


def shown_roots(document: Document, tree: NodeTree) -> tuple[int, ...]:
    """Return the root nodes of the default scene or the first one; all if there are no scenes."""
    scenes = document.table("scenes")
    default = document.root.index("scene", len(scenes), "scenes")
    every = tuple(np.nonzero(tree.parents < 0)[0].tolist())
    if not len(scenes):
        return every
    scene = scenes[max(default, 0)]
    nodes = scene.indices("nodes", tree.n_nodes, "nodes")
    children = [node for node in nodes if tree.parents[node] >= 0]
    if children:
        scene.warn(
            "G003.scene-child: {n} not a root (first: node {found}): shown from the root",
            "nodes",
            n=counted(len(children), "node", "is", "are"),
            found=children[0],
        )
    # Transforms of the ancestors apply, so the tree is shown from its root.
    roots = tuple(dict.fromkeys(roots_of(tree.parents)[nodes].tolist()))
    if len(scenes) > 1 and roots:
        name = scene.text("name") or str(max(default, 0))
        document.root.warn(
            "F007.gltf-scenes: {n} scenes: only {found} is shown",
            "scenes",
            n=len(scenes),
            found=quoted(name),
        )
    if not roots and every:
        scene.warn("F007.gltf-empty-scene: no nodes in the scene: all nodes are shown")
    return roots or every


def shown_scene(document: Document) -> Json:
    """Return the name and the application data of the default scene or the first one."""
    scenes = document.table("scenes")
    if not len(scenes):
        return {}
    scene = scenes[max(document.root.index("scene", len(scenes), "scenes"), 0)]
    name, extras = scene.text("name"), scene.values.get("extras")
    return ({"name": name} if name else {}) | ({} if extras is None else {"extras": extras})


def read_cameras(document: Document) -> tuple[NodeCamera, ...]:
    """Return all cameras; an invalid camera gets a default field of view, with a warning."""
    table = document.table("cameras")
    cameras = []
    for index in range(len(table)):
        try:
            cameras.append(_camera(table[index]))
        except FormatError as problem:
            # A figure can be shown without the file's camera.
            pointer = problem.diagnostic.pointer
            table.source.warn(
                "G003.camera: {problem}: default lens used",
                pointer,
                problem=problem.diagnostic.message,
            )
            cameras.append(NodeCamera("", _ANGLE))
    return tuple(cameras)


def _camera(camera: Element) -> NodeCamera:
    name = camera.text("name")
    kind = camera.choice("type", ("perspective", "orthographic"))
    lens = camera.part(kind)
    if lens is None:
        raise camera.wrong(kind, "an object")
    if kind == "orthographic":
        height = abs(lens.number("ymag")) * 2.0
        width = abs(lens.number("xmag")) * 2.0
        return NodeCamera(name, None, width / height if height else None, height)
    angle = lens.number("yfov")
    if not 0.0 < angle < math.pi:
        raise lens.wrong("yfov", "an angle between 0 and pi")
    aspect, near, far = (_positive(lens, each) for each in ("aspectRatio", "znear", "zfar"))
    far = None if near is not None and far is not None and far <= near else far
    return NodeCamera(name, angle, aspect, near=near, far=far)


def _positive(lens: Element, name: str) -> float | None:
    """Return a number above 0; None if it is missing or not above 0."""
    found = lens.number(name) if lens.has(name) else 0.0
    return found if found > 0.0 else None


def read_skins(document: Document) -> tuple[NodeSkin, ...]:
    """Return all skins."""
    table = document.table("skins")
    skins = (partial(_skin, document, table, index) for index in range(len(table)))
    return tuple(document.kept(skin, _EMPTY) for skin in skins)


def _skin(document: Document, table: Table, index: int) -> NodeSkin:
    skin = table[index]
    n_nodes = len(document.table("nodes"))
    joints = skin.indices("joints", n_nodes, "nodes")
    if not joints:
        if not skin.has("joints"):
            raise skin.wrong("joints", "a list of nodes")
        skin.warn("G004.no-joints: skin without joints: not used", "joints")
        return _EMPTY
    if len(set(joints)) != len(joints):
        skin.warn(
            "G004.joint-twice: {n} listed more than once",
            "joints",
            n=counted(len(joints) - len(set(joints)), "joint", "is", "are"),
        )
    root = skin.values.get("skeleton", 0)
    if type(root) is not int or not 0 <= root < n_nodes:
        skin.warn(
            "G004.skeleton: expected the index of a node, found {found}: ignored",
            "skeleton",
            found=str(root)[:20],
        )
    matrices = _inverse_bind(document, skin, len(joints))
    return NodeSkin(skin.text("name"), np.array(joints, dtype=np.int32), matrices)


def _inverse_bind(document: Document, skin: Element, n_joints: int) -> Floats:
    """Return one matrix per joint; identities if there are none."""
    name = "inverseBindMatrices"
    accessor = skin.index(name, len(document.accessors), "accessors")
    if accessor < 0:
        return np.tile(np.eye(4), (n_joints, 1, 1))
    found = document.accessors.count(accessor)
    if found < n_joints:
        raise skin.fault(
            "F002.gltf-bind-count: expected {expected}, one per joint, found {found}",
            name,
            expected=counted(n_joints, "matrix"),
            found=found,
        )
    if found > n_joints:
        skin.warn(
            "G004.bind-count: expected {expected}, one per joint, found {found}: the rest ignored",
            name,
            expected=counted(n_joints, "matrix"),
            found=found,
        )
    matrices = document.accessors.matrices(accessor, skin.at(name))[:n_joints]
    is_finite = np.isfinite(matrices).all(axis=(1, 2))
    if not is_finite.all():
        raise skin.fault(
            "F003.gltf-bind: joint {joint}: expected a finite inverse bind matrix, found a "
            "non-finite one",
            name,
            joint=int((~is_finite).argmax()),
        )
    odd = (np.abs(matrices[:, 3] - (0.0, 0.0, 0.0, 1.0)) > _BINDING_LAST_ROW).any(axis=1)
    if odd.any():
        joint = int(odd.argmax())
        row = " ".join(f"{value:g}" for value in matrices[joint, 3])
        raise skin.fault(
            "F002.gltf-bind-row: joint {joint}: expected 0 0 0 1 as the last row, found {found}",
            name,
            joint=joint,
            found=row,
        )
    matrices[:, 3] = 0.0, 0.0, 0.0, 1.0
    return matrices


def checked_bindings(
    document: Document,
    tree: NodeTree,
    meshes: tuple[NodeMesh, ...],
    skins: tuple[NodeSkin, ...],
) -> tuple[NodeMesh, ...]:
    """Return the meshes; joints that a skin lacks are refused, or get weight 0 if only recorded."""
    limits: dict[int, tuple[int, int]] = {}
    for node in np.nonzero((tree.meshes >= 0) & (tree.skins >= 0))[0].tolist():
        mesh, skin = int(tree.meshes[node]), int(tree.skins[node])
        count = len(skins[skin].joints)
        limits[mesh] = min(limits.get(mesh, (count, skin)), (count, skin))
    result = list(meshes)
    for mesh, (count, skin) in limits.items():
        primitives = []
        for primitive in meshes[mesh].primitives:
            joints, weights = primitive.joints, primitive.weights
            if joints is None or weights is None or int(joints.max(initial=0)) < count:
                primitives.append(primitive)
                continue
            bad = joints >= count
            vertex, column = (int(axis[0]) for axis in np.nonzero(bad))
            document.source.refuse(
                "W010.gltf-joint: vertex {vertex}: expected a joint index below {joints} (skin "
                "{skin}), found {found}",
                f"{primitive.pointer}/attributes/JOINTS_{column // 4}",
                vertex=vertex,
                found=int(joints[vertex, column]),
                joints=count,
                skin=skin,
            )
            joints, weights = np.where(bad, 0, joints), np.where(bad, 0.0, weights)
            primitives.append(replace(primitive, joints=joints, weights=weights))
        result[mesh] = replace(meshes[mesh], primitives=tuple(primitives))
    return tuple(result)
