"""The ``.ply`` reader for text and both byte orders: contents, warnings, and refusals."""

import struct

import numpy as np
import pytest
from faults import Fault, refusal_of, warnings_of

import viewer
from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats import Source, detect, ply
from viewer.formats.ply import elements
from viewer.formats.ply.elements import line_sizes
from viewer.media.png import encode_png
from viewer.phrases import brief

VERTEX = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 2\nproperty list uchar int vertex_indices\n"
HEAD = "ply\nformat ascii 1.0\n"
ORDERS = ["ascii", "binary_little_endian", "binary_big_endian"]
POINTS = "0 0 0\n2 0 0\n2 2 0\n0 2 0\n"
GOOD = f"{HEAD}{VERTEX}{FACE}end_header\n{POINTS}3 0 1 2\n4 0 1 2 3\n"
SQUARE = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
         "float": "f", "double": "d"}  # fmt: skip


def read(data, path="a.ply"):
    """Return the figure of a text, and its warnings as (key, line, values)."""
    source = Source(path, data if isinstance(data, bytes) else data.encode())
    return ply.read(source), warnings_of(source.diagnostics)


def silent(data):
    figure, warnings = read(data)
    assert warnings == []
    return figure


def vertex(row: int) -> Phrase:
    return Phrase("{element} {row}", element=brief("vertex"), row=row)


def unused(*names: str) -> Fault:
    return "F007.ply-unused", None, {"names": list(names)}


def refusal(data):
    return refusal_of(lambda: read(data))


def binary(order, elements, comments=()) -> bytes:
    """Write elements, each (name, properties, rows), using only struct."""
    kind = {"<": "little", ">": "big"}[order]
    lines = ["ply", f"format binary_{kind}_endian 1.0", *comments]
    body = b""
    for name, properties, rows in elements:
        lines.append(f"element {name} {len(rows)}")
        lines += [f"property {text}" for text in properties]
        for row in rows:
            for text, value in zip(properties, row, strict=True):
                words = text.split()
                if words[0] == "list":
                    body += struct.pack(order + CODES[words[1]], len(value))
                    body += struct.pack(f"{order}{len(value)}{CODES[words[2]]}", *value)
                else:
                    body += struct.pack(order + CODES[words[0]], value)
    return "\n".join([*lines, "end_header\n"]).encode() + body


def test_ascii_file_is_read():
    figure = silent(GOOD)
    assert figure.mesh.positions.tolist() == SQUARE
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    assert figure.mesh.normals.tolist() == [[0, 0, 1]] * 4
    assert figure.facts == (
        ("polygons", "1 triangle, 1 quad: 3 triangles in all"),
        ("normals", "none in the file: computed from the triangles"),
    )
    assert (figure.name, figure.up, figure.unit) == ("a", "y", "")


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("number", ["float", "double", "short"])
@pytest.mark.parametrize("index", ["uchar", "short", "int", "uint"])
def test_binary_file_of_every_type_and_byte_order_is_read(order, number, index):
    vertices = [[x, y, z] for x, y, z in [(0, 0, 0), (2, 0, 0), (2, 2, 0), (-3, 2, 7)]]
    faces = [[[0, 1, 2]], [[0, 2, 3]]]
    data = binary(
        order,
        [
            ("vertex", [f"{number} {name}" for name in "xyz"], vertices),
            ("face", [f"list uchar {index} vertex_index"], faces),
        ],
    )
    mesh = silent(data).mesh
    assert mesh.positions.tolist() == vertices
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("order", "<>")
def test_properties_may_be_in_any_order_and_unknown_elements_are_skipped(order):
    data = binary(
        order,
        [
            ("camera", ["float near", "list uint double poses"], [[1.5, [1, 2, 3]], [2.5, []]]),
            (
                "vertex",
                ["uchar red", "float z", "double ny", "float x", "float nz", "short y",
                 "float nx", "float t", "float s"],
                [[9, 3, 1, 1, 0, 2, 0, 0.25, 0.5]] * 3,
            ),
            ("face", ["uchar flags", "list int uint vertex_indices", "float quality"],
             [[1, [0, 1, 2], 0.5], [0, [0, 1, 2, 1], 0.5], [1, [2, 1, 0], 1.0]]),
        ],
    )  # fmt: skip
    figure, warnings = read(data)
    assert figure.mesh.positions.tolist() == [[1, 2, 3]] * 3
    assert figure.mesh.normals.tolist() == [[0, 1, 0]] * 3
    assert figure.mesh.uvs.tolist() == [[0.5, 0.25]] * 3
    assert figure.mesh.n_triangles == 4
    assert figure.mesh.triangles[[0, 3]].tolist() == [[0, 1, 2], [2, 1, 0]]
    assert warnings == [unused("element camera", "vertex red", "face flags", "face quality")]


