"""AMASS and related motions: all key names, mismatched arrays, and distinction from poses."""

import json
import pickle

import numpy as np
import pytest
from faults import NAN, fault_of, warnings_of
from formats.capture_files import waves
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import FormatError
from viewer.formats import Source, amass, detect, read
from viewer.rigs.bodies.smpl_family import FAMILY, ShapeSpace
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.posing.pose_record import PoseRecord

SMPLH, SMPLX, SMPL = FAMILY[52].names, FAMILY[55].names, FAMILY[24].names
NO_RATE = ("F007.no-rate", None, {"rate": 30.0})


def saved(path, **arrays):
    """Write an archive; keys set to None are left out."""
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return path


def first_release(count=4, **changes):
    """Return the arrays of an AMASS file for SMPL+H."""
    values = {
        "poses": waves(count, 156),
        "trans": waves(count, 3, seed=1),
        "betas": waves(16, seed=2),
        "dmpls": np.zeros((count, 8)),
        "gender": np.array("male"),
        "mocap_framerate": np.array(120.0),
    }
    return {**values, **changes}


def motion_of(path):
    source = Source.open(path)
    motion = read(source)
    assert isinstance(motion, BodyMotion)
    assert all(found.path == path for found in source.diagnostics)
    return motion, warnings_of(source.diagnostics)


def refusal(path):
    with pytest.raises(FormatError) as caught:
        amass.read(Source.open(path))
    assert caught.value.path == path
    return fault_of(caught.value.diagnostic)


def note_texts(path):
    source = Source.open(path)
    read(source)
    return [found.message for found in source.diagnostics.warnings]


def test_first_release_is_read(tmp_path):
    path = saved(tmp_path / "walk_poses.npz", **first_release())
    motion, warnings = motion_of(path)
    assert (motion.name, warnings) == ("walk_poses", [])
    assert (motion.joint_names, motion.up, motion.about_origin) == (SMPLH, "z", False)
    assert_array_equal(motion.vectors, waves(4, 156).reshape(4, 52, 3))
    assert_array_equal(motion.translations, waves(4, 3, seed=1))
    assert_array_equal(motion.shape, [waves(16, seed=2)])
    timing = motion.timing
    assert (timing.frame_rate, timing.rows.tolist(), timing.holds) == (120.0, [0, 1, 2, 3], True)
    assert (motion.hands, motion.expression, motion.world_rotations) == ({}, None, None)
    assert motion.shape_space == ShapeSpace("SMPL+H", "male")


@pytest.mark.parametrize(
    ("gender", "said"),
    [
        (np.array("female"), "female"),
        (np.array(b"female"), "female"),
        (np.array(["female"]), "female"),
        (np.array("b'female'"), "female"),
        (np.array("female", dtype=object), "female"),
    ],
)
def test_gender_is_accepted_in_several_spellings(tmp_path, gender, said):
    path = saved(tmp_path / "a.npz", **first_release(gender=gender))
    assert motion_of(path)[0].shape_space == ShapeSpace("SMPL+H", said)


@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate", "fps"])
@pytest.mark.parametrize("value", [np.array(59.94), np.array([59.94], dtype=">f8")])
def test_frame_rate_is_found_under_any_key(tmp_path, key, value):
    path = saved(tmp_path / "a.npz", **first_release(**{"mocap_framerate": None, key: value}))
    motion, warnings = motion_of(path)
    assert (motion.timing.frame_rate, warnings) == (59.94, [])


def test_conflicting_frame_rates_are_reported(tmp_path):
    path = saved(tmp_path / "a.npz", **first_release(mocap_frame_rate=np.array(60)))
    motion, warnings = motion_of(path)
    assert motion.timing.frame_rate == 120.0
    assert warnings == [
        ("F007.motion-rates", None, {"rates": ["mocap_framerate 120", "mocap_frame_rate 60"]})
    ]


def test_soft_tissue_coefficients_are_counted(tmp_path):
    dmpls = np.zeros((4, 8))
    dmpls[1:3, 2] = 0.5
    path = saved(tmp_path / "a.npz", **first_release(dmpls=dmpls))
    assert motion_of(path)[1] == [("F007.motion-tissue", None, {"n": 2})]


