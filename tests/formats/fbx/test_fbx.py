"""The ``.fbx`` reader: contents, units and axes, and failures of the child process."""

import gc
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from formats.fbx.tiny_fbx import write_strip
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats.fbx import worker
from viewer.formats.fbx.contents import materials_of, node_file
from viewer.formats.fbx.message import packed, unpacked
from viewer.media.png import encode_png

needs_ufbx = pytest.mark.skipif(find_spec("ufbx") is None, reason="ufbx is not installed")


@pytest.fixture(scope="module")
def strip(tmp_path_factory: pytest.TempPathFactory) -> NodeFile:
    return node_file(Source.open(write_strip(tmp_path_factory.mktemp("fbx"))))


@needs_ufbx
def test_nodes_keep_names_and_parents(strip):
    assert strip.tree.names == ("RootNode", "Body", "low", "high")
    assert strip.tree.parents.tolist() == [-1, 0, 0, 2]
    assert_allclose(strip.tree.translations[3], [0.0, 1.0, 0.0])
    assert (strip.up, strip.unit) == ("y", "cm")


@needs_ufbx
def test_mesh_is_split_by_material_and_quads_are_triangulated(strip):
    (mesh,) = strip.meshes
    assert [primitive.material for primitive in mesh.primitives] == [0, 1]
    assert [len(primitive.triangles) for primitive in mesh.primitives] == [2, 2]
    assert [material.base_color for material in strip.materials] == [(1, 0, 0, 1), (0, 0, 1, 1)]
    # Corners with equal attributes are one vertex.
    assert [len(primitive.positions) for primitive in mesh.primitives] == [4, 4]
    low, high = (primitive.positions[primitive.triangles] for primitive in mesh.primitives)
    areas = np.cross(low[:, 1] - low[:, 0], low[:, 2] - low[:, 0])
    assert_allclose(areas, [[0, 0, 1], [0, 0, 1]])
    assert high[..., 1].min() == 1.0


@needs_ufbx
def test_influences_match_the_clusters(strip):
    (skin,), low = strip.skins, strip.meshes[0].primitives[0]
    assert skin.joints.tolist() == [2, 3] and skin.method == "lbs"
    assert_allclose(skin.inverse_bind[1][:3, 3], [0.0, -1.0, 0.0])
    at = {tuple(position): row for row, position in enumerate(low.positions.tolist())}
    assert low.joints is not None and low.weights is not None
    assert low.weights[at[0.0, 0.0, 0.0]].tolist() == [1.0, 0.0]
    assert low.joints[at[0.0, 1.0, 0.0]].tolist() == [0, 1]
    assert low.weights[at[0.0, 1.0, 0.0]].tolist() == [0.5, 0.5]


@needs_ufbx
def test_blend_shapes_are_offsets_with_default_weights(strip):
    mesh = strip.meshes[0]
    assert mesh.target_names == ("wide",) and mesh.shape_weights.tolist() == [0.25]
    low = mesh.primitives[0]
    assert low.targets is not None
    expected = np.where(low.positions[:, :1] == 1.0, [[0.5, 0.0, 0.0]], 0.0)
    assert_allclose(low.targets.dense()[0], expected)


@needs_ufbx
def test_keys_are_baked_at_the_frame_rate_of_the_file(strip):
    (bend,) = strip.animations
    assert (bend.name, bend.start, bend.end) == ("Bend", 0.0, 1.0)
    channels = {(channel.node, channel.path): channel for channel in bend.read()}
    turned = channels[3, "rotation"]
    assert_allclose(turned.times, np.arange(25) / 24, atol=1e-12)
    half = np.radians(90.0 * turned.times) / 2
    expected = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)
    assert_allclose(turned.values, expected, atol=1e-7)  # keys are in single precision
    weights = channels[1, "weights"]
    assert_allclose(weights.values[[0, -1], 0], [0.0, 1.0])


@needs_ufbx
def test_up_axis_and_unit_of_the_file_are_unchanged(tmp_path):
    source = Source.open(write_strip(tmp_path, up="z", unit=100.0))
    content = node_file(source)
    assert (content.up, content.unit) == ("z", "m")
    assert_allclose(content.tree.translations[3], [0.0, 1.0, 0.0])
    assert not source.warnings


@needs_ufbx
def test_unknown_units_are_converted_to_metres(tmp_path):
    source = Source.open(write_strip(tmp_path, unit=30.48))  # feet
    content = node_file(source)
    assert content.unit == "m"
    assert [found.key for found in source.diagnostics.warnings] == ["F007.fbx-converted"]
    tree = content.tree
    scale = np.prod(tree.scales[[0, 2]], axis=0)
    assert_allclose(scale * tree.translations[3], [0.0, 0.3048, 0.0], atol=1e-9)


@needs_ufbx
def test_invalid_contents_are_refused(tmp_path):
    path = tmp_path / "wrong.fbx"
    path.write_text("no FBX at all\n")
    with pytest.raises(FormatError) as caught:
        node_file(Source.open(path))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.fbx"


