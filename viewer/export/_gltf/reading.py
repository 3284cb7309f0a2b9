"""Reader of glTF files written here: arrays, nodes in every frame, the mesh and its skin.

Only the output of ``viewer.export.gltf`` is supported: one buffer without strides, and samplers
with one key per frame. Joints and vertices are returned in the figure's space, below the node
that rotates and scales the whole figure.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.export._gltf.nodes import Tree
from viewer.export._losses.skinned import Body, Poses, Rows, Side
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.kinematics import forward_kinematics
from viewer.rig.skin import Skin, skin_from_entries

_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_DEFAULTS = {"translation": (0.0, 0, 0), "rotation": (0.0, 0, 0, 1), "scale": (1.0, 1, 1)}
_HEAD = 12  # bytes before the first chunk of a .glb
_CHUNK = 8  # bytes before a chunk's data


@dataclass(frozen=True, slots=True, eq=False)
class GltfFile:
    """A file's JSON and the bytes of its buffer."""

    root: dict[str, Any]
    buffer: bytes

    def array(self, accessor: int) -> NDArray[Any]:
        """Return an array in its stored type: (N, components)."""
        item = self.root["accessors"][accessor]
        view = self.root["bufferViews"][item["bufferView"]]
        start = view["byteOffset"] + item["byteOffset"]
        count = item["count"] * _SIZES[item["type"]]
        dtype = np.dtype(_TYPES[item["componentType"]])
        return np.frombuffer(self.buffer, dtype, count, start).reshape(item["count"], -1)

    def floats(self, accessor: int) -> Floats:
        """Return an array in double precision."""
        return self.array(accessor).astype(np.float64)


def parsed(files: list[bytes]) -> GltfFile:
    """Return a file from the bytes of a ``.glb``, or of a ``.gltf`` and its buffer."""
    if files[0][:4] != b"glTF":
        return GltfFile(json.loads(files[0]), files[1] if len(files) > 1 else b"")
    (length,) = struct.unpack_from("<I", files[0], _HEAD)
    end = _HEAD + _CHUNK + length
    root = json.loads(files[0][_HEAD + _CHUNK : end])
    return GltfFile(root, files[0][end + _CHUNK :])


