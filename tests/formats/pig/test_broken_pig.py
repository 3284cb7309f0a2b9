"""Broken PIG models and their messages: file, line, found and expected values."""

import numpy as np
import pytest
from faults import NAN
from formats.pickle_bytes import named, saved, several, text
from formats.pig_text import GOOD, arrays, refusal, silent, write
from numpy.testing import assert_array_equal

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
        ({"vertices": "0 0 0\n1 0\n0 1 0\n1 1 0\n2 2 -1"}, ("pig/vertices.txt",
         "F002.table-width", 2, {"expected": 3, "found": 2})),
        ({"vertices": "0 0 0\n1 0\n0 1 0 0\n1 1 0\n2 2 -1"}, ("pig/vertices.txt",
         "F002.table-width", 2, {"expected": 3, "found": 2})),
        ({"vertices": "0 0 0\n1 0 0 0 1 0\n1 1 0\n2 2 -1"}, ("pig/vertices.txt",
         "F002.table-width", 2, {"expected": 3, "found": 6})),
        ({"vertices": "0 0 0\n\n1 0 0\r0 1 0\r\n1 1 0\n2 2 -1 7"}, ("pig/vertices.txt",
         "F002.table-width", 6, {"expected": 3, "found": 4})),
        ({"vertices": "0 0 0\n1 up 0"}, ("pig/vertices.txt", "F002.number", 2,
         {"item": "row 1", "found": b"up"})),
        ({"vertices": "0 0 0\n1 nan 0"}, ("pig/vertices.txt", "F003.number", 2,
         {"item": "row 1", "found": b"nan"})),
        ({"vertices": "0 0 0\n1 -inf 0"}, ("pig/vertices.txt", "F003.number", 2,
         {"item": "row 1", "found": b"-inf"})),
        ({"vertices": "0 0 0\n1 1e999 0"}, ("pig/vertices.txt", "F003.too-large", 2,
         {"item": "row 1", "found": b"1e999"})),
        ({"vertices": "0 0 0\n1 1e39 0"}, ("pig/vertices.txt", "F003.too-large", 2,
         {"item": "row 1", "found": b"1e39"})),
        ({"vertices": "0 0 0\n1,0,0"}, ("pig/vertices.txt", "F002.number", 2,
         {"item": "row 1", "found": b"1,0,0"})),
        ({"vertices": "0 0 0\n1_0 0 0"}, ("pig/vertices.txt", "F002.number", 2,
         {"item": "row 1", "found": b"1_0"})),
        ({"vertices": "x y z\n0 0 0"}, ("pig/vertices.txt", "F002.number", 1,
         {"item": "row 0", "found": b"x"})),
        ({"vertices": "# 5 rows\n0 0 0"}, ("pig/vertices.txt", "F002.number", 1,
         {"item": "row 0", "found": b"#"})),
        ({"vertices": "0 0 0\n{ 0 0"}, ("pig/vertices.txt", "F002.number", 2,
         {"item": "row 1", "found": b"{"})),
        ({"vertices": "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2"}, ("pig/vertices.txt", "F002.table-width",
         5, {"expected": 3, "found": 2})),
        ({"vertices": ""}, ("pig/vertices.txt", "F002.table-empty", None, {"columns": 3,
         "found": "an empty file"})),
        ({"vertices": " \n"}, ("pig/vertices.txt", "F002.table-empty", None, {"columns": 3,
         "found": "only white space"})),
        ({"vertices": "0 0 0\n".encode("utf-16-le")}, ("pig/vertices.txt", "F002.number", 1,
         {"item": "row 0", "found": b"0\x00"})),
        ({"textures": "0 0 0\n" * 6}, ("pig/textures.txt", "F002.table-width", 1, {"expected": 2,
         "found": 3})),
        ({"parents": "-1 0 1"}, ("pig/parents.txt", "F002.table-width", 1, {"expected": 1,
         "found": 3})),
        # Truncated files
        ({"vertices": "0 0 0\n1 0 0\n0 1 0"}, ("pig/faces_vert.txt", "F002.pig-index", 2,
         {"item": "", "noun": "vertex", "last": 2, "found": 3.0,
         "proof": "vertices.txt has 3 rows"})),
        ({"vertices": "0 0 0\n1 0 0\n0 1 0\n1 1 0"}, ("pig/skinning_weights.txt",
         "F002.pig-index", 6, {"item": "", "noun": "vertex", "last": 3, "found": 4.0,
         "proof": "vertices.txt has 4 rows"})),
        ({"textures": "0 0\n0.5 0\n0 1\n"}, ("pig/faces_tex.txt", "F002.pig-index", 2,
         {"item": "", "noun": "texture coordinate", "last": 2, "found": 3.0,
         "proof": "textures.txt has 3 rows"})),
        ({"faces_tex": "0 1 2\n"}, ("pig/faces_tex.txt", "F002.pig-rows-as", 1, {"item": "",
         "expected": 2, "other": "faces_vert.txt", "found": 1})),
        ({"faces_vert": "0 1 2\n"}, ("pig/faces_tex.txt", "F002.pig-rows-as", 2, {"item": "",
         "expected": 1, "other": "faces_vert.txt", "found": 2})),
        ({"parents": "-1\n0\n"}, ("pig/parents.txt", "F002.pig-rows-as", 2, {"item": "",
         "expected": 3, "other": "t_pose_joints.txt", "found": 2})),
        ({"t_pose_joints": "0 0 0\n1 0 0", "parents": "-1\n0\n"}, ("pig/skinning_weights.txt",
         "W010.pig-joint", 5, {"item": "", "noun": "joint", "last": 1, "found": 2.0,
         "proof": "t_pose_joints.txt has 2 rows"})),
        # Indices
        ({"faces_vert": "0 1 2\n\n1 5 2"}, ("pig/faces_vert.txt", "F002.pig-index", 3,
         {"item": "", "noun": "vertex", "last": 4, "found": 5.0,
         "proof": "vertices.txt has 5 rows"})),
        ({"faces_vert": "0 1 2\n1 -3 2"}, ("pig/faces_vert.txt", "F002.pig-index", 2, {"item": "",
         "noun": "vertex", "last": 4, "found": -3.0, "proof": "vertices.txt has 5 rows"})),
        ({"faces_vert": "0 1.5 2\n1 3 2"}, ("pig/faces_vert.txt", "F002.pig-index", 1,
         {"item": "", "noun": "vertex", "last": 4, "found": 1.5,
         "proof": "vertices.txt has 5 rows"})),
        ({"faces_vert": "0 99999999999 2\n1 3 2"}, ("pig/faces_vert.txt", "F002.pig-index", 1,
         {"item": "", "noun": "vertex", "last": 4, "found": 99999999999.0,
         "proof": "vertices.txt has 5 rows"})),
        ({"faces_tex": "0 1 2\n3 4 6"}, ("pig/faces_tex.txt", "F002.pig-index", 2, {"item": "",
         "noun": "texture coordinate", "last": 5, "found": 6.0,
         "proof": "textures.txt has 6 rows"})),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "0 5 0.75")},
         ("pig/skinning_weights.txt", "F002.pig-index", 3, {"item": "",
         "noun": "vertex", "last": 4, "found": 5.0, "proof": "vertices.txt has 5 rows"})),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "3 2 0.75")},
         ("pig/skinning_weights.txt", "W010.pig-joint", 3, {"item": "",
         "noun": "joint", "last": 2, "found": 3.0, "proof": "t_pose_joints.txt has 3 rows"})),
        ({"skinning_weights": WEIGHTS.replace("0 2 0.75", "0.5 2 0.75")},
         ("pig/skinning_weights.txt", "W010.pig-joint", 3, {"item": "",
         "noun": "joint", "last": 2, "found": 0.5, "proof": "t_pose_joints.txt has 3 rows"})),
        ({"skinning_weights": WEIGHTS + "1 2 0.125\n0 2 0.5\n"}, ("pig/skinning_weights.txt",
         "F002.pig-twice", 8, {"item": "", "joint": 1, "vertex": 2})),
        ({"J_regressor": "0 0 1\n3 1 1\n"}, ("pig/J_regressor.txt", "W010.pig-joint", 2,
         {"item": "", "noun": "joint", "last": 2, "found": 3.0,
         "proof": "t_pose_joints.txt has 3 rows"})),
        ({"J_regressor": "0 0 1\n1 9 1\n"}, ("pig/J_regressor.txt", "F002.pig-index", 2,
         {"item": "", "noun": "vertex", "last": 4, "found": 9.0,
         "proof": "vertices.txt has 5 rows"})),
        # The hierarchy
        ({"parents": "-1\n0\n-1\n"}, ("pig/parents.txt", "F002.roots", 3, {"item": "",
         "found": -1.0, "joint": 2})),
        ({"parents": "0\n0\n1\n"}, ("pig/parents.txt", "S002.root", 1, {"item": "",
         "found": 0.0, "joint": 0})),
        ({"parents": "-1\n2\n0\n"}, ("pig/parents.txt", "S001.parent", 2, {"item": "",
         "found": 2.0, "joint": 1})),
        ({"parents": "-1\n1\n0\n"}, ("pig/parents.txt", "S002.parent", 2, {"item": "",
         "found": 1.0, "joint": 1})),
        ({"parents": "-1\n0\n3\n"}, ("pig/parents.txt", "S001.parent", 3, {"item": "",
         "found": 3.0, "joint": 2})),
        ({"parents": "-1\n0\n-2\n"}, ("pig/parents.txt", "S001.parent", 3, {"item": "",
         "found": -2.0, "joint": 2})),
        ({"parents": "-1\n0\n0.5\n"}, ("pig/parents.txt", "S001.parent", 3, {"item": "",
         "found": 0.5, "joint": 2})),
        # Optional files
        ({"body_parts": "1\n1\n1\n3\n2\n"}, ("pig/body_parts.txt", "F002.pig-index", 4,
         {"item": "", "noun": "body part", "last": 2, "found": 3.0, "proof": ""})),
        ({"body_parts": "1\n1\n"}, ("pig/body_parts.txt", "F002.pig-rows", 2, {"item": "",
         "expected": 5, "found": 2})),
        ({"sym": "0\n2\n1\n3\n"}, ("pig/sym.txt", "F002.pig-rows", 4, {"item": "", "expected": 5,
         "found": 4})),
        ({"sym": "0\n2\n1\n3\n5\n"}, ("pig/sym.txt", "F002.pig-index", 5, {"item": "",
         "noun": "vertex", "last": 4, "found": 5.0, "proof": ""})),
        ({"sym": "0\n2\n3\n1\n4\n"}, ("pig/sym.txt", "F002.pig-symmetry", 2, {"item": "",
         "vertex": 1, "partner": 2, "back": 3})),
        ({"reduced_ids": "0\n7\n3\n"}, ("pig/reduced_ids.txt", "F002.pig-index", 2, {"item": "",
         "noun": "vertex", "last": 4, "found": 7.0, "proof": "vertices.txt has 5 rows"})),
        ({"reduced_faces": "0 1 2\n0 1 3\n"}, ("pig/reduced_faces.txt", "F002.pig-index", 2,
         {"item": "", "noun": "reduced vertex", "last": 2, "found": 3.0,
         "proof": "reduced_ids.txt has 3 rows"})),
    ],
)  # fmt: skip
def test_broken_table_is_refused_with_file_and_line(folder, change, message):
    assert refusal(write(folder, **change)) == message


