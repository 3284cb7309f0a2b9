"""The ``.obj`` reader: contents, warnings, and refusals."""

import time

import numpy as np
import pytest
from faults import refusal_of

import viewer
from viewer.errors import FormatError
from viewer.formats import Source, _polygons, detect, obj
from viewer.formats._polygons import triangulate
from viewer.formats._text.growing_table import GrowingTable
from viewer.media.png import encode_png
from viewer.rigs.mesh import triangle_areas, volume

SQUARE = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"


def read(text, path="a.obj"):
    """Return the figure and the warnings of a text."""
    source = Source(path, text if isinstance(text, bytes) else text.encode())
    return obj.read(source), source.warnings


def silent(text):
    figure, warnings = read(text)
    assert warnings == []
    return figure


def test_triangles_keep_vertices_and_order():
    figure = silent(SQUARE + "f 1 2 3\nf 3 4 1\n")
    assert figure.mesh.positions.tolist() == [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [2, 3, 0]]
    assert figure.mesh.uvs is None and figure.mesh.materials == ()
    assert figure.skeleton is None and figure.skin is None
    assert (figure.name, figure.up, figure.unit) == ("a", "y", "")


def test_missing_normals_are_computed_and_listed_in_the_facts():
    figure = silent(SQUARE + "f 1 2 3\n")
    assert figure.mesh.normals.tolist()[:3] == [[0, 0, 1]] * 3
    assert figure.facts == (("normals", "none in the file: computed from the triangles"),)


def test_comments_may_follow_the_numbers_of_a_line():
    text = (
        "# top\nv 0 0 0 # 7 8 9\nv 2 0 0#end\nv 2 2 0\nv 0 2 0 # last\n"
        "vt 0 1 # uv\no a#b\nusemtl c # d\nf 1/1 2/1 3/1 # 4/1\no e\nf 3/1 4/1 1/1\n"
    )
    mesh = silent(text).mesh
    assert mesh.positions.tolist() == [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    assert mesh.triangles.tolist() == [[0, 1, 2], [2, 3, 0]]
    assert mesh.parts == ("a#b", "e") and mesh.materials[0].name == "c # d"
    with pytest.raises(FormatError, match=r"a\.obj:3: v of vertex 1: expected 3 numbers, found 2"):
        read("v 0 0 0 # 1\n# 2 3\nv 1 2 # 3\nf 1 2 1\n")


def test_corners_refer_to_texture_coordinates_and_normals():
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt .5 .25 0\nvn 0 1 0\nvn 1 0 0\n"
    figure = silent(text + "f 1/1/1 2/2/2 3/3/1\nf 3/4/1 4/1/1 1/2/1\n")
    mesh = figure.mesh
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [1, 1], [0.5, 0.25]]
    assert mesh.uv_triangles.tolist() == [[0, 1, 2], [3, 0, 1]]
    assert mesh.normals.tolist() == [[0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]]


def test_normals_without_texture_coordinates():
    mesh = silent(SQUARE + "vn 0 1 0\nf 1//1 2//1 3//1\n").mesh
    assert mesh.uvs is None
    # The fourth vertex has no normal and no triangle.
    assert mesh.normals.tolist() == [[0, 1, 0]] * 4


def test_faces_with_different_corner_formats_may_be_mixed():
    figure, warnings = read(
        SQUARE + "vt 1 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1/1/1 3/1/1 4/1/1\nf 1 2 4"
    )
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 3]]
    assert figure.mesh.uvs.tolist() == [[1, 1], [0, 0]]
    assert figure.mesh.uv_triangles.tolist() == [[1, 1, 1], [0, 0, 0], [1, 1, 1]]
    assert warnings == ["a.obj: 6 triangle corners without vt: 0 0 used"]


def test_negative_indices_count_back_from_their_line():
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -1 -3 -2\nf 1 -1 2\n"
    assert silent(text).mesh.triangles.tolist() == [[0, 1, 2], [3, 1, 2], [0, 3, 1]]


