"""PIG models from a folder of tables or an archive: all files and all notations."""

import pickle

import numpy as np
import pytest
from faults import NAN, told
from formats.pickle_bytes import array, fake_class, matrix, named, saved, several, text
from formats.pig_text import (
    CORE,
    GOOD,
    WEIGHTS,
    arrays,
    assert_core,
    assert_good,
    influences,
    read,
    refusal,
    silent,
    write,
)
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import RigError
from viewer.formats import save_image
from viewer.rigs.mesh import split_seams
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record
from viewer.rigs.skinning import deform, joint_matrices

EXACT = 1e-15  # metres; one or two rounding errors of values near 1


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "pig"


def facts(figure):
    return dict(figure.facts)


# Models in a folder


def test_folder_with_every_file_is_read(folder):
    assert_good(silent(write(folder)))


def test_core_files_without_optional_files_are_read(folder):
    figure = silent(write(folder, CORE))
    assert_core(figure)
    assert (figure.body_parts, figure.symmetry, figure.reduced) == (None, None, None)


def test_folder_is_recognised_and_named_after_itself(folder):
    scene = viewer.load(write(folder))
    assert scene.warnings == ()
    assert [actor.figure.name for actor in scene.actors] == ["pig"]
    assert scene.up == "z"


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.replace(b"\n", b"\r\n"),
        lambda data: data.replace(b"\n", b"\r"),
        lambda data: data.replace(b"\n", b"\r\r\n"),
        lambda data: b"\xef\xbb\xbf" + data,
        lambda data: data.replace(b" ", b"\t"),
        lambda data: b" \t " + data.replace(b"\n", b"\n \t").replace(b" ", b"   "),
        lambda data: data.rstrip(b"\n"),
        lambda data: data + b"\n\n \n",
        lambda data: b"\n" + data.replace(b"\n", b"\n\n"),
        lambda data: data + b"\x1a",
    ],
    ids="crlf cr crcrlf bom tabs blank-led cut-newline newlines gaps ctrl-z".split(),  # noqa: SIM905
)
def test_table_format_variants_load_without_warnings(folder, change):
    assert_good(silent(write(folder, {name: change(text.encode()) for name, text in GOOD.items()})))


def test_numbers_may_be_written_in_any_notation(folder):
    changed = "-0 +0 .0\n1.000000000 0e5 -1.08033e-07\n0 10e-1 0\n1 1. 0\n2 2 -1"
    figure, warnings = read(write(folder, vertices=changed))
    assert warnings == []
    assert figure.mesh.positions[1].tolist() == [1, 0, -1.08033e-07]
    assert_array_equal(figure.mesh.positions[[0, 2, 3]], [[0, 0, 0], [0, 1, 0], [1, 1, 0]])


@pytest.mark.parametrize("seed", range(4))
def test_weights_may_be_in_any_order(folder, seed):
    rows = GOOD["skinning_weights.txt"].splitlines()
    np.random.default_rng(seed).shuffle(rows)
    assert influences(silent(write(folder, skinning_weights="\n".join(rows)))) == WEIGHTS


def test_weights_are_used_as_stored(folder):
    rows = "0 0 0.998\n1 1 1.002\n0 2 0.75\n1 2 0.24800000\n2 3 1\n2 4 0.5\n1 4 0.5\n"
    # Deviations up to 0.01 are rounding by the authors.
    figure = silent(write(folder, skinning_weights=rows))
    assert influences(figure)[:3] == [[(0, 0.998)], [(1, 1.002)], [(0, 0.75), (1, 0.248)]]
    # Raw weights scale a vertex about the origin, even at rest.
    rest = [[0, 0, 0], [1.002, 0, 0], [0, 0.998, 0], [1, 1, 0], [2, 2, -1]]
    assert_allclose(deform(figure)[0], rest, rtol=0, atol=EXACT)


