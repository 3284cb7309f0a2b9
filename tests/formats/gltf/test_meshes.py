"""Meshes: modes, shared vertices, attributes, influences and morph targets."""

import sys

import numpy as np
import pytest
from formats.gltf.files import TRIANGLE, File, read, refused, skinned, source_of, warned

from viewer.formats._scene_graph.content import Primitive
from viewer.formats.gltf import read_nodes

SQUARE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]


def only(file: File) -> Primitive:
    [primitive] = read(file).meshes[0].primitives
    return primitive


@pytest.mark.parametrize(
    ("mode", "triangles"),
    [
        (4, [[0, 1, 2]]),
        (5, [[0, 1, 2], [1, 3, 2]]),
        (6, [[1, 2, 0], [2, 3, 0]]),
    ],
)
def test_modes_without_indices_are_read_as_triangles(mode, triangles):
    file = File()
    file.mesh(SQUARE)
    file.primitive["mode"] = mode
    assert only(file).triangles.tolist() == triangles


def test_degenerate_triangles_of_strips_are_omitted():
    file = File()
    file.mesh(SQUARE)
    file.primitive.update(mode=5, indices=file.accessor([0, 1, 2, 2, 1, 1, 3], "B"))
    # The triangles 2 2 1, 2 1 1, 1 1 3 and 1 2 2, which follow 0 1 2, have no area.
    assert only(file).triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("kind", ["B", "H", "I"])
def test_indices_select_vertices(kind):
    file = File()
    file.mesh(SQUARE)
    file.primitive["indices"] = file.accessor([3, 1, 0, 0, 2, 3, 1], kind)
    assert only(file).triangles.tolist() == [[3, 1, 0], [0, 2, 3]]
    assert warned(file) == [("G002.corners", "/meshes/0/primitives/0/indices")]


def test_points_and_lines_are_reported_once():
    file = File()
    file.mesh()
    file.primitive["mode"] = 0
    file.root["meshes"][0]["primitives"].append({**file.primitive, "mode": 3})
    assert read(file).meshes[0].primitives == ()
    assert warned(file) == [("F007.gltf-undrawn", "/meshes/0/primitives/0")]


def test_primitives_that_share_vertices_keep_only_the_used_vertices():
    file = File()
    file.mesh(SQUARE, TEXCOORD_0=file.accessor([[0, 0], [1, 0], [0, 1], [1, 1]]))
    first = file.primitive
    first["indices"] = file.accessor([0, 1, 2], "B")
    second = {**first, "indices": file.accessor([3, 1, 2], "B")}
    file.root["meshes"][0]["primitives"].append(second)
    one, two = read(file).meshes[0].primitives
    assert one.positions.tolist() == SQUARE[:3] and two.positions.tolist() == SQUARE[1:]
    assert one.triangles.tolist() == [[0, 1, 2]] and two.triangles.tolist() == [[2, 0, 1]]
    assert two.uvs[0].tolist() == [[1, 1], [0, 0], [1, 0]]


def test_unused_vertices_of_other_primitives_are_kept():
    file = File()
    file.mesh(SQUARE)
    file.primitive["indices"] = file.accessor([3, 1, 0], "B")
    assert only(file).positions.tolist() == SQUARE


def test_v_is_0_at_the_bottom_of_images():
    file = File()
    uvs = file.accessor([[0, 0], [255, 0], [0, 51]], "B", normalized=True)
    file.mesh(TEXCOORD_1=uvs)
    first, second = only(file).uvs
    assert second == pytest.approx(np.array([[0, 1], [1, 1], [0, 0.8]]), abs=1e-15)
    assert first.shape == (3, 2)  # materials refer to sets by number


def test_colours_are_read_as_linear_with_opacity():
    file = File()
    file.mesh(COLOR_0=file.accessor([[0.5, 0.25, 2], [0, 0, 0], [1, 1, 1]]))
    assert only(file).colors.tolist() == [[0.5, 0.25, 2, 1], [0, 0, 0, 1], [1, 1, 1, 1]]
    file = File()
    file.mesh(COLOR_0=file.accessor([[255, 0, 51, 255]] * 3, "B"))
    assert only(file).colors[0] == pytest.approx([1, 0, 0.2, 1])
    assert warned(file) == [("G002.normalized", "/accessors/0")]