def test_second_release_is_read(tmp_path):
    path = saved(
        tmp_path / "a_stageii.npz",
        gender=np.array("neutral"),
        surface_model_type=np.array("smplx"),
        mocap_frame_rate=np.array(120.0),
        mocap_time_length=np.array(0.1),
        trans=waves(3, 3),
        poses=waves(3, 165),
        betas=waves(16),
        num_betas=np.array(16),
        # Parts rounded to single precision are treated as equal, and the fingers may be missing.
        root_orient=waves(3, 165)[:, :3].astype(np.float32),
        pose_body=waves(3, 165)[:, 3:66],
        pose_eye=waves(3, 165)[:, 69:75],
        markers_latent=np.zeros((5, 3)),
        latent_labels=np.array(["a"]),
    )
    motion, warnings = motion_of(path)
    assert (motion.joint_names, motion.up, warnings) == (SMPLX, "z", [])
    assert motion.shape_space == ShapeSpace("SMPL-X", "neutral")


def test_split_keys_without_poses_are_read(tmp_path):
    parts = {
        "root_orient": waves(3, 3, seed=1),
        "pose_body": waves(3, 63, seed=2),
        "pose_jaw": waves(3, 3, seed=3),
        "pose_eye": waves(3, 6, seed=4),
        "pose_hand": waves(3, 90, seed=5),
    }
    path = saved(tmp_path / "a.npz", **parts, trans=waves(3, 3), mocap_frame_rate=np.array(30))
    motion, warnings = motion_of(path)
    assert (motion.joint_names, warnings) == (SMPLX, [])
    expected = np.concatenate(list(parts.values()), axis=1).reshape(3, 55, 3)
    assert_array_equal(motion.vectors, expected)


def test_names_of_smplx_are_read(tmp_path):
    path = saved(
        tmp_path / "a.npz",
        global_orient=waves(2, 1, 3),
        body_pose=waves(2, 23, 3),
        transl=waves(2, 3),
        betas=waves(2, 10),
        left_hand_pose=waves(2, 6),
        fps=np.array(25),
    )
    motion, warnings = motion_of(path)
    assert (motion.joint_names, motion.up, warnings) == (SMPL, "", [])
    assert_array_equal(motion.vectors[:, 1:], waves(2, 69).reshape(2, 23, 3))
    assert_array_equal(motion.hands["left"], waves(2, 6))
    assert (motion.flat_hands, motion.shape.shape) == (False, (2, 10))


def test_hand_angles_are_joint_rotations_without_the_mean(tmp_path):
    parts = {"global_orient": waves(2, 3), "body_pose": waves(2, 63)}
    parts |= {"right_hand_pose": waves(2, 45), "flat_hand_mean": np.array(False)}
    path = saved(tmp_path / "a.npz", **parts, transl=waves(2, 3), fps=np.array(25))
    motion, warnings = motion_of(path)
    assert motion.joint_names == (*SMPL[:22], *SMPLX[40:])
    assert warnings == [("F007.motion-angles", None, {"item": "right_hand_pose"})]


def test_speech_expressions_are_read(tmp_path):
    path = saved(
        tmp_path / "a.npz",
        betas=waves(300),
        poses=waves(3, 165),
        expressions=waves(3, 100),
        trans=waves(3, 3),
        model=np.array("smplx2020"),
        gender=np.array("neutral"),
        mocap_frame_rate=np.array(30),
    )
    motion, warnings = motion_of(path)
    assert (motion.up, warnings) == ("", [])
    assert_array_equal(motion.expression, waves(3, 100))


def test_dance_data_in_a_pickle_is_read(tmp_path):
    path = tmp_path / "gBR_sBM_c01.pkl"
    values = {"smpl_poses": waves(3, 72), "smpl_trans": 93.0 * waves(3, 3)}
    values |= {"smpl_scaling": np.array([93.0]), "smpl_loss": 0.5}
    path.write_bytes(pickle.dumps(values, protocol=4))
    motion, warnings = motion_of(path)
    assert (motion.joint_names, motion.up, motion.timing.frame_rate) == (SMPL, "y", 60.0)
    # A single rounding of 93 x.
    assert_allclose(motion.translations, waves(3, 3), rtol=0, atol=1e-15)
    assert warnings == [("F007.motion-aist-rate", None, {"rate": 60.0})]


