"""The published PIG model, if available: counts and check values of its specification."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import split_seams, volume
from viewer.rigs.pose import joint_rotations, rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record, record_of
from viewer.rigs.skin import influence_counts, weight_sums
from viewer.rigs.skinning import deform, joint_matrices

PRINTED = 5.01e-7  # metres; check values have six decimals
NO_WEIGHTS = [5, 13, 38, 54, 10, 12, 18, 20, 24, 25, 30, 35, 37, 43, 45, 53, 59, 61]


@pytest.fixture(scope="module")
def folder(shared_data):
    path = shared_data / "pig" / "core_txt_files"
    if not path.is_dir():
        pytest.skip(f"no PIG model in {path}")
    return path


@pytest.fixture(scope="module")
def pig(folder):
    scene = viewer.load(folder)
    assert scene.warnings == ()
    return scene.actors[0].figure


def numbers(joints=None, translation=(0, 0, 0), scale=1.0):
    """Return the 190 pose values of the authors."""
    vector = np.zeros(190)
    vector[:3], vector[189] = translation, scale
    for joint, turn in (joints or {}).items():
        vector[3 + 3 * joint : 6 + 3 * joint] = turn
    return vector


def posed(pig, vector):
    pose = rest_pose(pig.skeleton)
    assert apply_record(PoseRecord(vector=vector), pig, pose) == []
    return pose


ROOT = {0: (0.9, -0.4, 0.25)}
PLACED = {"translation": (0.3, -0.2, 0.5), "scale": 1.35}
THREE = {8: (0, 0.5, 0), 23: (0, 0, 0.4), 46: (0, -0.3, 0.2)}


# Counts


def test_counts_are_those_of_the_specification(pig):
    assert (pig.mesh.n_vertices, pig.mesh.n_triangles, len(pig.mesh.uvs)) == (11239, 22446, 12208)
    assert (pig.skeleton.n_joints, pig.skin.n_joints) == (62, 62)
    assert (len(pig.skin.weights), len(pig.joint_regressor.weights)) == (38841, 8079)
    assert (pig.up, pig.unit) == ("z", "m")
    assert pig.pose_layout.n_numbers == 190


def test_all_influences_are_kept(pig):
    counts = influence_counts(pig.skin)
    assert (counts.max(), counts.argmax()) == (13, 5335)
    assert ((counts > 4).sum(), (counts > 8).sum(), counts.min()) == (3143, 646, 1)
    assert round(counts.mean(), 1) == 3.5
    assert pig.skin.weights.min() == 0.001
    assert sorted(set(range(62)) - set(pig.skin.joints.tolist())) == sorted(NO_WEIGHTS)


def test_weights_are_used_as_stored(pig):
    sums = weight_sums(pig.skin)
    assert_allclose(sums[[1740, 109]], [0.998, 1.002], rtol=0, atol=1e-12)
    assert_allclose([sums.min(), sums.max()], [0.998, 1.002], rtol=0, atol=1e-12)
    assert (np.abs(sums - 1.0) > 1e-9).sum() == 2411
    off = np.linalg.norm(deform(pig)[0] - pig.mesh.positions, axis=1)
    assert round(1000 * off.max(), 2) == 0.73
    facts = dict(pig.facts)
    assert facts["normalising"] == "would move rest vertices by up to 0.73 mm"
    assert facts["weights"] == "raw; their sums are 0.998 to 1.002"


def test_regressed_joints_are_near_the_stored_ones(pig):
    fact = dict(pig.facts)["joint regressor"]
    assert fact.startswith("0.13 mm from the file's joints on average, 1.63 mm at most")


def test_hierarchy_and_names_are_those_of_the_specification(pig):
    skeleton = pig.skeleton
    assert len(skeleton.names) == 62
    named = {0: "Hip", 4: "Front hip", 5: "RF hip", 16: "LF knee", 23: "Head", 24: "R eye"}
    named |= {35: "L ear4", 37: "Jaw end", 38: "R leg", 39: "R leg", 46: "Tail1", 53: "Tail8"}
    named |= {54: "L leg", 55: "L leg", 57: "L foot", 61: "L toe"}
    assert {joint: skeleton.names[joint] for joint in named} == named
    assert skeleton.parents.tolist() == [
        *[
            -1,
            0,
            1,
            2,
            3,
            4,
            5,
            6,
            7,
            8,
            9,
            9,
            11,
            4,
            13,
            14,
            15,
            16,
            17,
            17,
            19,
            4,
            21,
            22,
            23,
            23,
        ],
        *[23, 26, 27, 28, 29, 23, 31, 32, 33, 34, 23, 36, 0, 38, 39, 40, 41, 42, 42, 44],
        *[0, 46, 47, 48, 49, 50, 51, 52, 0, 54, 55, 56, 57, 58, 58, 60],
    ]
    at = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    lengths = np.linalg.norm(skeleton.rest_translations, axis=1)
    assert (np.round(1000 * lengths[[5, 13, 38, 54]]) == 4).all()
    assert round(1000 * lengths[1:].max()) == 75
    lefts = [joint for joint, name in enumerate(skeleton.names) if name.startswith("L")]
    rights = [joint for joint, name in enumerate(skeleton.names) if name.startswith("R")]
    assert (at[lefts, 1] > 0).all()
    assert (at[rights, 1] < 0).all()


def test_keypoints_are_those_of_the_specification(pig):
    points = pig.keypoints
    assert len(points.names) == 19
    assert points.names[:2] + points.names[-2:] == ("nose", "left eye", "tail", "centre")
    assert points.vertices[points.joints < 0, 0].tolist() == [10895, 938, 6053, 1368, 6600, 7903]
    assert points.joints[points.joints >= 0].tolist() == [
        *[15, 7, 16, 8, 17, 9, 56, 40, 57, 41, 58, 42, 2]
    ]


def test_seams_split_into_one_vertex_for_each_texture_coordinate(pig):
    sources, _, triangles = split_seams(pig.mesh)
    assert len(sources) == 12208
    counts = np.bincount(np.bincount(sources))
    assert counts.tolist() == [0, 10324, 876, 24, 15]
    assert_array_equal(sources[triangles], pig.mesh.triangles)
    assert np.round([pig.mesh.uvs.min(), pig.mesh.uvs.max()], 3).tolist() == [0.008, 0.994]


def test_mesh_faces_outwards(pig):
    assert round(volume(pig.mesh.positions, pig.mesh.triangles), 4) == 0.0076


# Check values of the specification


def test_rest_box_and_normals_have_the_check_values(pig):
    vertices, normals = deform(pig)
    box = [vertices.min(axis=0), vertices.max(axis=0)]
    expected = [[-0.215591, -0.081306, -0.208351], [0.447458, 0.081306, 0.067361]]
    assert_allclose(box, expected, rtol=0, atol=PRINTED)
    expected = [[-0.123134, -0.205877, -0.970800], [0.313490, 0, 0.949591]]
    assert_allclose(normals[[0, 10895]], expected, rtol=0, atol=PRINTED)
    assert_allclose(pig.mesh.normals[[0, 10895]], expected, rtol=0, atol=PRINTED)


def test_rotated_root_has_the_check_values(pig):
    pose = posed(pig, numbers(ROOT))
    row = joint_rotations(pig.skeleton, pose)[0, 0]
    assert_allclose(row, [0.572541, -0.818863, -0.040743], rtol=0, atol=PRINTED)


def test_placed_and_scaled_root_has_the_check_values(pig):
    pose = posed(pig, numbers(ROOT, **PLACED))
    nose = deform(pig, pose)[0][10895]
    assert_allclose(nose, [0.643911, 0.241038, 0.716217], rtol=0, atol=PRINTED)
    tail = joint_matrices(pig, pose)[53, :3, 3]
    assert_allclose(tail, [0.132899, -0.415763, 0.398340], rtol=0, atol=PRINTED)


def test_three_rotated_joints_have_the_check_values(pig):
    pose = posed(pig, numbers(THREE))
    vertices = deform(pig, pose)[0]
    nose = [0.433938, 0.049298, -0.014247]
    assert_allclose(vertices[10895], nose, rtol=0, atol=PRINTED)
    mean = [0.177036, 0.006901, -0.074471]
    assert_allclose(vertices.mean(axis=0), mean, rtol=0, atol=PRINTED)
    joints = joint_matrices(pig, pose)[[12, 53], :3, 3]
    expected = [[0.219049, -0.036934, -0.207263], [-0.202617, -0.028575, -0.033206]]
    assert_allclose(joints, expected, rtol=0, atol=PRINTED)


# The pickled model


def test_pickle_equals_the_folder(pig, shared_data):
    scene = viewer.load(shared_data / "pig" / "PIG_core.pkl")
    assert scene.warnings == ()
    other = scene.actors[0].figure
    for name in ("positions", "normals", "triangles", "uvs", "uv_triangles"):
        assert_array_equal(getattr(other.mesh, name), getattr(pig.mesh, name))
    for name in ("names", "parents", "rest_translations"):
        assert_array_equal(getattr(other.skeleton, name), getattr(pig.skeleton, name))
    assert_array_equal(other.skin.starts, pig.skin.starts)
    for vertex in range(11239):  # the order within a vertex differs
        rows = slice(pig.skin.starts[vertex], pig.skin.starts[vertex + 1])
        mine, theirs = np.argsort(pig.skin.joints[rows]), np.argsort(other.skin.joints[rows])
        assert_array_equal(other.skin.joints[rows][theirs], pig.skin.joints[rows][mine])
        assert_array_equal(other.skin.weights[rows][theirs], pig.skin.weights[rows][mine])
    mine, theirs = (
        np.lexsort((each.joint_regressor.vertices, each.joint_regressor.joints))
        for each in (pig, other)
    )
    # The pickle stores these weights in single precision.
    found = other.joint_regressor.weights[theirs]
    assert_allclose(found, pig.joint_regressor.weights[mine], rtol=0, atol=3.1e-8)


# Pose files


VECTOR = np.concatenate([[0.3, -0.2, 0.5], 0.4 * np.sin(np.arange(186.0)), [1.35]])


@pytest.mark.parametrize("separator", ["\n", " ", "\r\n", "\t"])
def test_pose_file_of_190_values_round_trips(pig, folder, tmp_path, separator):
    path = tmp_path / "pose.txt"
    path.write_bytes(separator.join(map(repr, VECTOR.tolist())).encode())
    scene = viewer.load(folder, path)
    assert scene.warnings == ()
    pose = scene.actors[0].pose
    viewer.write(record_of(pig, pose), tmp_path / "again.txt")
    again = np.loadtxt(tmp_path / "again.txt")
    # Conversion to angles about x, y, z and back causes rounding errors of values near 1.
    assert_allclose(again, VECTOR, rtol=0, atol=1e-14)


@pytest.mark.parametrize("count", [189, 191, 186])
def test_pose_file_of_a_different_length_is_refused(folder, tmp_path, count):
    path = tmp_path / "pose.txt"
    path.write_text("0\n" * count)
    with pytest.raises(FormatError) as caught:
        viewer.load(folder, path)
    assert (caught.value.path, caught.value.line) == (path, count)
    assert f"190 pose values for pig, found {count}" in str(caught.value)
