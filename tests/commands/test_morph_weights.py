"""The option ``--shape`` for bodies and morphs, by name and as a list."""

import numpy as np
import pytest
from app.tiny import skin_text, write_rig
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

from viewer.cli import run

# Vertices 11 and 10 of the tiny column, at (0.2, 2, -0.2) and (-0.2, 2, -0.2).
SHARP = "positions 1 {\n 11 0.2 5 -0.2\n}\nnormals 1 {\n 11 1 0 -1\n}\n"
WIDE = "positions 1 {\n 10 -4.2 2 -0.2\n}\nnormals 1 {\n 10 -1 0 -1\n}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    skel, _ = write_rig(tmp_path)
    skel.write_text("balljoint root { balljoint arm { offset 0 1 0 } }")
    (tmp_path / "sharp.morph").write_text(SHARP)
    (tmp_path / "wide.morph").write_text(WIDE)
    np.savez(tmp_path / "smpl.npz", **model("smpl", 32))
    return tmp_path


RIG = ("tiny.skel", "tiny.skin", "sharp.morph", "wide.morph")


def vertices(*arguments) -> np.ndarray:
    assert run(["convert", *arguments, "-o", "x.npz", "--force"]) == 0
    with np.load("x.npz") as arrays:
        return arrays["vertices"]


@pytest.mark.parametrize(
    ("text", "sharp", "wide"),
    [
        ("sharp=0.5", 0.5, 0),
        ("sharp=0.5,wide=1", 0.5, 1),
        (" Wide = -1 ,", 0, -1),
        ("sharp=1e-1", 0.1, 0),
        ("0.5", 0.5, 0),
        ("0,2", 0, 2),
        ("0.25,0.75,0", 0.25, 0.75),
    ],
)
def test_morphs_move_their_vertices(folder, text, sharp, wide):
    plain = vertices(*RIG)
    assert_allclose(plain[[10, 11]], [[-0.2, 2, -0.2], [0.2, 2, -0.2]], atol=1e-12)
    moved = vertices(*RIG, f"--shape={text}") - plain
    expected = np.zeros((12, 3))
    expected[11, 1], expected[10, 0] = 3 * sharp, -4 * wide
    assert_allclose(moved, expected, atol=1e-12)


def test_morphs_do_not_need_a_skeleton(folder):
    (folder / "alone.skin").write_text(skin_text())
    moved = vertices("alone.skin", "sharp.morph", "--shape", "sharp=1")
    assert_allclose(moved[11], [0.2, 5, -0.2], atol=1e-12)


def test_body_shapes_can_be_set_by_name(folder):
    by_place = vertices("smpl.npz", "--shape", "0,2")
    assert np.abs(by_place - vertices("smpl.npz")).max() > 1e-3
    assert (by_place == vertices("smpl.npz", "--shape", "shape 1=2")).all()


def test_names_apply_to_a_body_opened_with_a_morphed_rig(folder):
    """A list sets the coefficients of the body; names apply to the figures that have them."""
    first = vertices(*RIG, "smpl.npz", "--shape", "sharp=1")
    assert_allclose(first[11], [0.2, 5, -0.2], atol=1e-12)
    first = vertices(*RIG, "smpl.npz", "--shape", "1")
    assert_allclose(first[11], [0.2, 2, -0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("files", "text", "message"),
    [
        (RIG, "narrow=1", 'no shape is called "narrow"; there are 2: sharp, wide'),
        (RIG, "sharp=1,narrow=1", 'no shape is called "narrow"; there are 2: sharp, wide'),
        (RIG, "sharpe=1", 'no shape is called "sharpe"; did you mean sharp?'),
        (RIG, "sharp=much", 'expected NAME=NUMBER, found "sharp=much"'),
        (RIG, "sharp=nan", 'expected NAME=NUMBER, found "sharp=nan"'),
        (RIG, "=1", 'expected NAME=NUMBER, found "=1"'),
        (RIG, "sharp=1,0.5", 'expected NAME=NUMBER, found "0.5"'),
        (RIG, "1,2,3", "tiny has 2 morphs (sharp, wide), found 3 numbers"),
        (RIG[:2], "sharp=1", "no file has shapes or morphs"),
        (
            ("sharp.morph", "sub/sharp.morph", *RIG[:2]),
            "sharp=1",
            '2 shapes are called "sharp"; numbers without names set all shapes in order',
        ),
    ],
)
def test_invalid_shapes_are_refused_in_one_line(folder, capsys, files, text, message):
    (folder / "sub").mkdir()
    (folder / "sub" / "sharp.morph").write_text(WIDE)
    assert run(["info", *files, f"--shape={text}"]) == 2
    assert capsys.readouterr().err == f"viewer: --shape: {message}\n"


def test_long_name_lists_are_truncated(folder, capsys):
    assert run(["info", "smpl.npz", "--shape", "x=1"]) == 2
    assert 'no shape is called "x"; there are 10: ' in capsys.readouterr().err