@pytest.mark.parametrize(
    ("turn", "place", "up"),
    [
        ((0, 0.4, 0), (0.3, 1.2, 5.0), ""),  # stands along y: estimated from the poses
        ((np.pi / 2, 0, 0), (0.3, 1.2, 1.2), "z"),  # stands along z
        ((0, 0.4, 0), (0.3, 4.0, 0.2), "z"),  # lies along y on a ground with z up
        ((0, 0, np.pi / 2), (0.3, 1.2, 0.2), "z"),  # lies along x
    ],
)
def test_people_who_stand_along_y_do_not_get_z_up(tmp_path, turn, place, up):
    """Some programs write the layout of AMASS with y up: such people lay on their backs."""
    poses = np.zeros((3, 156))
    poses[:, :3] = turn
    path = saved(tmp_path / "a.npz", **first_release(3, poses=poses, trans=np.tile(place, (3, 1))))
    assert motion_of(path)[0].up == up


@pytest.mark.parametrize(
    ("shape", "names"),
    [((2, 72), SMPL), ((2, 24, 3), SMPL), ((2, 66), SMPL[:22]), ((2, 52, 3), SMPLH)],
)
def test_several_poses_without_other_keys_are_a_motion(tmp_path, shape, names):
    path = saved(tmp_path / "a.npz", poses=waves(*shape))
    motion, warnings = motion_of(path)
    assert (motion.joint_names, motion.n_rows, motion.up) == (names, 2, "")
    assert warnings == [NO_RATE, ("F007.motion-place", None, {})]


@pytest.mark.parametrize(
    "arrays",
    [
        {"poses": waves(1, 72), "trans": waves(1, 3)},
        {"poses": waves(24, 3)},
        {"poses": waves(156), "mocap_framerate": np.array(120.0)},
        {"poses": waves(24, 3), "fps": np.array(120.0)},
        {"global_orient": waves(3), "body_pose": waves(21, 3)},
        {"betas": waves(10), "gender": np.array("male")},
    ],
)
def test_single_frame_is_a_pose(tmp_path, arrays):
    source = Source.open(saved(tmp_path / "a.npz", **arrays))
    assert detect(source) == "pose"
    assert isinstance(read(source), PoseRecord)


@pytest.mark.parametrize(
    ("arrays", "names"),
    [
        (first_release(1), SMPLH),
        ({"poses": waves(1, 24, 3), "fps": np.array(30)}, SMPL),
        ({"root_orient": waves(1, 3), "pose_body": waves(1, 63), "fps": np.array(30)}, SMPL[:22]),
    ],
)
def test_single_frame_with_a_frame_rate_is_a_motion(tmp_path, arrays, names):
    motion, _ = motion_of(saved(tmp_path / "a.npz", **arrays))
    assert (motion.joint_names, motion.n_rows, motion.timing.rows.tolist()) == (names, 1, [0])


@pytest.mark.parametrize(
    ("arrays", "key"),
    [
        (first_release(0), "poses"),
        ({"poses": np.zeros((0, 72)), "betas": waves(10)}, "poses"),
        ({"poses": np.zeros((0, 24, 3))}, "poses"),
        ({"root_orient": np.zeros((0, 3)), "pose_body": np.zeros((0, 63))}, "root_orient"),
        ({"global_orient": np.zeros((0, 3)), "body_pose": np.zeros((0, 69))}, "global_orient"),
    ],
)
def test_empty_motions_are_refused(tmp_path, arrays, key):
    path = saved(tmp_path / "a.npz", **arrays)
    with pytest.raises(FormatError) as caught:
        read(Source.open(path))
    assert caught.value.path == path
    fault = ("F002.motion-no-frames", None, {"item": key})
    assert fault_of(caught.value.diagnostic) == fault