@pytest.mark.parametrize(
    ("gone", "names"),
    [
        (["vertices"], ["vertices.txt"]),
        (["parents", "faces_vert"], ["parents.txt", "faces_vert.txt"]),
        (["t_pose_joints", "skinning_weights"], ["t_pose_joints.txt", "skinning_weights.txt"]),
    ],
)
def test_missing_files_are_reported_with_the_folder(folder, gone, names):
    write(folder, **dict.fromkeys(gone))
    assert refusal(folder) == ("pig", "F002.pig-folder", None, {"missing": names})


def test_file_that_is_a_folder_is_refused(folder):
    write(folder, parents=None)
    (folder / "parents.txt").mkdir()
    assert refusal(folder) == ("pig/parents.txt", "F001.no-file", None, {"found": "a folder"})


def test_large_file_in_the_folder_is_refused_before_it_is_read(folder):
    write(folder)
    with (folder / "vertices.txt").open("wb") as stream:
        stream.truncate(3 << 30)
    assert refusal(folder) == (
        ("pig/vertices.txt", "F001.too-large", None, {"most": 2147483648, "size": 3221225472})
    )


# Unusual weights that load


def test_vertices_without_weights_do_not_move(folder):
    rows = WEIGHTS.replace("1 1 1\n", "").replace("2 3 1\n", "0 3 0\n")
    figure = silent(write(folder, skinning_weights=rows))
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 1.0
    assert_array_equal(deform(figure, pose)[0][[1, 3]], [[1, 0, 0], [1, 1, 0]])
    # With normalised weights, these vertices would not move either.
    assert dict(figure.facts)["normalising"] == "would move rest vertices by up to 0.00 mm"
    assert dict(figure.facts)["weights"] == "raw; their sums are 1.000 to 1.000"