def test_negative_indices_may_refer_to_earlier_chunks():
    # 40,000 quads with four vertices each span several chunks of the file.
    block = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n"
    mesh = silent(block * 40_000).mesh
    expected = np.arange(160_000).reshape(-1, 4)
    assert np.array_equal(mesh.triangles[0::2], expected[:, [0, 1, 2]])
    assert np.array_equal(mesh.triangles[1::2], expected[:, [0, 2, 3]])


def test_indices_may_point_forward():
    assert silent("f 1 2 3\n" + SQUARE).mesh.triangles.tolist() == [[0, 1, 2]]


def test_polygons_are_triangulated_and_counted():
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 3 0\nv 0 2 0\nf 1 2 3 4 5\nf 1 2 3 5\nf 1 2 3\n"
    figure = silent(text)
    triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [0, 2, 4], [0, 1, 2]]
    assert figure.mesh.triangles.tolist() == triangles
    text = "1 triangle, 1 quad, 1 with 5 or more corners: 6 triangles in all"
    assert ("polygons", text) in figure.facts


def test_concave_quad_is_split_at_its_reflex_corner():
    # The fourth corner is inside the triangle of the others, so only its diagonal is inside the
    # quad.
    text = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 1 1 0\nf 1 2 4 3\nf 4 3 1 2\nf 2 4 3 1\nf 3 1 2 4\n"
    mesh = silent(text).mesh
    areas = triangle_areas(mesh.positions, mesh.triangles).reshape(4, 2)
    assert areas.sum(axis=1) == pytest.approx([4.0] * 4)  # two triangles of 1 * 4 / 2
    a, b, c = (mesh.positions[mesh.triangles[:, k], :2] for k in range(3))
    crosses = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (crosses > 0).all()


@pytest.mark.parametrize("turn", range(0, 12, 3))
def test_concave_polygon_is_covered_exactly(turn):
    # A comb with three teeth has 12 corners in a slanted plane; the shoelace formula gives the
    # area.
    flat = [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3),
            (0, 3)]  # fmt: skip
    flat = flat[turn:] + flat[:turn]
    shoelace = sum(x * w - z * y for (x, y), (z, w) in zip(flat, flat[1:] + flat[:1], strict=True))
    lines = "".join(f"v {x} {y} {2 * x - y}\n" for x, y in flat)
    mesh = silent(lines + "f " + " ".join(str(i + 1) for i in range(12))).mesh
    flat_points = mesh.positions[:, :2]
    a, b, c = (flat_points[mesh.triangles[:, k]] for k in range(3))
    crosses = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert len(crosses) == 10 and (crosses > 0).all()
    assert crosses.sum() == pytest.approx(shoelace)


def test_polygon_with_very_many_corners_is_triangulated_quickly():
    angles = np.linspace(0, 2 * np.pi, 60_000, endpoint=False)
    radii = 1.0 + 0.1 * np.cos(9 * angles)  # nine dents make it concave
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    text = "".join(f"v {x} {y} 0\n" for x, y in points.tolist())
    start = time.process_time()
    mesh = silent(text + "f " + " ".join(map(str, range(1, 60_001)))).mesh
    assert mesh.n_triangles == 59_998
    assert time.process_time() - start < 5.0


def test_triangles_of_a_closed_box_of_quads_enclose_its_volume():
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 2) for y in (0, 3) for z in (0, 5))
    quads = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    mesh = silent(corners + quads).mesh
    assert volume(mesh.positions, mesh.triangles) == pytest.approx(30.0)


def test_weights_of_vertices_are_ignored_with_a_note():
    figure, warnings = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1 2\nv 0 0 1 1\nf 1 2 3\n")
    assert figure.mesh.positions.tolist()[:3] == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert warnings == ["a.obj:4: w of 1 vertex ignored"]


