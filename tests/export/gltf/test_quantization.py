"""Quantised glTF files: round trips, and their printed errors."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from exporting import export_clips
from numpy.testing import assert_allclose
from two_parts import two_parts

import viewer
from viewer.export import export
from viewer.rig.motion.evaluation import frames_of, pose_of
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning, deform

STEP = 1.0 / 32767.0  # relative to half the size of 2 units


def document(path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_attributes_are_normalised_integers_with_exact_sums(tmp_path):
    export_clips(Actor(two_parts()), tmp_path / "small.glb", optimizes=True)
    root, binary = document(tmp_path / "small.glb")
    assert root["extensionsUsed"] == root["extensionsRequired"] == ["KHR_mesh_quantization"]
    (bar,) = (mesh for mesh in root["meshes"] if mesh["name"] == "bar mesh")
    attributes = bar["primitives"][0]["attributes"]
    accessors = {name: root["accessors"][index] for name, index in attributes.items()}
    kinds = {name: each["componentType"] for name, each in accessors.items()}
    assert kinds == {"POSITION": 5122, "NORMAL": 5122, "JOINTS_0": 5121, "WEIGHTS_0": 5123}
    assert all(root["accessors"][index]["normalized"] for index in (attributes["POSITION"],))
    for name in ("POSITION", "NORMAL"):
        assert root["bufferViews"][accessors[name]["bufferView"]]["byteStride"] == 8
    start = root["bufferViews"][accessors["WEIGHTS_0"]["bufferView"]]["byteOffset"]
    weights = np.frombuffer(binary, "<u2", 24, start).reshape(6, 4)
    assert weights.sum(axis=1).tolist() == [65535] * 6


def test_quantised_figure_moves_like_the_original(tmp_path):
    figure = two_parts()
    notes = export_clips(Actor(figure), tmp_path / "small.glb", optimizes=True)
    back = viewer.load(tmp_path / "small.glb").actors[0].figure
    (measured,) = (note.values["distance"] for note in notes if note.key == "X002.animations")
    assert 0.0 < measured < 3.0 * STEP
    order = [6, 7, 8, 0, 1, 2, 3, 4, 5]
    for animation, other in zip(figure.animations, back.animations, strict=True):
        for time in (0.2, 0.7, 1.4):
            shapes = []
            for each, played in ((figure, animation), (back, other)):
                frames = frames_of(each, played.clip(), np.array([time]))
                shapes.append(deform(each, pose_of(each, frames, 0), Skinning())[0])
            assert_allclose(shapes[1], shapes[0][order], rtol=0, atol=3.0 * STEP)


@pytest.mark.parametrize("unbound", [False, True])
def test_single_pose_is_quantised(tmp_path, unbound):
    figure = replace(two_parts(), animations=(), record=None)
    if unbound:
        figure = replace(figure, skin=None, skeleton=None)
    notes = viewer.export(Actor(figure), tmp_path / "small.glb", optimizes=True)
    assert "X002.quantized" in [note.key for note in notes]
    back = viewer.load(tmp_path / "small.glb").actors[0]
    found = deform(back.figure, back.pose, Skinning())[0]
    for point in figure.mesh.positions:
        assert np.linalg.norm(found - point, axis=1).min() < 2.0 * STEP


def test_optimisation_of_other_formats_is_refused(tmp_path):
    with pytest.raises(viewer.ViewerError, match=r"\.obj: only glTF files can be optimised"):
        export(Actor(two_parts()), tmp_path / "small.obj", optimizes=True)
    assert not (tmp_path / "small.obj").exists()