def test_fact_states_the_effect_of_normalising(folder):
    rows = "0 0 0.998\n1 1 1.002\n0 2 0.75\n1 2 0.25\n2 3 0.999\n2 4 0.5\n1 4 0.503\n"
    told = facts(silent(write(folder, skinning_weights=rows)))
    # The last vertex is 3 m from the origin, and its weights sum to 1.003; 9 mm is the largest
    # error.
    assert told["normalising"] == "would move rest vertices by up to 9.00 mm"
    assert told["weights"] == "raw; their sums are 0.998 to 1.003"


def test_fact_states_the_distance_of_regressed_joints(folder):
    # Joint 2 is regressed to the middle of (1, 1, 0) and (2, 2, -1), sqrt(1.5) m from its position.
    assert facts(silent(write(folder)))["joint regressor"] == (
        "408.25 mm from the file's joints on average, 1224.74 mm at most; "
        "used when the rest mesh changes"
    )


def test_unused_files_are_listed(folder):
    write(folder, {**GOOD, "PIG.obj": "v 0 0 0", "SOURCE.md": "x", ".hidden": "x"})
    assert facts(silent(folder))["not needed"] == "PIG.obj, SOURCE.md"


def test_body_part_names_may_have_spaces_or_be_missing(folder):
    figure = silent(write(folder, body_part_defs="NOT BODY\r\nMAIN BODY\r\nHEAD\r\n"))
    assert figure.body_parts.names == ("NOT BODY", "MAIN BODY", "HEAD")
    figure = silent(write(folder, body_part_defs=None))
    assert figure.body_parts.names == ("part 0", "part 1", "part 2")


# Posing


def test_root_uses_euler_angles_and_others_rotation_vectors(folder):
    figure = silent(write(folder))
    pose = rest_pose(figure.skeleton)
    # The first root value rotates by 90 degrees about z; joint 1 rotates by 90 degrees about x.
    numbers = [0, 0, 0, np.pi / 2, 0, 0, np.pi / 2, 0, 0, 0, 0, 0, 1]
    assert apply_record(PoseRecord(vector=np.array(numbers)), figure, pose) == []
    # Joint 2 is at (0, 1, 0.5) from joint 1; rotated about x it is (0, -0.5, 1), then (1, 0, 0) is
    # added, then all is rotated about z.
    joints = joint_matrices(figure, pose)[:, :3, 3]
    assert_allclose(joints, [[0, 0, 0], [0, 1, 0], [0.5, 1, 1]], rtol=0, atol=EXACT)
    # Vertex 2 is moved to (-1, 0, 0) by the root with weight 3/4. From joint 1, with weight 1/4, it
    # is at (-1, 1, 0): rotated about x (-1, 0, 1), plus joint 1 (0, 0, 1), rotated about z (0, 0,
    # 1).
    expected = [-0.75, 0, 0.25]
    assert_allclose(deform(figure, pose)[0][2], expected, rtol=0, atol=EXACT)


def test_root_applies_its_third_angle_first(folder):
    figure = silent(write(folder))
    pose = rest_pose(figure.skeleton)
    numbers = [0, 0, 0, np.pi / 2, 0, np.pi / 2, *[0] * 6, 1]
    apply_record(PoseRecord(vector=np.array(numbers)), figure, pose)
    # In Rz Rx, Rx maps y to z, where Rz leaves it, and Rz maps x to y.
    turn = joint_matrices(figure, pose)[0, :3, :3]
    assert_allclose(turn, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], rtol=0, atol=EXACT)


def test_scale_is_applied_before_translation_and_about_the_origin(folder):
    figure = silent(write(folder))
    pose = rest_pose(figure.skeleton)
    apply_record(PoseRecord(vector=np.array([10.0, 20, 30, *[0] * 9, 2])), figure, pose)
    assert_array_equal(deform(figure, pose)[0][3], [12, 22, 30])
    assert_array_equal(joint_matrices(figure, pose)[2, :3, 3], [12, 22, 31])