@pytest.mark.parametrize(
    ("library", "ending"),
    [
        ("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n", "signal 11"),
        ("raise ImportError('damaged')\n", "damaged"),
        ("import os\nos._exit(0)\n", "exit code 0"),
    ],
)
def test_failed_child_process_is_reported_on_one_line(tmp_path, monkeypatch, library, ending):
    (tmp_path / "ufbx.py").write_text(library)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(FormatError) as caught:
        node_file(Source.open(write_strip(tmp_path)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F001.fbx-crash"
    assert ending in str(caught.value)


def test_missing_library_is_reported_by_name(tmp_path, monkeypatch):
    monkeypatch.setattr("viewer.formats.fbx.contents.find_spec", lambda name: None)
    with pytest.raises(FormatError) as caught:
        node_file(Source.open(write_strip(tmp_path)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F001.fbx-extra"


def test_truncated_message_of_the_child_is_detected():
    data = packed({"a": np.arange(3)}, {"b": 1})
    arrays, told = unpacked(data) or ({}, {})
    assert arrays["a"].tolist() == [0, 1, 2] and told == {"b": 1}
    assert unpacked(data[:-30]) is None and unpacked(b"") is None


@needs_ufbx
@pytest.mark.parametrize(
    ("stack", "time", "reference"),
    [(0, 0.0, "base_0"), (1, 15 / 24, "spin_15"), (2, 20 / 24, "wiggle_20")],
)
def test_blender_file_matches_its_exported_frames(shared_data, stack, time, reference):
    folder = shared_data / "fbx"
    content = node_file(Source.open(folder / "blender_279_sausage_7400_binary.fbx"))
    keys = {
        (channel.node, channel.path): np.array(
            [np.interp(time, channel.times, column) for column in channel.values.T]
        )
        for channel in content.animations[stack].read()
    }
    vertices = _posed(content, keys)
    lines = (folder / f"blender_279_sausage_{reference}.obj").read_text().splitlines()
    expected = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    distances = np.linalg.norm(vertices[:, None] - expected, axis=-1)
    assert distances.min(axis=0).max() < 1e-5  # metres, for a figure 4 m long in single precision
    assert distances.min(axis=1).max() < 1e-5


def _posed(content: NodeFile, keys: dict[tuple[int, str], np.ndarray]) -> np.ndarray:
    """Return all vertices in world space by the definition of a skin."""
    tree = content.tree
    world: list[np.ndarray] = []
    for node in range(tree.n_nodes):
        shift = keys.get((node, "translation"), tree.translations[node])
        scale = keys.get((node, "scale"), tree.scales[node])
        x, y, z, w = keys.get((node, "rotation"), tree.rotations[node])
        local = np.eye(4)
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + 2 * (w * skew + skew @ skew) / (x * x + y * y + z * z + w * w)
        local[:3, :3], local[:3, 3] = turn * scale, shift
        parent = tree.parents[node]
        world.append(local if parent < 0 else world[parent] @ local)
    (skin,), found = content.skins, []
    for primitive in content.meshes[0].primitives:
        assert primitive.joints is not None and primitive.weights is not None
        for position, joints, weights in zip(
            primitive.positions, primitive.joints, primitive.weights, strict=True
        ):
            total = sum(
                weight * world[skin.joints[joint]] @ skin.inverse_bind[joint]
                for joint, weight in zip(joints, weights, strict=True)
            )
            found.append((total @ [*position, 1.0])[:3] / weights.sum())
    return np.array(found)


GREY = encode_png(np.full((1, 1, 4), 128, dtype=np.uint8))
NAMES = (
    *("base_factor", "base_color", "roughness", "metalness", "emission_factor"),
    *("emission_color", "opacity", "normal_map", "ambient_occlusion"),
)
VALUES = {
    "emission_factor": [0.5],
    "emission_color": [0.0, 0.0, 0.2, 1.0],
    "metalness": [0.25],
    "roughness": [0.75],
}


def material(content: bytes, textured: tuple[str, ...]) -> Any:
    """Return a material with values, and a texture on some properties."""
    told: dict[str, Any] = {"name": "skin", "is_physical": True}
    for name in NAMES:
        number = 0 if name in textured else None
        told[name] = {"value": VALUES.get(name), "texture": number}
    stated = {
        "names": ["map.png"],
        "uv_set": "",
        "wrap": ["repeat", "repeat"],
        "transform": np.eye(4).tolist(),
    }
    message = {"materials": [told], "textures": [stated], "meshes": []}
    arrays = {"texture0": np.frombuffer(content, dtype=np.uint8)}
    (found,) = materials_of(Source(Path("figure.fbx"), b""), arrays, message)
    return found


def test_values_apply_without_textures():
    found = material(GREY, ())
    assert (found.metallic, found.roughness) == (0.25, 0.75)
    assert found.emissive == pytest.approx((0.0, 0.0, 0.1))


def test_textures_replace_values():
    found = material(GREY, ("metalness", "roughness", "emission_color"))
    assert (found.metallic, found.roughness) == (1.0, 1.0)
    assert found.emissive == pytest.approx((0.5, 0.5, 0.5))
    assert found.emissive_texture.image is not None


def test_values_replace_textures_that_cannot_be_read():
    found = material(b"not an image", ("metalness", "roughness", "emission_color"))
    assert (found.metallic, found.roughness) == (0.25, 0.75)
    assert found.emissive == pytest.approx((0.0, 0.0, 0.1))
    assert found.metallic_texture.image is None


def test_objects_of_the_library_live_until_the_process_exits(monkeypatch, capfdbinary):
    events = []

    class Scene:
        def __init__(self, *_arguments: object) -> None:
            pass

        def message(self, _stack: list[str]) -> tuple[dict[str, object], dict[str, object]]:
            return {}, {"names": ["root"]}

        def __del__(self) -> None:
            events.append("destroyed")

    def leave(code: int) -> None:
        events.append(f"exit {code}")
        raise SystemExit

    monkeypatch.setitem(sys.modules, "ufbx", SimpleNamespace(UfbxError=RuntimeError))
    monkeypatch.setattr(worker, "_Scene", Scene)
    monkeypatch.setattr(os, "_exit", leave)
    try:
        with pytest.raises(SystemExit):
            worker.main(["figure.fbx"])
    finally:
        gc.enable()
    assert events[0] == "exit 0"
    message = unpacked(capfdbinary.readouterr().out)
    assert message is not None and message[1] == {"names": ["root"]}