@pytest.mark.parametrize(("half", "most"), [("0.5", "1"), ("127.5", "255")])
def test_vertex_colours_are_converted_to_linear(half, most):
    """sRGB 0.5 is 0.2140 in linear light; vertices without a colour are white."""
    mesh = silent(
        f"v 0 0 0 {most} 0 {half}\nv 1 0 0\nv 0 1 0 0 {half} 0 0.25\nf 1 2 3\nf 3 2 1\n"
    ).mesh
    wanted = [[1, 0, 0.214041, 1], [1, 1, 1, 1], [0, 0.214041, 0, 0.25]]
    np.testing.assert_allclose(mesh.colors, wanted, atol=1e-6)
    assert silent("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh.colors is None


def test_continued_lines_comments_and_white_space_are_read():
    text = "# a comment \\\nstill one\r\n\n  v 0 \\\n  0 0\n\tv 1 0 0 \nv 0 1\\\r\n 0\nf 1 \\\n2 3"
    assert silent(text).mesh.triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("end", ["\r\n", "\r", "\r\r\n"])
def test_line_endings_may_vary(end):
    mesh = silent((SQUARE + "f 1 2 3\n").replace("\n", end)).mesh
    assert mesh.positions.shape == (4, 3) and mesh.triangles.tolist() == [[0, 1, 2]]


def test_unused_vertices_are_kept():
    mesh = silent("v 9 9 9\n" + SQUARE + "f 2 3 4\n").mesh
    assert mesh.n_vertices == 5 and mesh.triangles.tolist() == [[1, 2, 3]]


def test_vertex_with_several_normals_gets_their_mean():
    text = SQUARE + "vn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 3//1 4//1\nf 1//2 4//1 2//1\n"
    figure, warnings = read(text)
    # Two faces share the second normal, which is averaged once: (0, 1, 1) / sqrt(2).
    half = 0.5**0.5
    np.testing.assert_allclose(figure.mesh.normals[0], [0, half, half], atol=1e-15)
    assert figure.mesh.normals[1:].tolist() == [[0, 0, 1]] * 3
    assert warnings == [
        (
            "a.obj: 1 vertex has several normals (first: vertex 0): averaged, so hard "
            "edges are drawn smooth"
        )
    ]


def test_normals_of_length_0_are_computed():
    figure, warnings = read(SQUARE + "vn 0 0 0\nvn 1 0 0\nf 1//1 2//2 3//2\n")
    assert figure.mesh.normals.tolist()[:3] == [[0, 0, 1], [1, 0, 0], [1, 0, 0]]
    assert warnings == [
        "a.obj: 1 zero-length normal (first: vertex 0): recomputed from the triangles"
    ]


def test_materials_apply_to_runs_of_triangles():
    figure = silent(
        SQUARE + "f 1 2 3\nusemtl red\nf 1 2 3\nf 1 2 4\nusemtl a b\nf 1 2 3\nusemtl red\nf 2 3 4"
    )
    assert [material.name for material in figure.mesh.materials] == ["red", "a b"]
    assert figure.mesh.material_indices.tolist() == [-1, 0, 0, 1, 0]


def test_groups_are_used_as_materials_if_there_are_none():
    figure = silent(SQUARE + "o body\nf 1 2 3\ng shoe\nf 1 2 3 4\no body\nf 2 3 4")
    assert [material.name for material in figure.mesh.materials] == ["body", "shoe"]
    assert figure.mesh.material_indices.tolist() == [0, 1, 1, 0]
    assert ("parts", "2 groups and objects") in figure.facts


def test_groups_within_objects_are_named_as_ignored():
    vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    faces = "usemtl red\no body\ng arm\nf 1 2 3\ng leg\nf 1 3 2\no hat\ng hat\nf 2 3 1\n"
    figure, warnings = read(vertices + faces)
    assert figure.mesh.parts == ("body", "hat")
    note = "2 groups within objects ignored, as a face has one part: arm, leg"
    assert any(note in str(warning) for warning in warnings)
    # The groups of a single object are its parts.
    figure, warnings = read(vertices + faces.replace("o hat\n", ""))
    assert figure.mesh.parts == ("arm", "leg", "hat")
    assert not any("groups within" in str(warning) for warning in warnings)


def test_single_object_is_not_used_as_a_material():
    figure = silent("o body\n" + SQUARE + "s 1\nf 1 2 3\n")
    assert figure.mesh.materials == ()


def test_textures_are_read_from_the_library(tmp_path):
    pixels = np.full((2, 2, 4), 255, np.uint8)
    (tmp_path / "two words.png").write_bytes(encode_png(pixels))
    (tmp_path / "m.mtl").write_text(
        "# colours\nnewmtl skin\nKd 1 0 0\nmap_Kd -s 1 1 1 -clamp on two words.png\nnewmtl plain\n"
    )
    text = (
        "mtllib m.mtl\n"
        + SQUARE
        + "vt 0 0\nusemtl skin\nf 1/1 2/1 3/1\nusemtl plain\nf 1/1 2/1 3/1"
    )
    (tmp_path / "a.obj").write_text(text)
    source = Source.open(tmp_path / "a.obj")
    mesh = obj.read(source).mesh
    assert source.warnings == []
    assert mesh.materials[0].texture == "two words.png"
    assert np.array_equal(mesh.materials[0].image, pixels)
    assert mesh.materials[1].image is None


def test_missing_library_entries_are_reported(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd gone.png\nnewmtl b\nmap_Kd ../b.png\n")
    text = SQUARE + "vt 0 0\nmtllib m.mtl none.mtl ../up.mtl\n"
    text += "".join(f"usemtl {name}\nf 1/1 2/1 3/1\n" for name in "abc")
    (tmp_path / "a.obj").write_text(text)
    source = Source.open(tmp_path / "a.obj")
    obj.read(source)
    here = tmp_path
    assert source.warnings == [
        f"{here}/a.obj:6: material library {here}/none.mtl: cannot be read: "
        "No such file or directory; drawn untextured",
        f"{here}/a.obj:6: material library ../up.mtl is outside the folder: not read",
        f"{here}/a.obj: 1 material is not in any library (first: c): drawn untextured",
        f"{here}/m.mtl:2: texture {here}/gone.png: cannot be read: "
        "No such file or directory; drawn untextured",
        f"{here}/m.mtl:4: texture ../b.png is outside the folder: not read",
    ]


def test_unsupported_elements_are_reported():
    text = SQUARE + "f 1 2 3\nl 1 2 3\nl 2 3\np 1\ncstype bezier\ncstype bezier\nvp 0 0\n"
    _, warnings = read(text)
    assert warnings == [
        'a.obj:9: skipped unknown keyword "cstype"',
        "a.obj: 2 lines not drawn",
        "a.obj: 1 point not drawn",
    ]


def test_file_with_only_points_is_read_with_a_warning():
    figure, warnings = read(SQUARE)
    assert figure.mesh.n_triangles == 0
    assert warnings == ["a.obj: no faces: 4 points, not drawn"]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", ('F002.obj-mesh', None, {'looks': 'an empty file'})),
        ("\0" * 9, ('F002.obj-mesh', None, {'looks': 'zeros'})),
        ("vt 0 0\n", ('F002.obj-mesh', 1, {'looks': None})),
        ("v 0 0\n", ('F002.width', 1, {'item': "v of vertex 0", 'expected': 3,
         'found': 2})),
        ("v 0 0 0\nv\n", ('F002.width', 2, {'item': "v of vertex 1", 'expected': 3,
         'found': 0})),
        ("v 0 0 0 0 0\n",
         ('F002.obj-vertex', 1, {'found': 5})),
        ("\nv 0 up 0\n", ('F002.number', 2, {'item': "v of vertex 0", 'found': b'up'})),
        ("v 0 nan 0\n", ('F003.number', 1, {'item': "v of vertex 0", 'found': b'nan'})),
        ("v 0 1e39 0\n", ('F003.too-large', 1, {'item': "v of vertex 0",
         'found': b'1e39'})),
        ("v 0 0,5 0\n", ('F002.number', 1, {'item': "v of vertex 0", 'found': b'0,5'})),
        (SQUARE + "vn 0 1\n", ('F002.width', 5, {'item': "vn 0", 'expected': 3,
         'found': 2})),
        (SQUARE + "vt\n", ('F002.width', 5, {'item': "vt 0", 'expected': 1,
         'found': 0})),
        (SQUARE + "f\n", ('F002.obj-face', 5, {'least': 3, 'found': 0})),
        (SQUARE + "f 1 2 0\n", ('F002.obj-zero', 5, {})),
        (SQUARE + "vt 0 0\n\nf 1/1 2/0 3/1\n", ('F002.obj-zero', 7, {})),
        (SQUARE + "f 1 2 3\nf 1 2 5\n", ('F002.obj-v-range', 6, {'limit': 4, 'found': 5})),
        (SQUARE + "f 1 2 -5\n", ('F002.obj-v-back', 5, {'least': -4, 'found': -5})),
        ("v 0 0 0\nf -1 -1 -2\n" + SQUARE, ('F002.obj-v-back', 2, {'least': -1, 'found': -2})),
        ("f -1 -1 -2\n" + SQUARE, ('F002.obj-v-early', 1, {'least': 0, 'found': -1})),
        (SQUARE + "f 1/1 2/1 3/1\n",
         ('F002.obj-vt-none', 5, {'limit': 0, 'found': 1})),
        (SQUARE + "vn 0 0 1\nf 1//1 2//2 3//1\n",
         ('F002.obj-vn-range', 6, {'limit': 1, 'found': 2})),
        (SQUARE + "f 1 2 x\n",
         ('F002.obj-corner', 5, {'found': b'x'})),
        (SQUARE + "f 1 2 3/x\n",
         ('F002.obj-corner', 5, {'found': b'3/x'})),
        (SQUARE + "f 1 2 1.5\n",
         ('F002.obj-corner', 5, {'found': b'1.5'})),
        *(
            (SQUARE + f"vt 0 0\nvn 0 0 1\nf 1 2 {word}\n",
             ("F002.obj-corner", 7, {"found": word.encode()}))
            for word in ("1e-400", "-1e-400", "0x1", "1e-1", "2.5e0", "1e-1000f")
        ),
        *(
            (SQUARE + f"vt 0 0\nvn 0 0 1\nf 1{rest} 2{rest} {word}\n",
             ("F002.obj-corner", 7, {"found": word.encode()}))
            for rest, word in (
                ("//1", "1e-400"), ("/1", "1e-324/1"), ("/1", "3/1e-400"), ("//1", "3//1e-400"),
                ("/1", "3/1.5"), ("//1", "3//1.5"), ("/1/1", "3/1/0x1"), ("/1/1", "3/1/1e-999"),
            )
        ),
        *(
            (SQUARE + f"f 1 2 {word}\n", ("F002.obj-zero", 5, {}))
            for word in (".0", "-.0", "0.", "+0.0", "0e5", "0f", "00")
        ),
        (SQUARE + "f 1 2 1e3\n", ('F002.obj-v-range', 5, {'limit': 4, 'found': 1000})),
        (SQUARE + "vt 0 0\nf 1/1 /1 3/1\n",
         ('F002.obj-corner', 6, {'found': b'/1'})),
        (SQUARE + "f 1///1 2 3\n",
         ('F002.obj-corner', 5, {'found': b'1///1'})),
        (SQUARE + "f 1/1/1/1 2 3\n",
         ('F002.obj-corner', 5, {'found': b'1/1/1/1'})),
        (SQUARE + "f 1 2 99999999999999999999\n",
         ('F002.obj-corner', 5, {'found': b'99999999999999999999'})),
    ],
)  # fmt: skip
def test_invalid_files_are_reported_with_location_and_reason(text, fault):
    assert refusal_of(lambda: read(text)) == fault


