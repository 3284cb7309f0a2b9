"""Every quirk of ``.skin`` as a tiny file, and every broken one with its exact message."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from viewer.errors import FormatError
from viewer.formats import Source, skin

POSITIONS = "positions 3 {\n  0 0 0\n  2 0 0\n  0 2 0\n}\n"
NORMALS = "normals 3 {\n  0 0 1\n  0 0 1\n  0 1 0\n}\n"
WEIGHTS = "skinweights 3 {\n  1 0 1.0\n  2 0 0.25 1 0.75\n  1 1 1\n}\n"
TRIANGLES = "triangles 1 {\n  0 1 2\n}\n"
MATRIX = "matrix {\n  1 0 0\n  0 1 0\n  0 0 1\n  5 6 7\n}\n"
BINDINGS = f"bindings 2 {{\n{MATRIX}{MATRIX.replace('5 6 7', '8 9 10')}}}\n"
GOOD = POSITIONS + NORMALS + WEIGHTS + TRIANGLES + BINDINGS
BARE = POSITIONS + NORMALS + TRIANGLES


def read(text, path="a.skin"):
    """Return the figure and the warnings of a text."""
    source = Source(path, text if isinstance(text, bytes) else text.encode())
    return skin.read(source), source.warnings


def silent(text):
    figure, warnings = read(text)
    assert warnings == []
    return figure


def refusal(text):
    with pytest.raises(FormatError) as caught:
        read(text)
    assert caught.value.exit_code == 2
    return str(caught.value)


def assert_good(figure):
    assert figure.mesh.positions.tolist() == [[0, 0, 0], [2, 0, 0], [0, 2, 0]]
    assert figure.mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0]]
    assert figure.mesh.triangles.tolist() == [[0, 1, 2]]
    assert figure.mesh.material_indices.tolist() == [-1]
    assert figure.skin.starts.tolist() == [0, 1, 3, 4]
    assert figure.skin.joints.tolist() == [0, 0, 1, 1]
    assert figure.skin.weights.tolist() == [1, 0.25, 0.75, 1]
    assert figure.skin.inverse_bind[:, :3, 3].tolist() == [[-5, -6, -7], [-8, -9, -10]]
    assert figure.skin.inverse_bind[:, :3, :3].tolist() == [np.eye(3).tolist()] * 2


def test_good_file_gives_every_value():
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
def test_white_space_order_and_optional_braces_mean_nothing(text):
    assert_good(silent(text))


def test_rows_of_a_binding_are_the_columns_of_its_matrix():
    # A quarter turn about z, scaled by 2: x goes to 2y, y to -2x, z to 2z; then move by 1 2 3.
    rows = "0 2 0  -2 0 0  0 0 2  1 2 3"
    figure = silent(
        BARE + f"skinweights 3 {{ 1 0 1 1 0 1 1 0 1 }} bindings 1 {{ matrix {{ {rows} }} }}"
    )
    expected = [[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]
    assert_allclose(np.linalg.inv(figure.skin.inverse_bind[0]), expected, atol=1e-15)


def test_clockwise_triangles_are_kept_as_they_are():
    assert silent(GOOD.replace("0 1 2", "0 2 1")).mesh.triangles.tolist() == [[0, 2, 1]]


def test_flat_triangles_are_kept():
    assert silent(GOOD.replace("0 1 2", "1 1 2")).mesh.triangles.tolist() == [[1, 1, 2]]


def test_normals_are_kept_as_stored():
    assert silent(GOOD.replace("0 1 0\n}", "0 1.73 0\n}", 1)).mesh.normals[2].tolist() == [
        0,
        1.73,
        0,
    ]


def test_any_number_of_influences_is_kept():
    pairs = " ".join("1 0.001" for _ in range(5000))
    figure, warnings = read(GOOD.replace("1 1 1\n}", f"5000 {pairs}\n}}"))
    assert figure.skin.starts.tolist() == [0, 1, 3, 5003]
    assert figure.skin.weights[3:].tolist() == [0.001] * 5000
    assert warnings == [
        "a.skin:11: the weights of 1 vertices do not add up to 1 and are used as stored, "
        "worst vertex 2 with 5"
    ]


def test_zero_weights_and_a_joint_listed_twice_are_kept():
    figure = silent(GOOD.replace("2 0 0.25 1 0.75", "4 0 0.25 1 0.5 1 0.25 0 0.0"))
    assert figure.skin.joints[1:5].tolist() == [0, 1, 1, 0]
    assert figure.skin.weights[1:5].tolist() == [0.25, 0.5, 0.25, 0]


def test_several_sections_of_triangles_follow_each_other():
    figure = silent(GOOD + "triangles 2 { 2 1 0 0 2 1 }")
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [2, 1, 0], [0, 2, 1]]


# What is missing, repeated or unknown


def test_mesh_without_weights_and_bindings_loads_with_a_warning():
    figure, warnings = read(BARE)
    assert figure.skin is None
    assert warnings == [
        "a.skin: no `skinweights` and no `bindings`: the mesh cannot follow a skeleton"
    ]


def test_missing_normals_are_computed():
    figure, warnings = read(POSITIONS + WEIGHTS + TRIANGLES + BINDINGS)
    assert figure.mesh.normals.tolist() == [[0, 0, 1]] * 3
    assert warnings == ["a.skin: no `normals` section: computed them from the triangles"]


def test_zero_normals_are_computed():
    text = GOOD.replace("  0 0 1\n  0 0 1\n", "  0 0 0\n  1e-30 0 0\n", 1)
    figure, warnings = read(text)
    assert figure.mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0]]
    assert warnings == [
        "a.skin:6: 2 normals of length 0, first of vertex 0: computed from the triangles"
    ]


def test_repeated_section_counts_last():
    figure, warnings = read(GOOD + POSITIONS.replace("2 0 0", "9 0 0") + POSITIONS)
    assert_good(figure)
    assert warnings == ["a.skin:33: positions occurs again: the last one counts"]


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
def test_unknown_section_is_skipped_whole(section, place):
    parts = [POSITIONS, NORMALS, WEIGHTS, TRIANGLES, BINDINGS]
    parts.insert(place, section + "\n")
    line = "".join(parts[:place]).count("\n") + 1
    first = section.replace("{", " ").split()[0] if section[0] != "{" else "{"
    figure, warnings = read("".join(parts))
    assert_good(figure)
    assert warnings == [f'a.skin:{line}: skipped unknown section "{first}"']


def test_unknown_section_is_named_once_and_with_its_first_line():
    _, warnings = read("foo { }\nbar { }\nfoo { }\n" + GOOD)
    assert warnings == [
        'a.skin:1: skipped unknown section "foo"',
        'a.skin:2: skipped unknown section "bar"',
    ]


@pytest.mark.parametrize("name", ["triangles", "skinweights", "bindings"])
def test_missing_brace_at_the_very_end_is_a_warning(name):
    sections = {"triangles": TRIANGLES, "skinweights": WEIGHTS, "bindings": BINDINGS}
    last = sections.pop(name)
    text = POSITIONS + NORMALS + "".join(sections.values()) + last.rstrip().removesuffix("}")
    figure, warnings = read(text)
    assert_good(figure)
    assert warnings == [f'a.skin: the last "}}" is missing: {name} ends with the file']


def test_extra_braces_are_a_warning():
    figure, warnings = read(GOOD + "}}")
    assert_good(figure)
    assert warnings == ['a.skin: ignored 2 "}" outside all sections']


def test_vertices_without_influence_are_a_warning():
    figure, warnings = read(GOOD.replace("1 0 1.0", "0").replace("1 1 1\n", "1 1 0\n"))
    assert figure.skin.starts.tolist() == [0, 0, 2, 3]
    assert warnings == [
        "a.skin:11: 2 vertices without influence stay where they were bound, first vertex 0"
    ]


def test_negative_weights_are_a_warning():
    figure, warnings = read(GOOD.replace("0.25 1 0.75", "-0.25 1 1.25"))
    assert figure.skin.weights.tolist() == [1, -0.25, 1.25, 1]
    assert warnings == ["a.skin:11: 1 negative weights are used as stored, first -0.25 of vertex 1"]


def test_weights_that_do_not_add_up_are_a_warning():
    figure, warnings = read(GOOD.replace("0 1.0", "0 0.98").replace("0.75", "0.5"))
    assert figure.skin.weights.tolist() == [0.98, 0.25, 0.5, 1]
    assert warnings == [
        "a.skin:11: the weights of 2 vertices do not add up to 1 and are used as stored, "
        "worst vertex 1 with 0.75"
    ]


def test_weights_that_add_up_within_a_hundredth_are_no_warning():
    silent(GOOD.replace("0 1.0", "0 0.991"))


def test_nearly_singular_binding_is_a_warning():
    _, warnings = read(GOOD.replace("0 0 1\n  5", "0 0 1e-8\n  5"))
    assert warnings == [
        "a.skin:19: matrix 0 of bindings can hardly be inverted (condition number 1e+08)"
    ]


def test_far_vertex_is_a_warning():
    figure, warnings = read(GOOD.replace("  0 2 0\n", "  0 1e30 0\n"))
    assert figure.mesh.positions[2].tolist() == [0, 1e30, 0]
    # Half of three vertices are no cloud: the median distance is 2.
    assert warnings == ["a.skin:1: vertex 2 is 1e+30 units away from the others"]


# Texture coordinates and materials

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
def test_material_covers_the_triangles_after_it(folder, material):
    figure, warnings = textured(folder, material)
    assert warnings == []
    assert figure.mesh.uvs.tolist() == [[0, 0], [1.07, 0], [0, 1]]
    assert figure.mesh.material_indices.tolist() == [0]
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("face", "red.bmp")]
    assert figure.mesh.materials[0].image.tolist() == [[[255, 0, 0, 255]] * 2]


def test_texture_name_may_hold_blanks_and_back_slashes(folder):
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


def test_materials_of_one_picture_share_it(folder):
    material = "material { texture red.bmp }"
    figure, _ = textured(folder, material * 3)
    first, second, third = (material.image for material in figure.mesh.materials)
    assert first is second is third


def test_material_without_texture_is_a_warning(folder):
    figure, warnings = textured(folder, "material a { }\nmaterial { texture }\n")
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("a", None), ("", None)]
    assert warnings == [
        f"{folder}/a.skin:21: material without texture: drawn untextured",
        f"{folder}/a.skin:11: texcoords without a texture: drawn untextured",
    ]


@pytest.mark.parametrize("item", ["shininess 20 30", "shine { 1 { 2 } }", "shine 3 { }", "shine"])
def test_unknown_item_of_a_material_is_skipped(folder, item):
    figure, warnings = textured(folder, f"material a {{ {item} texture red.bmp }}")
    assert figure.mesh.materials[0].texture == "red.bmp"
    assert figure.mesh.material_indices.tolist() == [0]
    assert warnings == [f'{folder}/a.skin:21: skipped unknown "{item.split()[0]}" in a material']


def test_texture_without_texcoords_is_a_warning(folder):
    text = POSITIONS + NORMALS + WEIGHTS + "material { texture red.bmp }\n" + TRIANGLES + BINDINGS
    figure, warnings = read(text, folder / "a.skin")
    assert figure.mesh.materials[0].image is not None
    assert warnings == [f"{folder}/a.skin:16: a texture without texcoords: drawn untextured"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gone.png", "cannot be read: No such file or directory"),
        ("folder", "expected a file, found a folder"),
        ("text.png", "not a picture that can be read"),
        ("new\x1bline.png", "cannot be read: No such file or directory"),
    ],
)
def test_picture_that_cannot_be_read_is_a_warning(folder, name, reason):
    (folder / "folder").mkdir()
    (folder / "text.png").write_text("no picture")
    figure, warnings = textured(folder, f"material {{ texture {name} }}")
    assert figure.mesh.materials[0].image is None
    assert figure.mesh.materials[0].texture == name
    path = f"{folder}/{name}".replace("\x1b", "\\x1b")
    assert warnings == [f"{folder}/a.skin:21: texture {path}: {reason}; drawn untextured"]


def test_truncated_picture_is_a_warning(folder):
    whole = (folder / "red.bmp").read_bytes()
    (folder / "cut.bmp").write_bytes(whole[:-3])
    figure, warnings = textured(folder, "material { texture cut.bmp }")
    assert figure.mesh.materials[0].image is None
    assert len(warnings) == 1
    assert warnings[0].startswith(f"{folder}/a.skin:21: texture {folder}/cut.bmp: ")
    assert warnings[0].endswith("; drawn untextured")


def test_picture_that_ends_in_ctrl_z_loses_nothing(folder):
    # The last byte of a 24 bit BMP of one pixel's width is padding: take four pixels.
    Image.new("RGB", (4, 1), (26, 26, 26)).save(folder / "dark.bmp")
    assert (folder / "dark.bmp").read_bytes().endswith(b"\x1a" * 12)
    figure, warnings = textured(folder, "material { texture dark.bmp }")
    assert warnings == []
    assert figure.mesh.materials[0].image.tolist() == [[[26, 26, 26, 255]] * 4]


# Broken files


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.skin: expected a skin, found no `positions` section (an empty file)"),
        (" \n\n", "a.skin: expected a skin, found no `positions` section (only white space)"),
        ("\0" * 9, "a.skin: expected a skin, found no `positions` section (zeros)"),
        (NORMALS + TRIANGLES, "a.skin: expected a skin, found no `positions` section"),
        (POSITIONS + NORMALS, "a.skin: expected triangles, found no `triangles` section"),
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
         'a.skin:3: positions: expected a number, found "3.5e38"'),
        (GOOD.replace("2 0 0", "2 1_0 0", 1),
         'a.skin:3: positions: expected a number, found "1_0"'),
        (GOOD.replace("2 0 0", "2 0,5 0", 1),
         'a.skin:3: positions: expected a number, found "0,5"'),
        (GOOD.replace("2 0 0", "2 \0 0", 1),
         'a.skin:3: positions: expected a number, found "\\x00"'),
        (GOOD.replace("\n", "\r\r\n").replace("2 0 0", "2 - 0", 1),
         'a.skin:3: positions: expected a number, found "-"'),
        (GOOD.replace("2 0 0", "2 0", 1), "a.skin:3: positions: expected 3 numbers, found 2"),
        (GOOD.replace("2 0 0", "2 0 0 0", 1), "a.skin:3: positions: expected 3 numbers, found 4"),
        (GOOD.replace("  2 0 0\n", "", 1),
         "a.skin:4: positions: expected 3 rows of 3 numbers, found 2 (from line 1)"),
        (GOOD.replace("  2 0 0\n", "  2 0 0\n" * 2, 1),
         "a.skin:6: positions: expected 3 rows of 3 numbers, found 4 (from line 1)"),
        ("positions 3 { 0 0 0 1 1 1 2 2 }\n" + NORMALS,
         "a.skin:1: positions: expected 3 rows of 3 numbers, found 2 and 2 numbers (from line 1)"),
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
        (GOOD.replace("0 1 2", "0 1 2\n 2 1"), "a.skin:18: triangles: expected 3 numbers, found 2"),
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
         "a.skin:14: skinweights of vertex 2, the last: expected 2 pairs of joint and weight, "
         "found 2 numbers up to the closing brace"),
        (GOOD.replace("1 1 1\n}", "1 1 1\n1 1 1\n}"),
         "a.skin:14: skinweights of vertex 2, the last: expected 1 pairs of joint and weight, "
         "found 5 numbers up to the closing brace"),
        (GOOD.replace("  1 1 1\n}", "}"),
         "a.skin:14: skinweights: expected 3 vertices, found 2 (from line 11)"),
        (GOOD.replace("skinweights 3", "skinweights 0"),
         "a.skin:11: skinweights: expected no vertices, found 11 numbers"),
        (POSITIONS + "skinweights 3 {\n 1 0 1\n 1 0",
         'a.skin:8: expected "}" to close skinweights (line 6), found the end of the file '
         "after 2 of 3 vertices"),
        (BARE + WEIGHTS, "a.skin: expected a `bindings` section beside `skinweights`, found none"),
        (BARE + BINDINGS, "a.skin: expected a `skinweights` section beside `bindings`, found none"),
        (GOOD.replace("bindings 2", "bindings 3"),
         'a.skin:32: bindings (line 19): expected 3 matrices, found 2 matrices, then "}"'),
        (GOOD.replace("bindings 2", "bindings 1"),
         'a.skin:32: bindings (line 19): expected 1 matrices, found 2 matrices, then "}"'),
        (GOOD.replace("matrix", "matrices", 1),
         'a.skin:20: bindings (line 19): expected 2 matrices, found 0 matrices, then "matrices"'),
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
         "a.skin:25: bindings (line 19): expected 2 matrices, found 1 matrices, "
         "then the end of the file"),
        (GOOD.replace("0 0 1\n  8", "0 1 0\n  8"),
         "a.skin:19: bindings: expected matrices that can be inverted, found matrix 1 "
         "with determinant 0"),
        (GOOD.replace("0 0 1\n  8", "0 0 1e-300\n  8"),
         "a.skin:19: bindings: expected matrices that can be inverted, found matrix 1 "
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
        "a.skin:14: skinweights of vertex 2, the last: expected 1e38 pairs of joint and weight, "
        "found 2 numbers up to the closing brace"
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
