"""Animations that keep their keys in glTF, checked by a small independent evaluator."""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_clips
from numpy.testing import assert_allclose, assert_array_equal
from two_parts import clips, quaternions, two_parts

import viewer
from viewer.rig.motion.evaluation import frames_of, pose_of
from viewer.rig.motion.transform_clip import TransformChannel, TransformClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning, deform

FORMATS = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
CLOSE = 1e-6  # relative to the size of 2 units, for single precision


class Plain:
    """A ``.glb``, evaluated node by node and vertex by vertex as the specification defines it."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        (size,) = struct.unpack_from("<I", data, 12)
        self.root, self.binary = json.loads(data[20 : 20 + size]), data[28 + size :]
        self.parents = {
            child: index
            for index, node in enumerate(self.root["nodes"])
            for child in node.get("children", ())
        }

    def array(self, index: int) -> np.ndarray:
        item = self.root["accessors"][index]
        view = self.root["bufferViews"][item["bufferView"]]
        start, width = view["byteOffset"] + item["byteOffset"], SIZES[item["type"]]
        kind = np.dtype(FORMATS[item["componentType"]])
        flat = np.frombuffer(self.binary, kind, item["count"] * width, start)
        return flat.reshape(-1, width).astype(float)

    def posed(self, animation: int, time: float) -> list[dict]:
        nodes = [dict(node) for node in self.root["nodes"]]
        played = self.root["animations"][animation]
        for channel in played["channels"]:
            sampler, target = played["samplers"][channel["sampler"]], channel["target"]
            times = self.array(sampler["input"])[:, 0]
            kind = sampler["interpolation"]
            values = self.array(sampler["output"])
            if kind == "CUBICSPLINE":
                values = values.reshape(len(times), 3, -1)
            else:
                values = values.reshape(len(times), -1)
            turns = target["path"] == "rotation"
            nodes[target["node"]][target["path"]] = sampled(times, values, kind, turns, time)
        return nodes

    def world(self, nodes: list[dict], index: int) -> np.ndarray:
        above = self.parents.get(index)
        own = matrix(nodes[index])
        return own if above is None else self.world(nodes, above) @ own

    def vertices(self, animation: int, time: float) -> np.ndarray:
        nodes, found = self.posed(animation, time), []
        for index, node in enumerate(nodes):
            if "mesh" not in node:
                continue
            mesh = self.root["meshes"][node["mesh"]]
            first = mesh["primitives"][0]
            points = self.array(first["attributes"]["POSITION"])
            weights = node.get("weights", mesh.get("weights", ()))
            for weight, target in zip(weights, first.get("targets", ()), strict=True):
                points = points + weight * self.array(target["POSITION"])
            found.append(self.skinned(nodes, index, first["attributes"], points))
        return np.concatenate(found)

    def skinned(self, nodes: list[dict], index: int, attributes: dict, points: np.ndarray):
        if "skin" not in nodes[index]:
            whole = np.broadcast_to(self.world(nodes, index), (len(points), 4, 4))
        else:
            skin = self.root["skins"][nodes[index]["skin"]]
            bound = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            palette = [
                self.world(nodes, joint) @ inverse.T
                for joint, inverse in zip(skin["joints"], bound, strict=True)
            ]
            joints, weights = (self.array(attributes[name]) for name in ("JOINTS_0", "WEIGHTS_0"))
            whole = np.einsum("vk,vkab->vab", weights, np.array(palette)[joints.astype(int)])
        return np.einsum("vab,vb->va", whole[:, :3, :3], points) + whole[:, :3, 3]


def matrix(node: dict) -> np.ndarray:
    """Return the matrix T R S."""
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1))) / np.linalg.norm(
        node.get("rotation", (0, 0, 0, 1))
    )
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    whole = np.eye(4)
    whole[:3, :3] = np.array(turn) * node.get("scale", (1, 1, 1))
    whole[:3, 3] = node.get("translation", (0, 0, 0))
    return whole


def sampled(times, values, kind: str, turns: bool, time: float) -> np.ndarray:
    """Return a value between keys (glTF 2.0, appendix C)."""
    row = max(int(np.searchsorted(times, time, side="right")) - 1, 0)
    last = len(times) - 1
    if time <= times[0] or row == last or kind == "STEP":
        return values[row, 1] if kind == "CUBICSPLINE" else values[row]
    h = times[row + 1] - times[row]
    u = (time - times[row]) / h
    if kind == "CUBICSPLINE":
        start, end = values[row], values[row + 1]
        return (
            (2 * u**3 - 3 * u**2 + 1) * start[1]
            + h * (u**3 - 2 * u**2 + u) * start[2]
            + (3 * u**2 - 2 * u**3) * end[1]
            + h * (u**3 - u**2) * end[0]
        )
    start, end = values[row], values[row + 1]
    if not turns:
        return (1 - u) * start + u * end
    cosine = float(start @ end)
    end = -end if cosine < 0 else end
    angle = math.acos(min(abs(cosine), 1.0))
    if angle < 1e-6:
        return end
    return (math.sin((1 - u) * angle) * start + math.sin(u * angle) * end) / math.sin(angle)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("keys") / "bender.glb"
    export_clips(Actor(two_parts()), path)
    return path


@pytest.mark.parametrize(("animation", "times"), [(0, (0.1, 0.6, 1.7)), (1, (0.4, 0.8, 1.5))])
def test_vertices_match_the_definition(written, animation, times):
    figure, file = two_parts(), Plain(written)
    for time in times:
        frames = frames_of(figure, clips()[animation], np.array([time]))
        expected = deform(figure, pose_of(figure, frames, 0), Skinning())[0]
        # The box is on the node of its joint, which precedes that of the bar.
        expected = np.concatenate([expected[6:], expected[:6]])
        assert_allclose(file.vertices(animation, time), expected, rtol=0, atol=2 * CLOSE)


def test_keys_round_trip(written):
    figure = viewer.load(written).actors[0].figure
    assert [animation.name for animation in figure.animations] == ["wave", "jump"]
    for animation, wanted in zip(figure.animations, clips(), strict=True):
        for one, other in zip(animation.clip().channels, wanted.channels, strict=True):
            assert (one.path, one.interpolation) == (other.path, other.interpolation)
            assert_array_equal(one.times, other.times)
            assert_allclose(one.values, other.values, rtol=0, atol=1e-7)
            if other.tangents is not None:
                assert_array_equal(one.tangents, other.tangents)


def test_names_parts_and_application_data_round_trip(written):
    figure, root = viewer.load(written).actors[0].figure, Plain(written).root
    assert figure.skeleton.names == ("root", "box")
    assert figure.mesh.parts == ("box", "bar") and set(figure.blend_shapes.names) == {"up", "wide"}
    assert root["asset"]["copyright"] == "2026 A. Author" and root["extras"] == {"rating": 5}
    nodes = {node["name"]: node for node in root["nodes"]}
    assert nodes["box"]["extras"] == {"layer": 2} and nodes["bar"]["extras"] == ["hull"]
    meshes = {mesh["name"]: mesh for mesh in root["meshes"]}
    assert meshes["box mesh"]["extras"] == {"kind": "box"} and "targets" not in meshes["box mesh"]
    assert meshes["bar mesh"]["extras"] == {"targetNames": ["up", "wide"]}
    # A part that follows its joint rigidly is on the node of the joint.
    assert "skin" not in nodes["box"] and "mesh" in nodes["box"] and "skin" in nodes["bar"]


def test_largest_difference_is_measured(tmp_path):
    figure = two_parts()
    crooked = replace(
        figure, skin=replace(figure.skin, weights=figure.skin.weights * np.float64(0.5))
    )
    notes = {}
    for name, each in (("exact", figure), ("crooked", crooked)):
        (note,) = (
            note
            for note in export_clips(Actor(each), tmp_path / f"{name}.glb")
            if note.key == "X002.animations"
        )
        notes[name] = note.values
    assert notes["exact"]["distance"] < 2 * CLOSE and not notes["exact"]["causes"]
    assert notes["crooked"]["distance"] > 0.5 and notes["crooked"]["causes"]


def test_edited_animation_replaces_that_of_the_file(tmp_path):
    figure, edited = two_parts(), replace(clips()[1], channels=clips()[1].channels[:1])
    actor = Actor(figure, clip=edited, animation=1)
    export_clips(actor, tmp_path / "edited.glb")
    root = Plain(tmp_path / "edited.glb").root
    assert [len(each["channels"]) for each in root["animations"]] == [2, 1]
    assert Scene([actor]).actors[0].clip is edited


def test_times_below_zero_delay_the_animation(tmp_path):
    channel = TransformChannel(1, "rotation", np.array([-0.5, 0.5]), quaternions(0, 90))
    clip = TransformClip("early", (channel,), -0.5, 0.5)
    notes = export_clips(Actor(two_parts()), tmp_path / "early.glb", clips=[clip])
    assert "X005.negative-times" in [note.key for note in notes]
    file = Plain(tmp_path / "early.glb")
    (sampler,) = file.root["animations"][0]["samplers"]
    assert file.array(sampler["input"])[:, 0].tolist() == [0.0, 1.0]


def test_animation_without_channels_of_the_figure_is_reported(tmp_path):
    # An animation of a file may move only other figures, or a mesh that is not drawn.
    notes = export_clips(Actor(two_parts()), tmp_path / "a.glb", [TransformClip("x", (), 0, 1)])
    assert "animations" not in Plain(tmp_path / "a.glb").root
    assert [note.key for note in notes if note.code == "X003"] == ["X003.idle-animations"]


def test_mesh_without_skin_is_a_child_of_the_figure_node(tmp_path):
    export_clips(Actor(replace(two_parts(), skin=None)), tmp_path / "loose.glb")
    nodes = Plain(tmp_path / "loose.glb").root["nodes"]
    (place,) = (node for node in nodes if node.get("name") == "bender")
    below = [nodes[child]["name"] for child in place["children"]]
    assert below == ["root", "bar", "box"]