def read_back(
    file: GltfFile,
    tree: Tree,
    node: int | None,
    sources: Rows,
    start: int,
    sets: int | None = None,
) -> Side:
    """Return the contents of a file in a form that can be compared with the figure.

    ``file``: the written file.
    ``tree``: indices of the nodes.
    ``node``: index of the mesh's node.
    ``sources`` (M,): indices of the morph targets that change over time.
    ``start``: frame of the figure that is the first in the file.
    ``sets``: number of influence sets to use, normalised to a sum of 1; all if omitted.
    """
    nodes = file.root["nodes"]
    parents = np.full(len(nodes), -1, dtype=np.int32)
    for index, item in enumerate(nodes):
        parents[item.get("children", [])] = index
    keys = _keys(file)
    skinned = node is not None and "skin" in nodes[node]
    bound, joints = np.tile(np.eye(4), (len(tree.joints) + 1, 1, 1)), [*tree.joints, tree.place]
    if skinned and node is not None:
        skin = file.root["skins"][nodes[node]["skin"]]
        stored = file.floats(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        bound[: len(stored)] = stored
        joints[: len(skin["joints"])] = skin["joints"]
    elif node is not None:
        joints[-1] = node
    body, morphs = None, np.zeros((1, 0))
    if node is not None:
        body, morphs = _body(file, node, keys, len(tree.joints), sources, sets)

    def poses(rows: Rows) -> Poses:
        world = _world(nodes, parents, keys, rows - start)
        above = parents[tree.place]
        if above >= 0:
            world = np.linalg.inv(world[:, above : above + 1]) @ world
        places = world[:, tree.joints][..., :3, 3]
        weights = morphs if len(morphs) == 1 else morphs[rows - start]
        still = np.zeros((len(rows), 3))
        return Poses(places, world[:, joints] @ bound, still, weights, np.zeros((len(rows), 0)))

    return Side(body, poses)


def _keys(file: GltfFile) -> dict[tuple[int, str], Floats]:
    """Return the animated values by node and path, one row per frame."""
    found: dict[tuple[int, str], Floats] = {}
    for animation in file.root.get("animations", ()):
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            count = len(file.array(sampler["input"]))
            values = file.floats(sampler["output"]).reshape(count, -1)
            target = channel["target"]
            found[target["node"], target["path"]] = values
    return found


def _world(
    nodes: list[dict[str, Any]], parents: Ints, keys: dict[tuple[int, str], Floats], rows: Rows
) -> Floats:
    """Return the global matrices of all nodes: (F, N, 4, 4)."""
    parts = {}
    for path, default in _DEFAULTS.items():
        values = np.array([item.get(path, default) for item in nodes], dtype=np.float64)
        parts[path] = np.repeat(values[:, None], len(rows), axis=1)
        for (node, what), moved in keys.items():
            if what == path:
                parts[path][node] = moved[rows]
    local = np.zeros((len(nodes), len(rows), 4, 4))
    local[..., 3, 3] = 1.0
    rotations = parts["rotation"] / np.linalg.norm(parts["rotation"], axis=-1, keepdims=True)
    local[..., :3, :3] = quaternion_to_matrix(rotations) * parts["scale"][..., None, :]
    local[..., :3, 3] = parts["translation"]
    return np.swapaxes(forward_kinematics(parents, local), 0, 1)


def _body(
    file: GltfFile,
    node: int,
    keys: dict[tuple[int, str], Floats],
    n_joints: int,
    changing: Rows,
    sets: int | None,
) -> tuple[Body, Floats]:
    """Return the mesh in the shape of the first frame, and the weights that change it: (F, M)."""
    mesh = file.root["meshes"][file.root["nodes"][node]["mesh"]]
    primitive = mesh["primitives"][0]  # all primitives share their vertices
    attributes = primitive["attributes"]
    positions = file.floats(attributes["POSITION"])
    weights, shapes = np.zeros((1, 0)), None
    targets = [file.floats(target["POSITION"]) for target in primitive.get("targets", ())]
    if targets:
        directions = np.stack(targets)
        weights = keys.get((node, "weights"), np.array([mesh["weights"]], dtype=np.float64))
        positions = positions + np.einsum("s,sva->va", weights[0], directions)
        shapes = directions[changing] if len(changing) else None
        weights = (weights - weights[0])[:, changing]
    return Body(positions, _skin(file, attributes, n_joints, sets), shapes), weights


def _skin(file: GltfFile, attributes: dict[str, int], n_joints: int, sets: int | None) -> Skin:
    """Return the influences of a mesh; an unskinned mesh follows the last joint, its node."""
    count = file.root["accessors"][attributes["POSITION"]]["count"]
    names = sorted(name for name in attributes if name.startswith("JOINTS_"))
    numbers = sorted(int(name.split("_")[1]) for name in names)[:sets]
    bound = np.tile(np.eye(4), (n_joints + 1, 1, 1))
    if not numbers:
        last = np.full(count, n_joints)
        return skin_from_entries(count, np.arange(count), last, np.ones(count), bound)
    joints = np.concatenate([file.array(attributes[f"JOINTS_{n}"]) for n in numbers], axis=1)
    weights = np.concatenate([file.floats(attributes[f"WEIGHTS_{n}"]) for n in numbers], axis=1)
    if sets is not None:
        weights = weights / weights.sum(axis=1, keepdims=True)
    used = weights != 0.0
    rows, _ = np.nonzero(used)
    return skin_from_entries(
        count, rows.astype(np.int32), joints[used].astype(np.int32), weights[used], bound
    )
