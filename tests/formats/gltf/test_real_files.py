"""Real files, if present next to the checkout, compared with numbers from their descriptions."""

from pathlib import Path

import numpy as np
import pytest

from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats.gltf import read_nodes


def opened(folder: Path, name: str) -> NodeFile:
    source = Source.open(folder / "gltf" / name)
    content = read_nodes(source)
    assert source.warnings == []
    return content


def test_fox_has_the_published_counts(shared_data: Path) -> None:
    content = opened(shared_data, "Fox.glb")
    assert [animation.name for animation in content.animations] == ["Survey", "Walk", "Run"]
    assert len(content.skins[0].joints) == 24
    [primitive] = content.meshes[0].primitives
    # Without indices, every triangle has its own vertices.
    assert primitive.triangles.ravel().tolist() == list(range(1728))
    assert 150 < np.ptp(primitive.positions, axis=0)[2] < 160


def test_animations_with_late_constant_keys_are_read(shared_data: Path) -> None:
    content = opened(shared_data, "fox-animations.glb")
    assert len(content.animations) == 14
    channels = [channel for animation in content.animations for channel in animation.read()]
    assert {channel.interpolation for channel in channels} == {"linear", "step"}
    assert min(animation.start for animation in content.animations) > 0.0


def test_cesium_man_has_the_published_counts(shared_data: Path) -> None:
    content = opened(shared_data, "cesium_man.gltf")
    weights = content.meshes[0].primitives[0].weights
    assert weights is not None
    assert (np.abs(weights.sum(axis=1) - 1.0) > 1e-3).sum() == 210
    assert not content.tree.matrices  # rotations include rounding


def test_vertices_may_have_ten_influences(shared_data: Path) -> None:
    [primitive] = (
        read_nodes(Source.open(shared_data / "gltf" / "quad_skin.glb")).meshes[0].primitives
    )
    assert primitive.weights is not None
    assert (primitive.weights > 0.0).sum(axis=1).max() == 10


@pytest.mark.parametrize(
    ("name", "path", "names"),
    [
        ("01_cs_translate.gltf", "translation", ()),
        ("01_morphed_cube_no_uv.gltf", "weights", ("Top",)),
    ],
)
def test_spline_animations_are_read(
    shared_data: Path, name: str, path: str, names: tuple[str, ...]
) -> None:
    content = opened(shared_data, name)
    [channel] = content.animations[0].read()
    assert (channel.path, channel.interpolation) == (path, "cubic")
    assert content.meshes[0].target_names == names


def test_skeleton_without_mesh_is_read(shared_data: Path) -> None:
    content = opened(shared_data, "rig-fox.glb")
    assert content.meshes == () and len(content.skins[0].joints) == 49


@pytest.mark.parametrize(
    ("name", "extension"),
    [
        ("vrm0_sphere.vrm", "VRM"),
        ("vrm1_shapekey.vrm", "VRMC_vrm"),
        ("vrm1_shared_mesh.vrm", "VRMC_vrm"),
    ],
)
def test_characters_are_read(shared_data: Path, name: str, extension: str) -> None:
    assert extension in opened(shared_data, name).extensions