# Duplicate data


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"root_orient": waves(4, 3, seed=9)}, ("F007.motion-differ", None, {"first": "poses",
         "others": ["root_orient"]})),
        ({"pose_body": waves(4, 63, seed=9), "pose_hand": waves(4, 90, seed=9)},
         ("F007.motion-differ", None, {"first": "poses", "others": ["pose_body", "pose_hand"]})),
        ({"root_orient": waves(4, 156)[:3, :3]}, ("F007.motion-differ", None, {"first": "poses",
         "others": ["root_orient"]})),
        ({"root_orient": np.array("none")}, ("F007.motion-differ", None, {"first": "poses",
         "others": ["root_orient"]})),
        ({"fullpose": waves(4, 156, seed=9)}, ("F007.motion-differ", None, {"first": "poses",
         "others": ["fullpose"]})),
        ({"transl": waves(4, 3)}, ("F007.motion-differ", None, {"first": "trans",
         "others": ["transl"]})),
        ({"shape": waves(10)}, ("F007.motion-differ", None, {"first": "betas",
         "others": ["shape"]})),
    ],
)  # fmt: skip
def test_conflicting_duplicates_are_reported(tmp_path, changes, message):
    motion, warnings = motion_of(saved(tmp_path / "a.npz", **first_release(**changes)))
    assert warnings == [message]
    assert_array_equal(motion.vectors, waves(4, 156).reshape(4, 52, 3))
    assert_array_equal(motion.translations, waves(4, 3, seed=1))


def test_identical_duplicates_are_not_reported(tmp_path):
    same = {"fullpose": waves(4, 156), "transl": waves(4, 1, 3, seed=1), "shape": waves(16, seed=2)}
    same |= {"root_orient": waves(4, 156)[:, :3] + 9e-6, "pose_hand": waves(4, 156)[:, 66:]}
    assert motion_of(saved(tmp_path / "a.npz", **first_release(**same)))[1] == []


def test_hand_components_next_to_full_poses_are_not_compared(tmp_path):
    beside = {"left_hand_pose": waves(4, 45), "use_pca": np.array(True)}
    assert motion_of(saved(tmp_path / "a.npz", **first_release(**beside)))[1] == []
    beside = {"right_hand_pose": waves(4, 12)}
    assert motion_of(saved(tmp_path / "b.npz", **first_release(**beside)))[1] == []


def test_second_part_with_the_same_joints_is_ignored(tmp_path):
    parts = {"root_orient": waves(3, 3), "pose_body": waves(3, 63), "pose_eye": waves(3, 6)}
    parts |= {"leye_pose": waves(3, 3, seed=2), "reye_pose": waves(3, 6)[:, 3:]}
    path = saved(tmp_path / "a.npz", **parts, trans=waves(3, 3), fps=np.array(30))
    motion, warnings = motion_of(path)
    assert motion.joint_names == (*SMPL[:22], "left_eye", "right_eye")
    assert_array_equal(motion.vectors[:, 22:].reshape(3, 6), waves(3, 6))
    assert warnings == [("F007.motion-again", None, {"item": "leye_pose"})]


def test_metadata_of_the_writer_is_read(tmp_path):
    present = np.array([True, False, True, True])
    arrays = first_release(present=present, up=np.array("y"))
    motion, warnings = motion_of(saved(tmp_path / "a.npz", **arrays))
    assert (motion.timing.rows.tolist(), motion.up, warnings) == ([0, -1, 2, 3], "y", [])


def test_unknown_keys_are_reported(tmp_path):
    path = saved(tmp_path / "a.npz", **first_release(contact=np.zeros(4)))
    assert motion_of(path)[1] == [("F007.motion-keys", None, {"keys": ["contact"]})]


def rows_as_objects(values):
    found = np.empty(len(values), dtype=object)
    found[:] = [*values]
    return found


@pytest.mark.parametrize("form", ["lists", "arrays", "objects", "json"])
def test_frames_in_lists_are_read_like_arrays(tmp_path, form):
    poses, trans = waves(5, 72), waves(5, 3)
    path = tmp_path / ("a.json" if form == "json" else "a.npz" if form == "objects" else "a.pkl")
    if form == "objects":
        saved(path, poses=rows_as_objects(poses), trans=trans)
    elif form == "json":
        path.write_text(json.dumps({"poses": poses.tolist(), "trans": trans.tolist()}))
    else:
        as_list = {"lists": np.ndarray.tolist, "arrays": list}[form]
        path.write_bytes(pickle.dumps({"poses": as_list(poses), "trans": as_list(trans)}))
    motion, warnings = motion_of(path)
    assert warnings == [NO_RATE]
    assert_array_equal(motion.vectors.reshape(5, 72), poses)
    assert_array_equal(motion.translations, trans)