def test_scale_of_0_or_less_is_reported(folder):
    figure = silent(write(folder))
    pose = rest_pose(figure.skeleton)
    notes = apply_record(PoseRecord(vector=np.array([0.0] * 12 + [-2])), figure, pose)
    fault = "scale: expected a positive number, found -2"
    assert told(notes) == [("F007.scale-kept", {"fault": fault, "scale": 1.0})]


# Seams


def test_vertex_on_a_seam_is_split_by_texture_coordinate(folder):
    sources, uv_indices, triangles = split_seams(silent(write(folder)).mesh)
    # Vertices 1 and 2 occur twice; vertex 4, which is in no triangle, occurs once.
    assert sorted(sources.tolist()) == [0, 1, 1, 2, 2, 3, 4]
    assert sources[triangles].tolist() == [[0, 1, 2], [1, 3, 2]]
    assert uv_indices[triangles].tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize("gone", ["textures", "faces_tex"])
def test_figure_without_texture_coordinates_is_untextured(folder, gone):
    figure, warnings = read(write(folder, **{gone: None}))
    assert_core(figure)
    assert (figure.mesh.uvs, figure.mesh.uv_triangles) == (None, None)
    assert warnings == [("F007.pig-texture", None, {})]


# Images in the folder

RED = np.full((2, 2, 4), (255, 0, 0, 255), np.uint8)


def test_image_in_the_folder_is_used_as_texture(folder):
    write(folder)
    save_image(folder / "skin.png", RED)
    scene = viewer.load(folder)
    assert scene.warnings == ()
    (material,) = scene.actors[0].figure.mesh.materials
    assert (material.name, material.texture) == ("skin", "skin.png")
    assert_array_equal(material.image, RED)
    assert scene.actors[0].figure.mesh.material_indices.tolist() == [0, 0]


def test_neither_of_two_images_is_used(folder):
    write(folder)
    for name in ("a.png", "b.jpg"):
        save_image(folder / name, RED)
    scene = viewer.load(folder)
    assert scene.warnings == (f"{folder}: 2 images in the folder: specify the texture to show",)
    assert scene.actors[0].figure.mesh.materials == ()