def test_format_is_detected_by_content_and_suffix():
    assert detect(Source("a.obj", b"# made by hand\n" + SQUARE.encode())) == "obj"
    assert detect(Source("a.txt", SQUARE.encode())) == "obj"
    assert detect(Source("a.obj", b"g nothing\n")) == "obj"


def test_exported_files_round_trip(tmp_path):
    actor = viewer.load().actors[0]
    viewer.export(actor, tmp_path / "fox.obj")
    scene = viewer.load(tmp_path / "fox.obj")
    written, mesh = actor.figure.mesh, scene.actors[0].figure.mesh
    assert scene.warnings == ()
    posed, normals = viewer.deform(actor.figure, actor.pose)
    # The file has nine digits, for lengths up to 10.
    np.testing.assert_allclose(mesh.positions, posed, atol=1e-8)
    np.testing.assert_allclose(mesh.normals, normals, atol=1e-8)
    assert np.array_equal(mesh.triangles, written.triangles)
    corners = written.triangles if written.uv_triangles is None else written.uv_triangles
    np.testing.assert_allclose(mesh.uvs[mesh.uv_triangles], written.uvs[corners], atol=1e-8)
    assert np.array_equal(mesh.materials[0].image, written.materials[0].image)


def test_exported_files_record_the_up_axis():
    figure = silent("# pig: z up, metres\n" + SQUARE + "f 1 2 3\n")
    assert (figure.up, figure.unit) == ("z", "m")


