"""Pose files: round trips, names of smplx, and values for different models."""

import json

import numpy as np
import pytest
from faults import told, warnings_of
from formats.pig_text import write as write_pig
from formats.pose.pose_texts import read
from formats.skel_text import GOOD as SKEL
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import UnsupportedFormatError
from viewer.formats import Source, pose
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.hands import hand_vectors
from viewer.rig.pose import joint_rotations, rest_pose
from viewer.rig.posing.pose_record import PoseRecord, apply_record, record_of

MODELS = {kind: model(kind, 32) for kind in ("smpl", "smplx", "flame", "mano")}


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """One figure of each kind."""
    folder = tmp_path_factory.mktemp("figures")
    paths = {"pig": write_pig(folder / "pig"), "skel": folder / "a.skel"}
    paths["skel"].write_text(SKEL)
    for kind, arrays in MODELS.items():
        paths[kind] = folder / f"{kind}.npz"
        np.savez(paths[kind], **arrays)
    figures.paths = paths
    return {kind: viewer.load(path).actors[0].figure for kind, path in paths.items()}


def parts(**values):
    """Return the record that is read from the given values."""
    source = Source("a.json", json.dumps(values).encode())
    return pose.read(source), warnings_of(source.diagnostics)


def turns(figure, posed):
    return joint_rotations(figure.skeleton, posed)


def waves(count, seed=0.0):
    return 0.6 * np.sin(seed + 1.7 * np.arange(1, count + 1) ** 1.3)


def some_pose(figure):
    """Return a pose in which all values differ from the defaults."""
    posed = rest_pose(figure.skeleton)
    low, high = np.maximum(figure.skeleton.dof_limits.T[0], -1), figure.skeleton.dof_limits.T[1]
    posed.dofs[:] = np.clip(waves(len(posed.dofs)), low, high)
    posed.shape_weights = waves(figure.n_shapes, 0.5)
    posed.figure_translation[:] = 0.1, -1 / 3, 1e-17
    posed.figure_scale = 1 / 7
    return posed


# Round trips


@pytest.mark.parametrize("suffix", [".json", ".npz", ".JSON"])
@pytest.mark.parametrize("kind", ["pig", "skel", *MODELS])
def test_pose_round_trips_exactly(figures, tmp_path, kind, suffix):
    figure = figures[kind]
    given, path = some_pose(figure), tmp_path / f"pose{suffix}"
    viewer.write(record_of(figure, given), path)
    record, warnings = read(path)
    assert warnings == []
    found = rest_pose(figure.skeleton)
    assert apply_record(record, figure, found) == []
    assert_array_equal(found.dofs, given.dofs)
    assert_array_equal(found.shape_weights, given.shape_weights)
    assert_array_equal(found.figure_translation, given.figure_translation)
    assert found.figure_scale == given.figure_scale


@pytest.mark.parametrize("kind", ["pig", "smpl", "smplx"])
def test_raw_pose_values_round_trip_as_text(figures, tmp_path, kind):
    figure = figures[kind]
    given, path = some_pose(figure), tmp_path / "pose.txt"
    viewer.write(record_of(figure, given), path)
    assert len(path.read_text().splitlines()) == {"pig": 13, "smpl": 72, "smplx": 165}[kind]
    record, warnings = read(path)
    assert warnings == []
    found = rest_pose(figure.skeleton)
    apply_record(record, figure, found)
    # Conversion to rotation vectors and back causes rounding errors of values below 2.
    assert_allclose(turns(figure, found), turns(figure, given), rtol=0, atol=1e-14)


