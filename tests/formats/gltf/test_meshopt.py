"""Compressed buffer views: streams written by meshoptimizer 1.0, and a group encoded by hand."""

import json

import numpy as np
import pytest
from formats.gltf.files import File, read, refused

from viewer.formats.gltf.meshopt import (
    decoded_attributes,
    decoded_indices,
    decoded_triangles,
    filtered,
)

N = np.arange(20)
SHORTS = np.stack([N * N, -3 * N, N * 7919 % 32768, 0 * N + 5], axis=1).astype("<i2")
FLOATS = np.stack([N * 0.5, 0 * N + 100.0], axis=1).astype("<f4")
TRIANGLES = [0, 1, 2, 2, 1, 3, 2, 3, 4, 7, 6, 5, 4, 3, 5, 0, 2, 9]

VERSION_0 = (
    "a0070002060a0e12161a1e22262a2e32363aff0000003e42464a04800000000a0555555555555555555500000000"
    "000001100000000700212121212121212121212121212121ff0000002121212107003c3e3e3ec13e3e3ec13e3e3e"
    "c13e3eff0000003cc13e3e00000000000000000000000000000000000000000000000000000000000000000500"
)
VERSION_1 = (
    "a19baf0002060a0e12161a1e22262a2e32363a3e42464a0205555555555555550f00050505050021212121212121"
    "212121212121212121212121003c3e3e3ec13e3e3ec13e3e3ec13e3e3cc13e3e0000000000000000000000000000"
    "00000000000005000100"
)
WITH_XOR = (
    "a168aa011200070f020ff8f4c4f262e262e010f81c0f003e01030100000000000000000000000000000000000000"
    "00c8425200"
)
TRIANGLE_STREAM = "e1f01000fe429ff00e04007687566778a9866589689801690000"
INDEX_STREAM = "d10004040002080204040c020202020812081c00000000"


def rotated(corners: np.ndarray) -> list[list[int]]:
    """Return triangles that start with the smallest index, because the encoder rotates them."""
    rows = corners.reshape(-1, 3).tolist()
    return [row[row.index(min(row)) :] + row[: row.index(min(row))] for row in rows]


def stream(text: str) -> np.ndarray:
    return np.frombuffer(bytes.fromhex(text), dtype=np.uint8)


@pytest.mark.parametrize(
    ("text", "expected"),
    [(VERSION_0, SHORTS), (VERSION_1, SHORTS), (WITH_XOR, FLOATS)],
    ids=["version 0", "version 1", "version 1 with XOR"],
)
def test_attributes_are_decoded(text, expected):
    found = decoded_attributes(stream(text), 20, 8)
    assert found is not None and found.tobytes() == expected.tobytes()


def test_deltas_match_the_example_in_the_specification():
    group = "175ff0bc77a9210034b5"
    # One group of 4 bits is followed by three groups of zeros and an element of zeros.
    data = stream("a0" + "02" + group + "000000" + "00" * 32)
    found = decoded_attributes(data, 16, 4)
    deltas = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]
    assert found is not None
    assert found.reshape(16, 4)[:, 0].tolist() == (np.cumsum(deltas) % 256).tolist()
    assert not found.reshape(16, 4)[:, 1:].any()


@pytest.mark.parametrize("stride", [2, 4])
def test_triangles_and_indices_are_decoded(stride):
    found = decoded_indices(stream(INDEX_STREAM), 18, stride)
    assert found is not None and found.view(f"<u{stride}").tolist() == TRIANGLES
    found = decoded_triangles(stream(TRIANGLE_STREAM), 18, stride)
    assert found is not None
    assert rotated(found.view(f"<u{stride}")) == rotated(np.array(TRIANGLES))


