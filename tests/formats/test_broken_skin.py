"""Broken ``.skin`` files with their exact messages, and large ones."""

import tracemalloc
from pathlib import Path

import pytest
from skin_text import (
    BARE,
    BINDINGS,
    GOOD,
    MATRIX,
    NORMALS,
    POSITIONS,
    TRIANGLES,
    WEIGHTS,
    read,
    refusal,
    silent,
)

from viewer.errors import FormatError
from viewer.formats import Source, skin


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.skin: expected a skin, found no `positions` section (an empty file)"),
        (" \n\n", "a.skin: expected a skin, found no `positions` section (only white space)"),
        ("\0" * 9, "a.skin: expected a skin, found no `positions` section (zeros)"),
        (NORMALS + TRIANGLES, "a.skin:8: expected a skin, found no `positions` section"),
        (POSITIONS + NORMALS, "a.skin:10: expected triangles, found no `triangles` section"),
        (
            POSITIONS + NORMALS + "triangles 0 {\n}",
            "a.skin:11: expected at least one triangle, found none",
        ),
        ("\npositions 0 { }" + TRIANGLES,
         "a.skin:2: expected at least one vertex, found positions 0"),
        ("positions", "a.skin:1: positions: expected a count, found the end of the file"),
        ("positions {", 'a.skin:1: positions: expected a count, found "{"'),
        ("positions\n-3 {", 'a.skin:2: positions: expected a count, found "-3"'),
        ("positions 1.5 {", 'a.skin:1: positions: expected a count, found "1.5"'),
        ("positions nan {", 'a.skin:1: positions: expected a count, found "nan"'),
        ("positions 1e999 {", 'a.skin:1: positions: expected a count, found "1e999"'),
        (
            "positions 99999999999 { 0 0 0 }",
            "a.skin:1: positions: expected a count that the file can hold, "
            "found 99999999999 entries in 10 bytes",
        ),
        ("positions 1", 'a.skin:1: positions: expected a count that the file can hold, '
                        'found 1 entries in 0 bytes'),
        ("positions 1\n0 0 0 }", 'a.skin:2: positions: expected "{", found "0"'),
        ("positions 1\n  ", 'a.skin:1: positions: expected "{", found the end of the file'),
        (GOOD.replace("2 0 0", "2 up 0", 1), 'a.skin:3: positions: expected a number, found "up"'),
        (GOOD.replace("2 0 0", "2 nan 0", 1),
         'a.skin:3: positions: expected a number, found "nan"'),
        (GOOD.replace("2 0 0", "2 3.5e38 0", 1),
         'a.skin:3: positions: expected a number below 3.4e+38, found "3.5e38"'),
        (GOOD.replace("2 0 0", "2 1_0 0", 1),
         'a.skin:3: positions: expected a number, found "1_0"'),
        (GOOD.replace("2 0 0", "2 0,5 0", 1),
         'a.skin:3: positions: expected a number, found "0,5"'),
        (GOOD.replace("2 0 0", "2 \0 0", 1),
         'a.skin:3: positions: expected a number, found "\\x00"'),
        (GOOD.replace("\n", "\r\r\n").replace("2 0 0", "2 - 0", 1),
         'a.skin:3: positions: expected a number, found "-"'),
        (GOOD.replace("2 0 0", "2 0", 1), "a.skin:3: expected 3 numbers, found 2 (positions)"),
        (GOOD.replace("2 0 0", "2 0 0 0", 1), "a.skin:3: expected 3 numbers, found 4 (positions)"),
        (GOOD.replace("  2 0 0\n", "", 1),
         "a.skin:1: positions: expected 3 rows of 3 numbers, found 2 (to line 4)"),
        (GOOD.replace("  2 0 0\n", "  2 0 0\n" * 2, 1),
         "a.skin:1: positions: expected 3 rows of 3 numbers, found 4 (to line 6)"),
        ("positions 3 { 0 0 0 1 1 1 2 2 }\n" + NORMALS,
         "a.skin:1: positions: expected 3 rows of 3 numbers, found 2 and 2 numbers (to line 1)"),
        ("positions 3 {\n 0 0 0\n 1 1 1\n 2",
         'a.skin:4: expected "}" to close positions (line 1), found the end of the file '
         "after 2 of 3 rows"),
        (GOOD.replace("\n}\nnormals", "\nnormals"),
         'a.skin:5: expected "}" to close positions (line 1), found "normals"'),
        (GOOD.replace("  2 0 0\n", "{", 1),
         'a.skin:3: expected "}" to close positions (line 1), found "{"'),
        (GOOD.replace("normals 3", "normals 2").replace("  0 1 0\n}", "}", 1),
         "a.skin:6: normals: expected 3 entries as in positions, found 2"),
        (GOOD + "texcoords 1 { 0 0 }",
         "a.skin:33: texcoords: expected 3 entries as in positions, found 1"),
        (GOOD.replace(WEIGHTS, "skinweights 2 { 1 0 1 1 0 1 }\n"),
         "a.skin:11: skinweights: expected 3 entries as in positions, found 2"),
        (GOOD.replace("0 1 2", "0 1 3"),
         "a.skin:17: triangle 0: expected a vertex index below 3, found 3"),
        (GOOD.replace("0 1 2", "0 -1 2"),
         "a.skin:17: triangle 0: expected a vertex index below 3, found -1"),
        (GOOD.replace("0 1 2", "0 1.5 2"),
         'a.skin:17: triangles: expected a vertex index, found "1.5"'),
        (GOOD.replace("0 1 2", "0 1 4e9"),
         'a.skin:17: triangles: expected a vertex index, found "4e9"'),
        (GOOD.replace("0 1 2", "0 1 2\n 2 1"),
         "a.skin:18: expected 3 numbers, found 2 (triangles)"),
        (GOOD.replace("1 1 1\n}", "1 2 1\n}"),
         "a.skin:14: skinweights of vertex 2: expected a joint index below 2, found 2"),
        (GOOD.replace("0.25 1 0.75", "0.25 -1 0.75"),
         "a.skin:13: skinweights of vertex 1: expected a joint index below 2, found -1"),
        (GOOD.replace("0.25 1 0.75", "0.25 0.5 0.75"),
         'a.skin:13: skinweights of vertex 1: expected a joint index, found "0.5"'),
        (GOOD.replace("0.25 1 0.75", "0.25 1 nan"),
         'a.skin:13: skinweights: expected a number, found "nan"'),
        (GOOD.replace("2 0 0.25", "-2 0 0.25"),
         'a.skin:13: skinweights of vertex 1: expected a number of influences, found "-2"'),
        (GOOD.replace("2 0 0.25", "1.5 0 0.25"),
         'a.skin:13: skinweights of vertex 1: expected a number of influences, found "1.5"'),
        (GOOD.replace("1 1 1\n}", "2 1 1\n}"),
         "a.skin:14: skinweights of vertex 2: expected 2 pairs of joint and weight, "
         "found 2 numbers in the line"),
        (GOOD.replace("1 1 1\n}", "1 1 1\n1 1 1\n}"),
         "a.skin:11: skinweights: expected 3 vertices, found 4 (to line 16)"),
        (GOOD.replace("  1 1 1\n}", "}"),
         "a.skin:11: skinweights: expected 3 vertices, found 2 (to line 14)"),
        (GOOD.replace("skinweights 3", "skinweights 0"),
         "a.skin:11: skinweights: expected 0 vertices, found 3 (to line 15)"),
        (POSITIONS + "skinweights 3 {\n 1 0 1\n 1 0",
         'a.skin:8: expected "}" to close skinweights (line 6), found the end of the file '
         "after 2 of 3 vertices"),
        (BARE + WEIGHTS,
         "a.skin:14: expected a `bindings` section beside `skinweights`, found none"),
        (BARE + BINDINGS,
         "a.skin:14: expected a `skinweights` section beside `bindings`, found none"),
        (GOOD.replace("bindings 2", "bindings 3"),
         'a.skin:19: bindings (to line 32): expected 3 matrices, found 2 matrices, then "}"'),
        (GOOD.replace("bindings 2", "bindings 1"),
         'a.skin:19: bindings (to line 32): expected 1 matrix, found 2 matrices, then "}"'),
        (GOOD.replace("matrix", "matrices", 1),
         "a.skin:20: bindings (from line 19): expected 2 matrices, found 0 matrices, then "
         '"matrices"'),
        (GOOD.replace("  8 9 10\n", ""),
         "a.skin:26: matrix 1 of bindings: expected 12 numbers, found 9"),
        (GOOD.replace("8 9 10", "8 9 10 11"),
         "a.skin:26: matrix 1 of bindings: expected 12 numbers, found 13"),
        (GOOD.replace("8 9 10", "8 9 x"),
         'a.skin:30: matrix 1 of bindings: expected a number, found "x"'),
        (GOOD.replace("matrix {", "matrix 1", 1),
         'a.skin:20: matrix 0 of bindings: expected "{", found "1"'),
        (GOOD[: GOOD.index("8 9")],
         'a.skin:29: expected "}" to close matrix 1 of bindings (line 26), '
         "found the end of the file"),
        (GOOD[: GOOD.index("matrix {\n  1 0 0\n  0 1 0\n  0 0 1\n  8")],
         "a.skin:25: bindings (from line 19): expected 2 matrices, found 1 matrix, "
         "then the end of the file"),
        (GOOD.replace("0 0 1\n  8", "0 1 0\n  8"),
         "a.skin:26: bindings: expected matrices that can be inverted, found matrix 1 "
         "with determinant 0"),
        (GOOD.replace("0 0 1\n  8", "0 0 1e-300\n  8"),
         "a.skin:26: bindings: expected matrices that can be inverted, found matrix 1 "
         "with determinant 1e-300"),
        (BARE + "material a", 'a.skin:14: material: expected "{", found the end of the file'),
        (BARE + "material\ntriangles 1", 'a.skin:15: material: expected "{", found "triangles"'),
        (BARE + "material a {\n texture b.png\n",
         'a.skin:15: expected "}" to close material (line 14), found the end of the file'),
        (BARE + "material a {\n foo { texture b.png }",
         'a.skin:15: expected "}" to close material (line 14), found the end of the file'),
        (BARE + "material a {\n foo { {",
         'a.skin:15: "foo" is still open where the file ends'),
        (GOOD + "foo {\n { }\n", 'a.skin:33: "foo" is still open where the file ends'),
    ],
)  # fmt: skip
def test_broken_file_is_refused_with_its_line(text, message):
    assert refusal(text) == message


