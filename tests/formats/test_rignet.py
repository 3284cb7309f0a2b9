"""Text rigs of networks that predict skeletons."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.rignet import read

GOOD = """joints tip 0.1 0.9 0.0
joints hips 0.0 0.1 0.0
joints chest 0.0 0.5 0.02

root hips
skin 0 hips 0.75 chest 0.25
skin 1 tip 1.0
hier hips chest
hier chest tip
"""


def source(text):
    return Source("rig.txt", text.encode())


def test_joints_have_their_positions_and_parents_come_first():
    made = source(GOOD)
    assert detect(made) == "rignet"
    figure = read(made)
    skeleton = figure.skeleton
    assert skeleton.names == ("hips", "chest", "tip")
    assert skeleton.parents.tolist() == [-1, 0, 1]
    assert_allclose(
        np.cumsum(skeleton.rest_translations, axis=0),
        [[0, 0.1, 0], [0, 0.5, 0.02], [0.1, 0.9, 0]],
        atol=1e-15,
    )
    assert made.warnings == [
        "rig.txt: weights of 2 vertices not read: they belong to a mesh that is not in the "
        "file; viewer rig --skeleton computes weights for a mesh"
    ]
    assert made.place("joints", 0)[1] == 2


def test_names_that_are_not_utf_8_stay_different():
    text = "joints 頭 0 0 0\njoints 首 1 0 0\nroot 首\nhier 首 頭\n"
    names = read(Source("rig.txt", text.encode("shift_jis"))).skeleton.names
    assert [name.encode("utf-8", "surrogateescape").decode("shift_jis") for name in names] == [
        "首", "頭"
    ]  # fmt: skip


def test_joints_without_a_parent_are_further_roots():
    made = source("joints a 0 0 0\njoints b 1 0 0\njoints c 2 0 0\nroot b\nhier b c\n")
    skeleton = read(made).skeleton
    assert skeleton.names == ("b", "c", "a") and skeleton.parents.tolist() == [-1, 0, -1]
    assert made.warnings == ["rig.txt:1: no parent for a: read as further roots"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.1 0.9 0.0", "0.1 0.9", "1: joints: expected a name and 3 numbers, found 3 words"),
        ("0.9", "nan", '1: joint "tip": expected 3 numbers within ±3.40282e+38, found "nan"'),
        ("joints hips", "joints tip", '2: expected different names, found "tip" twice'),
        ("root hips", "root hip", '5: expected the name of a joint, found "hip"'),
        ("root hips", "root tip", '9: the root "tip": expected no parent, found "chest"'),
        ("hier chest tip", "hier chest toe", '9: expected the name of a joint, found "toe"'),
        ("hier chest tip", "hier tip chest",
         '9: expected one parent of "chest", found "hips" and "tip"'),
        ("hier hips chest", "hier tip chest",
         '9: expected joints below a root, found "tip" below itself or below a circle'),
        ("hier chest tip", "root tip", '9: expected one root, found "hips" and "tip"'),
    ],
)  # fmt: skip
def test_faults_have_their_lines(old, new, said):
    with pytest.raises(FormatError) as caught:
        read(source(GOOD.replace(old, new)))
    assert str(caught.value) == f"rig.txt:{said}"


def test_file_opens_and_unknown_lines_are_named(tmp_path, capsys):
    path = tmp_path / "result_pred.txt"
    path.write_text(GOOD + "version 2\n")
    assert viewer.load(path).actors[0].figure.skeleton.n_joints == 3
    assert run(["info", str(path)]) == 0
    assert f'{path}:10: skipped unknown keyword "version"' in capsys.readouterr().err
