"""Vertices of a glTF file, computed from its bytes as the specification defines them. It shares no
code with the viewer and computes in the requested precision.
"""

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from builders import quaternion_matrix

FORMATS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Evaluator:
    """A file of triangles; extensions are ignored."""

    def __init__(self, path: Path, precision: type = np.float64) -> None:
        self.precision, self.path = precision, path
        data = path.read_bytes()
        self.binary = b""
        if data[:4] == b"glTF":
            (size,) = struct.unpack_from("<I", data, 12)
            self.binary, data = data[28 + size :], data[20 : 20 + size]
        self.root: dict[str, Any] = json.loads(data, parse_constant=lambda word: 1 / 0)
        self.nodes = self.root["nodes"]
        children = ((n, c) for n, node in enumerate(self.nodes) for c in node.get("children", ()))
        self.parents = {child: node for node, child in children}

    # Arrays

    def buffer_bytes(self, index: int) -> bytes:
        uri = self.root["buffers"][index].get("uri")
        if uri is None:
            return self.binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        return (self.path.parent / unquote(uri, errors="surrogateescape")).read_bytes()

    def array(self, index: int) -> np.ndarray:
        """Return the values of an accessor, (N, C); normalised integers are fractions (3.6.2.2)."""
        item = self.root["accessors"][index]
        kind, width = np.dtype(FORMATS[item["componentType"]]), SIZES[item["type"]]
        rows = np.zeros((item["count"], width), kind)
        if "bufferView" in item:
            rows = self.rows(item, kind, width, item["count"])
        if "sparse" in item:
            sparse, rows = item["sparse"], rows.copy()
            numbers = np.dtype(FORMATS[sparse["indices"]["componentType"]])
            at = self.rows(sparse["indices"], numbers, 1, sparse["count"])[:, 0]
            rows[at] = self.rows(sparse["values"], kind, width, sparse["count"])
        values = rows.astype(self.precision)
        if item.get("normalized"):
            most = self.precision(np.iinfo(kind).max)
            values = np.maximum(values / most, self.precision(-1))
        return values

    def rows(self, item: dict[str, Any], kind: np.dtype, width: int, count: int) -> np.ndarray:
        view = self.root["bufferViews"][item["bufferView"]]
        start = view.get("byteOffset", 0) + item.get("byteOffset", 0)
        strides = (view.get("byteStride", width * kind.itemsize), kind.itemsize)
        return np.ndarray((count, width), kind, self.buffer_bytes(view["buffer"]), start, strides)

    def picture(self, index: int) -> bytes:
        view = self.root["bufferViews"][self.root["images"][index]["bufferView"]]
        start = view.get("byteOffset", 0)
        return self.buffer_bytes(view["buffer"])[start : start + view["byteLength"]]

    # Posing

    def key_times(self, animation: int) -> np.ndarray:
        """Return the times of all keys of an animation in ascending order."""
        samplers = self.root["animations"][animation]["samplers"]
        return np.unique(np.concatenate([self.array(each["input"])[:, 0] for each in samplers]))

    def posed(self, animation: int | None, time: float) -> list[dict[str, Any]]:
        """Return the nodes with their animated members replaced."""
        nodes = [dict(node) for node in self.nodes]
        if animation is None:
            return nodes
        played = self.root["animations"][animation]
        for channel in played["channels"]:
            sampler, target = played["samplers"][channel["sampler"]], channel["target"]
            times = self.array(sampler["input"])[:, 0]
            kind = sampler.get("interpolation", "LINEAR")
            values = self.array(sampler["output"])
            shape = (len(times), 3, -1) if kind == "CUBICSPLINE" else (len(times), -1)
            turns = target["path"] == "rotation"
            value = self.sampled(times, values.reshape(shape), kind, turns, self.precision(time))
            nodes[target["node"]][target["path"]] = value
        return nodes

    def sampled(
        self, times: np.ndarray, values: np.ndarray, kind: str, turns: bool, time: Any
    ) -> np.ndarray:
        """Return a value between keys (appendix C)."""
        row = int(np.searchsorted(times, time, side="right")) - 1
        points = values[:, 1] if kind == "CUBICSPLINE" else values
        if row < 0 or row == len(times) - 1 or kind == "STEP":
            return points[max(row, 0)]
        step = times[row + 1] - times[row]
        t = (time - times[row]) / step
        a, b = points[row], points[row + 1]
        if kind == "LINEAR" and not turns:
            return a + t * (b - a)
        if kind == "LINEAR":
            return self.slerp(a / np.linalg.norm(a), b / np.linalg.norm(b), t)
        value = (2 * t**3 - 3 * t**2 + 1) * a + step * (t**3 - 2 * t**2 + t) * values[row, 2]
        value += (3 * t**2 - 2 * t**3) * b + step * (t**3 - t**2) * values[row + 1, 0]
        return value / np.linalg.norm(value) if turns else value

    def slerp(self, a: np.ndarray, b: np.ndarray, t: Any) -> np.ndarray:
        """Return a rotation on the shorter arc, using the unit quaternion orthogonal to a."""
        b = b if a @ b >= 0 else -b
        aside = b - (a @ b) * a
        length = np.linalg.norm(aside)
        if length == 0:
            return a
        angle = t * np.arctan2(length, a @ b)
        return np.cos(angle) * a + np.sin(angle) * aside / length

    def local(self, node: dict[str, Any]) -> np.ndarray:
        """Return the local matrix of a node, as given or as T R S."""
        if "matrix" in node:
            return np.array(node["matrix"], self.precision).reshape(4, 4).T
        quaternion = np.array(node.get("rotation", (0, 0, 0, 1)), self.precision)
        turn = quaternion_matrix(quaternion / np.linalg.norm(quaternion))
        whole = np.eye(4, dtype=self.precision)
        scale = np.array(node.get("scale", (1, 1, 1)), self.precision)
        whole[:3, :3] = turn * scale
        whole[:3, 3] = node.get("translation", (0, 0, 0))
        return whole

    def worlds(self, nodes: list[dict[str, Any]]) -> np.ndarray:
        """Return the product of the local matrices from the root down to each node: (N, 4, 4)."""
        found = np.array([self.local(node) for node in nodes])
        for root in (n for n in range(len(nodes)) if n not in self.parents):
            for node in self.below(root)[1:]:
                found[node] = found[self.parents[node]] @ found[node]
        return found

    # Vertices

    def meshes(self, animation: int | None = None, time: float = 0.0) -> list[np.ndarray]:
        """Return the posed vertices of each primitive, in tree order: (V, 3)."""
        nodes, found = self.posed(animation, time), []
        worlds = self.worlds(nodes)
        for index in (n for root in self.scene_roots() for n in self.below(root)):
            node = nodes[index]
            mesh = self.root["meshes"][node["mesh"]] if "mesh" in node else {"primitives": ()}
            weights = node.get("weights", mesh.get("weights", ()))
            for primitive in mesh["primitives"]:
                points = self.array(primitive["attributes"]["POSITION"])
                for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
                    if "POSITION" in target:
                        offset = self.array(target["POSITION"])
                        points = points + self.precision(weight) * offset
                whole = self.moves(worlds, index, primitive["attributes"], len(points))
                moved = np.einsum("vab,vb->va", whole[:, :3, :3], points) + whole[:, :3, 3]
                found.append(moved)
        return found

    def corners(self, animation: int | None = None, time: float = 0.0) -> np.ndarray:
        """Return the corners of all triangles: (3 T, 3)."""
        places, found = [], self.meshes(animation, time)
        for index in (n for root in self.scene_roots() for n in self.below(root)):
            if "mesh" in self.nodes[index]:
                places += self.root["meshes"][self.nodes[index]["mesh"]]["primitives"]
        rows = []
        for points, primitive in zip(found, places, strict=True):
            listed = primitive.get("indices")
            whole = np.arange(len(points)) if listed is None else self.array(listed)[:, 0]
            rows.append(points[whole.astype(int)])
        return np.concatenate(rows)

    def scene_roots(self) -> list[int]:
        return self.root["scenes"][self.root.get("scene", 0)]["nodes"]

    def below(self, node: int) -> list[int]:
        """Return a node and its descendants in preorder."""
        deeper = (self.below(child) for child in self.nodes[node].get("children", ()))
        return [node, *(each for nodes in deeper for each in nodes)]

    def moves(
        self, worlds: np.ndarray, index: int, attributes: dict[str, int], count: int
    ) -> np.ndarray:
        """Return the matrix of each vertex, with weights divided by their sum: (V, 4, 4)."""
        if "skin" not in self.nodes[index]:
            return np.broadcast_to(worlds[index], (count, 4, 4))
        skin = self.root["skins"][self.nodes[index]["skin"]]
        palette = worlds[skin["joints"]]
        if "inverseBindMatrices" in skin:
            bound = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            palette = palette @ bound.transpose(0, 2, 1)
        sets = sum(name.startswith("JOINTS_") for name in attributes)
        joints = [self.array(attributes[f"JOINTS_{n}"]).astype(int) for n in range(sets)]
        weights = np.hstack([self.array(attributes[f"WEIGHTS_{n}"]) for n in range(sets)])
        weights = weights / weights.sum(axis=1, keepdims=True)
        return np.einsum("vk,vkab->vab", weights, palette[np.hstack(joints)])
