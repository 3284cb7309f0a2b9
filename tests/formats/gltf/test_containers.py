"""Containers of glTF: GLB chunks and lengths, JSON, and embedded and external buffers."""

import gc
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from formats.gltf.files import File, glb, read, refused, source_of, warned

import viewer
from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats.gltf import read_nodes
from viewer.formats.gltf.document import parsed_json

TEXT = b'{"asset": {"version": "2.0"}, "nodes": [{"name": "a"}]}'


def triangle() -> File:
    file = File(nodes=[{"mesh": 0}])
    file.mesh()
    return file


def test_text_and_binary_files_have_the_same_contents():
    for data in (triangle().json(), triangle().glb(), b"\xef\xbb\xbf" + triangle().json()):
        [mesh] = read(data).meshes
        assert mesh.primitives[0].positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        assert warned(data) == []


def test_binary_file_may_end_with_a_control_z():
    data = glb([(b"JSON", TEXT + b" "), (b"odd\x1a", b"\x1a" * 4)])
    assert source_of(data).data == data and warned(data) == []


def test_unknown_chunks_are_skipped_and_repeated_chunks_reported():
    file = triangle()
    text = json.dumps({**file.root, "buffers": [{"byteLength": 36}]}).encode()
    chunks = [(b"JSON", text), (b"NOTE", b"?"), (b"BIN\0", file.binary), (b"BIN\0", b"more")]
    assert len(read(glb(chunks)).meshes[0].primitives[0].positions) == 3
    assert warned(glb(chunks)) == [("G001.chunk-again", ""), ("G001.chunk-order", "")]


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ((1, 0), "expected the JSON chunk as the first one, found BIN"),
        ((0, 2, 1), "expected the BIN chunk as the second one, found NOTE"),
        ((2, 0, 1), "expected the JSON chunk as the first one, found NOTE"),
        ((0, 1, 2), ""),
    ],
)
def test_chunks_in_another_order_are_reported(order, message):
    file = triangle()
    text = json.dumps({**file.root, "buffers": [{"byteLength": 36}]}).encode()
    chunks = (b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", file.binary), (b"NOTE", b"abcd")
    source = source_of(glb([chunks[place] for place in order]))
    assert len(read_nodes(source).meshes) == 1
    assert [found.message for found in source.diagnostics] == ([message] if message else [])


def test_numbers_beyond_double_precision_are_reported():
    text = b'{"asset": {"version": "2.0"}, "extras": [1e999, -1E+400, 1e308, 1]}'
    source = source_of(text)
    read_nodes(source)
    (found,) = source.diagnostics
    assert found.message == "2 numbers too large for double precision (first: 1e999)"


@pytest.mark.parametrize("padding", [b"\0\0\0", b"   ", b"\n\t\0"])
def test_json_chunk_may_be_padded_with_white_space_or_zeros(padding):
    data = glb([(b"JSON", TEXT + padding)])
    assert read(data).tree.names == ("a",)
    is_odd = padding.endswith(b"\0")
    assert warned(data) == ([("G001.padding", "")] if is_odd else [])


def test_chunks_after_padding_outside_the_chunk_length_are_found():
    file = triangle()
    text = json.dumps({**file.root, "buffers": [{"byteLength": 36}]}).encode()
    text += b" " * ((1 - len(text)) % 4)  # one more than a multiple of 4
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + b"\0\0\0"
    chunks += struct.pack("<I4s", 36, b"BIN\0") + file.binary
    data = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
    assert len(read(data).meshes) == 1 and warned(data) == []


def test_wrong_lengths_are_warnings_if_no_data_are_missing():
    data = triangle().glb()
    longer = data[:8] + struct.pack("<I", len(data) + 8) + data[12:]
    shorter = data[:8] + struct.pack("<I", 0) + data[12:]
    for changed in (longer, shorter, data + b"tail"):
        assert len(read(changed).meshes) == 1
        assert warned(changed) == [("G001.length", "")]


def test_truncated_binary_chunk_is_an_error_if_data_are_missing():
    data = triangle().glb()[:-12]
    source = source_of(data)
    with pytest.raises(FormatError) as caught:
        read_nodes(source)
    assert caught.value.diagnostic.pointer == "/bufferViews/0"
    assert [found.key for found in source.diagnostics] == [
        "G001.length",
        "G001.chunk-length",
        "G001.buffer",
    ]


def test_binary_chunk_may_be_longer_than_its_buffer():
    file = triangle()
    text = json.dumps({**file.root, "buffers": [{"byteLength": 36}]}).encode()
    data = glb([(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", file.binary + bytes(400))])
    assert len(read(data).meshes) == 1 and warned(data) == []


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (b"glTF", "F002.glb-header"),
        (struct.pack("<4sII", b"glTF", 1, 20) + bytes(8), "F002.gltf-version"),
        (glb([(b"BIN\0", b"1234")]), "F002.glb-json"),
        (glb([(b"JSON", TEXT)])[:40], "F002.glb-chunk"),
        (glb([(b"JSON", b"    ")]), "F002.gltf-no-json"),
        (b'{"nodes": [1,]}', "F002.gltf-json"),
        (b"[" * 100_000, "F002.json-nesting"),
        (b'{"a":' * 100_000, "F002.json-nesting"),
        (b'{"scene": ' + b"1" * 5000 + b"}", "F002.gltf-digits"),
        ('{"asset": {}}'.encode("utf-16"), "F002.gltf-utf-16"),
        (b"[1]", "F002.gltf-type"),
        (b'{"asset": {"version": "1.0"}}', "F002.gltf-version"),
        (b'{"asset": {"version": 1}}', "F002.gltf-version"),
        (b'{"asset": {"version": true}}', "F002.gltf-type"),
        (b'{"asset": {"version": "1.0"}, "buffers": {}, "accessors": {}}', "F002.gltf-version"),
        (b'{"asset": {"version": "2.0", "minVersion": "2.1"}}', "F002.gltf-version"),
        (b'{"asset": {"version": 2.0}}', "F002.gltf-type"),
    ],
)
def test_broken_containers_are_refused(data, key):
    assert refused(data)[0] == key


def test_syntax_errors_have_a_line_number():
    with pytest.raises(FormatError) as caught:
        read(b'{\n"nodes": [\n{,\n')
    assert str(caught.value).startswith("a.gltf:3: expected JSON, found a syntax error")


def test_json_above_half_a_gigabyte_is_refused(monkeypatch):
    monkeypatch.setattr("viewer.formats.gltf.document._MOST_BYTES", 50)
    assert refused(TEXT) == ("F001.gltf-text", "")
    assert len(read(b'{"asset": {"version": "2.0"}}').meshes) == 0


def test_deviations_from_json_are_reported_as_warnings():
    head = b'{"asset": {"version": "2.0"}, '
    assert warned(head + b'"extras": NaN, "nodes": [], "nodes": [{}]}') == [
        ("G001.constants", ""),
        ("G001.repeated", ""),
    ]
    nulls = b'"scene": null, "extras": {"a": null}, "nodes": [{"name": null, "mesh": null}]}'
    assert warned(head + nulls) == [("G001.nulls", "")]
    assert read(head + nulls).extras == {"a": None} and read(head + nulls).tree.names == ("",)
    assert warned(head + b'"nodes": [{"name": "a\xff"}]}') == [("G001.text", "")]
    assert read(head + b'"nodes": [{"name": "a\xff"}]}').tree.names == ("a\ufffd",)
    assert warned(b"{}") == [("G001.no-asset", "")]


def test_garbage_collection_is_suspended_while_json_is_parsed():
    lists = b",".join([b"[]"] * 5000)
    text = b'{"asset": {"version": "2.0"}, "extras": [' + lists + b"]}"
    phases: list[str] = []

    def note(phase: str, _: dict[str, int]) -> None:
        phases.append(phase)

    gc.callbacks.append(note)
    try:
        json.loads(text)
        usual = phases.count("start")
        parsed_json(source_of(text), text, has_lines=True)
    finally:
        gc.callbacks.remove(note)
    # The first new object after parsing may start a collection.
    assert usual > 1 and phases.count("start") <= usual + 1


def test_garbage_collection_resumes_after_broken_json():
    assert gc.isenabled()
    assert refused(b'{"asset": [') == ("F002.gltf-json", "")
    assert gc.isenabled()


@pytest.mark.parametrize(
    "uri",
    [
        "data:application/octet-stream;base64,AAAAAAAAgD8=",
        "data:;base64,AAAAAAAAgD8",
        "data:;base64,AAAA%41AAAgD8=",
        "data:application/gltf-buffer;BASE64, AAAAAAAA gD8= ",
        "data:,%00%00%00%00%00%00%80%3F",
    ],
)
def test_data_uris_are_decoded(uri):
    file = File(nodes=[{"mesh": 0}])
    file.root["buffers"] = [{"uri": uri, "byteLength": 8}]
    file.root["bufferViews"] = [{"buffer": 0, "byteLength": 8}]
    accessor = {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR"}
    file.root["accessors"] = [accessor]
    from viewer.formats.gltf.document import open_document

    document = open_document(source_of(json.dumps(file.root).encode()))
    assert document.accessors.floats(0, ("SCALAR",), "")[:, 0].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("uri", "key"),
    [
        ("data:;base64", "F002.gltf-data-uri"),
        ("data:;base64,AA?A", "F002.gltf-base64"),
        ("data:;base64,A", "F002.gltf-base64"),
        ("https://example.org/a.bin", "F002.gltf-scheme"),
        ("file:///etc/passwd", "F002.gltf-scheme"),
        ("../a.bin", "F002.gltf-outside"),
        ("%2e%2e/a.bin", "F002.gltf-outside"),
        ("/etc/passwd", "F002.gltf-outside"),
        ("C:\\a.bin", "F002.gltf-outside"),
        (7, "F002.gltf-type"),
    ],
)
def test_unreadable_uris_are_refused(uri, key):
    file = triangle()
    file.root["buffers"] = [{"uri": uri, "byteLength": 36}]
    assert refused(file) == (key, "/buffers/0/uri")


@pytest.mark.parametrize(
    ("name", "uri"), [("a b.bin", "a%20b.bin"), ("ä.bin", "%C3%A4.bin"), ("50%25.bin", "50%25.bin")]
)
def test_external_files_are_read(tmp_path, name, uri):
    file = triangle()
    (tmp_path / name).write_bytes(file.binary)
    source = Source(tmp_path / "a.gltf", file.json(uri))
    assert len(read_nodes(source).meshes) == 1
    assert source.also_read == [tmp_path / name]


def test_missing_external_file_is_named_in_the_error(tmp_path):
    with pytest.raises(FormatError, match=r"a\.gltf#/buffers/0/uri: .*gone\.bin: cannot be read"):
        read(triangle().json("gone.bin"), tmp_path / "a.gltf")


def test_buffer_without_data_is_refused():
    file = triangle()
    file.root["buffers"] = [{"byteLength": 36}]
    assert refused(file) == ("F002.gltf-no-data", "/buffers/0")


def test_unknown_extensions_are_refused_if_required_and_reported_if_used():
    file = File(extensionsUsed=["ODD_a", "KHR_mesh_quantization", "ODD_b"])
    assert warned(file) == [("F007.gltf-extensions", "/extensionsUsed")]
    file.root["extensionsRequired"] = ["KHR_mesh_quantization", "ODD_b"]
    with pytest.raises(FormatError, match=r"found ODD_b, without which "):
        read(file)


@pytest.mark.parametrize(
    "name",
    ["KHR_materials_clearcoat", "KHR_texture_basisu", "EXT_lights_ies", "KHR_audio", "MSFT_lod"],
)
def test_required_extensions_of_the_look_are_reported(name):
    file = triangle()
    file.root["extensionsUsed"] = file.root["extensionsRequired"] = [name]
    source = source_of(file)
    assert len(read_nodes(source).meshes) == 1
    (found,) = source.diagnostics
    assert (found.key, found.pointer) == ("F007.gltf-look", "/extensionsRequired")
    assert found.message.startswith(f"{name} not shown")


def test_hidden_nodes_are_not_drawn(tmp_path):
    file = triangle()
    hidden = {"KHR_node_visibility": {"visible": False}}
    file.root["nodes"] = [
        {"name": "shown", "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": True}}},
        {"name": "above", "children": [2], "extensions": hidden},
        {"name": "below", "mesh": 0, "translation": [5, 0, 0]},
    ]
    file.root["extensionsUsed"] = file.root["extensionsRequired"] = ["KHR_node_visibility"]
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    scene = viewer.load(path)
    (note,) = [found for found in scene.diagnostics if found.key == "F007.gltf-hidden"]
    assert note.message == "1 node is hidden by KHR_node_visibility: below"
    (actor,) = scene.actors
    names = [actor.figure.mesh.parts[part] for part in actor.hidden_parts]
    assert names == ["below"]