def test_quantised_attributes_are_read():
    file = File(extensionsRequired=["KHR_mesh_quantization"])
    positions = file.accessor([[0, 0, 0, 0], [2, 0, 0, 0], [0, -3, 0, 0]], "h")
    file.root["accessors"][positions]["type"] = "VEC3"
    file.root["bufferViews"][0]["byteStride"] = 8
    normals = file.accessor([[0, 0, 127, 0]] * 3, "b", normalized=True)
    file.root["accessors"][normals]["type"] = "VEC3"
    file.root["bufferViews"][1]["byteStride"] = 4
    attributes = {"POSITION": positions, "NORMAL": normals}
    file.add("meshes", {"primitives": [{"attributes": attributes}]})
    primitive = only(file)
    assert primitive.positions.tolist() == [[0, 0, 0], [2, 0, 0], [0, -3, 0]]
    assert primitive.normals.tolist() == [[0, 0, 1]] * 3
    assert warned(file) == []


def test_all_sets_of_influences_are_concatenated():
    file = skinned()
    attributes = file.primitive["attributes"]
    attributes["JOINTS_1"] = file.accessor([[1, 0, 9, 0]] * 3, "H")
    attributes["WEIGHTS_1"] = file.accessor([[51, 0, 0, 0]] * 3, "B", normalized=True)
    primitive = only(file)
    assert primitive.joints.tolist() == [[0, 1, 0, 0, 1, 0, 0, 0]] * 3
    assert primitive.weights[0] == pytest.approx([0.25, 0.75, 0, 0, 0.2, 0, 0, 0])
    assert warned(file) == []


def test_joints_without_weights_are_ignored():
    file = skinned()
    file.primitive["attributes"]["JOINTS_1"] = file.accessor([[1, 0, 0, 0]] * 3, "B")
    assert only(file).joints.shape == (3, 4)
    assert warned(file) == [("G004.influence-sets", "/meshes/0/primitives/0/attributes")]
    source = source_of(file)
    read_nodes(source)
    said = [found.message for found in source.diagnostics]
    assert said == ["joints without weights, or weights without joints, in set 1: ignored"]


def test_joints_must_exist_in_the_skin():
    file = skinned()
    joints = file.accessor([[0, 1, 0, 0], [0, 1, 0, 0], [0, 2, 7, 0]], "B")
    file.primitive["attributes"]["JOINTS_0"] = joints
    pointer = "/meshes/0/primitives/0/attributes/JOINTS_0"
    assert refused(file) == ("W010.gltf-joint", pointer)
    with pytest.raises(
        Exception, match=r"vertex 2: expected a joint index below 2 \(skin 0\), found 2$"
    ):
        read(file)


def targets(file: File, **members: object) -> None:
    """Add two morph targets to the first mesh, one of them sparse."""
    offsets = {"componentType": 5126, "count": 3, "type": "VEC3"}
    offsets["sparse"] = {
        "count": 1,
        "indices": {"bufferView": file.view(b"\1"), "componentType": 5121},
        "values": {"bufferView": file.view(np.array([1, 2, 3], "<f4").tobytes())},
    }
    first = {"POSITION": file.accessor([[0, 0, 1]] * 3), "NORMAL": file.accessor([[1, 0, 0]] * 3)}
    second = {"POSITION": file.add("accessors", offsets)}
    file.primitive["targets"] = [first, second]
    file.root["meshes"][0] |= members


def test_morph_targets_are_read_with_names_and_weights():
    file = File(nodes=[{"mesh": 0, "weights": [0.5, 2]}])
    file.mesh()
    targets(file, weights=[0, 0.25], extras={"targetNames": ["up", "aside"]})
    content = read(file)
    [mesh] = content.meshes
    assert mesh.target_names == ("up", "aside") and mesh.shape_weights.tolist() == [0, 0.25]
    assert content.tree.shape_weights[0].tolist() == [0.5, 2]
    [primitive] = mesh.primitives
    first, second = primitive.targets.dense().tolist()
    assert first == [[0, 0, 1]] * 3 and second == [[0, 0, 0], [1, 2, 3], [0, 0, 0]]
    assert primitive.normal_targets.dense().tolist() == [[[1, 0, 0]] * 3, [[0, 0, 0]] * 3]