@pytest.mark.parametrize("missing", [None, []])
def test_missing_frames_in_lists_are_gaps(tmp_path, missing):
    poses, trans = [*waves(5, 72)], [*waves(5, 3)]
    poses[1] = trans[1] = missing
    path = tmp_path / "a.pkl"
    path.write_bytes(pickle.dumps({"poses": poses, "trans": trans}))
    motion, _ = motion_of(path)
    assert motion.timing.rows.tolist() == [0, -1, 2, 3, 4]
    assert_array_equal(motion.translations[2:], waves(5, 3)[2:])


def test_frames_of_different_lengths_are_not_an_array(tmp_path):
    path = tmp_path / "a.pkl"
    poses = [*waves(5, 72)]
    poses[1] = poses[1][:70]
    path.write_bytes(pickle.dumps({"poses": poses, "trans": waves(5, 3)}))
    with pytest.raises(FormatError):
        read(Source.open(path))


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("poses", np.nan, "poses: expected finite numbers, found nan at 3, 1"),
        ("trans", np.inf, "trans: expected finite numbers, found inf at 3, 1"),
        ("trans", -1e12, "trans: expected numbers within ±1e+09, found -1e+12 in frame 3"),
        ("betas", np.nan, "betas: expected finite numbers, found nan at 3, 1"),
    ],
)
def test_invalid_frames_are_gaps(tmp_path, key, value, problem):
    arrays = first_release(6, betas=waves(6, 16))
    valid = {name: np.delete(arrays[name], [3, 4], axis=0) for name in ("poses", "trans", "betas")}
    arrays[key][3:5, 1] = value
    path = saved(tmp_path / "a.npz", **arrays)
    motion, _ = motion_of(path)
    (note,) = [found for found in note_texts(path) if "gap" in found]
    assert note.startswith("2 frames with invalid numbers are gaps: frames 3 to 4; first error: ")
    assert problem in note
    rows = motion.timing.rows
    assert (rows >= 0).tolist() == [True, True, True, False, False, True]
    kept = rows[rows >= 0]
    assert_array_equal(motion.vectors[kept].reshape(4, 156), valid["poses"])
    assert_array_equal(motion.translations[kept], valid["trans"])
    assert_array_equal(motion.shape[kept], valid["betas"])


def test_invalid_soft_tissue_loses_no_frame(tmp_path):
    path = saved(tmp_path / "a.npz", **first_release(dmpls=np.full((4, 8), np.nan)))
    motion, warnings = motion_of(path)
    assert (motion.timing.rows.tolist(), warnings) == ([0, 1, 2, 3], [])