def opened(folder: Path, name: str) -> NodeFile:
    source = Source.open(folder / "gltf" / name)
    content = read_nodes(source)
    assert source.warnings == []
    return content


def test_fox_has_the_published_counts(shared_data):
    content = opened(shared_data, "Fox.glb")
    assert [animation.name for animation in content.animations] == ["Survey", "Walk", "Run"]
    assert len(content.skins[0].joints) == 24
    [primitive] = content.meshes[0].primitives
    # Without indices, every triangle has its own vertices.
    assert primitive.triangles.ravel().tolist() == list(range(1728))
    assert 150 < np.ptp(primitive.positions, axis=0)[2] < 160


def test_animations_with_late_constant_keys_are_read(shared_data):
    content = opened(shared_data, "fox-animations.glb")
    assert len(content.animations) == 14
    channels = [channel for animation in content.animations for channel in animation.read()]
    assert {channel.interpolation for channel in channels} == {"linear", "step"}
    assert min(animation.start for animation in content.animations) > 0.0


def test_cesium_man_has_the_published_counts(shared_data):
    content = opened(shared_data, "cesium_man.gltf")
    weights = content.meshes[0].primitives[0].weights
    assert weights is not None
    assert (np.abs(weights.sum(axis=1) - 1.0) > 1e-3).sum() == 210
    assert not content.tree.matrices  # rotations include rounding


def test_vertices_may_have_ten_influences(shared_data):
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
def test_spline_animations_are_read(shared_data, name, path, names):
    content = opened(shared_data, name)
    [channel] = content.animations[0].read()
    assert (channel.path, channel.interpolation) == (path, "cubic")
    assert content.meshes[0].target_names == names


def test_skeleton_without_mesh_is_read(shared_data):
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
def test_characters_are_read(shared_data, name, extension):
    assert extension in opened(shared_data, name).extensions
