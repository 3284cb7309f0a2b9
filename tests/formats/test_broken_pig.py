"""Broken PIG models with their exact messages: file, line, what was found and expected."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pickle_bytes import named, saved, several, text
from pig_text import GOOD, arrays, read, refusal, silent, write

from viewer.errors import RigError
from viewer.rig.pose import rest_pose
from viewer.rig.posing.pose_record import PoseRecord, apply_record
from viewer.rig.skinning import deform

WEIGHTS = GOOD["skinning_weights.txt"]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "pig"


# Tables


@pytest.mark.parametrize(
    ("change", "message"),
    [
        # Numbers and columns
        ({"vertices": "0 0 0\n1 0\n0 1 0\n1 1 0\n2 2 -1"},
         "pig/vertices.txt:2: expected 3 numbers in a row, found 2"),
        ({"vertices": "0 0 0\n1 0\n0 1 0 0\n1 1 0\n2 2 -1"},
         "pig/vertices.txt:2: expected 3 numbers in a row, found 2"),
        ({"vertices": "0 0 0\n1 0 0 0 1 0\n1 1 0\n2 2 -1"},
         "pig/vertices.txt:2: expected 3 numbers in a row, found 6"),
        ({"vertices": "0 0 0\n\n1 0 0\r0 1 0\r\n1 1 0\n2 2 -1 7"},
         "pig/vertices.txt:6: expected 3 numbers in a row, found 4"),
        ({"vertices": "0 0 0\n1 up 0"}, 'pig/vertices.txt:2: expected a number, found "up"'),
        ({"vertices": "0 0 0\n1 nan 0"}, 'pig/vertices.txt:2: expected a number, found "nan"'),
        ({"vertices": "0 0 0\n1 -inf 0"}, 'pig/vertices.txt:2: expected a number, found "-inf"'),
        (
            {"vertices": "0 0 0\n1 1e999 0"},
            'pig/vertices.txt:2: expected a number below 3.4e+38, found "1e999"',
        ),
        (
            {"vertices": "0 0 0\n1 1e39 0"},
            'pig/vertices.txt:2: expected a number below 3.4e+38, found "1e39"',
        ),
        ({"vertices": "0 0 0\n1,0,0"}, 'pig/vertices.txt:2: expected a number, found "1,0,0"'),
        ({"vertices": "0 0 0\n1_0 0 0"}, 'pig/vertices.txt:2: expected a number, found "1_0"'),
        ({"vertices": "x y z\n0 0 0"}, 'pig/vertices.txt:1: expected a number, found "x"'),
        ({"vertices": "# 5 rows\n0 0 0"}, 'pig/vertices.txt:1: expected a number, found "#"'),
        ({"vertices": "0 0 0\n{ 0 0"}, 'pig/vertices.txt:2: expected a number, found "{"'),
        ({"vertices": "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2"},
         "pig/vertices.txt:5: expected 3 numbers in a row, found 2"),
        ({"vertices": ""}, "pig/vertices.txt: expected rows of 3 numbers, found an empty file"),
        ({"vertices": " \n"}, "pig/vertices.txt: expected rows of 3 numbers, "
         "found only white space"),
        ({"vertices": "0 0 0\n".encode("utf-16-le")},
         'pig/vertices.txt:1: expected a number, found "0\\x00"'),
        ({"textures": "0 0 0\n" * 6}, "pig/textures.txt:1: expected 2 numbers in a row, found 3"),
        ({"parents": "-1 0 1"}, "pig/parents.txt:1: expected 1 numbers in a row, found 3"),
        # Truncated files
        ({"vertices": "0 0 0\n1 0 0\n0 1 0"},
         "pig/faces_vert.txt:2: expected a vertex from 0 to 2, found 3: vertices.txt has 3 rows"),
        ({"vertices": "0 0 0\n1 0 0\n0 1 0\n1 1 0"},
         "pig/skinning_weights.txt:6: expected a vertex from 0 to 3, found 4: "
         "vertices.txt has 4 rows"),
        ({"textures": "0 0\n0.5 0\n0 1\n"},
         "pig/faces_tex.txt:2: expected a texture coordinate from 0 to 2, found 3: "
         "textures.txt has 3 rows"),
        ({"faces_tex": "0 1 2\n"},
         "pig/faces_tex.txt:1: expected 2 rows as in faces_vert.txt, found 1"),
        ({"faces_vert": "0 1 2\n"},
         "pig/faces_tex.txt:2: expected 1 rows as in faces_vert.txt, found 2"),
        ({"parents": "-1\n0\n"},
         "pig/parents.txt:2: expected 3 rows as in t_pose_joints.txt, found 2"),
        ({"t_pose_joints": "0 0 0\n1 0 0", "parents": "-1\n0\n"},
         "pig/skinning_weights.txt:5: expected a joint from 0 to 1, found 2: "
         "t_pose_joints.txt has 2 rows"),
        # Indices
        ({"faces_vert": "0 1 2\n\n1 5 2"},
         "pig/faces_vert.txt:3: expected a vertex from 0 to 4, found 5: vertices.txt has 5 rows"),
        ({"faces_vert": "0 1 2\n1 -3 2"},
         "pig/faces_vert.txt:2: expected a vertex from 0 to 4, found -3: vertices.txt has 5 rows"),
        ({"faces_vert": "0 1.5 2\n1 3 2"},
         "pig/faces_vert.txt:1: expected a vertex from 0 to 4, found 1.5: vertices.txt has 5 rows"),
        ({"faces_vert": "0 99999999999 2\n1 3 2"},
         "pig/faces_vert.txt:1: expected a vertex from 0 to 4, found 99999999999: "
         "vertices.txt has 5 rows"),
        ({"faces_tex": "0 1 2\n3 4 6"},
         "pig/faces_tex.txt:2: expected a texture coordinate from 0 to 5, found 6: "
         "textures.txt has 6 rows"),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "0 5 0.75")},
         "pig/skinning_weights.txt:3: expected a vertex from 0 to 4, found 5: "
         "vertices.txt has 5 rows"),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "3 2 0.75")},
         "pig/skinning_weights.txt:3: expected a joint from 0 to 2, found 3: "
         "t_pose_joints.txt has 3 rows"),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "0.5 2 0.75")},
         "pig/skinning_weights.txt:3: expected a joint from 0 to 2, found 0.5: "
         "t_pose_joints.txt has 3 rows"),
        ({"skinning_weights": WEIGHTS + "1 2 0.125\n0 2 0.5\n"},
         "pig/skinning_weights.txt:8: expected each pair once, "
         "found joint 1 and vertex 2 again"),
        ({"J_regressor": "0 0 1\n3 1 1\n"},
         "pig/J_regressor.txt:2: expected a joint from 0 to 2, found 3: "
         "t_pose_joints.txt has 3 rows"),
        ({"J_regressor": "0 0 1\n1 9 1\n"},
         "pig/J_regressor.txt:2: expected a vertex from 0 to 4, found 9: vertices.txt has 5 rows"),
        # The hierarchy
        ({"parents": "-1\n0\n-1\n"},
         "pig/parents.txt:3: joint 2: expected one root, found another"),
        ({"parents": "0\n0\n1\n"},
         "pig/parents.txt:1: joint 0: expected -1, the root, found 0"),
        ({"parents": "-1\n2\n0\n"},
         "pig/parents.txt:2: joint 1: expected a parent before it, found 2"),
        ({"parents": "-1\n1\n0\n"},
         "pig/parents.txt:2: joint 1: expected a parent before it, found 1"),
        ({"parents": "-1\n0\n3\n"},
         "pig/parents.txt:3: joint 2: expected a parent before it, found 3"),
        ({"parents": "-1\n0\n-2\n"},
         "pig/parents.txt:3: joint 2: expected a parent before it, found -2"),
        ({"parents": "-1\n0\n0.5\n"},
         "pig/parents.txt:3: joint 2: expected a parent before it, found 0.5"),
        # Optional files
        ({"body_parts": "1\n1\n1\n3\n2\n"},
         "pig/body_parts.txt:4: expected a body part from 0 to 2, found 3"),
        ({"body_parts": "1\n1\n"}, "pig/body_parts.txt:2: expected 5 rows, found 2"),
        ({"sym": "0\n2\n1\n3\n"}, "pig/sym.txt:4: expected 5 rows, found 4"),
        ({"sym": "0\n2\n1\n3\n5\n"}, "pig/sym.txt:5: expected a vertex from 0 to 4, found 5"),
        ({"sym": "0\n2\n3\n1\n4\n"},
         "pig/sym.txt:2: expected partners in pairs, found 1 -> 2 -> 3"),
        ({"reduced_ids": "0\n7\n3\n"},
         "pig/reduced_ids.txt:2: expected a vertex from 0 to 4, found 7: vertices.txt has 5 rows"),
        ({"reduced_faces": "0 1 2\n0 1 3\n"},
         "pig/reduced_faces.txt:2: expected a reduced vertex from 0 to 2, found 3: "
         "reduced_ids.txt has 3 rows"),
    ],
)  # fmt: skip
def test_broken_table_is_refused_with_file_and_line(folder, change, message):
    assert refusal(write(folder, **change)) == message


@pytest.mark.parametrize(
    ("gone", "names"),
    [
        (["vertices"], "vertices.txt"),
        (["parents", "faces_vert"], "parents.txt, faces_vert.txt"),
        (["t_pose_joints", "skinning_weights"], "t_pose_joints.txt, skinning_weights.txt"),
    ],
)
def test_missing_files_are_named_with_the_folder(folder, gone, names):
    write(folder, **dict.fromkeys(gone))
    assert refusal(folder) == f"pig: expected a PIG folder, found no {names}"


def test_file_that_is_a_folder_is_refused(folder):
    write(folder, parents=None)
    (folder / "parents.txt").mkdir()
    assert refusal(folder) == "pig/parents.txt: expected a file, found a folder"


def test_large_file_in_the_folder_is_refused_before_it_is_read(folder):
    write(folder)
    with (folder / "vertices.txt").open("wb") as stream:
        stream.truncate(3 << 30)
    assert refusal(folder) == (
        "pig/vertices.txt: expected at most 2147483648 bytes, found 3221225472 (--max-size)"
    )


# Weights that are odd, but load


def test_vertices_without_weights_stay_at_rest(folder):
    rows = WEIGHTS.replace("1 1 1\n", "").replace("2 3 1\n", "0 3 0\n")
    figure, warnings = read(write(folder, skinning_weights=rows))
    assert warnings == [
        f"{folder}: skinning_weights.txt: 2 vertices without weights, first 1: they stay at rest"
    ]
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 1.0
    assert_array_equal(deform(figure, pose)[0][[1, 3]], [[1, 0, 0], [1, 1, 0]])
    # They would not move if the weights were normalised either.
    assert dict(figure.facts)["normalising"] == "would move rest vertices by up to 0.00 mm"
    assert dict(figure.facts)["weights"] == "raw; their sums are 1.000 to 1.000"


def test_weight_sums_far_from_1_are_counted_with_the_worst(folder):
    rows = WEIGHTS.replace("1 1 1\n", "1 1 0.98\n").replace("2 3 1\n", "2 3 1.5\n")
    _, warnings = read(write(folder, skinning_weights=rows))
    assert warnings == [
        f"{folder}: skinning_weights.txt: 2 weight sums differ from 1 by more than 0.01, "
        "most vertex 3 with 1.5"
    ]


def test_negative_weights_are_counted_and_kept(folder):
    rows = WEIGHTS.replace("0 2 0.75", "0 2 1.25").replace("1 2 0.25", "1 2 -0.25")
    figure, warnings = read(write(folder, skinning_weights=rows))
    assert warnings == [f"{folder}: skinning_weights.txt: 1 negative weight, kept as it is"]
    assert figure.skin.weights.min() == -0.25


# Archives


def archive_refusal(tmp_path, **changes):
    given = {**arrays(), **changes}
    np.savez(
        tmp_path / "a.npz", **{key: array for key, array in given.items() if array is not None}
    )
    return refusal(tmp_path / "a.npz").removeprefix("a.npz: ")


ALL = arrays()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": None, "parents": None},
         "expected a PIG model; keys missing: vertices, parents; keys found: t_pose_joints, "
         "skinning_weights, faces_vert, textures, faces_tex, J_regressor, body_parts, sym, "
         "reduced_ids, reduced_faces, body_part_defs"),
        ({"vertices": np.zeros((5, 4))},
         "vertices: expected any x 3 numbers, found 5 x 4 float64"),
        ({"vertices": np.zeros((0, 3))}, "vertices: expected at least one row, found none"),
        ({"vertices": np.array(["a"])}, "vertices: expected any x 3 numbers, found 1 texts"),
        ({"vertices": np.full((5, 3), np.nan)},
         "vertices: expected finite numbers, found 15 that are not"),
        ({"vertices": np.full((5, 3), -1e300)},
         "vertices: expected numbers up to 3.4e+38, found -1e+300"),
        ({"vertices": np.array([{}], dtype=object)},
         "vertices: expected any x 3 numbers, found an unread value (object array)"),
        ({"parents": np.array(-1)}, "parents: expected any numbers, found a single int64"),
        ({"parents": np.array([-1, 0, 0, 1])},
         "parents: expected 3 rows as in t_pose_joints, found 4"),
        ({"parents": np.array([-1, 0, 2])},
         "parents: row 2: joint 2: expected a parent before it, found 2"),
        ({"t_pose_joints": np.zeros((0, 3))},
         "t_pose_joints: expected at least one row, found none"),
        ({"skinning_weights": np.eye(5)},
         "skinning_weights: expected 3 x 5 numbers, found 5 x 5 float64"),
        ({"skinning_weights": np.full((3, 5), np.nan)},
         "skinning_weights: expected finite numbers, found 15 that are not"),
        ({"skinning_weights": np.array([[0.0, 0, 1], [0, 0, 1]])},
         "skinning_weights: row 1: expected each pair once, found joint 0 and vertex 0 again"),
        ({"faces_vert": ALL["faces_vert"] + 3},
         "faces_vert: row 0: expected a vertex from 0 to 4, found 5: vertices has 5 rows"),
        ({"faces_tex": ALL["faces_tex"][:1]},
         "faces_tex: expected 2 rows as in faces_vert, found 1"),
        ({"sym": np.arange(4)}, "sym: expected 5 rows, found 4"),
        ({"body_part_defs": np.arange(3)}, "body_part_defs: expected any texts, found 3 int64"),
    ],
)  # fmt: skip
def test_broken_archive_is_refused_with_its_key(tmp_path, change, message):
    assert archive_refusal(tmp_path, **change) == message


@pytest.mark.parametrize("cut", [1, 40, 200])
def test_pickle_cut_short_is_refused(tmp_path, cut):
    whole = saved(vertices=text("x" * 200), parents=text("y"))
    (tmp_path / "a.pkl").write_bytes(whole[:-cut])
    assert refusal(tmp_path / "a.pkl").startswith("a.pkl: ")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\x80\x02]q\x01.", "a.pkl: expected a dict of named values, found a list"),
        (b"vertices", "a.pkl: expected a pickle, .npz or .npy file, found something else"),
        (b"", "a.pkl: expected a pickle, .npz or .npy file, found an empty file"),
        (b"<!doctype html>", "a.pkl: expected a pickle, .npz or .npy file, "
         "found HTML or XML (a failed download?)"),
    ],
)  # fmt: skip
def test_what_is_no_pickle_of_a_model_is_refused(tmp_path, data, message):
    (tmp_path / "a.pkl").write_bytes(data)
    assert refusal(tmp_path / "a.pkl") == message


def test_pickle_with_another_global_names_it(tmp_path):
    call = named("os", "system") + several(text("true")) + b"R"
    (tmp_path / "a.pkl").write_bytes(saved(vertices=call))
    assert "os.system" in refusal(tmp_path / "a.pkl")
    assert "not allowed" in refusal(tmp_path / "a.pkl")


# Poses


def test_pose_of_another_length_is_refused_with_both_counts(folder):
    figure = silent(write(folder))
    with pytest.raises(RigError, match=r"^expected 13 pose numbers for pig, found 12$"):
        apply_record(PoseRecord(vector=np.zeros(12)), figure, rest_pose(figure.skeleton))