def test_invalid_image_in_the_folder_leaves_the_figure_untextured(folder):
    write(folder)
    (folder / "skin.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    scene = viewer.load(folder)
    assert scene.actors[0].figure.mesh.materials == ()
    (warning,) = scene.warnings
    assert warning.startswith(f"{folder}: texture {folder / 'skin.png'}: ")
    assert warning.endswith("; drawn untextured")


def test_image_opened_together_with_the_folder_is_used_as_texture(folder, tmp_path):
    save_image(tmp_path / "red.png", RED)
    figure = viewer.load(tmp_path / "red.png", write(folder)).actors[0].figure
    assert figure.mesh.materials[0].texture == "red.png"


# Archives


def test_npz_equals_the_folder(tmp_path):
    np.savez(tmp_path / "pig.npz", **arrays())
    assert_good(silent(tmp_path / "pig.npz"))


def test_npz_with_rows_of_entries_equals_the_folder(tmp_path):
    np.savez_compressed(tmp_path / "pig.npz", **arrays(dense=False))
    assert_good(silent(tmp_path / "pig.npz"))


def test_vertex_major_matrices_are_recognised_by_shape(tmp_path):
    given = arrays()
    given["skinning_weights"] = np.asfortranarray(given["skinning_weights"].T)
    given["J_regressor"] = given["J_regressor"].T.astype(np.float32)
    np.savez(tmp_path / "pig.npz", **given)
    assert_good(silent(tmp_path / "pig.npz"))


def test_columns_may_be_two_dimensional_and_of_different_types(tmp_path):
    given = arrays()
    for name in ("parents", "body_parts", "sym", "reduced_ids"):
        given[name] = given[name][:, None].astype(">i2")
    given["vertices"] = given["vertices"].astype(np.float32)
    given["faces_vert"] = given["faces_vert"].astype(np.float64)
    np.savez(tmp_path / "pig.npz", **given)
    assert_good(silent(tmp_path / "pig.npz"))


def sparse(dense):
    """Return a matrix in compressed columns as pickled by Python 2."""
    rows = [np.flatnonzero(column) for column in dense.T]
    return matrix(
        sides=dense.shape,
        data=np.concatenate([dense[row, number] for number, row in enumerate(rows)]),
        indices=np.concatenate(rows),
        indptr=np.cumsum([0, *map(len, rows)]),
    )


def test_pickle_equals_the_folder(tmp_path):
    given = {
        name: sparse(values) if name in ("skinning_weights", "J_regressor") else array(values)
        for name, values in arrays().items()
        if name != "body_part_defs"
    }
    names = several(*map(text, ("NOT_BODY", "MAIN_BODY", "HEAD")))
    (tmp_path / "PIG.pkl").write_bytes(saved(**given, body_part_defs=names))
    figure = silent(tmp_path / "PIG.pkl")
    assert_good(figure)
    assert figure.name == "PIG"


@pytest.mark.parametrize("protocol", range(2, 6))
def test_pickle_of_any_protocol_equals_the_folder(tmp_path, monkeypatch, protocol):
    made = fake_class(monkeypatch, "scipy.sparse._csr", "csr_matrix")
    given = arrays()
    for name in ("skinning_weights", "J_regressor"):
        dense, given[name] = given[name], made()
        rows, columns = np.nonzero(dense)
        given[name].__dict__.update(
            data=dense[rows, columns],
            indices=columns.astype(np.int32),
            indptr=np.searchsorted(rows, np.arange(4)).astype(np.int32),
            _shape=(3, 5),
        )
    given["body_part_defs"] = given["body_part_defs"].tolist()
    (tmp_path / "PIG.pkl").write_bytes(pickle.dumps(given, protocol))
    assert_good(silent(tmp_path / "PIG.pkl"))


def test_archive_reports_unused_keys(tmp_path):
    np.savez(tmp_path / "pig.npz", **arrays(), author=np.array("me"))
    assert facts(silent(tmp_path / "pig.npz"))["not needed"] == "author"


def test_pickle_with_other_calls_is_refused(tmp_path):
    (tmp_path / "PIG.pkl").write_bytes(
        saved(vertices=named("os", "system") + several(text("touch gone")) + b"R")
    )
    with pytest.raises(viewer.ViewerError, match=r"PIG\.pkl: .*os\.system"):
        viewer.load(tmp_path / "PIG.pkl")


SKINNING = GOOD["skinning_weights.txt"]


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
        ({"skinning_weights": SKINNING.replace("0 2 0.75", "0 5 0.75")},
         ("pig/skinning_weights.txt", "F002.pig-index", 3, {"item": "",
         "noun": "vertex", "last": 4, "found": 5.0, "proof": "vertices.txt has 5 rows"})),
        ({"skinning_weights": SKINNING.replace("0 2 0.75", "3 2 0.75")},
         ("pig/skinning_weights.txt", "W010.pig-joint", 3, {"item": "",
         "noun": "joint", "last": 2, "found": 3.0, "proof": "t_pose_joints.txt has 3 rows"})),
        ({"skinning_weights": SKINNING.replace("0 2 0.75", "0.5 2 0.75")},
         ("pig/skinning_weights.txt", "W010.pig-joint", 3, {"item": "",
         "noun": "joint", "last": 2, "found": 0.5, "proof": "t_pose_joints.txt has 3 rows"})),
        ({"skinning_weights": SKINNING + "1 2 0.125\n0 2 0.5\n"}, ("pig/skinning_weights.txt",
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
    rows = SKINNING.replace("1 1 1\n", "").replace("2 3 1\n", "0 3 0\n")
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