def test_morph_target_names_are_read_from_several_places():
    file = File()
    file.mesh()
    targets(file)
    assert read(file).meshes[0].target_names == ("", "")
    file.primitive["extras"] = {"targetNames": ["up", "aside"]}
    assert read(file).meshes[0].target_names == ("up", "aside")
    del file.primitive["extras"]
    file.primitive["targets"][1]["extras"] = {"name": "aside"}
    assert read(file).meshes[0].target_names == ("", "aside")


def test_wrong_number_of_morph_weights_is_a_warning():
    file = File()
    file.mesh()
    targets(file, weights=[1])
    assert read(file).meshes[0].shape_weights.tolist() == [1, 0]
    assert warned(file) == [("G002.weights", "/meshes/0/weights")]
    del file.root["meshes"][0]["weights"]
    file.root["nodes"] = [{"mesh": 0, "weights": [1, 2, 3]}, {"weights": [1]}]
    weights = read(file).tree.shape_weights
    assert {node: values.tolist() for node, values in weights.items()} == {0: [1, 2]}
    assert warned(file) == [("G002.weights", "/nodes/0/weights")]


def test_primitives_must_have_the_same_morph_targets():
    file = File()
    file.mesh()
    targets(file)
    without = {"attributes": file.primitive["attributes"]}
    file.root["meshes"][0]["primitives"].append(without)
    assert refused(file) == ("F002.gltf-targets", "/meshes/0/primitives/1/targets")


def test_non_finite_numbers_are_refused_or_replaced():
    file = File()
    file.mesh([*TRIANGLE[:2], [0, np.nan, 0]])
    assert refused(file)[0] == "F003.gltf-positions"
    file = File()
    file.mesh(NORMAL=file.accessor([[0, 0, 1], [0, np.inf, 0], [0, 0, 1]]))
    assert only(file).normals.tolist() == [[0, 0, 1], [0, 0, 0], [0, 0, 1]]
    assert warned(file) == [("G002.finite", "/meshes/0/primitives/0/attributes/NORMAL")]
    file = skinned()
    weights = file.accessor([[np.nan, 1, 0, 0]] * 3)
    file.primitive["attributes"]["WEIGHTS_0"] = weights
    assert refused(file)[0] == "W003.gltf-weights"


@pytest.mark.parametrize(
    ("members", "key", "pointer"),
    [
        ({"mode": 7}, "F002.gltf-type", "/mode"),
        ({"attributes": 3}, "F002.gltf-type", "/attributes"),
        ({"attributes": {"POSITION": 5}}, "F002.gltf-index", "/attributes/POSITION"),
        ({"indices": 0}, "F002.gltf-kind", "/indices"),
        ({"indices": 1}, "F002.gltf-corner", "/indices"),
        ({"indices": 2}, "F002.gltf-whole", "/indices"),
        ({"material": 0}, "F002.gltf-index", "/material"),
        ({"targets": [{"POSITION": 1}]}, "F002.gltf-vertices", "/targets/0/POSITION"),
        ({"targets": 1}, "F002.gltf-type", "/targets"),
    ],
)
def test_invalid_primitives_are_refused(members, key, pointer):
    file = File()
    file.mesh()
    file.accessor([0, 1, 3, 0], "B")
    file.accessor([0.0, 1.0, 2.0])
    file.primitive.update(members)
    assert refused(file) == (key, f"/meshes/0/primitives/0{pointer}")


MOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]


def bound(matrices: list[list[float]]) -> File:
    file = skinned()
    file.root["skins"][0]["inverseBindMatrices"] = file.accessor(matrices)
    return file


def test_joints_and_matrices_are_read():
    [skin] = read(bound([MOVED, MOVED])).skins
    assert skin.joints.tolist() == [1, 2]
    assert skin.inverse_bind[1, :3, 3].tolist() == [1, 2, 3]


def test_missing_matrices_are_the_identity():
    [skin] = read(skinned()).skins
    assert skin.inverse_bind.tolist() == [np.eye(4).tolist()] * 2


def test_surplus_matrices_are_ignored_with_a_warning():
    file = bound([MOVED] * 3)
    assert read(file).skins[0].inverse_bind.shape == (2, 4, 4)
    assert warned(file) == [("G004.bind-count", "/skins/0/inverseBindMatrices")]