@pytest.mark.parametrize(
    ("text", "count", "stride", "name", "dtype", "expected", "step"),
    [
        (
            ("a1ef00fe00bc00fe6b39000403000000000000000000000000000000000000000000007f7f00"),
            *(4, 4, "OCTAHEDRAL", "i1"),
            [[0, 0, 127, 127], [0, 0, -127, -127], [76, 0, -102, 127], [-61, 76, 81, 127]],
            2,
        ),
        (
            (
                "a1ffba00010073000e00130001d970000e0503000403000000000000000000000000000000000000"
                "00ff07ff7f0001"
            ),
            *(4, 8, "OCTAHEDRAL", "<i2"),
            np.round(
                np.array([[0, 0, 1, 1], [0, 0, -1, -1], [0.6, 0, -0.8, 1], [-0.48, 0.6, 0.64, 1]])
                * 32767
            ),
            10,  # 12 bits are stored
        ),
        (
            (
                "a1ffbf0000fc0000b500c73300d8230000fc0000b500010300000000000000000000000000000000"
                "00000000ff7f0000"
            ),
            *(3, 8, "QUATERNION", "<i2"),
            np.round(np.array([[0, 0, 0, 1], [0.6, 0, 0.8, 0], [0.5, -0.5, 0.5, -0.5]]) * 32767),
            2,
        ),
        (
            (
                "a1effbee000f00040011002800fd001300200011000000000000000000080000fdecfffffd002000"
                "fd000100"
            ),
            *(2, 12, "EXPONENTIAL", "<f4"),
            [[1, -2.5, 1024], [0.125, 0, 3]],
            0,
        ),
        (
            ("a1ff004c009c007e00fd00000000000000000000000000000000000000407fc1ff00"),
            *(2, 4, "COLOR", "u1"),
            [[255, 0, 0, 255], [51, 102, 153, 0]],
            1,
        ),
    ],
    ids=["octahedral", "octahedral 16", "quaternion", "exponential", "color"],
)
def test_filters_match_the_values_given_to_the_encoder(
    text, count, stride, name, dtype, expected, step
):
    decoded = decoded_attributes(stream(text), count, stride)
    assert decoded is not None
    found = filtered(decoded, name, stride).view(dtype).reshape(count, -1).astype(np.float64)
    if name == "QUATERNION":  # both signs are the same rotation
        found *= np.sign(np.einsum("nc,nc->n", found, expected))[:, None]
    assert np.abs(found - expected).max() <= step


@pytest.mark.parametrize("text", [VERSION_0, VERSION_1, WITH_XOR, TRIANGLE_STREAM, INDEX_STREAM])
def test_damaged_streams_are_detected(text):
    whole = stream(text)
    size = {"a": (20, 8), "e": (18, 4), "d": (18, 4)}[text[0]]
    decoders = {"a": decoded_attributes, "e": decoded_triangles, "d": decoded_indices}
    decode = decoders[text[0]]
    for length in range(len(whole)):
        assert decode(whole[:length], *size) is None
    random = np.random.default_rng(1)
    for _ in range(200):
        broken = whole.copy()
        broken[random.integers(len(whole), size=3)] = random.integers(256, size=3)
        found = decode(broken, *size)
        assert found is None or len(found) == size[0] * size[1]


def compressed(extension: str = "EXT_meshopt_compression") -> File:
    """Return a mesh whose positions and indices exist only in compressed form."""
    file = File(extensionsUsed=[extension], extensionsRequired=[extension])
    positions = bytes.fromhex(VERSION_0)
    for data, mode, count, stride in (
        (positions, "ATTRIBUTES", 20, 8),
        (bytes.fromhex(TRIANGLE_STREAM), "TRIANGLES", 18, 4),
    ):
        part = {"buffer": 0, "byteOffset": len(file.binary), "byteLength": len(data)}
        file.binary += data
        part |= {"mode": mode, "count": count, "byteStride": stride}
        plain = {"buffer": 1, "byteLength": count * stride, "extensions": {extension: part}}
        if mode == "ATTRIBUTES":
            plain["byteStride"] = stride
        file.add("bufferViews", plain)
    base = {"bufferView": 0, "componentType": 5122, "count": 20, "type": "VEC3"}
    file.add("accessors", base)
    corners = {"bufferView": 1, "componentType": 5125, "count": 18, "type": "SCALAR"}
    file.add("accessors", corners)
    file.add("meshes", {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]})
    return file


def text_of(file: File) -> bytes:
    root = json.loads(file.json())
    root["buffers"].append({"byteLength": 10_000, "extensions": {"x": {"fallback": True}}})
    return json.dumps(root).encode()


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_file_with_only_compressed_data_is_read(extension):
    [primitive] = read(text_of(compressed(extension))).meshes[0].primitives
    assert primitive.positions.tolist() == SHORTS[:, :3].tolist()
    assert rotated(primitive.triangles) == rotated(np.array(TRIANGLES))


@pytest.mark.parametrize(
    ("members", "key", "member"),
    [
        ({"mode": "POINTS"}, "F002.gltf-type", "/mode"),
        ({"filter": "ODD"}, "F002.gltf-type", "/filter"),
        ({"filter": "QUATERNION", "byteStride": 4}, "F002.gltf-type", "/byteStride"),
        ({"byteStride": 6}, "F002.gltf-type", "/byteStride"),
        ({"byteStride": 0}, "F002.gltf-type", "/byteStride"),
        ({"count": 300}, "F002.gltf-compressed", ""),
        ({"count": 2**40}, "F002.gltf-decoded", ""),
        ({"byteLength": 90}, "F002.gltf-compressed", ""),
        ({"byteLength": 9000}, "F002.gltf-view", ""),
        ({"buffer": 7}, "F002.gltf-index", "/buffer"),
    ],
)
def test_invalid_compression_is_refused(members, key, member):
    file = compressed()
    file.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"].update(members)
    pointer = f"/bufferViews/0/extensions/EXT_meshopt_compression{member}"
    assert refused(text_of(file)) == (key, pointer)