# Archives


def archive_refusal(tmp_path, **changes):
    given = {**arrays(), **changes}
    np.savez(
        tmp_path / "a.npz", **{key: array for key, array in given.items() if array is not None}
    )
    return refusal(tmp_path / "a.npz")


ALL = arrays()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": None, "parents": None}, ("a.npz", "F002.pig-keys", None,
         {"missing": ["vertices", "parents"], "found": ["t_pose_joints", "skinning_weights",
         "faces_vert", "textures", "faces_tex", "J_regressor", "body_parts", "sym", "reduced_ids",
         "reduced_faces", "body_part_defs"]})),
        ({"vertices": np.zeros((5, 4))}, ("a.npz", "F002.value", None, {"item": "vertices",
         "expected": "any x 3 numbers", "found": "5 x 4 float64"})),
        ({"vertices": np.zeros((0, 3))}, ("a.npz", "F002.no-rows", None, {"item": "vertices"})),
        ({"vertices": np.array(["a"])}, ("a.npz", "F002.value", None, {"item": "vertices",
         "expected": "any x 3 numbers", "found": "1 strings"})),
        ({"vertices": np.full((5, 3), np.nan)}, ("a.npz", "F003.finite", None,
         {"item": "vertices", "found": NAN, "at": "vertex 0"})),
        ({"vertices": np.full((5, 3), -1e300)}, ("a.npz", "F003.limit", None, {"item": "vertices",
         "found": -1e300, "at": "vertex 0", "limit": 3.4028234663852886e38})),
        ({"vertices": np.array([{}], dtype=object)}, ("a.npz", "F002.value", None,
         {"item": "vertices", "expected": "any x 3 numbers",
         "found": "an unsupported value (object array)"})),
        ({"parents": np.array(-1)}, ("a.npz", "F002.value", None, {"item": "parents",
         "expected": "any numbers", "found": "a single int64"})),
        ({"parents": np.array([-1, 0, 0, 1])}, ("a.npz", "F002.pig-rows-as", None,
         {"item": "parents", "expected": 3, "other": "t_pose_joints", "found": 4})),
        ({"parents": np.array([-1, 0, 2])}, ("a.npz", "S002.parent", None,
         {"item": "parents: row 2", "found": 2.0, "joint": 2})),
        ({"t_pose_joints": np.zeros((0, 3))}, ("a.npz", "F002.no-rows", None,
         {"item": "t_pose_joints"})),
        ({"skinning_weights": np.eye(5)}, ("a.npz", "F002.value", None,
         {"item": "skinning_weights", "expected": "3 x 5 numbers",
         "found": "5 x 5 float64"})),
        ({"skinning_weights": np.full((3, 5), np.nan)}, ("a.npz", "W003.finite", None,
         {"item": "skinning_weights", "found": NAN, "at": "vertex 0"})),
        ({"skinning_weights": np.array([[0.0, 0, 1], [0, 0, 1]])}, ("a.npz", "F002.pig-twice",
         None, {"item": "skinning_weights: row 1", "joint": 0,
         "vertex": 0})),
        ({"faces_vert": ALL["faces_vert"] + 3}, ("a.npz", "F002.pig-index", None,
         {"item": "faces_vert: row 0", "noun": "vertex",
         "last": 4, "found": 5.0, "proof": "vertices has 5 rows"})),
        ({"faces_tex": ALL["faces_tex"][:1]}, ("a.npz", "F002.pig-rows-as", None,
         {"item": "faces_tex", "expected": 2, "other": "faces_vert", "found": 1})),
        ({"sym": np.arange(4)}, ("a.npz", "F002.pig-rows", None, {"item": "sym", "expected": 5,
         "found": 4})),
        ({"body_part_defs": np.arange(3)}, ("a.npz", "F002.value", None,
         {"item": "body_part_defs", "expected": "any strings",
         "found": "3 int64"})),
    ],
)  # fmt: skip
def test_broken_archive_is_refused_with_its_key(tmp_path, change, message):
    assert archive_refusal(tmp_path, **change) == message