def test_vertex_colours_are_converted_to_linear():
    """sRGB 188 is 0.5029 in linear light, and 0.5 is 0.2140; floats are clamped to 0 to 1."""
    triangle = ("face", ["list uchar uchar vertex_indices"], [[[0, 1, 2]]])
    places = ["float x", "float y", "float z"]
    names = ["uchar red", "uchar green", "uchar blue"]
    rows = [[0, 0, 0, 255, 0, 188], [1, 0, 0, 0, 0, 0], [0, 1, 0, 255, 255, 255]]
    figure, warnings = read(binary("<", [("vertex", [*places, *names], rows), triangle]))
    assert warnings == []
    wanted = [[1, 0, 0.502886, 1], [0, 0, 0, 1], [1, 1, 1, 1]]
    np.testing.assert_allclose(figure.mesh.colors, wanted, atol=1e-6)
    names = ["float red", "float green", "float blue", "ushort alpha"]
    rows = [[0, 0, 0, 0.5, 0, 2, 65535], [1, 0, 0, 0, 0, 0, 0], [0, 1, 0, 1, 1, 1, 13107]]
    figure, warnings = read(binary(">", [("vertex", [*places, *names], rows), triangle]))
    assert warnings == []
    wanted = [[0.214041, 0, 1, 1], [0, 0, 0, 0], [1, 1, 1, 0.2]]
    np.testing.assert_allclose(figure.mesh.colors, wanted, atol=1e-6)


def test_texture_replaces_vertex_colours(tmp_path):
    (tmp_path / "a.png").write_bytes(encode_png(np.full((1, 1, 4), 255, np.uint8)))
    names = ["float x", "float y", "float z", "float s", "float t", "uchar red", "uchar green"]
    rows = [[0, 0, 0, 0, 0, 9, 9, 9], [1, 0, 0, 0, 0, 9, 9, 9], [0, 1, 0, 0, 0, 9, 9, 9]]
    triangle = ("face", ["list uchar uchar vertex_indices"], [[[0, 1, 2]]])
    vertices = ("vertex", [*names, "uchar blue"], rows)
    data = binary("<", [vertices, triangle], ["comment TextureFile a.png"])
    figure, warnings = read(data, tmp_path / "a.ply")
    assert figure.mesh.colors is None and figure.mesh.materials[0].image is not None
    assert warnings == [unused("vertex red", "vertex green", "vertex blue")]
    (tmp_path / "a.png").unlink()
    assert read(data, tmp_path / "a.ply")[0].mesh.colors is not None


def test_trailing_ctrl_z_byte_of_binary_data_is_kept():
    data = binary("<", [("vertex", ["float x", "float y", "uchar z"], [[0, 0, 26]] * 3),
                        ("face", ["list uchar uchar vertex_indices"], [])])  # fmt: skip
    mesh, _ = read(data)
    assert mesh.mesh.positions[:, 2].tolist() == [26] * 3


def test_texture_coordinates_per_corner_are_read_as_seams():
    data = binary(
        "<",
        [
            ("vertex", ["float x", "float y", "float z"], SQUARE),
            (
                "face",
                ["list uchar int vertex_indices", "list uchar float texcoord"],
                [[[0, 1, 2], [0, 0, 1, 0, 1, 1]], [[0, 2, 3], [0.5, 0, 1, 1, 0, 1]]],
            ),
        ],
    )
    mesh = silent(data).mesh
    assert mesh.uvs[mesh.uv_triangles].tolist() == [
        [[0, 0], [1, 0], [1, 1]], [[0.5, 0], [1, 1], [0, 1]]
    ]  # fmt: skip
    assert len(mesh.uvs) == 5  # (1, 1) is shared by two corners


