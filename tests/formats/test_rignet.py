"""Skeletons that networks predict, as text and as arrays."""

from dataclasses import replace

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


def test_names_keep_their_spaces_and_comments_are_skipped():
    made = source(
        "# a network\n\njoints Bip01 L Thigh 0 0 0\njoints Bip01 1 0 0\n  # joints\n"
        "joints Bip01 L 2 0 0\nroot Bip01\nhier Bip01 Bip01 L\nhier Bip01 L Bip01 L Thigh\n"
    )
    assert detect(made) == "rignet"
    skeleton = read(made).skeleton
    assert skeleton.names == ("Bip01", "Bip01 L", "Bip01 L Thigh") and not made.warnings
    assert skeleton.parents.tolist() == [-1, 0, 1]


def test_names_that_can_be_split_in_two_ways_are_refused():
    names = "".join(f"joints {name} 0 0 0\n" for name in ("a", "a b", "b", "b b"))
    with pytest.raises(FormatError) as caught:
        read(source(names + "hier a b b\n"))
    assert str(caught.value) == (
        'rig.txt:5: expected a parent and a child, found "a b b", which can be split in several '
        "ways"
    )


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


PLACES = np.array([[0.1, 0.9, 0.0], [0.0, 0.1, 0.0], [0.0, 0.5, 0.02]])
NAMES = ("tip", "hips", "chest")


def saved(path, **arrays):
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    "arrays",
    [
        # Arrays beside a mesh whose influences are called joints.
        {"J": PLACES, "parents": np.array([2, -1, 1]), "joints": np.zeros((9, 4), np.uint16),
         "names": np.array(NAMES), "V": np.zeros((9, 3))},
        # UniRig: half precision, lists of objects, and None for what it does not know.
        {"joints": PLACES.astype(np.float16), "parents": np.array([2, None, 1]),
         "names": np.array(NAMES, dtype=object), "tails": None, "cls": "x"},
        # SMPL's root in unsigned integers.
        {"J": PLACES, "parents": np.array([2, 2**32 - 1, 1], dtype=np.uint32), "names": NAMES},
        # Articulation-XL.
        {"joints": PLACES, "bones": np.array([[1, 2], [2, 0]]), "joint_names": NAMES},
        {"joint_positions": PLACES, "parents": np.array([2, 1, 1]), "names": NAMES},
    ],
)  # fmt: skip
def test_arrays_are_the_same_skeleton_as_the_text(tmp_path, arrays):
    figure = viewer.load(saved(tmp_path / "predicted.npz", **arrays)).actors[0].figure
    skeleton = figure.skeleton
    assert skeleton.names == ("hips", "chest", "tip")
    assert skeleton.parents.tolist() == [-1, 0, 1]
    assert_allclose(
        np.cumsum(skeleton.rest_translations, axis=0),
        PLACES[[1, 2, 0]],
        atol=1e-3,  # of half precision
    )


def test_arrays_without_names_and_with_two_roots(tmp_path):
    path = saved(tmp_path / "a.npz", J=PLACES, parents=np.array([-1, -1, 1]), names=None)
    skeleton = viewer.load(path).actors[0].figure.skeleton
    assert skeleton.names == ("joint_0", "joint_1", "joint_2")
    assert skeleton.parents.tolist() == [-1, -1, 1]


def test_skeleton_of_our_own_arrays_has_their_axis_and_unit(tmp_path):
    (tmp_path / "rig.txt").write_text(GOOD)
    actor = viewer.load(tmp_path / "rig.txt").actors[0]
    for up, unit in (("z", "cm"), ("y", "")):
        path = tmp_path / f"{up}.npz"
        viewer.export(viewer.Actor(replace(actor.figure, up=up, unit=unit)), path)
        (again,) = viewer.load(path).actors
        assert (again.figure.up, again.figure.unit) == (up, unit)
        assert_allclose(again.joints(), actor.joints(), atol=1e-12)
    assert again.figure.facts == (("not needed", "name, own_numbers, shape_weights, world"),)


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"J": PLACES, "parents": [3, -1, 1]},
         "parents: expected joints from 0 to 2, found 3"),
        ({"J": PLACES, "parents": [2, -1, 0]},
         "parents: expected joints below a root, found joint 0 below itself"),
        ({"J": PLACES, "parents": [2, -1]}, "parents: expected 3 numbers, found 2 int64"),
        ({"J": PLACES, "parents": [0.5, -1, 1]},
         "parents: expected joints from 0 to 2, found 0.5"),
        ({"J": PLACES, "parents": [np.inf, -1, 1]},
         "parents: expected joints from 0 to 2, found inf"),
        ({"J": PLACES, "bones": [[1, 2], [1, 3]]},
         "bones: expected joints from 0 to 2, found 3"),
        ({"J": PLACES, "bones": [[1, 2], [0, 2]]},
         "bones: expected one parent of joint 2, found several"),
        ({"J": PLACES, "parents": [2, -1, 1], "names": ["a", "b"]},
         "names: expected 3 names, found 2"),
        ({"J": PLACES[:0], "parents": np.zeros(0)},
         "J: expected at least one row, found none"),
        ({"positions": np.zeros((5, 3, 3)), "parents": [2, -1, 1]},
         "expected positions of joints (J, 3) as J, joints or joint_positions, found the keys "
         "positions, parents"),
    ],
)  # fmt: skip
def test_arrays_that_are_no_skeleton_are_refused(tmp_path, arrays, said):
    path = saved(tmp_path / "a.npz", **arrays)
    with pytest.raises(FormatError) as caught:
        viewer.load(path)
    assert str(caught.value) == f"{path}: {said}"


def test_mesh_is_bound_to_predicted_arrays(tmp_path):
    # A box of 1 x 4 x 1 with a ring of vertices at every unit: each end moves with its joint.
    heights = np.arange(5.0)
    ring = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    lines = [f"v {x} {y} {z}" for y in heights for x, z in ring]
    lines += ["f 1 2 3 4", "f 20 19 18 17"]
    for level in range(4):
        for side in range(4):
            a, b = 4 * level + side + 1, 4 * level + (side + 1) % 4 + 1
            lines.append(f"f {a} {a + 4} {b + 4} {b}")
    (tmp_path / "box.obj").write_text("\n".join(lines))
    places = np.array([[0.0, 3.9, 0.0], [0.0, 0.1, 0.0], [0.0, 2.0, 0.0]])
    path = saved(tmp_path / "a.npz", joints=places, parents=np.array([2, None, 1]), names=NAMES)
    lines = [f"joints {name} {x} {y} {z}" for name, (x, y, z) in zip(NAMES, places, strict=True)]
    text = tmp_path / "a.txt"
    text.write_text("\n".join([*lines, "root hips", "hier hips chest", "hier chest tip"]))
    ours, theirs = (
        viewer.rig(tmp_path / "box.obj", skeleton=file).actors[0].figure for file in (path, text)
    )
    assert ours.skeleton.names == theirs.skeleton.names == ("hips", "chest", "tip")
    assert_allclose(ours.skin.weights, theirs.skin.weights, atol=0.0)
    assert len(ours.skin.starts) == 21