@pytest.mark.parametrize("cut", [1, 40, 200])
def test_truncated_pickle_is_refused(tmp_path, cut):
    whole = saved(vertices=text("x" * 200), parents=text("y"))
    (tmp_path / "a.pkl").write_bytes(whole[:-cut])
    assert refusal(tmp_path / "a.pkl")[0] == "a.pkl"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\x80\x02]q\x01.", ("a.pkl", "F002.pickle-named", None, {"found": "a list"})),
        (b"vertices", ("a.pkl", "F002.archive", None, {"found": "an unknown format"})),
        (b"", ("a.pkl", "F002.archive", None, {"found": "an empty file"})),
        (b"<!doctype html>", ("a.pkl", "F002.archive", None,
         {"found": "HTML or XML (a failed download?)"})),
    ],
)  # fmt: skip
def test_pickle_of_other_data_is_refused(tmp_path, data, message):
    (tmp_path / "a.pkl").write_bytes(data)
    assert refusal(tmp_path / "a.pkl") == message


def test_pickle_with_a_disallowed_global_is_refused_by_name(tmp_path):
    call = named("os", "system") + several(text("true")) + b"R"
    (tmp_path / "a.pkl").write_bytes(saved(vertices=call))
    problem = (
        "expected arrays and plain data, found the global "
        '"os.system", which is not allowed; nothing was executed'
    )
    assert refusal(tmp_path / "a.pkl") == ("a.pkl", "F002.pickle", None, {"problem": problem})


# Poses


def test_pose_of_a_different_length_is_refused_with_both_counts(folder):
    figure = silent(write(folder))
    with pytest.raises(RigError, match=r"^expected 13 pose values for pig, found 12$"):
        apply_record(PoseRecord(vector=np.zeros(12)), figure, rest_pose(figure.skeleton))