def test_texture_coordinates_other_than_two_per_corner_are_ignored():
    text = GOOD.replace("indices\nend", "indices\nproperty list uchar float texcoord\nend")
    text = text.replace("3 0 1 2\n", "3 0 1 2 0\n").replace("0 1 2 3\n", "0 1 2 3 2 .5 .5\n")
    figure, warnings = read(text)
    assert figure.mesh.uvs is None
    texcoord = ("F007.ply-texcoord", None, {"n": 2, "face": 0})
    assert warnings == [texcoord, unused("face texcoord")]


def test_texture_name_is_read_from_a_comment(tmp_path):
    pixels = np.full((2, 2, 4), 128, np.uint8)
    (tmp_path / "my skin.png").write_bytes(encode_png(pixels))
    text = GOOD.replace("float z\n", "float z\nproperty float u\nproperty float v\n")
    text = text.replace("1.0\n", "1.0\ncomment TextureFile my skin.png\n")
    for row in POINTS.splitlines():
        text = text.replace(f"\n{row}\n", f"\n{row} 0.5 1\n")
    (tmp_path / "a.ply").write_text(text)
    source = Source.open(tmp_path / "a.ply")
    mesh = ply.read(source).mesh
    assert source.warnings == []
    assert mesh.uvs.tolist() == [[0.5, 1]] * 4
    assert np.array_equal(mesh.materials[0].image, pixels)
    assert mesh.material_indices.tolist() == [0, 0, 0]


def test_header_line_endings_may_vary():
    assert silent(GOOD.replace("\n", "\r\n")).mesh.n_triangles == 3
    assert silent(GOOD.replace("\n", "\r")).mesh.n_triangles == 3
    rows = [[10.0, 0, 0]] * 3  # the bytes of value 10 must not be read as line ends
    data = binary("<", [("vertex", ["uchar x", "uchar y", "uchar z"], [[10, 1, 2]] * len(rows))])
    head, body = data.split(b"end_header\n")
    figure, _ = read(head + b"end_header\n" + body)
    assert figure.mesh.positions.tolist() == [[10, 1, 2]] * 3
    carriage = (head + b"end_header\n").replace(b"\n", b"\r") + body
    assert read(carriage)[0].mesh.positions.tolist() == [[10, 1, 2]] * 3


def test_file_with_only_points_is_read_with_a_warning():
    figure, warnings = read(f"{HEAD}{VERTEX}end_header\n{POINTS}")
    assert figure.mesh.n_vertices == 4 and figure.mesh.n_triangles == 0
    assert warnings == [("F007.ply-no-faces", None, {"n": 4})]


def test_trailing_data_is_reported():
    assert read(GOOD + "1 2 3\n")[1] == [("F006.ply-lines", None, {"n": 1})]
    data = binary("<", [("vertex", ["float x", "float y", "float z"], SQUARE)])
    assert read(data + b"abc")[1][0] == ("F006.ply-bytes", None, {"n": 3})