def test_record_with_smplx_names_round_trips(tmp_path):
    given = PoseRecord(
        parts={"body_pose": waves(63), "left_hand_pose": waves(6), "jaw_pose": waves(3)},
        shape=waves(10),
        flat_hands=True,
        hand_coefficients=False,
    )
    for suffix in (".json", ".npz"):
        viewer.write(given, tmp_path / f"a{suffix}")
        record, warnings = read(tmp_path / f"a{suffix}")
        assert warnings == []
        assert record.parts.keys() == given.parts.keys()
        for name, values in given.parts.items():
            assert_array_equal(record.parts[name], values)
        assert_array_equal(record.shape, given.shape)
        assert (record.flat_hands, record.hand_coefficients) == (True, False)


def test_equal_poses_are_written_as_equal_bytes(figures, tmp_path):
    record = record_of(figures["smpl"], some_pose(figures["smpl"]))
    for suffix in (".json", ".npz", ".txt"):
        viewer.write(record, tmp_path / f"a{suffix}")
        viewer.write(record, tmp_path / f"b{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_writer_refuses_invalid_poses(figures, tmp_path):
    with pytest.raises(
        UnsupportedFormatError, match=r"^\.json stores a pose, not a figure or clip$"
    ):
        viewer.write(figures["smpl"], tmp_path / "a.json")
    with pytest.raises(UnsupportedFormatError, match="has no raw pose vector to write"):
        viewer.write(PoseRecord(dofs={"a.x": 1.0}), tmp_path / "a.txt")
    assert not list(tmp_path.iterdir())


# Names used by smplx


def test_parts_rotate_their_joints(figures):
    figure = figures["smplx"]
    given = {"global_orient": waves(3, 1), "body_pose": waves(63, 2), "jaw_pose": waves(3, 3)}
    given |= {"leye_pose": waves(3, 4), "reye_pose": waves(3, 5), "betas": waves(10, 6)}
    given |= {"transl": np.array([1.0, 2, 3]), "expression": waves(4, 7)}
    record, warnings = parts(**{name: values.tolist() for name, values in given.items()})
    assert warnings == []
    posed = rest_pose(figure.skeleton)
    assert apply_record(record, figure, posed) == []
    order = ["global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose"]
    vectors = np.concatenate([given[name] for name in order]).reshape(-1, 3)
    expected = np.concatenate([rotation_vector_to_matrix(vectors), np.tile(np.eye(3), (30, 1, 1))])
    assert_allclose(turns(figure, posed), expected, rtol=0, atol=1e-15)
    assert posed.shape_weights.tolist() == [*waves(10, 6), *waves(4, 7), *[0] * 6]
    assert posed.figure_translation.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("values", "mean", "kind"),
    [
        ({"left_hand_pose": waves(6)}, True, "coefficients"),
        ({"left_hand_pose": waves(6), "flat_hand_mean": True}, False, "coefficients"),
        ({"left_hand_pose": waves(45)}, False, "angles"),
        ({"left_hand_pose": waves(45), "flat_hand_mean": False}, True, "angles"),
        ({"left_hand_pose": waves(45), "use_pca": True}, True, "coefficients"),
        ({"left_hand_pose": waves(45), "use_pca": False}, False, "angles"),
    ],
)
@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_hands_are_rotation_vectors_or_coefficients(figures, tmp_path, values, mean, kind, suffix):
    figure = figures["smplx"]
    path = tmp_path / f"a{suffix}"
    if suffix == ".npz":
        np.savez(path, **values)
    else:
        path.write_text(json.dumps({key: np.asarray(v).tolist() for key, v in values.items()}))
    posed = rest_pose(figure.skeleton)
    apply_record(read(path)[0], figure, posed)
    hand, numbers = figure.hands[0], values["left_hand_pose"]
    if kind == "coefficients":
        vectors = hand_vectors(hand, numbers, not mean)
    else:
        vectors = (numbers + (hand.mean if mean else 0.0)).reshape(-1, 3)
    expected = rotation_vector_to_matrix(vectors)
    assert_allclose(turns(figure, posed)[25:40], expected, rtol=0, atol=1e-15)
    assert_array_equal(turns(figure, posed)[40:], [np.eye(3)] * 15)


