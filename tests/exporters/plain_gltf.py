"""A glTF 2.0 file as the exporters must write it, read without code of the viewer.

It checks the rules of the specification and evaluates vertices and joints in double precision.
"""

import json
import math
import struct
from pathlib import Path

import numpy as np
from formats.gltf.spec_evaluator import FORMATS, SIZES, Evaluator

UNIT = 1e-6  # rounding of four single-precision components
SIDES = {"POSITION": "VEC3", "NORMAL": "VEC3", "TEXCOORD_0": "VEC2", "TEXCOORD_1": "VEC2"}


class Gltf(Evaluator):
    """A file that is checked against every rule when it is opened."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        if data[:4] == b"glTF":
            self._check_chunks(data)
        super().__init__(path)
        self.buffer = self.buffer_bytes(0) if "buffers" in self.root else b""
        assert data[:4] == b"glTF" or len(self.buffer) == self._declared(self.root)
        self._check()

    def _check_chunks(self, data: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON" and size % 4 == 0
        text, place = data[20 : 20 + size], 20 + size
        if place < len(data):
            size, kind = struct.unpack_from("<I4s", data, place)
            assert kind == b"BIN\0" and size % 4 == 0 and place + 8 + size == len(data)
            root = json.loads(text)
            assert "uri" not in root["buffers"][0] and 0 <= size - self._declared(root) <= 3

    def _declared(self, root: dict) -> int:
        return root["buffers"][0]["byteLength"] if "buffers" in root else 0

    # Contents of the file

    def accessor(self, index: int) -> np.ndarray:
        """Return an array as it is stored: (N,) for scalars, otherwise (N, components)."""
        item = self.root["accessors"][index]
        view = self.root["bufferViews"][item["bufferView"]]
        kind, width = np.dtype(FORMATS[item["componentType"]]), SIZES[item["type"]]
        assert item["componentType"] in (5121, 5123, 5125, 5126)
        assert (view["byteOffset"] + item.get("byteOffset", 0)) % kind.itemsize == 0
        size = item["count"] * width * kind.itemsize
        assert item["count"] >= 1 and item.get("byteOffset", 0) + size <= view["byteLength"]
        rows = self.rows(item, kind, width, item["count"])
        assert rows.dtype.kind != "f" or np.isfinite(rows).all()
        for name, least in (("min", rows.min(axis=0)), ("max", rows.max(axis=0))):
            assert item.get(name, least.tolist()) == least.tolist()
        return rows[:, 0] if width == 1 else rows

    def named(self, name: str) -> int:
        """Return the only node with this name."""
        (found,) = [n for n, node in enumerate(self.nodes) if node.get("name") == name]
        return found

    @property
    def mesh_node(self) -> int:
        (found,) = [n for n, node in enumerate(self.nodes) if "mesh" in node]
        return found

    @property
    def primitives(self) -> list[dict]:
        return self.root["meshes"][0]["primitives"]

    def triangles(self, primitive: int = 0) -> np.ndarray:
        return self.accessor(self.primitives[primitive]["indices"]).reshape(-1, 3).astype(int)

    def attribute(self, name: str) -> np.ndarray:
        return self.accessor(self.primitives[0]["attributes"][name])

    def duration(self) -> float:
        return max(
            float(self.accessor(sampler["input"])[-1])
            for sampler in self.root["animations"][0]["samplers"]
        )

    # Posing and skinning

    def transforms(self, time: float | None = None) -> list[dict]:
        """Return the local transform of every node, animated if a time is given."""
        return self.posed(None if time is None else 0, time or 0.0)

    def world(self, time: float | None = None) -> np.ndarray:
        """Return the world matrix of every node, (N, 4, 4)."""
        return self.worlds(self.transforms(time))

    def vertices(self, time: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return morphed and skinned positions and normals in world space."""
        nodes = self.transforms(time)
        positions = self.attribute("POSITION").astype(float)
        normals = self.attribute("NORMAL").astype(float)
        given = self.root["meshes"][0].get("weights", ())
        weights = nodes[self.mesh_node].get("weights", given)
        for weight, target in zip(weights, self.primitives[0].get("targets", ()), strict=True):
            positions = positions + weight * self.accessor(target["POSITION"])
            if "NORMAL" in target:
                normals = normals + weight * self.accessor(target["NORMAL"])
        attributes = self.primitives[0]["attributes"]
        whole = self.moves(self.worlds(nodes), self.mesh_node, attributes, len(positions))
        moved = np.einsum("vab,vb->va", whole[:, :3, :3], positions) + whole[:, :3, 3]
        turned = np.einsum("vab,vb->va", whole[:, :3, :3], normals)
        return moved, turned / np.linalg.norm(turned, axis=1, keepdims=True)

    def influence_sets(self) -> list[tuple[np.ndarray, np.ndarray]]:
        count = sum(name.startswith("JOINTS_") for name in self.primitives[0]["attributes"])
        return [
            (
                self.attribute(f"JOINTS_{n}").astype(int),
                self.attribute(f"WEIGHTS_{n}").astype(float),
            )
            for n in range(count)
        ]

    # Rules of the specification

    def _check(self) -> None:
        root = self.root
        assert root["asset"] == {"version": "2.0", "generator": "viewer"}
        for key, value in root.items():
            assert not isinstance(value, list) or value, key  # arrays must not be empty
        end = 0
        for view in root.get("bufferViews", ()):
            assert view["buffer"] == 0 and view["byteOffset"] % 4 == 0 and view["byteLength"] > 0
            assert end <= view["byteOffset"] and "byteStride" not in view
            end = view["byteOffset"] + view["byteLength"]
        assert end <= len(self.buffer)
        self._check_nodes()
        if "meshes" in root:
            self._check_mesh()
        for skin in root.get("skins", ()):
            assert len(set(skin["joints"])) == len(skin["joints"])
            assert max(skin["joints"]) < len(self.nodes)
            bound = self.accessor(skin["inverseBindMatrices"])
            assert len(bound) == len(skin["joints"])
            assert (bound[:, 3::4] == [0, 0, 0, 1]).all()
            assert len({self.top(joint) for joint in skin["joints"]}) == 1
        for animation in root.get("animations", ()):
            self._check_animation(animation)
        for texture in root.get("textures", ()):
            assert self.picture(texture["source"]).startswith(b"\x89PNG\r\n\x1a\n")
            assert root["images"][texture["source"]]["mimeType"] == "image/png"
            assert texture["sampler"] < len(root["samplers"])

    def top(self, node: int) -> int:
        seen = set()
        while node in self.parents:
            assert node not in seen
            seen.add(node)
            node = self.parents[node]
        return node

    def _check_nodes(self) -> None:
        children = [child for node in self.nodes for child in node.get("children", [])]
        assert len(set(children)) == len(children)
        assert all(0 <= child < len(self.nodes) for child in children)
        (scene,) = self.root["scenes"]
        assert self.root["scene"] == 0
        assert sorted(scene["nodes"]) == [n for n in range(len(self.nodes)) if n not in children]
        for number, node in enumerate(self.nodes):
            assert self.top(number) in scene["nodes"]
            assert node.get("children", [0])
            assert abs(math.hypot(*node.get("rotation", [1.0])) - 1.0) < 1e-12
            assert len(node.get("rotation", [0] * 4)) == 4
            assert len(node.get("translation", [0] * 3)) == len(node.get("scale", [0] * 3)) == 3
        if "skins" in self.root:  # the ancestors of a skinned mesh would not move it
            assert self.mesh_node in scene["nodes"]
            assert not {"translation", "rotation", "scale"} & set(self.nodes[self.mesh_node])

    def _check_mesh(self) -> None:
        (mesh,) = self.root["meshes"]
        names = list(mesh["primitives"][0]["attributes"])
        count = len(self.attribute("POSITION"))
        for primitive in mesh["primitives"]:
            assert primitive["attributes"] == mesh["primitives"][0]["attributes"]
            assert primitive.get("targets") == mesh["primitives"][0].get("targets")
            material = self.root["materials"][primitive["material"]]["pbrMetallicRoughness"]
            if "baseColorTexture" in material:
                assert "TEXCOORD_0" in names
                assert material["baseColorTexture"]["index"] < len(self.root["textures"])
            if "indices" not in primitive:
                assert primitive["mode"] == 0
                continue
            indices = self.accessor(primitive["indices"])
            item = self.root["accessors"][primitive["indices"]]
            assert self.root["bufferViews"][item["bufferView"]]["target"] == 34963
            assert len(indices) % 3 == 0 and indices.max() < count
            assert indices.max() < {5123: 65535, 5125: 2**32 - 1}[item["componentType"]]
        views = []
        for name in names:
            item = self.root["accessors"][mesh["primitives"][0]["attributes"][name]]
            assert item["count"] == count and item["type"] == SIDES.get(name, "VEC4")
            views.append(item["bufferView"])
            assert self.root["bufferViews"][item["bufferView"]]["target"] == 34962
        # A buffer view without a stride has a single attribute.
        assert len(set(views)) == len(views)
        item = self.root["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
        assert len(item["min"]) == len(item["max"]) == 3
        lengths = np.linalg.norm(self.attribute("NORMAL").astype(float), axis=1)
        assert np.abs(lengths - 1.0).max() < UNIT
        self._check_influences()
        targets = mesh["primitives"][0].get("targets", ())
        assert len(mesh.get("weights", ())) == len(targets)
        assert len(mesh.get("extras", {}).get("targetNames", ())) == len(targets)
        for target in targets:
            assert {"min", "max"} <= set(self.root["accessors"][target["POSITION"]])
            assert all(len(self.accessor(index)) == count for index in target.values())

    def _check_influences(self) -> None:
        sets = self.influence_sets()
        assert bool(sets) == ("skin" in self.nodes[self.mesh_node])
        if not sets:
            return
        skin = self.root["skins"][self.nodes[self.mesh_node]["skin"]]
        joints = np.concatenate([joints for joints, _ in sets], axis=1)
        weights = np.concatenate([weights for _, weights in sets], axis=1)
        assert joints.max() < len(skin["joints"]) and weights.min() >= 0.0
        assert np.abs(weights.sum(axis=1) - 1.0).max() < 1e-7 * weights.shape[1]
        assert (joints[weights == 0.0] == 0).all()
        own = np.where(weights > 0.0, joints, -1 - np.arange(joints.shape[1]))
        assert (np.diff(np.sort(own, axis=1), axis=1) != 0).all()  # each joint occurs once

    def _check_animation(self, animation: dict) -> None:
        targets = [(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]]
        assert len(set(targets)) == len(targets)
        for channel, (node, path) in zip(animation["channels"], targets, strict=True):
            sampler = animation["samplers"][channel["sampler"]]
            times, output = self.accessor(sampler["input"]), self.accessor(sampler["output"])
            assert {"min", "max"} <= set(self.root["accessors"][sampler["input"]])
            assert times[0] == 0.0 and (np.diff(times) > 0.0).all()
            assert sampler["interpolation"] == "LINEAR" and node < len(self.nodes)
            width = len(self.root["meshes"][0]["weights"]) if path == "weights" else 1
            assert len(output) == len(times) * width
            if path == "rotation":
                lengths = np.linalg.norm(output.astype(float), axis=1)
                assert np.abs(lengths - 1.0).max() < UNIT
                assert (np.einsum("fa,fa->f", output[1:], output[:-1]) >= 0.0).all()
