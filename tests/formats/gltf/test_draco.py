"""Primitives compressed with Draco, with and without DracoPy."""

import sys

import pytest
from formats.gltf.files import File, read, refused

NAME = "KHR_draco_mesh_compression"
# A square of two triangles, as DracoPy 2.2 encodes it.
STREAM = bytes.fromhex(
    "445241434f02020100000002040100010201030201010009030000020001010003030130011003002882881100000000"
    "ff3f00000000000000000000000000000000803f0e"
)
SQUARE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
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


def test_positions_and_triangles_are_decoded() -> None:
    pytest.importorskip("DracoPy")
    [primitive] = read(compressed()).meshes[0].primitives
    assert primitive.positions.tolist() == SQUARE
    assert primitive.triangles.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_vertex_count_is_that_of_the_compressed_data() -> None:
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
def test_invalid_data_are_refused(file: File, key: str, pointer: str) -> None:
    pytest.importorskip("DracoPy")
    assert refused(file) == (key, pointer)


def test_uncompressed_data_are_required_without_the_library(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    assert refused(compressed()) == ("F002.gltf-draco", POINTER)
    file = compressed()
    del file.root["extensionsRequired"]
    file.primitive["attributes"]["POSITION"] = file.accessor(SQUARE)
    file.primitive["indices"] = file.accessor([2, 1, 0], "B")
    [primitive] = read(file).meshes[0].primitives
    assert primitive.triangles.tolist() == [[2, 1, 0]]
