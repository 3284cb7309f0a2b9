"""Broken ``.skin`` files with the error of each, and large files."""

import tracemalloc
from pathlib import Path

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
    read,
    silent,
)

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats import Source, skin


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


@pytest.mark.parametrize("cut", range(len(GOOD.rstrip())))
def test_truncated_file_is_refused_or_loads_with_a_warning(cut):
    source = Source("a.skin", GOOD[:cut].encode())
    try:
        figure = skin.read(source)
    except FormatError as problem:
        assert str(problem).startswith("a.skin")
    else:
        assert source.warnings
        assert figure.mesh.n_vertices == 3


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
def test_5_million_blank_lines_are_counted(end):
    line = 1 if end == " " else 5_000_001
    text = end * 5_000_000 + "positions up"
    values = {"item": "positions", "found": b"up"}
    assert refusal_of(lambda: read(text)) == ("F002.count", line, values)
    rows = f"positions 1 {{ {end * 5_000_000} 0 0 up }}"
    assert refusal_of(lambda: read(rows)) == ("F002.number", line, number(0, b"up"))


@pytest.mark.slow
def test_word_of_5_mb_is_refused():
    text = f"positions 1 {{ 0 0 {'9' * 5_000_000}x }}"
    word = b"9" * 5_000_000 + b"x"
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
