"""Contents of a written glTF file, read by the program's own reader, in every frame of a motion.

Joints and vertices are returned in the figure's space, below the node that rotates and scales the
whole figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.export._losses.posed_bodies import Body, Poses, Rows, Side
from viewer.export.gltf.mesh import Part
from viewer.export.gltf.nodes import Tree
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeTree
from viewer.formats.gltf.document import Document, open_document, parsed_json
from viewer.formats.gltf.nodes import read_tree
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.kinematics import joint_worlds
from viewer.rig.skin import Skin, influence_counts, skin_from_entries

Keys: TypeAlias = dict[tuple[int, str], Floats]
"""Animated values by node and path, one row per frame."""
_ANY = ("SCALAR", "VEC2", "VEC3", "VEC4", "MAT4")


class GltfFile:
    """A written file.

    ``files``: bytes of a ``.glb``, or of a ``.gltf`` and its buffer, if it has one. ``unplaced``:
    nodes whose matrices are ignored, as errors are measured in the space of each figure.
    """

    def __init__(self, path: Path, files: Sequence[bytes], unplaced: Sequence[int] = ()) -> None:
        source, (first, *others) = Source(path, files[0]), files
        if first[:4] == b"glTF":
            self._document = open_document(source)
        else:
            root = parsed_json(source, first, has_lines=True)
            for buffer in root.get("buffers", ()):
                del buffer["uri"]
            self._document = Document(source, root, memoryview(b"".join(others)))
            self._document.buffers.n_bytes_read += sum(map(len, others))
        self.root: dict[str, Any] = self._document.root.values
        for node in unplaced:
            del self.root["nodes"][node]["matrix"]
        self.tree = read_tree(self._document)

    def floats(self, accessor: int) -> Floats:
        """Return an array, normalised integers as fractions: (N, components)."""
        return self._document.accessors.floats(accessor, _ANY, "")

    def integers(self, accessor: int) -> NDArray[np.int64]:
        """Return an array of whole numbers: (N, components)."""
        return self._document.accessors.integers(accessor, _ANY, "")

    def matrices(self, accessor: int) -> Floats:
        """Return an array of matrices: (N, 4, 4)."""
        return self._document.accessors.matrices(accessor, "")


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A mesh in a file, and the figure's vertices in it."""

    node: int
    """Its node."""
    part: Part
    """The part from which it was written."""
    decoding: Floats = field(default_factory=lambda: np.eye(4))
    """(4, 4): from positions in the file, which may be quantised, to the figure's."""


def read_back(
    file: GltfFile,
    tree: Tree,
    meshes: list[Placed],
    figure: Figure,
    targets: Rows,
    keys: Keys,
    start: int = 0,
    sets: int | None = None,
) -> Side:
    """Return the contents of a file in a form that can be compared with the figure."""
    nodes, parents = file.root["nodes"], file.tree.parents
    n_joints = len(tree.joints)
    bound = np.tile(np.eye(4), (n_joints + 1, 1, 1))
    joints = [*tree.joints, len(nodes) if tree.place < 0 else tree.place]
    if figure.skin is not None and n_joints:
        bound[:-1] = figure.skin.inverse_bind
    for placed in meshes:
        item = nodes[placed.node]
        if "skin" in item:
            skin = file.root["skins"][item["skin"]]
            stored = file.matrices(skin["inverseBindMatrices"])
            bound[: len(stored)] = stored @ np.linalg.inv(placed.decoding)
            joints[: len(skin["joints"])] = skin["joints"]
        elif placed.part.joint < 0:
            joints[-1] = placed.node
            bound[-1] = np.linalg.inv(placed.decoding)
    body, morphs = None, np.zeros((1, 0))
    if meshes:
        body, morphs = _body(file, meshes, keys, bound, targets, sets)

    def poses(rows: Rows) -> Poses:
        world = _world(file.tree, keys, rows - start)
        world = np.concatenate([world, np.broadcast_to(np.eye(4), (len(rows), 1, 4, 4))], axis=1)
        above = parents[tree.place] if tree.place >= 0 else -1
        if above >= 0:
            world = np.linalg.inv(world[:, above : above + 1]) @ world
        places = world[:, tree.joints][..., :3, 3]
        weights = morphs if len(morphs) == 1 else morphs[rows - start]
        still = np.zeros((len(rows), 3))
        return Poses(places, world[:, joints] @ bound, still, weights, np.zeros((len(rows), 0)))

    return Side(body, poses)


def frame_keys(file: GltfFile) -> Keys:
    """Return the animated values of a file with one key per frame."""
    found: Keys = {}
    for animation in file.root.get("animations", ()):
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            count = len(file.floats(sampler["input"]))
            values = file.floats(sampler["output"]).reshape(count, -1)
            target = channel["target"]
            found[target["node"], target["path"]] = values
    return found


