"""All quirks of ``.skin``, each in a tiny file."""

import numpy as np
import pytest
from formats.skin_text import (
    BARE,
    BINDINGS,
    GOOD,
    NORMALS,
    POSITIONS,
    TRIANGLES,
    WEIGHTS,
    assert_good,
    read,
    silent,
)
from numpy.testing import assert_allclose


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