def test_faces_with_fewer_than_three_corners_are_left_out():
    figure, warnings = read(GOOD.replace("3 0 1 2\n", "2 0 1\n"))
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert warnings == [("F007.ply-small-faces", None, {"n": 1, "face": 0})]
    figure, warnings = read(GOOD.replace("3 0 1 2\n4 0 1 2 3\n", "0\n0\n"))
    assert len(figure.mesh.triangles) == 0
    assert warnings[0] == ("F007.ply-small-faces", None, {"n": 2, "face": 0})


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", ("F002.ply-no-end", 1, {})),
        ("\0\0\0\0", ("F002.ply-looks", 1, {"looks": "zeros"})),
        ("plx\n", ("F002.ply-start", 1, {"found": b"plx"})),
        ("ply\n\n", ("F002.ply-no-end", 3, {})),
        (changed("format ascii 1.0\n", ""), ("F002.ply-no-format", 8, {})),
        (
            changed("ascii 1.0", "ascii 2.0"),
            ("F002.ply-format", 2, {"orders": ORDERS, "found": "ascii 2.0"}),
        ),
        (
            changed("ascii 1.0", "text 1.0"),
            ("F002.ply-format", 2, {"orders": ORDERS, "found": "text 1.0"}),
        ),
        (changed("vertex 4", "vertex four"), ("F002.ply-element", 3, {"found": "vertex four"})),
        (changed("vertex 4", "vertex -4"), ("F002.ply-element", 3, {"found": "vertex -4"})),
        (changed("float y", "real y"), ("F002.ply-property", 5, {"found": "real y"})),
        (changed("float y", "float x"), ("F002.ply-property-again", 5, {"found": "x"})),
        (
            changed("list uchar int vertex_indices", "list uchar vertex_indices"),
            ("F002.ply-property", 8, {"found": "list uchar vertex_indices"}),
        ),
        (changed("list uchar", "list float"), ("F002.ply-list-count", 8, {"found": "float"})),
        (HEAD + "property float x\n", ("F002.ply-no-element", 3, {})),
        (changed("float y", "float y\nhello"), ("F002.ply-line", 6, {"found": "hello"})),
        (HEAD + "element face 0\nend_header\n", ("F002.ply-no-vertex", 4, {"names": ["face"]})),
        (HEAD + "end_header\n", ("F002.ply-nothing", 3, {})),
        (changed("float z", "float w"), ("F002.ply-coordinates", 3, {})),
        (HEAD + VERTEX.replace("4", "0") + "end_header\n", ("F002.ply-vertices", 3, {})),
        (changed("vertex_indices", "corners"), ("F002.ply-no-corners", 7, {})),
        (changed("face 2", "tristrips 2"), ("F002.ply-strips", 7, {})),
        (changed("2 0 0\n", "2 0\n"), ("F002.ply-fewer", 11, {"expected": 3, "found": 2})),
        (changed("2 0 0\n", "2 0 0 1\n"), ("F002.ply-more", 11, {"expected": 3, "found": 4})),
        (changed("2 0 0\n", "2 up 0\n"), ("F002.number", 11, {"item": vertex(1), "found": b"up"})),
        (
            changed("2 0 0\n", "2 nan 0\n"),
            ("F003.number", 11, {"item": vertex(1), "found": b"nan"}),
        ),
        (changed("3 0 1 2\n", "3 0 1\n"), ("F002.ply-fewer", 14, {"expected": 4, "found": 3})),
        (changed("3 0 1 2\n", "3 0 1 2 3\n"), ("F002.ply-more", 14, {"expected": 4, "found": 5})),
        (
            changed("3 0 1 2\n", "1.5 0 1 2\n"),
            ("F002.ply-list", 14, {"item": "face 0", "found": 1.5}),
        ),
        (
            changed("3 0 1 2\n", "-1 0 1 2\n"),
            ("F002.ply-list", 14, {"item": "face 0", "found": -1.0}),
        ),
        (
            changed("3 0 1 2\n", "3 0 1 4\n"),
            ("F002.ply-corner", 14, {"face": 0, "last": 3, "found": 4.0}),
        ),
        (
            changed("0 1 2 3\n", "0 1 -1 3\n"),
            ("F002.ply-corner", 15, {"face": 1, "last": 3, "found": -1.0}),
        ),
        (
            changed("face 2", "face 3"),
            ("F002.ply-lines", 7, {"element": "face", "expected": 3, "found": 2}),
        ),
        (
            changed("vertex 4", "vertex 99999999999"),
            ("F002.ply-lines", 3, {"element": "vertex", "expected": 99999999999, "found": 6}),
        ),
    ],
)
def test_invalid_ascii_files_are_reported_with_location_and_reason(text, fault):
    assert refusal(text) == fault


