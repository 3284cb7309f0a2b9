"""Hand-made contents of node files, and an evaluator that follows the glTF definition."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from builders import quaternion_matrix

from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeSkin, NodeTree, Primitive
from viewer.formats._source import Source

Local = Mapping[int, np.ndarray]


def tree_of(*nodes: dict[str, Any]) -> NodeTree:
    """Return a tree of nodes described with the keys of glTF, and ``parent``."""

    def column(key: str, default: object) -> np.ndarray:
        return np.array([node.get(key, default) for node in nodes])

    rotations = column("rotation", [0.0, 0.0, 0.0, 1.0]).astype(float)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    return NodeTree(
        names=tuple(node.get("name", f"n{index}") for index, node in enumerate(nodes)),
        parents=column("parent", -1).astype(np.int32),
        translations=column("translation", [0.0] * 3).astype(float),
        rotations=rotations,
        scales=column("scale", [1.0] * 3).astype(float),
        meshes=column("mesh", -1).astype(np.int32),
        skins=column("skin", -1).astype(np.int32),
        cameras=column("camera", -1).astype(np.int32),
        matrices={n: np.array(node["matrix"]) for n, node in enumerate(nodes) if "matrix" in node},
        shape_weights={
            n: np.array(node["weights"]) for n, node in enumerate(nodes) if "weights" in node
        },
    )


def triangle(seed: int, n_joints: int = 0, n_influences: int = 3, **more: Any) -> Primitive:
    """Return a triangle with random vertices, and random influences if there are joints."""
    random = np.random.default_rng(seed)
    skinned: dict[str, Any] = {}
    if n_joints:
        joints = random.integers(n_joints, size=(3, n_influences)).astype(np.int32)
        weights = random.random((3, n_influences))
        skinned = {"joints": joints, "weights": weights / weights.sum(axis=1, keepdims=True)}
    return Primitive(
        positions=random.normal(size=(3, 3)),
        triangles=np.array([[0, 1, 2]], dtype=np.int32),
        **({"normals": np.tile([0.0, 0.0, 1.0], (3, 1))} | skinned | more),
    )


def mesh(*primitives: Primitive, name: str = "mesh", **more: Any) -> NodeMesh:
    """Return a mesh."""
    return NodeMesh(name, primitives, **more)


def affine(seed: int, shift: float = 1.0) -> np.ndarray:
    """Return a random affine matrix, which shears."""
    random = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] += 0.4 * random.normal(size=(3, 3))
    matrix[:3, 3] = shift * random.normal(size=3)
    return matrix


def skin(joints: list[int], seed: int) -> NodeSkin:
    """Return a skin with random inverse bind matrices."""
    inverse = np.stack([affine(seed + number) for number in range(len(joints))])
    return NodeSkin("skin", np.array(joints, dtype=np.int32), inverse)


def file_of(tree: NodeTree, **more: Any) -> NodeFile:
    """Return a file whose scene contains all root nodes."""
    roots = tuple(np.flatnonzero(tree.parents < 0).tolist())
    return NodeFile("hero", tree, roots, **more)


def source() -> Source:
    """Return a source, which records notes."""
    return Source("hero.glb", data=b"")


def local(tree: NodeTree, node: int, turn: np.ndarray | None = None) -> np.ndarray:
    """Return the local matrix T R S of a node, with an additional rotation before S."""
    if node in tree.matrices:
        return tree.matrices[node]
    matrix = np.eye(4)
    turned = quaternion_matrix(tree.rotations[node]) @ (np.eye(3) if turn is None else turn)
    matrix[:3, :3] = turned @ np.diag(tree.scales[node])
    matrix[:3, 3] = tree.translations[node]
    return matrix


def world(tree: NodeTree, node: int, moved: Local) -> np.ndarray:
    """Return the products of local matrices from the root down; ``moved`` replaces some of them."""
    own = moved[node] if node in moved else local(tree, node)
    parent = int(tree.parents[node])
    return own if parent < 0 else world(tree, parent, moved) @ own


def _below(tree: NodeTree, node: int) -> list[int]:
    children = np.flatnonzero(tree.parents == node).tolist()
    return [node, *(deeper for child in children for deeper in _below(tree, child))]


def vertices(file: NodeFile, moved: Local | None = None, morphs: Local | None = None) -> np.ndarray:
    """Return all vertices of the scene, mesh by mesh in tree order (glTF 2.0, 3.7).

    Skinned: sum_w w world(joint) IBM (p + morphs), without the mesh node's transform; others:
    world(node) p.
    """
    tree, moved, found = file.tree, moved or {}, []
    for node in (n for root in file.roots for n in _below(tree, root)):
        if tree.meshes[node] < 0:
            continue
        whole = file.meshes[tree.meshes[node]]
        weights = (morphs or {}).get(node, tree.shape_weights.get(node, whole.shape_weights))
        for primitive in whole.primitives:
            points = np.array(primitive.positions)
            targets = () if primitive.targets is None else primitive.targets.dense()
            for weight, target in zip(weights, targets, strict=False):
                points = points + weight * target
            for vertex, point in enumerate(np.c_[points, np.ones(len(points))]):
                found.append(_moved(file, node, primitive, vertex, moved) @ point)
    return np.array(found)[:, :3]


def _moved(
    file: NodeFile, node: int, primitive: Primitive, vertex: int, moved: Local
) -> np.ndarray:
    tree = file.tree
    if tree.skins[node] < 0 or primitive.joints is None:
        return world(tree, node, moved)
    bound = file.skins[tree.skins[node]]
    total = np.zeros((4, 4))
    weights = primitive.weights[vertex]
    for joint, weight in zip(primitive.joints[vertex], weights / weights.sum(), strict=True):
        total += weight * world(tree, int(bound.joints[joint]), moved) @ bound.inverse_bind[joint]
    return total