@pytest.mark.parametrize("cut", range(len(GOOD.rstrip())))
def test_file_cut_anywhere_is_refused_or_warned_of(cut):
    source = Source("a.skin", GOOD[:cut].encode())
    try:
        figure = skin.read(source)
    except FormatError as problem:
        assert str(problem).startswith("a.skin")
    else:
        assert source.warnings
        assert figure.mesh.n_vertices == 3


def test_paths_and_words_are_never_taken_for_formats():
    with pytest.raises(FormatError) as caught:
        read("positions %s {", Path("a{0}%d\n.skin"))
    assert str(caught.value) == 'a{0}%d\\n.skin:1: positions: expected a count, found "%s"'


# Large files


@pytest.mark.parametrize(
    "name", ["positions", "normals", "texcoords", "skinweights", "triangles", "bindings"]
)
@pytest.mark.parametrize("count", ["2000000000", "99999999999", "1e38", "-5", "-0.5"])
def test_absurd_count_is_refused_without_memory(name, count):
    text = f"{BARE}{name} {count} {{ 1 2 3 }}".encode()
    tracemalloc.start()
    try:
        message = refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert message.startswith(f"a.skin:14: {name}: expected a count")
    assert peak < 200_000


def test_absurd_number_of_influences_is_refused_without_memory():
    text = GOOD.replace("1 1 1\n}", "1e38 1 1\n}").encode()
    tracemalloc.start()
    try:
        message = refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert message == (
        "a.skin:14: skinweights of vertex 2: expected 1e38 pairs of joint and weight, "
        "found 2 numbers in the line"
    )
    assert peak < 200_000


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n", " "])
def test_5_million_blank_lines_are_counted(end):
    line = 1 if end == " " else 5_000_001
    assert refusal(end * 5_000_000 + "positions up") == (
        f'a.skin:{line}: positions: expected a count, found "up"'
    )
    rows = f"positions 1 {{ {end * 5_000_000} 0 0 up }}"
    assert refusal(rows) == f'a.skin:{line}: positions: expected a number, found "up"'


def test_word_of_5_mb_is_refused():
    text = f"positions 1 {{ 0 0 {'9' * 5_000_000}x }}"
    assert refusal(text) == f'a.skin:1: positions: expected a number, found "{"9" * 39}…"'


def test_20_000_materials_load():
    figure, warnings = read(BARE + "material a { texture gone.png }" * 20_000 + TRIANGLES)
    assert len(figure.mesh.materials) == 20_000
    assert figure.mesh.material_indices.tolist() == [-1, 19_999]
    assert len(warnings) == 3


def test_20_000_sections_of_triangles_load():
    assert read(BARE + "triangles 1 {2 1 0}" * 20_000)[0].mesh.n_triangles == 20_001


def test_20_000_joints_are_bound():
    text = f"skinweights 3 {{ 1 0 1 1 19999 1 1 7 1 }} bindings 20000 {{ {MATRIX * 20_000} }}"
    assert silent(BARE + text).skin.n_joints == 20_000


def test_broken_word_far_down_is_found():
    text = "positions 200000 {\n" + "0.5 1.5 2.5\n" * 199_999 + "0.5 1.5 2.5x\n}"
    assert refusal(text) == 'a.skin:200001: positions: expected a number, found "2.5x"'