@pytest.mark.slow
def test_randomly_damaged_file_is_refused_in_one_line_or_read():
    good = (
        SQUARE
        + "vt 0 0\nvt 1 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/1/1 4/2/1\nf -1//1 -2//1 -3//1\n"
    ).encode()
    rng = np.random.default_rng(5)
    for _ in range(400):
        damaged = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(damaged)))
            kind = rng.integers(3)
            if kind == 0:
                damaged[at] = int(rng.integers(256))
            elif kind == 1:
                del damaged[at : at + int(rng.integers(1, 9))]
            else:
                damaged[at:at] = bytes(damaged[at : at + 7])
        try:
            figure, _ = read(bytes(damaged))
        except FormatError as problem:
            assert str(problem).startswith("a.obj") and "\n" not in str(problem)
        else:
            assert np.isfinite(figure.mesh.positions).all()
            assert np.isfinite(figure.mesh.normals).all()


HEAD = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\n"
UVS = [[0, 2, 1]]
NORMALS = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
FLAT = [[0, 0, 1]] * 3


def mesh_of_faces(faces: str):
    return obj.read(Source("a.obj", (HEAD + faces).encode())).require_mesh()


@pytest.mark.parametrize("between", ["", "# comment\n", "\n", "g part\n"])
@pytest.mark.parametrize(
    ("face", "uvs", "normals"),
    [
        ("f 1 2 3\n", None, FLAT),
        ("f 1/1 2/3 3/2\n", UVS, FLAT),
        ("f 1//2 2//3 3//1\n", None, NORMALS),
        ("f 1/1/2 2/3/3 3/2/1\n", UVS, NORMALS),
        ("  fo\t-3/-3/-2\t2/3/-1   3/2/1  \r\n", UVS, NORMALS),
    ],
)
def test_all_forms_of_corners_are_read(face, uvs, normals, between):
    mesh = mesh_of_faces(face + between + face)
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 2
    assert (mesh.uv_triangles if uvs is None else mesh.uv_triangles.tolist()) == (
        None if uvs is None else uvs * 2
    )
    assert mesh.normals.tolist() == normals