@pytest.mark.parametrize("shape", [(72,), (1, 72), (24, 3), (1, 24, 3)])
@pytest.mark.parametrize("key", ["poses", "pose", "fullpose"])
def test_vector_may_have_any_array_shape_of_one_frame(figures, tmp_path, shape, key):
    figure = figures["smpl"]
    np.savez(tmp_path / "a.npz", **{key: waves(72).reshape(shape).astype(np.float32)})
    posed = rest_pose(figure.skeleton)
    assert apply_record(read(tmp_path / "a.npz")[0], figure, posed) == []
    expected = rotation_vector_to_matrix(waves(72).astype(np.float32).reshape(-1, 3))
    assert_allclose(turns(figure, posed), expected, rtol=0, atol=1e-6)


def test_vector_of_a_related_model_poses_the_body(figures):
    figure = figures["smplx"]
    posed = rest_pose(figure.skeleton)
    notes = apply_record(PoseRecord(vector=waves(72)), figure, posed)
    assert told(notes) == [("F007.pose-joints-left-out", {"n": 2, "figure": figure.name})]
    expected = rotation_vector_to_matrix(waves(66).reshape(-1, 3))
    assert_allclose(turns(figure, posed)[:22], expected, rtol=0, atol=1e-15)
    assert_array_equal(turns(figure, posed)[22:], [np.eye(3)] * 33)


def test_body_pose_of_smpl_does_not_change_the_face_of_smplx(figures):
    figure = figures["smplx"]
    posed = rest_pose(figure.skeleton)
    notes = apply_record(PoseRecord(parts={"body_pose": waves(69)}), figure, posed)
    assert told(notes) == [("F007.body-joints-left-out", {"n": 2, "own": 21})]
    assert_array_equal(turns(figure, posed)[22:], [np.eye(3)] * 33)
    hands_at_rest = np.where(np.arange(69) < 63, waves(69), 0.0)
    assert apply_record(PoseRecord(parts={"body_pose": hands_at_rest}), figure, posed) == []


def test_missing_parts_of_the_figure_are_reported_unless_at_rest(figures):
    figure = figures["smpl"]
    record, _ = parts(jaw_pose=[0.1, 0, 0], leye_pose=[0, 0, 0], left_hand_pose=[0.5] * 6)
    assert told(apply_record(record, figure, rest_pose(figure.skeleton))) == [
        ("F007.part-left-out", {"part": "jaw_pose", "figure": "smpl"}),
        ("F007.hand-part-left-out", {"part": "left_hand_pose", "figure": "smpl"}),
    ]


def test_unknown_keys_are_reported_except_motion_keys():
    _, warnings = parts(body_pose=[0] * 63, gender="male", mocap_framerate=120, fps=30)
    assert warnings == []
    _, warnings = parts(body_pose=[0] * 63, body_poses=[1], comment="me")
    assert warnings == [
        (
            "F007.pose-keys",
            1,
            {
                "keys": [
                    "body_poses (did you mean body_pose?)",
                    "comment",
                ]
            },
        )
    ]


def test_unused_large_members_are_not_read(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, poses=np.zeros((1, 72)), marker_data=np.arange(1000.0))
    data = bytearray(path.read_bytes())
    data[data.index(np.arange(1000.0).tobytes()) + 4000] ^= 1  # would be reported if it were read
    path.write_bytes(data)
    record, warnings = read(path)
    assert (len(record.vector), warnings) == (72, [])


@pytest.mark.parametrize("text", ["1 2 3\n4 5 6\n", "1\r\n2\r\n3\r\n4\r\n5\r\n6", "1\t2 3 4 5 6 "])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf", b"\n\n "])
def test_text_may_have_any_line_layout(tmp_path, text, mark):
    (tmp_path / "a.txt").write_bytes(mark + text.encode())
    assert read(tmp_path / "a.txt")[0].vector.tolist() == [1, 2, 3, 4, 5, 6]