@pytest.mark.parametrize(
    ("matrices", "key"),
    [
        ([MOVED], "F002.gltf-bind-count"),
        ([MOVED, [*MOVED[:15], 2.0]], "F002.gltf-bind-row"),
        ([MOVED, [*MOVED[:3], 1.0, *MOVED[4:]]], "F002.gltf-bind-row"),
        ([[np.nan, *MOVED[1:]], MOVED], "F003.gltf-bind"),
    ],
)
def test_invalid_matrices_are_refused(matrices, key):
    assert refused(bound(matrices)) == (key, "/skins/0/inverseBindMatrices")


@pytest.mark.parametrize(
    ("skin", "key", "pointer"),
    [
        ({"joints": [1, 3]}, "F002.gltf-index", "/joints/1"),
        ({"joints": [1, "2"]}, "F002.gltf-type", "/joints/1"),
        ({}, "F002.gltf-missing", ""),
        ({"joints": [1, 2], "inverseBindMatrices": 3}, "F002.gltf-index", "/inverseBindMatrices"),
        ({"joints": [1, 2], "inverseBindMatrices": 0}, "F002.gltf-kind", "/inverseBindMatrices"),
    ],
)
def test_invalid_skins_are_refused(skin, key, pointer):
    file = skinned()
    file.root["skins"] = [skin]
    assert refused(file) == (key, f"/skins/0{pointer}")


def test_skin_without_joints_is_ignored():
    file = skinned()
    file.root["skins"][0]["joints"] = []
    file.root["skins"].append({"joints": [2]})
    file.root["nodes"][2]["skin"] = 1
    content = read(file)
    assert [skin.joints.tolist() for skin in content.skins] == [[2]]
    assert content.tree.skins.tolist() == [-1, -1, 0]
    assert warned(file) == [("G004.no-joints", "/skins/0/joints")]


def test_skeleton_that_is_not_a_node_is_ignored():
    file = skinned()
    file.root["skins"][0]["skeleton"] = 3
    assert warned(file) == [("G004.skeleton", "/skins/0/skeleton")]
    file.root["skins"][0]["skeleton"] = 1
    assert warned(file) == []


NAME = "KHR_draco_mesh_compression"
# A square of two triangles, as DracoPy 2.2 encodes it.
STREAM = bytes.fromhex(
    "445241434f02020100000002040100010201030201010009030000020001010003030130011003002882881100000000"
    "ff3f00000000000000000000000000000000803f0e"
)
POINTER = f"/meshes/0/primitives/0/extensions/{NAME}"


def compressed(data: bytes = STREAM, **members: object) -> File:
    """Return a mesh that has only compressed data."""
    file = File(extensionsUsed=[NAME], extensionsRequired=[NAME])
    file.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3"})
    file.add("accessors", {"componentType": 5121, "count": 6, "type": "SCALAR"})
    extension = {"bufferView": file.view(data), "attributes": {"POSITION": 0}, **members}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": {NAME: extension}}
    file.add("meshes", {"primitives": [primitive]})
    return file


def test_positions_and_triangles_are_decoded():
    pytest.importorskip("DracoPy")
    [primitive] = read(compressed()).meshes[0].primitives
    assert primitive.positions.tolist() == SQUARE
    assert primitive.triangles.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_vertex_count_is_that_of_the_compressed_data():
    pytest.importorskip("DracoPy")
    file = compressed()
    file.root["accessors"][0]["count"] = 2**40
    assert len(read(file).meshes[0].primitives[0].positions) == 4


@pytest.mark.parametrize(
    ("file", "key", "pointer"),
    [
        (compressed(STREAM[:40]), "F002.gltf-compressed", POINTER),
        (
            compressed(attributes={"POSITION": 7}),
            "F002.gltf-draco-id",
            f"{POINTER}/attributes/POSITION",
        ),
        (compressed(attributes=[]), "F002.gltf-type", f"{POINTER}/attributes"),
        (compressed(bufferView=4), "F002.gltf-index", f"{POINTER}/bufferView"),
    ],
)
def test_invalid_data_are_refused(file, key, pointer):
    pytest.importorskip("DracoPy")
    assert refused(file) == (key, pointer)


def test_uncompressed_data_are_required_without_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    assert refused(compressed()) == ("F002.gltf-draco", POINTER)
    file = compressed()
    del file.root["extensionsRequired"]
    file.primitive["attributes"]["POSITION"] = file.accessor(SQUARE)
    file.primitive["indices"] = file.accessor([2, 1, 0], "B")
    [primitive] = read(file).meshes[0].primitives
    assert primitive.triangles.tolist() == [[2, 1, 0]]