def test_forms_may_be_mixed():
    mesh = mesh_of_faces("f 1 2//3 3/2/1\nf 1//2 2 3/2\n")
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 2
    assert mesh.normals.tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


def test_slashes_without_a_number_after_them_are_ignored():
    mesh = mesh_of_faces("f 1/2/ 2/1/ 3/2/\nf 1/ 2// 3/2/1\nf 1//1\t2//2 3//\r\n")
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 3
    given = mesh_of_faces("f 1/2 2/1 3/2\nf 1 2 3/2/1\nf 1//1 2//2 3\n")
    assert mesh.uvs[mesh.uv_triangles].tolist() == given.uvs[given.uv_triangles].tolist()
    assert mesh.normals.tolist() == given.normals.tolist()


@pytest.mark.parametrize(
    "face",
    [
        *("f 1/1/1/1 2 3", "f /1 2/2 3/3", "f 1///1 2/2 3//3", "f //1 2//2 3//3"),
        *("f 1/1 /2 3/3", "f 1 / 2 3", "f 1/\x011 2/2 3/3", "f 1/1.5 2/2 3/3", "f 1/0 2/2 3/3"),
    ],
)
def test_invalid_corners_are_refused_at_their_line(face):
    with pytest.raises(FormatError, match=r"a\.obj:10: "):
        mesh_of_faces(face + "\n")


