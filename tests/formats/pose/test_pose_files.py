"""Pose files: round trips, names of smplx, and values for different models."""

import json
from pathlib import Path

import numpy as np
import pytest
from faults import INF, NAN, fault_of, told, warnings_of
from formats.pig_text import write as write_pig
from formats.skel_text import GOOD as SKEL
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats import Source, pose
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.hands import hand_vectors
from viewer.rigs.pose import joint_rotations, rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record, record_of


def read(path):
    source = Source.open(path)
    return pose.read(source), warnings_of(source.diagnostics)


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
        ("F007.pose-keys", 1, {"keys": ["body_poses (did you mean body_pose?)", "comment"]})
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


def text_refusal(text, name="a.json"):
    with pytest.raises(FormatError) as caught:
        pose.read(Source(name, text if isinstance(text, bytes) else text.encode()))
    assert str(caught.value).isprintable()
    assert caught.value.path == Path(name)
    key, line, values = fault_of(caught.value.diagnostic)
    # Python's wording of errors differs between versions.
    return key, line, {} if key == "F002.json" else values


# Broken


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", ("F002.json", 1, {})),
        ('{"dofs":\n\n {"a.x": 1,}}', ("F002.json", 3, {})),
        ('{"comment": "größe",\n"äöü": 1\n "betas": [1]}', ("F002.json", 3, {})),
        ('{"comment": "\udcff\udcfe\udcff\udcfe",\n\n"betas" [1]}', ("F002.json", 3, {})),
        ('{"betas": [1]} {}', ("F002.json", 1, {})),
        ('{"betas": [NaN]}', ("F002.json-constant", 1, {"found": "NaN"})),
        ('{"betas": [-Infinity]}', ("F002.json-constant", 1, {"found": "-Infinity"})),
        ('{"betas": [1e999]}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        ('{"betas": [1, -1e39]}', ("F003.pose-number", 1, {"item": "betas", "found": -1e39})),
        ('{"betas": ["1"]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "'1'"})),
        ('{"betas": [[1], [1, 2]]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "ragged lists"})),
        ('{"betas": [true]}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "True"})),
        ('{"betas": {"a": 1}}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "a dict of 1 value"})),
        ('{"betas": "none"}', ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "'none'"})),
        (f'{{"betas": [1{"0" * 400}]}}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        (f'{{"betas": [1{"0" * 5000}]}}', ("F003.pose-number", 1, {"item": "betas", "found": INF})),
        ('{"betas": ' + "[" * 200 + "]" * 200 + "}", ("F002.pose-array", 1, {"item": "betas",
         "expected": "numbers", "found": "ragged lists"})),
        ('{"betas": ' + "[" * 100_000 + "]" * 100_000 + "}", ("F002.json-nesting", 1, {})),
        ('{"a":' * 100_000, ("F002.json-nesting", 1, {})),
        ('{"dofs": {"a.x": "1"}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "'1'"})),
        ('{"dofs": {"a.x": 1e999}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "inf"})),
        ('{"dofs": {"a.x": true}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "True"})),
        ('{"dofs": {"a.x": [1]}}', ("F002.pose-dof", 1, {"item": "a.x",
         "found": "a list of length 1"})),
        ('{"dofs": [1, 2]}', ("F002.pose-dofs", 1, {"found": "a list of length 2"})),
        ('{"betas": [1], "use_pca": "yes"}', ("F002.pose-array", 1, {"item": "use_pca",
         "expected": "true or false", "found": "'yes'"})),
        ('{"viewer_pose": 2, "dofs": {"a.x": 1}}', ("F002.pose-array", 1, {"item": "viewer_pose",
         "expected": 1, "found": "2"})),
        ('{"viewer_pose": [1], "dofs": {"a.x": 1}}', ("F002.pose-array", 1,
         {"item": "viewer_pose", "expected": 1, "found": "a list of length 1"})),
        ('{"translation": [1, 2]}', ("F002.pose-three", 1, {"item": "translation", "found": 2})),
        ('{"scale": [1, 2]}', ("F002.pose-single", 1, {"item": "scale", "found": 2})),
        ('{"figure": "a", "gender": "male"}', ("F002.pose-keys", 1, {"keys": ["figure", "gender"],
         "near": ""})),
        ("{}", ("F002.pose-no-keys", 1, {})),
        ('{"poses": [[1, 2, 3, 4], [1, 2, 3, 4]]}', ("F002.pose-frames", 1, {"item": "poses",
         "found": 2})),
        ('{"body_pose": [[1, 2, 3, 4], [1, 2, 3, 4]]}', ("F002.pose-frames", 1,
         {"item": "body_pose", "found": 2})),
        ('{"global_orient": [[0, 0, 1], [0, 0, 1]]}', ("F002.pose-frames", 1,
         {"item": "global_orient", "found": 2})),
        ('{"transl": [[0, 0, 1], [0, 0, 1]]}', ("F002.pose-frames", 1, {"item": "transl",
         "found": 2})),
        ("[1, 2, 3]", ("F002.pose-object", 1, {"found": "a list of length 3"})),
        ("\n[]", ("F002.pose-object", 2, {"found": "an empty list"})),
        ("null", ("F002.pose-object", 1, {"found": "null"})),
        ("true", ("F002.pose-object", 1, {"found": "true"})),
        ("1 2 3", ("F002.json", 1, {})),
        ("", ("F002.json", 1, {})),
        # The line is that of the value, not that of its key.
        ('{"betas":\n[1,\n2,\nNaN]}', ("F002.json-constant", 4, {"found": "NaN"})),
        ('{"comment": "a NaN",\n"betas":\n[1,\n2, 1e999]}', ("F003.pose-number", 4,
         {"item": "betas", "found": INF})),
        ('{"betas": [1],\n"global_orient":\n[[0,\n0,\n"x"]]}', ("F002.pose-array", 5,
         {"item": "global_orient", "expected": "numbers",
         "found": "'x'"})),
        ('{"dofs": {\n"a.x": 1,\n"b.x": null}}', ("F002.pose-dof", 3, {"item": "b.x",
         "found": "None"})),
        ('{"dofs": {\n"a.x": 1,\n"a.x": 2}}', ("F002.json-twice", 3, {"found": "a.x"})),
        ('{"betas": [1],\r\n"dofs": {},\r\n"betas": [2]}', ("F002.json-twice", 3,
         {"found": "betas"})),
        ('{"comment": {"dofs": 1,\n"größe": [{"dofs": 3}]},\n"dofs":\n3}', ("F002.pose-dofs", 4,
         {"found": "3"})),
        ('{"scale": 1,\n"viewer_pose":\n2}', ("F002.pose-array", 3, {"item": "viewer_pose",
         "expected": 1, "found": "2"})),
        ('{\n"dof": {"a.x": 1}}', ("F002.pose-keys", 2, {"keys": ["dof"],
         "near": "did you mean dofs?"})),
        ("\n\n[1, 2]", ("F002.pose-object", 3, {"found": "a list of length 2"})),
        ('{"a":\n' * 499 + "[\n[\n" * 40_000, ("F002.json-nesting", 80499, {})),
    ],
)  # fmt: skip
def test_broken_json_is_refused(text, message):
    assert text_refusal(text.encode("utf-8", "surrogateescape")) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 up\n4", ("F002.number", 1, {"item": "word 2", "found": b"up"})),
        ("1 2\n\n3 nan 5 6", ("F003.number", 3, {"item": "word 3",
         "found": b"nan"})),
        ("1 2\r\n\r\n3 1e999", ("F003.too-large", 3, {"item": "word 3",
         "found": b"1e999"})),
        ("1\n2\n3,5", ("F002.number", 3, {"item": "word 2", "found": b"3,5"})),
        ("", ("F002.pose-empty", None, {"found": "an empty file"})),
        (" \n ", ("F002.pose-empty", None, {"found": "only white space"})),
    ],
)  # fmt: skip
def test_broken_text_is_refused_with_its_line(text, message):
    assert text_refusal(text, "a.txt") == message


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3))}, ("F002.pose-frames", None,
         {"item": "trans", "found": 3})),
        ({"poses": np.zeros((3, 156))}, ("F002.pose-frames", None, {"item": "poses", "found": 3})),
        ({"poses": np.zeros((3, 24, 3))}, ("F002.pose-frames", None, {"item": "poses",
         "found": 3})),
        ({"betas": np.full(10, np.nan)}, ("F003.pose-number", None, {"item": "betas",
         "found": NAN})),
        ({"betas": np.array(["a"])}, ("F002.pose-array", None, {"item": "betas",
         "expected": "numbers", "found": "1 strings"})),
        ({"betas": np.array([None])}, ("F002.pose-array", None, {"item": "betas",
         "expected": "numbers", "found": "an unsupported value (object array)"})),
        ({"dofs": np.zeros(2)}, ("F002.pose-dofs", None, {"found": "2 float64"})),
        ({"dofs": np.zeros(2), "dof_names": np.array(["a.x"])}, ("F002.pose-names", None,
         {"item": "dof_names", "expected": 2, "found": 1})),
        ({"dofs": np.zeros(()), "dof_names": np.array("a.x")}, ("F002.pose-names", None,
         {"item": "dof_names", "expected": 1, "found": 1})),
        ({"dofs": np.zeros(2), "dof_names": np.zeros(2)}, ("F002.pose-array", None,
         {"item": "dof_names", "expected": "names", "found": "2 float64"})),
        ({"dofs": np.array([np.inf]), "dof_names": np.array(["a.x"])}, ("F002.pose-dof", None,
         {"item": "a.x", "found": "inf"})),
        ({"viewer_pose": np.array([1, 2]), "betas": np.zeros(1)}, ("F002.pose-array", None,
         {"item": "viewer_pose", "expected": 1, "found": "a list of length 2"})),
    ],
)  # fmt: skip
def test_broken_archive_is_refused(tmp_path, arrays, message):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    with pytest.raises(FormatError) as caught:
        read(path)
    assert caught.value.path == path
    assert fault_of(caught.value.diagnostic) == message
