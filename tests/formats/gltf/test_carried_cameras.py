"""Cameras and helper nodes of glTF files: projection, movement, and what is written."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File, skinned
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.rendering.camera import camera_from_view, follow_view
from viewer.rendering.camera_views import drawn_cameras
from viewer.rendering.options import DisplayOptions
from viewer.rig.captures.carried_view import view_in
from viewer.rig.motion.evaluation import pose_actor

HALF = math.sqrt(0.5)
SIZE = 640, 480
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def carried() -> File:
    """Return a file whose second joint, one unit above the first, carries a camera on a helper.

    The joint rotates by 90 degrees about z, and the camera is 3 units to the side of the helper.
    """
    file = skinned()
    file.root["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"name": "root", "children": [2]},
        {"name": "tip", "translation": [0, 1, 0], "children": [3]},
        {"name": "helper", "translation": [0, 2, 0], "children": [4]},
        {"name": "eye", "translation": [3, 0, 0], "camera": 0},
    ]
    lens = {"yfov": 0.8, "aspectRatio": SIZE[0] / SIZE[1], "znear": 0.1}
    file.root["cameras"] = [{"type": "perspective", "perspective": lens}]
    keys = file.accessor([[0, 0, 0, 1], [0, 0, HALF, HALF]])
    samplers = [{"input": file.times([0.0, 1.0]), "output": keys}]
    channels = [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]
    file.root["animations"] = [{"channels": channels, "samplers": samplers}]
    return file


def saved(file: File, folder: Path) -> Path:
    path = folder / "a.glb"
    path.write_bytes(file.glb())
    return path


def center(view: Any) -> np.ndarray:
    return -view.rotation.T @ view.translation


def test_camera_moves_with_its_joint(tmp_path: Path) -> None:
    scene = viewer.load(saved(carried(), tmp_path))
    (view,) = scene.views
    assert_allclose(center(view_in(view, scene)), [3, 3, 0], atol=1e-12)
    scene.time = 1.0
    pose_actor(scene.actors[0], 1.0)
    # (3, 2, 0) from the joint, rotated by 90 degrees about z.
    there = view_in(view, scene)
    assert_allclose(center(there), [-2, 4, 0], atol=1e-12)
    # The camera looks along -z as before, but its right side points up.
    assert_allclose(there.rotation, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    (drawn,) = drawn_cameras(scene, None, DisplayOptions(cameras=True))
    assert_allclose(center(drawn), [-2, 4, 0], atol=1e-12)


def test_view_through_a_camera_follows_its_joint(tmp_path: Path) -> None:
    scene = viewer.load(saved(carried(), tmp_path))
    (view,) = scene.views
    camera = camera_from_view(view, SIZE, "y", seen=view_in(view, scene))
    pose_actor(scene.actors[0], 1.0)
    follow_view(camera, SIZE, scene, BOX)
    assert camera.fixed is view
    assert_allclose(np.linalg.inv(camera.view_matrix())[:3, 3], [-2, 4, 0], atol=1e-12)


def test_projection_is_that_of_gltf(tmp_path: Path) -> None:
    (view,) = viewer.load(saved(carried(), tmp_path)).views
    camera = camera_from_view(view, SIZE, "y")
    # x / (a tan(yfov / 2)) and y / tan(yfov / 2), divided by the distance 4 along -z.
    x, y, _, w = camera.projection_matrix(SIZE[0] / SIZE[1], BOX) @ [0.5, 0.25, -4.0, 1.0]
    reach = math.tan(0.4) * 4.0
    assert x / w == pytest.approx(0.5 / (reach * SIZE[0] / SIZE[1]), abs=1e-12)
    assert y / w == pytest.approx(0.25 / reach, abs=1e-12)


@pytest.mark.parametrize("options", [(), ("--fps", "20")], ids=["keys", "frames"])
def test_camera_is_written_below_its_joint(tmp_path: Path, options: tuple[str, ...]) -> None:
    path = tmp_path / "b.glb"
    source = saved(carried(), tmp_path)
    assert run(["convert", str(source), "-o", str(path), *options]) == 0
    data = path.read_bytes()
    root = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    nodes = root["nodes"]
    (eye,) = [place for place, node in enumerate(nodes) if "camera" in node]
    (above,) = [node for node in nodes if eye in node.get("children", ())]
    assert above["name"] in ("tip", "helper") and eye not in root["scenes"][0]["nodes"]
    assert root["cameras"][0]["perspective"]["yfov"] == pytest.approx(0.8, abs=1e-12)
    scene = viewer.load(path)
    pose_actor(scene.actors[0], 1.0)
    assert_allclose(center(view_in(scene.views[0], scene)), [-2, 4, 0], atol=1e-6)


def test_helper_nodes_that_are_not_written_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = skinned()
    file.root["nodes"] += [
        {"name": "Armature", "children": [0, 1], "extras": {"kind": 1}},
        {"name": "Empty", "translation": [7, 7, 7]},
    ]
    file.root["scenes"], file.root["scene"] = [{"nodes": [3, 4]}], 0
    source = saved(file, tmp_path)
    assert run(["convert", str(source), "-o", str(tmp_path / "b.glb")]) == 0
    assert (
        "2 nodes of the original file without a joint, mesh or camera are not copied: "
        "Armature (with extras), Empty"
    ) in capsys.readouterr().out
