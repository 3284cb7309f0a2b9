"""All quirks of ``.skin``, each in a tiny file."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from faults import refusal_of
from formats.skin_text import (
    BARE,
    BINDINGS,
    GOOD,
    MATRIX,
    NORMALS,
    POSITIONS,
    TRIANGLES,
    WEIGHTS,
    assert_good,
    read,
    silent,
)
from numpy.testing import assert_allclose
from PIL import Image

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats import Source, skin


def test_all_values_of_a_valid_file_are_read():
    figure = silent(GOOD)
    assert_good(figure)
    assert figure.name == "a"
    assert figure.skeleton is None
    assert figure.mesh.uvs is None


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(GOOD.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(GOOD.replace("\n", "\r"), id="CR"),
        pytest.param(GOOD.replace("\n", "\r\r\n"), id="CR CR LF"),
        pytest.param(" ".join(GOOD.split()), id="one line"),
        pytest.param("\n".join(GOOD.split()), id="a word a line"),
        pytest.param(GOOD.replace(" {", "{").replace("\n}", "}"), id="glued braces"),
        pytest.param(GOOD.replace("\n}\n", "}").replace("{\n", "{"), id="all glued"),
        pytest.param(GOOD.rstrip(), id="no final newline"),
        pytest.param("\n\n" + GOOD + " \t\n\n", id="blank lines around"),
        pytest.param(GOOD.replace(" ", "\t\v\f"), id="tabs"),
        pytest.param("\ufeff" + GOOD, id="byte order mark"),
        pytest.param(GOOD + "\x1a", id="Ctrl-Z"),
        pytest.param(GOOD.replace("0.75", "+.75").replace("2 0 0\n", "2. 0f -0\n"), id="spellings"),
        pytest.param(GOOD.replace("positions 3", "positions 3.0"), id="whole number with a point"),
        pytest.param(BINDINGS + TRIANGLES + WEIGHTS + NORMALS + POSITIONS, id="reordered"),
        pytest.param(GOOD.replace("skinweights 3 {", "skinweights 3"), id="skinweights without {"),
        pytest.param(GOOD.replace("bindings 2 {", "bindings 2"), id="bindings without {"),
        pytest.param(GOOD + "triangles 0 { }", id="an empty section of triangles"),
    ],
)
def test_white_space_section_order_and_optional_braces_may_vary(text):
    assert_good(silent(text))


def test_bind_matrix_rows_in_the_file_are_read_as_columns():
    # A rotation by 90 degrees about z, scaled by 2, maps x to 2y, y to -2x and z to 2z; then 1 2 3
    # is added.
    rows = "0 2 0  -2 0 0  0 0 2  1 2 3"
    figure = silent(
        BARE + f"skinweights 3 {{ 1 0 1 1 0 1 1 0 1 }} bindings 1 {{ matrix {{ {rows} }} }}"
    )
    expected = [[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]
    assert_allclose(np.linalg.inv(figure.skin.inverse_bind[0]), expected, atol=1e-15)


def test_clockwise_triangles_are_not_flipped():
    assert silent(GOOD.replace("0 1 2", "0 2 1")).mesh.triangles.tolist() == [[0, 2, 1]]


def test_zero_area_triangles_are_kept():
    assert silent(GOOD.replace("0 1 2", "1 1 2")).mesh.triangles.tolist() == [[1, 1, 2]]


def test_normals_are_used_as_stored():
    assert silent(GOOD.replace("0 1 0\n}", "0 1.73 0\n}", 1)).mesh.normals[2].tolist() == [
        0,
        1.73,
        0,
    ]


def test_any_number_of_influences_is_kept():
    pairs = " ".join("1 0.001" for _ in range(5000))
    figure = silent(GOOD.replace("1 1 1\n}", f"5000 {pairs}\n}}"))
    assert figure.skin.starts.tolist() == [0, 1, 3, 5003]
    assert figure.skin.weights[3:].tolist() == [0.001] * 5000


def test_zero_weights_and_a_joint_listed_twice_are_kept():
    figure = silent(GOOD.replace("2 0 0.25 1 0.75", "4 0 0.25 1 0.5 1 0.25 0 0.0"))
    assert figure.skin.joints[1:5].tolist() == [0, 1, 1, 0]
    assert figure.skin.weights[1:5].tolist() == [0.25, 0.5, 0.25, 0]


def test_several_sections_of_triangles_are_appended():
    figure = silent(GOOD + "triangles 2 { 2 1 0 0 2 1 }")
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [2, 1, 0], [0, 2, 1]]


# Missing, repeated or unknown sections


def test_mesh_without_weights_and_bindings_loads_with_a_warning():
    figure, warnings = read(BARE)
    assert figure.skin is None
    assert warnings == ["a.skin: no `skinweights` or `bindings`: the mesh cannot be skinned"]


def test_missing_normals_are_computed():
    figure, warnings = read(POSITIONS + WEIGHTS + TRIANGLES + BINDINGS)
    assert figure.mesh.normals.tolist() == [[0, 0, 1]] * 3
    assert warnings == ["a.skin: no `normals` section: computed from the triangles"]


def test_zero_normals_are_computed():
    text = GOOD.replace("  0 0 1\n  0 0 1\n", "  0 0 0\n  1e-30 0 0\n", 1)
    figure, warnings = read(text)
    assert figure.mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0]]
    assert warnings == [
        "a.skin:7: 2 zero-length normals (first: vertex 0): recomputed from the triangles"
    ]


def test_last_repeated_section_is_used():
    figure, warnings = read(GOOD + POSITIONS.replace("2 0 0", "9 0 0") + POSITIONS)
    assert_good(figure)
    assert warnings == ["a.skin:33: repeated positions section: the last one is used"]


@pytest.mark.parametrize(
    "section",
    [
        "colours 3 { 1 2 3 }",
        "colours{}",
        "version 1.0",
        "header { a { b 1 } positions 9 { } }",
        "Positions 3 { 0 0 0 0 0 0 0 0 0 }",
        "{ 1 2 3 }",
        "7 8 9",
    ],
)
@pytest.mark.parametrize("place", range(6))
def test_unknown_section_is_skipped_completely(section, place):
    parts = [POSITIONS, NORMALS, WEIGHTS, TRIANGLES, BINDINGS]
    parts.insert(place, section + "\n")
    line = "".join(parts[:place]).count("\n") + 1
    first = section.replace("{", " ").split()[0] if section[0] != "{" else "{"
    figure, warnings = read("".join(parts))
    assert_good(figure)
    assert warnings == [f'a.skin:{line}: ignored unknown section "{first}"']


def test_unknown_section_is_reported_once_with_its_first_line():
    _, warnings = read("foo { }\nbar { }\nfoo { }\n" + GOOD)
    assert warnings == [
        'a.skin:1: ignored unknown section "foo"',
        'a.skin:2: ignored unknown section "bar"',
    ]


@pytest.mark.parametrize("name", ["triangles", "skinweights", "bindings"])
def test_missing_brace_at_the_end_is_a_warning(name):
    sections = {"triangles": TRIANGLES, "skinweights": WEIGHTS, "bindings": BINDINGS}
    last = sections.pop(name)
    text = POSITIONS + NORMALS + "".join(sections.values()) + last.rstrip().removesuffix("}")
    figure, warnings = read(text)
    assert_good(figure)
    assert warnings == [f'a.skin: {name}: missing "}}" at the end of the file']


def test_extra_braces_are_reported_as_a_warning():
    figure, warnings = read(GOOD + "}}")
    assert_good(figure)
    assert warnings == ['a.skin: ignored 2 "}" outside any section']


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", ("F002.skin-positions", None, {'looks': 'an empty file'})),
        (" \n\n", ("F002.skin-positions", None, {'looks': 'only white space'})),
        ("\0" * 9, ("F002.skin-positions", None, {'looks': 'zeros'})),
        (NORMALS + TRIANGLES, ("F002.skin-positions", 8, {'looks': None})),
        (POSITIONS + NORMALS, ("F002.skin-triangles", 10, {})),
        (
            POSITIONS + NORMALS + "triangles 0 {\n}",
            ("F002.skin-no-triangle", 11, {}),
        ),
        ("\npositions 0 { }" + TRIANGLES,
         ("F002.skin-no-vertex", 2, {})),
        ("positions", ('F002.count', 1, {'item': 'positions', 'found': None})),
        ("positions {", ('F002.count', 1, {'item': 'positions', 'found': b'{'})),
        ("positions\n-3 {", ('F002.count', 2, {'item': 'positions', 'found': b'-3'})),
        ("positions 1.5 {", ('F002.count', 1, {'item': 'positions', 'found': b'1.5'})),
        ("positions nan {", ('F002.count', 1, {'item': 'positions', 'found': b'nan'})),
        ("positions 1e999 {", ('F002.count', 1, {'item': 'positions', 'found': b'1e999'})),
        (
            "positions 99999999999 { 0 0 0 }",
            ("F002.skin-too-many", 1, {'section': 'positions', 'found': 99999999999, 'size': 10}),
        ),
        ("positions 1", ("F002.skin-too-many", 1, {'section': 'positions', 'found': 1, 'size': 0})),
        ("positions 1\n0 0 0 }", ("F002.skin-brace", 2, {'section': 'positions', 'found': b'0'})),
        ("positions 1\n  ", ("F002.skin-brace", 1, {'section': 'positions', 'found': None})),
        (GOOD.replace("2 0 0", "2 up 0", 1), ("F002.number", 3, {'item': "positions of vertex 1",
         'found': b'up'})),
        (GOOD.replace("2 0 0", "2 nan 0", 1),
         ("F003.number", 3, {'item': "positions of vertex 1",
          'found': b'nan'})),
        (GOOD.replace("2 0 0", "2 3.5e38 0", 1),
         ("F003.too-large", 3, {'item': "positions of vertex 1",
          'found': b'3.5e38'})),
        (GOOD.replace("2 0 0", "2 1_0 0", 1),
         ("F002.number", 3, {'item': "positions of vertex 1",
          'found': b'1_0'})),
        (GOOD.replace("2 0 0", "2 0,5 0", 1),
         ("F002.number", 3, {'item': "positions of vertex 1",
          'found': b'0,5'})),
        (GOOD.replace("2 0 0", "2 \0 0", 1),
         ("F002.number", 3, {'item': "positions of vertex 1",
          'found': b'\x00'})),
        (GOOD.replace("\n", "\r\r\n").replace("2 0 0", "2 - 0", 1),
         ("F002.number", 3, {'item': "positions of vertex 1",
          'found': b'-'})),
        (GOOD.replace("2 0 0", "2 0", 1), ("F002.width", 3, {'item': "positions of vertex 1",
         'expected': 3, 'found': 2})),
        (GOOD.replace("2 0 0", "2 0 0 0", 1), ("F002.width", 3, {'item': "positions of vertex 1",
         'expected': 3, 'found': 4})),
        (GOOD.replace("  2 0 0\n", "", 1),
         ("F002.skin-entries", 1, {'section': 'positions', 'expected': 3, 'other': 'normals',
          'found': 2})),
        (GOOD.replace("  2 0 0\n", "  2 0 0\n" * 2, 1),
         ("F002.skin-entries", 1, {'section': 'positions', 'expected': 3, 'other': 'normals',
          'found': 4})),
        ("positions 3 { 0 0 0 1 1 1 2 2 }\n" + NORMALS,
         ("F002.skin-rows", 1, {'section': 'positions', 'expected': 3, 'width': 3, 'found': 2,
          'rest': 2, 'end': 1})),
        ("positions 3 {\n 0 0 0\n 1 1 1\n 2",
         ("F002.skin-rows-end", 4, {'section': 'positions', 'line': 1, 'found': 2, 'expected': 3})),
        (GOOD.replace("\n}\nnormals", "\nnormals"),
         ("F002.unclosed", 5, {'section': 'positions', 'line': 1, 'found': b'normals'})),
        (GOOD.replace("  2 0 0\n", "{", 1),
         ("F002.unclosed", 3, {'section': 'positions', 'line': 1, 'found': b'{'})),
        (GOOD.replace("normals 3", "normals 2").replace("  0 1 0\n}", "}", 1),
         ("F002.skin-entries", 6, {'section': 'normals', 'expected': 3, 'other': 'positions',
          'found': 2})),
        (GOOD + "texcoords 1 { 0 0 }",
         ("F002.skin-entries", 33, {'section': 'texcoords', 'expected': 3, 'other': 'positions',
          'found': 1})),
        (GOOD.replace(WEIGHTS, "skinweights 2 { 1 0 1 1 0 1 }\n"),
         ("F002.skin-entries", 11, {'section': 'skinweights', 'expected': 3, 'other': 'positions',
          'found': 2})),
        (GOOD.replace("0 1 2", "0 1 3"),
         ("F002.skin-corner-range", 17, {'triangle': 0, 'limit': 3, 'found': 3})),
        (GOOD.replace("0 1 2", "0 -1 2"),
         ("F002.skin-corner-range", 17, {'triangle': 0, 'limit': 3, 'found': -1})),
        (GOOD.replace("0 1 2", "0 1.5 2"),
         ("F002.skin-corner", 17, {'triangle': 0, 'found': 1.5})),
        (GOOD.replace("0 1 2", "0 1 4e9"),
         ("F002.skin-corner", 17, {'triangle': 0, 'found': 4000000000.0})),
        (GOOD.replace("0 1 2", "0 1 2\n 2 1"),
         ("F002.width", 18, {'item': "triangle 1",
          'expected': 3, 'found': 2})),
        (GOOD.replace("1 1 1\n}", "1 2 1\n}"),
         ('W010.skin-joint', 14, {'vertex': 2, 'limit': 2, 'found': 2})),
        (GOOD.replace("0.25 1 0.75", "0.25 -1 0.75"),
         ('W010.skin-joint', 13, {'vertex': 1, 'limit': 2, 'found': -1})),
        (GOOD.replace("0.25 1 0.75", "0.25 0.5 0.75"),
         ("F002.skin-joint", 13, {'vertex': 1, 'found': b'0.5'})),
        (GOOD.replace("0.25 1 0.75", "0.25 1 nan"),
         ('W003.number', 13, {'item': "skinweights of vertex 1",
          'found': b'nan'})),
        (GOOD.replace("2 0 0.25", "-2 0 0.25"),
         ("F002.skin-influence-count", 13, {'vertex': 1, 'found': b'-2'})),
        (GOOD.replace("2 0 0.25", "1.5 0 0.25"),
         ("F002.skin-influence-count", 13, {'vertex': 1, 'found': b'1.5'})),
        (GOOD.replace("1 1 1\n}", "2 1 1\n}"),
         ("F002.skin-influences", 14, {'vertex': 2, 'pairs': b'2', 'found': 2})),
        (GOOD.replace("1 1 1\n}", "1 1 1\n1 1 1\n}"),
         ("F002.skin-entries", 11, {'section': 'skinweights', 'expected': 3, 'other': 'positions',
          'found': 4})),
        (GOOD.replace("  1 1 1\n}", "}"),
         ("F002.skin-entries", 11, {'section': 'skinweights', 'expected': 3, 'other': 'positions',
          'found': 2})),
        (GOOD.replace("skinweights 3", "skinweights 0"),
         ("F002.skin-declared", 11, {'section': 'skinweights', 'expected': 0, 'found': 3})),
        (POSITIONS + "skinweights 3 {\n 1 0 1\n 1 0",
         ("F002.skin-weights-end", 8, {'line': 6, 'found': 2, 'expected': 3})),
        (BARE + WEIGHTS,
         ('B001.skin-section', 14, {'missing': 'bindings', 'present': 'skinweights'})),
        (BARE + BINDINGS,
         ('B001.skin-section', 14, {'missing': 'skinweights', 'present': 'bindings'})),
        (GOOD.replace("bindings 2", "bindings 3"),
         ('B001.skin-count', 19, {'line': 32, 'expected': 3, 'found': 2, 'then': b'}'})),
        (GOOD.replace("bindings 2", "bindings 1"),
         ('B001.skin-count', 19, {'line': 32, 'expected': 1, 'found': 2, 'then': b'}'})),
        (GOOD.replace("matrix", "matrices", 1),
         ("F002.skin-bindings-end", 20, {'line': 19, 'expected': 2, 'found': 0,
          'then': b'matrices'})),
        (GOOD.replace("  8 9 10\n", ""),
         ("F002.width", 26, {'item': "bindings matrix 1", 'expected': 12, 'found': 9})),
        (GOOD.replace("8 9 10", "8 9 10 11"),
         ("F002.width", 26, {'item': "bindings matrix 1", 'expected': 12, 'found': 13})),
        (GOOD.replace("8 9 10", "8 9 x"),
         ("F002.number", 30, {'item': "bindings matrix 1", 'found': b'x'})),
        (GOOD.replace("matrix {", "matrix 1", 1),
         ("F002.skin-brace", 20, {'section': 'matrix 0 of bindings', 'found': b'1'})),
        (GOOD[: GOOD.index("8 9")],
         ("F002.unclosed", 29, {'section': 'matrix 1 of bindings', 'line': 26, 'found': None})),
        (GOOD[: GOOD.index("matrix {\n  1 0 0\n  0 1 0\n  0 0 1\n  8")],
         ("F002.skin-bindings-end", 25, {'line': 19, 'expected': 2, 'found': 1, 'then': None})),
        (GOOD.replace("0 0 1\n  8", "0 1 0\n  8"),
         ('B002.skin-matrix', 26, {'matrix': 1, 'determinant': 0.0})),
        (GOOD.replace("0 0 1\n  8", "0 0 1e-300\n  8"),
         ('B002.skin-matrix', 26, {'matrix': 1, 'determinant': 1.0000000000000237e-300})),
        (BARE + "material a", ("F002.skin-brace", 14, {'section': 'material', 'found': None})),
        (BARE + "material\ntriangles 1", ("F002.skin-brace", 15, {'section': 'material',
         'found': b'triangles'})),
        (BARE + "material a {\n texture b.png\n",
         ("F002.unclosed", 15, {'section': 'material', 'line': 14, 'found': None})),
        (BARE + "material a {\n foo { texture b.png }",
         ("F002.unclosed", 15, {'section': 'material', 'line': 14, 'found': None})),
        (BARE + "material a {\n foo { {",
         ("F002.open", 15, {'word': b'foo'})),
        (GOOD + "foo {\n { }\n", ("F002.open", 33, {'word': b'foo'})),
    ],
)  # fmt: skip
def test_broken_file_is_refused_with_its_line(text, fault):
    assert refusal_of(lambda: read(text)) == fault


def number(vertex, word):
    item = Phrase("{section} of vertex {index}", section="positions", index=vertex)
    return {"item": item, "found": word}


def test_truncated_file_is_refused_or_loads_with_a_warning():
    for cut in range(len(GOOD.rstrip())):
        source = Source("a.skin", GOOD[:cut].encode())
        try:
            figure = skin.read(source)
        except FormatError as problem:
            assert str(problem).startswith("a.skin"), cut
        else:
            assert source.warnings, cut
            assert figure.mesh.n_vertices == 3, cut


def test_paths_and_words_are_never_used_as_format_strings():
    with pytest.raises(FormatError) as caught:
        read("positions %s {", Path("a{0}%d\n.skin"))
    assert str(caught.value) == 'a{0}%d\\n.skin:1: positions: expected a count, found "%s"'


# Large files


@pytest.mark.parametrize(
    "name", ["positions", "normals", "texcoords", "skinweights", "triangles", "bindings"]
)
@pytest.mark.parametrize("count", ["2000000000", "99999999999", "1e38", "-5", "-0.5"])
def test_absurd_count_is_refused_without_allocating(name, count):
    text = f"{BARE}{name} {count} {{ 1 2 3 }}".encode()
    refusal_of(lambda: read(text))  # load modules before measuring
    tracemalloc.start()
    try:
        key, line, values = refusal_of(lambda: read(text))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert key in ("F002.count", "F002.skin-too-many")
    assert (line, values["item" if key == "F002.count" else "section"]) == (14, name)
    assert peak < 200_000


def test_absurd_number_of_influences_is_refused_without_allocating():
    text = GOOD.replace("1 1 1\n}", "1e38 1 1\n}").encode()
    refusal_of(lambda: read(text))  # load modules before measuring
    tracemalloc.start()
    try:
        fault = refusal_of(lambda: read(text))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    values = {"vertex": 2, "pairs": b"1e38", "found": 2}
    assert fault == ("F002.skin-influences", 14, values)
    assert peak < 200_000


@pytest.mark.slow
@pytest.mark.parametrize("end", ["\n", "\r", "\r\n", " "])
def test_2_million_blank_lines_are_counted(end):
    line = 1 if end == " " else 2_000_001
    text = end * 2_000_000 + "positions up"
    values = {"item": "positions", "found": b"up"}
    assert refusal_of(lambda: read(text)) == ("F002.count", line, values)
    rows = f"positions 1 {{ {end * 2_000_000} 0 0 up }}"
    assert refusal_of(lambda: read(rows)) == ("F002.number", line, number(0, b"up"))


@pytest.mark.slow
def test_word_of_2_mb_is_refused():
    text = f"positions 1 {{ 0 0 {'9' * 2_000_000}x }}"
    word = b"9" * 2_000_000 + b"x"
    assert refusal_of(lambda: read(text)) == ("F002.number", 1, number(0, word))


@pytest.mark.slow
def test_20_000_materials_are_read():
    figure, warnings = read(BARE + "material a { texture gone.png }" * 20_000 + TRIANGLES)
    assert len(figure.mesh.materials) == 20_000
    assert figure.mesh.material_indices.tolist() == [-1, 19_999]
    assert len(warnings) == 3


@pytest.mark.slow
def test_20_000_sections_of_triangles_are_read():
    assert read(BARE + "triangles 1 {2 1 0}" * 20_000)[0].mesh.n_triangles == 20_001


def test_20_000_joints_are_bound():
    text = f"skinweights 3 {{ 1 0 1 1 19999 1 1 7 1 }} bindings 20000 {{ {MATRIX * 20_000} }}"
    assert silent(BARE + text).skin.n_joints == 20_000


def test_invalid_word_far_into_the_file_is_found():
    text = "positions 200000 {\n" + "0.5 1.5 2.5\n" * 199_999 + "0.5 1.5 2.5x\n}"
    assert refusal_of(lambda: read(text)) == ("F002.number", 200001, number(199_999, b"2.5x"))


UVS = "texcoords 3 {\n 0 0\n 1.07 0\n 0 1\n}\n"


@pytest.fixture
def folder(tmp_path):
    Image.new("RGB", (2, 1), (255, 0, 0)).save(tmp_path / "red.bmp")
    Image.new("RGBA", (1, 2), (0, 255, 0, 128)).save(tmp_path / "my green.png")
    return tmp_path


def textured(folder, material, rest=TRIANGLES):
    return read(POSITIONS + NORMALS + UVS + WEIGHTS + material + rest + BINDINGS, folder / "a.skin")


@pytest.mark.parametrize(
    "material",
    [
        "material face {\n texture red.bmp\n}\n",
        "material face { texture red.bmp }",
        "material face{texture red.bmp}",
        "material face\n{\r\n\ttexture\r\n\tred.bmp\r\n}",
        "material face { texture red.bmp \t }",
    ],
)
def test_material_applies_to_the_triangles_after_it(folder, material):
    figure, warnings = textured(folder, material)
    assert warnings == []
    assert figure.mesh.uvs.tolist() == [[0, 0], [1.07, 0], [0, 1]]
    assert figure.mesh.material_indices.tolist() == [0]
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("face", "red.bmp")]
    assert figure.mesh.materials[0].image.tolist() == [[[255, 0, 0, 255]] * 2]


def test_texture_name_may_contain_spaces_and_backslashes(folder):
    (folder / "tex").mkdir()
    (folder / "my green.png").rename(folder / "tex" / "my green.png")
    figure, warnings = textured(folder, "material { texture tex\\my green.png\n}")
    assert warnings == []
    assert figure.mesh.materials[0].texture == "tex\\my green.png"
    assert figure.mesh.materials[0].image.tolist() == [[[0, 255, 0, 128]]] * 2


def test_several_materials_apply_to_the_triangles_that_follow(folder):
    rest = (
        "material b { texture my green.png }\n" + TRIANGLES * 2 + "material c { texture red.bmp }\n"
    )
    figure, warnings = textured(
        folder, TRIANGLES + "material a { texture red.bmp }" + TRIANGLES, rest
    )
    assert warnings == []
    assert [material.name for material in figure.mesh.materials] == ["a", "b", "c"]
    assert figure.mesh.material_indices.tolist() == [-1, 0, 1, 1]


def test_materials_with_the_same_texture_share_it(folder):
    material = "material { texture red.bmp }"
    figure, _ = textured(folder, material * 3)
    first, second, third = (material.image for material in figure.mesh.materials)
    assert first is second is third


def test_material_without_texture_is_reported_as_a_warning(folder):
    figure, warnings = textured(folder, "material a { }\nmaterial { texture }\n")
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("a", None), ("", None)]
    assert warnings == [
        f"{folder}/a.skin:21: material without a texture: drawn untextured",
        f"{folder}/a.skin:11: texcoords without a texture: drawn untextured",
    ]


@pytest.mark.parametrize("item", ["shininess 20 30", "shine { 1 { 2 } }", "shine 3 { }", "shine"])
def test_unknown_item_of_a_material_is_skipped(folder, item):
    figure, warnings = textured(folder, f"material a {{ {item} texture red.bmp }}")
    assert figure.mesh.materials[0].texture == "red.bmp"
    assert figure.mesh.material_indices.tolist() == [0]
    assert warnings == [
        f'{folder}/a.skin:21: ignored unknown material property "{item.split()[0]}"'
    ]


def test_texture_without_texcoords_is_reported_as_a_warning(folder):
    text = POSITIONS + NORMALS + WEIGHTS + "material { texture red.bmp }\n" + TRIANGLES + BINDINGS
    figure, warnings = read(text, folder / "a.skin")
    assert figure.mesh.materials[0].image is not None
    assert warnings == [f"{folder}/a.skin:16: texture without texcoords: drawn untextured"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gone.png", "cannot be read: No such file or directory"),
        ("folder", "expected a file, found a folder"),
        ("text.png", "unsupported or damaged image"),
        ("new\x1bline.png", "cannot be read: No such file or directory"),
    ],
)
def test_unreadable_texture_is_reported_as_a_warning(folder, name, reason):
    (folder / "folder").mkdir()
    (folder / "text.png").write_text("no picture")
    figure, warnings = textured(folder, f"material {{ texture {name} }}")
    assert figure.mesh.materials[0].image is None
    assert figure.mesh.materials[0].texture == name
    path = f"{folder}/{name}".replace("\x1b", "\\x1b")
    assert warnings == [f"{folder}/a.skin:21: texture {path}: {reason}; drawn untextured"]


def test_truncated_texture_is_reported_as_a_warning(folder):
    whole = (folder / "red.bmp").read_bytes()
    (folder / "cut.bmp").write_bytes(whole[:-3])
    figure, warnings = textured(folder, "material { texture cut.bmp }")
    assert figure.mesh.materials[0].image is None
    assert len(warnings) == 1
    assert warnings[0].startswith(f"{folder}/a.skin:21: texture {folder}/cut.bmp: ")
    assert warnings[0].endswith("; drawn untextured")


def test_texture_that_ends_in_ctrl_z_is_read_completely(folder):
    # The last byte of a one-pixel-wide 24-bit BMP is padding, so four pixels are used.
    Image.new("RGB", (4, 1), (26, 26, 26)).save(folder / "dark.bmp")
    assert (folder / "dark.bmp").read_bytes().endswith(b"\x1a" * 12)
    figure, warnings = textured(folder, "material { texture dark.bmp }")
    assert warnings == []
    assert figure.mesh.materials[0].image.tolist() == [[[26, 26, 26, 255]] * 4]
