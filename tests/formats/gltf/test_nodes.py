"""Nodes of glTF files: tree, transforms, scenes and cameras."""

import math

import numpy as np
import pytest
from formats.gltf.files import File, read, refused, source_of, warned

from viewer.diagnostics import Collector
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeTree
from viewer.formats.gltf import read_nodes
from viewer.rig.geometry.rotation import quaternion_to_matrix

HALF = math.sqrt(0.5)


def local(tree: NodeTree, node: int) -> np.ndarray:
    """Return the local matrix of a node by its definition."""
    if node in tree.matrices:
        return tree.matrices[node]
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(tree.rotations[node]) * tree.scales[node]
    matrix[:3, 3] = tree.translations[node]
    return matrix


def with_matrix(matrix: np.ndarray) -> NodeTree:
    columns = [float(value) for value in np.asarray(matrix, dtype=np.float64).T.ravel()]
    return read(File(nodes=[{"matrix": columns}])).tree


def test_tree_names_and_extras_are_read() -> None:
    nodes = [
        {"name": "a", "children": [2]},
        {"children": [0], "extras": {"kind": 1}},
        {"name": "a", "extensions": {"ODD": {"x": 2}}},
    ]
    tree = read(File(nodes=nodes)).tree
    assert tree.names == ("a", "", "a")
    assert tree.parents.tolist() == [1, -1, 0]
    assert tree.extras == {1: {"kind": 1}} and tree.extensions == {2: {"ODD": {"x": 2}}}


def test_transforms_are_read() -> None:
    nodes = [{}, {"translation": [1, 2, 3], "rotation": [0, 0, HALF, HALF], "scale": [2, 1, 1]}]
    tree = read(File(nodes=nodes)).tree
    assert local(tree, 0).tolist() == np.eye(4).tolist()
    # The x axis points along y and has length 2.
    expected = [[0, -1, 0, 1], [2, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert np.abs(local(tree, 1) - expected).max() < 1e-15


def test_quaternions_are_normalised() -> None:
    file = File(nodes=[{}, {"rotation": [0, 0, 3, 4]}, {"rotation": [0, 0, 0, 0]}])
    tree = read(file).tree
    assert tree.rotations[1] == pytest.approx([0, 0, 0.6, 0.8])
    assert tree.rotations[2].tolist() == [0, 0, 0, 1]
    assert warned(file) == [("G003.rotation", "/nodes/1/rotation")]


@pytest.mark.parametrize(
    "linear",
    [
        [[0, -2, 0], [3, 0, 0], [0, 0, 4]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, -2, 0], [-3, 0, 0]],
        [[0, 0, 0], [0, 1, 0], [0, 0, 2]],
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
    ],
    ids=["scaled", "mirrored", "mirrored and rotated", "flat", "zero"],
)
def test_matrices_are_decomposed(linear: list[list[float]]) -> None:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, (1, 2, 3)
    tree = with_matrix(matrix)
    assert not tree.matrices
    assert np.linalg.norm(tree.rotations[0]) == pytest.approx(1.0)
    assert np.abs(local(tree, 0) - matrix).max() < 1e-14


def test_sheared_matrices_are_kept_exactly() -> None:
    matrix = np.array([[1, 0.5, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1.0]])
    tree = with_matrix(matrix)
    assert tree.matrices[0].tolist() == matrix.tolist()
    assert tree.translations.tolist() == [[0, 0, 0]] and tree.scales.tolist() == [[1, 1, 1]]


def test_rounding_is_not_treated_as_shear() -> None:
    # A rotation by 30 degrees, rounded to six digits as by exporters to text.
    matrix = np.eye(4)
    matrix[:2, :2] = [[0.866025, -0.5], [0.5, 0.866025]]
    assert not with_matrix(matrix).matrices


@pytest.mark.parametrize(
    ("nodes", "key", "pointer"),
    [
        ([{"children": [1]}, {"children": [0]}], "F002.gltf-cycle", "/nodes/1/children"),
        ([{"children": [0]}], "F002.gltf-cycle", "/nodes/0/children"),
        ([{"children": [2]}, {"children": [2]}, {}], "F002.gltf-parents", "/nodes/1/children/0"),
        ([{"children": [1]}], "F002.gltf-index", "/nodes/0/children/0"),
        ([{"children": [-1]}], "F002.gltf-type", "/nodes/0/children/0"),
        ([{"children": 3}], "F002.gltf-type", "/nodes/0/children"),
        ([7], "F002.gltf-type", "/nodes/0"),
        ([{}, {"mesh": 0}], "F002.gltf-index", "/nodes/1/mesh"),
        ([{"name": 5}], "F002.gltf-type", "/nodes/0/name"),
        ([{}, {"translation": [0, 1]}], "F002.gltf-type", "/nodes/1/translation"),
        ([{"scale": [1, 1, "1"]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, True]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, 10**400]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, math.nan]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"matrix": [1] * 15}], "F002.gltf-type", "/nodes/0/matrix"),
        ([{"matrix": [1] * 16}], "F002.gltf-affine", "/nodes/0/matrix"),
    ],
)
def test_invalid_nodes_are_refused(nodes: list[object], key: str, pointer: str) -> None:
    assert refused(File(nodes=nodes)) == (key, pointer)