# Broken files


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trans": waves(3, 3)}, ("F002.motion-frames", None, {"item": "trans", "expected": 4,
         "other": "poses", "found": 3})),
        ({"trans": waves(4, 2)}, ("F002.motion-width", None, {"item": "trans", "expected": [3],
         "found": 2})),
        ({"betas": waves(3, 16)}, ("F002.motion-frames", None, {"item": "betas", "expected": 4,
         "other": "poses", "found": 3})),
        ({"poses": waves(4, 155)}, ("F002.motion-width", None, {"item": "poses", "expected": [66,
         72, 156, 165], "found": 155})),
        ({"poses": np.zeros((0, 156))}, ("F002.motion-no-frames", None, {"item": "poses"})),
        ({"poses": np.array(["a"])}, ("F002.value", None, {"item": "poses",
         "expected": "an array of numbers", "found": "1 strings"})),
        ({"mocap_framerate": np.array(0.0)}, ("F002.motion-rate", None,
         {"item": "mocap_framerate", "low": 1e-06, "high": 1000000.0, "found": 0.0})),
        ({"mocap_framerate": np.array(1e-320)}, ("F002.motion-rate", None,
         {"item": "mocap_framerate", "low": 1e-06, "high": 1000000.0, "found": 1e-320})),
        ({"mocap_framerate": None, "fps": np.array(1.5e6)}, ("F002.motion-rate", None,
         {"item": "fps", "low": 1e-06, "high": 1000000.0, "found": 1500000.0})),
        ({"smpl_scaling": np.array([1e-320])}, ("F002.motion-scale", None,
         {"item": "smpl_scaling", "low": 1e-06, "high": 1000000.0, "found": 1e-320})),
        ({"mocap_framerate": np.array([30.0, 60.0])}, ("F002.motion-single", None,
         {"item": "mocap_framerate", "found": 2})),
        ({"mocap_framerate": np.array(np.nan)}, ("F003.finite", None, {"item": "mocap_framerate",
         "found": NAN, "at": "0"})),
        ({"present": np.ones(3)}, ("F002.motion-present", None, {"item": "present", "expected": 4,
         "other": "poses", "found": 3})),
        ({"smpl_scaling": np.zeros(1)}, ("F002.motion-scale", None, {"item": "smpl_scaling",
         "low": 1e-06, "high": 1000000.0, "found": 0.0})),
    ],
)  # fmt: skip
def test_mismatched_arrays_are_refused(tmp_path, changes, message):
    assert refusal(saved(tmp_path / "a.npz", **first_release(**changes))) == message


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"trans": np.full((4, 3), np.nan)}, "F003.finite"),
        ({"smpl_scaling": np.array([1e-6]), "trans": np.full((4, 3), 1e38)}, "F003.limit"),
    ],
)  # fmt: skip
def test_motions_without_a_valid_frame_are_refused(tmp_path, changes, problem):
    key, _, values = refusal(saved(tmp_path / "a.npz", **first_release(**changes)))
    assert (key, values["n"], values["problem"][0]) == ("F003.frames-lost", 4, problem)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ({"pose_body": waves(2, 63)}, ("F002.motion-frames", None, {"item": "pose_body",
         "expected": 3, "other": "root_orient", "found": 2})),
        ({"pose_body": waves(3, 62)}, ("F002.motion-width", None, {"item": "pose_body",
         "expected": [63, 69], "found": 62})),
        ({"pose_hand": waves(3, 12)}, ("F002.motion-width", None, {"item": "pose_hand",
         "expected": [90], "found": 12})),
    ],
)  # fmt: skip
def test_mismatched_parts_are_refused(tmp_path, part, message):
    assert refusal(saved(tmp_path / "a.npz", root_orient=waves(3, 3), **part)) == message


def test_shape_of_a_subject_is_refused_as_a_motion(tmp_path):
    path = saved(tmp_path / "shape.npz", betas=waves(16), gender=np.array("male"))
    assert refusal(path) == (("F002.motion-shape", None, {"keys": ["betas", "gender"]}))


def test_file_of_the_first_stage_is_refused_as_a_motion(tmp_path):
    arrays = {"betas": waves(16), "markers_latent": np.zeros((4, 3)), "gender": np.array("male")}
    path = saved(tmp_path / "female_stagei.npz", **arrays)
    assert detect(Source.open(path)) == "amass"
    assert refusal(path) == (("F002.motion-stage", None, {}))


def test_archives_of_other_data_are_described_by_their_keys(tmp_path):
    path = saved(tmp_path / "a.npz", pose_body=waves(3, 63))
    assert refusal(path) == (("F002.motion", None, {"keys": ["pose_body"]}))


@pytest.mark.parametrize("key", ["frame_rate", "framerate", "frameRate", "video_fps"])
def test_frame_rate_of_other_datasets_is_read(tmp_path, key):
    arrays = first_release(mocap_framerate=None, **{key: np.array(50.0)})
    motion, warnings = motion_of(saved(tmp_path / "a.npz", **arrays))
    assert motion.timing.frame_rate == 50.0
    assert warnings == []


def test_errors_in_json_name_the_line(tmp_path):
    path = tmp_path / "a.json"
    poses = json.dumps([[0.0] * 72] * 2)
    path.write_text('{"poses": ' + poses + ',\n"fps": 30,\n"trans": [[0, 0, 0]]}')
    with pytest.raises(FormatError) as caught:
        amass.read(Source.open(path))
    assert (caught.value.diagnostic.key, caught.value.line) == ("F002.motion-frames", 3)