def test_normals_of_many_vertices_are_averaged_without_overflow():
    # The number of pairs of 50,000 vertices and 50,000 normals does not fit into 32 bits.
    count = 50_000
    text = "v 0 0 0\n" * (count - 3) + "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    text += "vn 1 0 0\n" * (count - 2) + "vn 0 1 0\nvn 0 0 1\n"
    a, b, c = count - 2, count - 1, count
    text += f"f {a}//{b} {b}//{b} {c}//{b}\nf {a}//{c} {c}//{c} {b}//{c}\n"
    figure = obj.read(Source("large.obj", text.encode()))
    half = 0.5**0.5
    np.testing.assert_allclose(figure.mesh.normals[-3:], [[0, half, half]] * 3, atol=1e-12)


@pytest.mark.parametrize("part", [1, 2, 3, 7])
def test_parts_give_the_triangles_of_single_polygons(monkeypatch, part):
    rng = np.random.default_rng(0)
    counts = np.array([4, 3, 5, 3, 3, 4, 8, 6, 3, 4])
    points = rng.normal(size=(40, 3))
    corners = rng.integers(0, 40, counts.sum())
    monkeypatch.setattr(_polygons, "_PART", part)
    picks, owners = triangulate(points, corners, counts)
    assert owners.tolist() == np.repeat(np.arange(10), counts - 2).tolist()
    starts = np.cumsum(counts) - counts
    for face, (start, size) in enumerate(zip(starts, counts, strict=True)):
        alone, _ = triangulate(points, corners[start : start + size], np.array([size]))
        np.testing.assert_array_equal(picks[owners == face], alone + start)


def test_rows_are_those_that_were_added():
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(size, 3)) for size in (0, 1, 5, 0, 300, 2)]
    table = GrowingTable((3,), np.float64)
    for part in parts:
        table.add(part)
    np.testing.assert_array_equal(table.rows(), np.concatenate(parts))
    assert GrowingTable((2,)).rows().shape == (0, 2)


def test_table_is_widened_for_large_numbers():
    table = GrowingTable((), np.int32)
    table.add(np.array([1], np.int32))
    table.add(np.array([1 << 40], np.int64))
    assert table.rows().tolist() == [1, 1 << 40]


def test_hard_edges_of_large_meshes_get_mean_normals():
    # The product of the numbers of vertices and normals does not fit into 32 bits.
    count = 50_000
    places = "".join(f"v {n} {n % 7} {n % 3}\n" for n in range(count))
    normals = "vn 0 0 1\n" * (count - 2) + "vn 1 0 0\nvn 0 1 0\n"
    faces = f"f 1//1 2//1 {count}//{count - 1}\nf 1//1 3//1 {count}//{count}\n"
    mesh = obj.read(Source("a.obj", (places + normals + faces).encode())).require_mesh()
    half = np.sqrt(0.5)
    np.testing.assert_allclose(mesh.normals[-1], [half, half, 0.0], atol=1e-15)