def test_all_errors_are_reported_if_errors_are_collected() -> None:
    nodes = [{"children": [1, 1]}, {"children": [0]}, {"children": [1]}]
    source = Source("a.gltf", File(nodes=nodes).json(), diagnostics=Collector(keeps_errors=True))
    tree = read_nodes(source).tree
    assert [found.key for found in source.diagnostics.errors] == [
        "F002.gltf-parents",
        "F002.gltf-cycle",
    ]
    assert tree.parents.tolist() == [-1, 0, -1]


def test_deep_trees_are_read_without_recursion() -> None:
    count = 20_000
    nodes = [{"children": [index + 1]} for index in range(count - 1)] + [{}]
    tree = read(File(nodes=nodes)).tree
    assert tree.parents.tolist() == list(range(-1, count - 1))


def test_matrix_overrides_other_transforms() -> None:
    columns = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]
    file = File(nodes=[{"matrix": columns, "translation": [1, 1, 1]}])
    assert read(file).tree.translations.tolist() == [[5, 0, 0]]
    assert warned(file) == [("G003.matrix-and", "/nodes/0/matrix")]


def test_shown_roots_are_those_of_the_default_or_first_scene() -> None:
    nodes = [{"children": [1]}, {}, {}, {}]
    scenes = [{"nodes": [2]}, {"name": "main", "nodes": [3, 0]}]
    assert read(File(nodes=nodes)).roots == (0, 2, 3)
    assert read(File(nodes=nodes, scenes=scenes)).roots == (2,)
    file = File(nodes=nodes, scenes=scenes, scene=1)
    assert read(file).roots == (3, 0)
    assert warned(file) == [("F007.gltf-scenes", "/scenes")]
    file = File(nodes=nodes, scenes=[{"nodes": [1]}])
    assert read(file).roots == (0,)
    assert warned(file) == [("G003.scene-child", "/scenes/0/nodes")]
    assert read(File(nodes=nodes, scenes=[{}])).roots == (0, 2, 3)
    assert refused(File(nodes=nodes, scene=0)) == ("F002.gltf-index", "/scene")


def test_cameras_are_read() -> None:
    file = File(
        nodes=[{"camera": 1}],
        cameras=[
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 2}},
            {"name": "flat", "type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2}},
            {"type": "perspective", "perspective": {"yfov": 0}},
        ],
    )
    content = read(file)
    near, flat, _ = content.cameras
    assert (near.vertical_angle, near.aspect) == (0.5, 2.0)
    assert (flat.name, flat.vertical_angle, flat.height, flat.aspect) == ("flat", None, 4.0, 1.5)
    assert content.tree.cameras.tolist() == [1]
    assert warned(file) == [("G003.camera", "/cameras/2/perspective/yfov")]


def test_application_data_are_preserved() -> None:
    file = File(nodes=[{}], extras=[1], extensions={"VRMC_vrm": {"specVersion": "1.0"}})
    file.root["asset"]["generator"] = "by hand"
    content = read_nodes(source_of(file, "folder/hero.gltf"))
    assert (content.name, content.up, content.unit) == ("hero", "y", "m")
    assert content.extras == [1] and content.asset["generator"] == "by hand"
    assert content.extensions == {"VRMC_vrm": {"specVersion": "1.0"}}