def _world(tree: NodeTree, keys: Keys, rows: Rows) -> Floats:
    """Return the global matrices of all nodes: (F, N, 4, 4)."""
    still = {
        "translation": tree.translations,
        "rotation": tree.rotations,
        "scale": tree.scales,
    }
    parts = {path: np.repeat(values[:, None], len(rows), axis=1) for path, values in still.items()}
    for (node, path), moved in keys.items():
        if path in parts:
            parts[path][node] = moved[rows]
    rotations = parts["rotation"] / np.linalg.norm(parts["rotation"], axis=-1, keepdims=True)
    linear = quaternion_to_matrix(rotations) * parts["scale"][..., None, :]
    return joint_worlds(
        tree.parents, np.swapaxes(linear, 0, 1), np.swapaxes(parts["translation"], 0, 1)
    )


def _body(
    file: GltfFile,
    meshes: list[Placed],
    keys: Keys,
    bound: Floats,
    changing: Rows,
    sets: int | None,
) -> tuple[Body, Floats]:
    """Return all meshes in the shape of the first frame, and the weights that change it: (F, M)."""
    found = [_one_body(file, placed, keys, bound, sets) for placed in meshes]
    positions = np.concatenate([each.positions for each in found])
    skin = _joined([each.skin for each in found], bound)
    count = max((len(each.weights) for each in found), default=1)
    weights = np.zeros((count, len(changing)))
    shapes = np.zeros((len(changing), len(positions), 3))
    first = 0
    for placed, each in zip(meshes, found, strict=True):
        rows = slice(first, first + len(each.positions))
        first = rows.stop
        for column, target in enumerate(changing.tolist()):
            for own in np.flatnonzero(placed.part.targets == target).tolist():
                shapes[column, rows] = each.targets[own]
                weights[:, column] = each.weights[:, own] - each.weights[0, own]
    return Body(positions, skin, shapes if len(changing) else None), weights


@dataclass(frozen=True, slots=True, eq=False)
class _OneBody:
    """One mesh: positions (V, 3) in the first frame, skin, targets (S, V, 3), weights (F, S)."""

    positions: Floats
    skin: Skin
    targets: Floats
    weights: Floats


def _one_body(
    file: GltfFile, placed: Placed, keys: Keys, bound: Floats, sets: int | None
) -> _OneBody:
    mesh = file.root["meshes"][file.root["nodes"][placed.node]["mesh"]]
    primitive = mesh["primitives"][0]  # all primitives share their vertices
    attributes = primitive["attributes"]
    positions = file.floats(attributes["POSITION"])
    weights = np.zeros((1, 0))
    directions = np.zeros((0, *positions.shape))
    targets = [file.floats(target["POSITION"]) for target in primitive.get("targets", ())]
    if targets:
        directions = np.stack(targets)
        weights = keys.get((placed.node, "weights"), np.array([mesh["weights"]], dtype=np.float64))
        positions = positions + np.einsum("s,sva->va", weights[0], directions)
    joint = placed.part.joint
    # The comparison is in binding space.
    space = placed.decoding if joint < 0 else np.linalg.inv(bound[joint])
    if not np.array_equal(space, np.eye(4)):
        positions = apply_transform(space, positions)
        directions = directions @ space[:3, :3].T
    count = len(positions)
    names = sorted(name for name in attributes if name.startswith("JOINTS_"))
    numbers = sorted(int(name.split("_")[1]) for name in names)[:sets]
    if numbers:
        slots = np.concatenate([file.integers(attributes[f"JOINTS_{n}"]) for n in numbers], axis=1)
        values = np.concatenate([file.floats(attributes[f"WEIGHTS_{n}"]) for n in numbers], axis=1)
        if sets is not None:
            values = values / values.sum(axis=1, keepdims=True)
        used = values != 0.0
        rows, followed, values = np.nonzero(used)[0], slots[used], values[used]
    else:
        # All vertices follow the node of the mesh.
        rows, values = np.arange(count), np.ones(count)
        followed = np.full(count, joint if joint >= 0 else len(bound) - 1)
    skin = skin_from_entries(count, rows.astype(np.int32), followed.astype(np.int32), values, bound)
    return _OneBody(positions, skin, directions, weights)


def _joined(skins: list[Skin], bound: Floats) -> Skin:
    """Return one skin with the concatenated vertices of several."""
    counts = np.concatenate([influence_counts(skin) for skin in skins])
    return Skin(
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.concatenate([skin.joints for skin in skins]),
        weights=np.concatenate([skin.weights for skin in skins]),
        inverse_bind=bound,
    )