def test_invalid_binary_files_are_reported_with_location_and_reason():
    elements = [
        ("vertex", ["float x", "float y", "float z"], SQUARE),
        ("face", ["list char int vertex_indices"], [[[0, 1, 2]], [[0, 1, 2, 3]]]),
    ]
    data = binary("<", elements)
    short = {"element": "face", "expected": 2, "size": 29}
    assert refusal(data[:-1]) == ("F002.ply-short", 7, short)
    many = data.replace(b"vertex 4", b"vertex 999999999999")
    short = {"element": "vertex", "expected": 999999999999, "size": 78}
    assert refusal(many) == ("F002.ply-short", 3, short)
    start = data.index(b"end_header\n") + 11
    nan = data[: start + 16] + struct.pack("<f", float("nan")) + data[start + 20 :]
    key, line, values = refusal(nan)
    assert (key, line, values["names"]) == ("F003.ply-finite", None, "x y z")
    assert values["item"] == vertex(1) and np.isnan(values["found"])
    negative = data[: start + 48] + b"\xff" + data[start + 49 :]
    face = "face 0"
    assert refusal(negative) == ("F002.ply-list", None, {"item": face, "found": -1})


def test_format_is_detected_by_content():
    assert detect(Source("a.ply", GOOD.encode())) == "ply"
    assert detect(Source("a.txt", GOOD.encode())) == "ply"


def test_exported_files_round_trip(tmp_path):
    actor = viewer.load().actors[0]
    viewer.export(actor, tmp_path / "fox.ply")
    scene = viewer.load(tmp_path / "fox.ply")
    written, mesh = actor.figure.mesh, scene.actors[0].figure.mesh
    assert scene.warnings == ()
    posed, _ = viewer.deform(actor.figure, actor.pose)
    # Single precision, for lengths up to 10.
    np.testing.assert_allclose(mesh.positions, posed, atol=1e-6)
    assert np.array_equal(mesh.triangles, written.triangles)
    corners = written.triangles if written.uv_triangles is None else written.uv_triangles
    np.testing.assert_allclose(mesh.uvs[mesh.uv_triangles], written.uvs[corners], atol=1e-7)


def test_randomly_damaged_file_is_refused_in_one_line_or_read():
    good = [
        GOOD.encode(),
        binary(
            ">",
            [
                ("vertex", ["float x", "float y", "float z"], SQUARE),
                ("face", ["list uchar int vertex_indices"], [[[0, 1, 2]], [[0, 1, 2, 3]]]),
            ],
        ),
    ]
    rng = np.random.default_rng(5)
    for number in range(600):
        damaged = bytearray(good[number % 2])
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(damaged)))
            if rng.integers(2):
                damaged[at] = int(rng.integers(256))
            else:
                del damaged[at : at + int(rng.integers(1, 9))]
        try:
            figure, _ = read(bytes(damaged))
        except FormatError as problem:
            assert str(problem).startswith("a.ply") and "\n" not in str(problem)
        else:
            assert np.isfinite(figure.mesh.positions).all()
            assert np.isfinite(figure.mesh.normals).all()


@pytest.mark.parametrize("piece", [1, 3, 8, 1 << 18])
def test_line_sizes_are_the_word_counts_of_lines_with_words(monkeypatch, piece):
    monkeypatch.setattr(elements, "_PIECE", piece)
    text = b"head 9\n 1 2\r\n\r\n\t\n3\r4 5 6 \v7\f8\n\n-1.5e3\n  9  9"
    lines = text.replace(b"\r", b"\n").split(b"\n")
    expected = [len(line.split()) for line in lines if line.split()]
    assert line_sizes(text, 0).words.tolist() == expected == [2, 2, 1, 5, 1, 2]
    assert line_sizes(text, 7).words.tolist() == expected[1:]
    assert line_sizes(b"", 0).words.tolist() == line_sizes(b" \n", 0).words.tolist() == []


@pytest.mark.parametrize("piece", [1, 3, 8, 1 << 18])
def test_offsets_divide_the_words_of_lines(monkeypatch, piece):
    monkeypatch.setattr(elements, "_PIECE", piece)
    text = b"head 9\n 1 2\r\n\r\n\t\n3\r4 5 6 \v7\f8\n\n-1.5e3\n  9  9"
    found = line_sizes(text, 7)
    for line in range(6):
        words = text[7 : found.offset(line)].split()
        assert len(words) == sum([2, 1, 5, 1, 2][:line])
        # No word is divided.
        assert text[7:].split() == words + text[found.offset(line) :].split()
