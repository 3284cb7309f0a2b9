"""SAM 3D Body results: people as upright points, with their camera."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import waves
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats._archive.checking import archive_of
from viewer.formats.video_mocap import read as open_results
from viewer.formats.video_mocap.sam3d_body import (
    JOINTS,
    KEYPOINTS,
    PARENTS,
    intrinsics_seen,
    read_person,
)
from viewer.loading import load

REAL = Path(__file__).resolve().parents[4] / "shared" / "data" / "sam3d_body" / "img_subj00.npz"
DOWN = np.array([1.0, -1.0, -1.0])
K = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])


def person(seed: float = 0.0, **changes: Any) -> dict[str, Any]:
    """Return one person in a picture of 1280 x 720, with y down."""
    keypoints, place = waves(70, 3, seed=seed), np.array([0.2, -0.1, 4.0])
    seen = (keypoints + place) @ K.T
    found = {
        "bbox": waves(4),
        "focal_length": np.float32(900.0),
        "pred_keypoints_3d": keypoints,
        "pred_keypoints_2d": seen[:, :2] / seen[:, 2:],
        "pred_vertices": waves(20, 3, seed=seed + 1),
        "pred_cam_t": place,
        "pred_joint_coords": waves(127, 3, seed=seed + 2),
        "pred_global_rots": np.tile(np.eye(3), (127, 1, 1)),
        "mhr_model_params": waves(204),
        "shape_params": waves(45),
        "expr_params": waves(72),
        "mask": None,
        **changes,
    }
    return {key: value for key, value in found.items() if not isinstance(value, str)}


def npz(folder: Path, name: str = "img.npz", **changes: Any) -> Path:
    arrays = {key: value for key, value in person(**changes).items() if value is not None}
    np.savez(folder / name, **arrays)
    return folder / name


def points_of(path: Path) -> dict[int, Any]:
    part = next(iter(open_results(Source.open(path)).parts()))
    return {number: clip for number, (_, clip) in part.points.items()}


def test_points_are_upright_in_front_of_the_camera(tmp_path):
    path = npz(tmp_path)
    assert detect(Source.open(path)) == "video_mocap"
    scene = load(path)
    (actor,) = scene.actors
    given = person()
    parts = (given[key] for key in ("pred_keypoints_3d", "pred_joint_coords", "pred_vertices"))
    wanted = (np.concatenate([*parts]) + given["pred_cam_t"]) * DOWN
    assert scene.up == "y"
    visible = np.arange(len(wanted)) != 70  # the origin of the rig is not part of the body
    assert_allclose(actor.points[visible, :3], wanted[visible], atol=1e-12)
    assert actor.points[:, 3].tolist() == visible.tolist()
    layout = actor.figure.points
    assert layout.names[:2] == ("nose", "left_eye")
    assert layout.names[70:72] == ("body_world", "root")
    assert layout.names[-1] == "vertex19"


def test_camera_is_computed_from_the_keypoints(tmp_path):
    scene = load(npz(tmp_path))
    (view,) = scene.views
    assert_allclose(view.intrinsic, K, atol=1e-8)
    assert view.size == (1280, 720)
    given = person()
    seen = scene.actors[0].points[:70, :3] @ view.rotation.T + view.translation
    pixels = seen @ view.intrinsic.T
    assert_allclose(pixels[:, :2] / pixels[:, 2:], given["pred_keypoints_2d"], atol=1e-8)


def test_joints_of_the_rig_are_preceded_by_their_parents():
    assert (len(JOINTS), len(set(JOINTS)), len(KEYPOINTS)) == (127, 127, 70)
    assert all(parent < joint for joint, parent in enumerate(PARENTS))
    ends = {JOINTS[joint]: JOINTS[PARENTS[joint]] for joint in range(1, 127)}
    assert (ends["l_foot"], ends["r_wrist"], ends["c_head"]) == (
        "l_lowleg",
        "r_wrist_twist",
        "c_neck",
    )
    assert (ends["l_index1"], ends["l_clavicle"], ends["r_eye"]) == (
        "l_wrist",
        "c_spine3",
        "c_head",
    )


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (person(), {0: [0]}),
        ([person(), person(1.0)], {0: [0], 1: [0]}),
        ({"f2": person(), "f7": person()}, {0: [0, 1]}),
        ({"f2": [person(), person(1.0)], "f7": [person()]}, {0: [0, 1], 1: [0]}),
        ([[person()], [], [person(), person()]], {0: [0, 2], 1: [2]}),
    ],
    ids=["person", "picture", "frames", "frames of people", "list of frames"],
)
def test_pickles_of_people_and_frames_are_read(given, wanted, tmp_path):
    path = tmp_path / "out.pkl"
    path.write_bytes(joblib_file(given))
    assert detect(Source.open(path)) == "video_mocap"
    found = {
        number: np.flatnonzero(clip.timing.present) + clip.timing.first_frame
        for number, clip in points_of(path).items()
    }
    assert {number: frames.tolist() for number, frames in found.items()} == wanted


def test_arrays_with_an_axis_of_frames_are_read(tmp_path):
    arrays = {key: value for key, value in person().items() if np.ndim(value)}
    stacked = {key: np.stack([value, value + 1.0, value]) for key, value in arrays.items()}
    np.savez(tmp_path / "a.npz", **stacked)
    clip = points_of(tmp_path / "a.npz")[0]
    assert clip.points.shape == (3, 217, 4)
    assert_allclose(clip.points[1, 0, :3] - clip.points[0, 0, :3], 2.0 * DOWN)


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (["a_subj00.npz", "a_subj01.npz"], {0: 1, 1: 1}),
        (["f1.npz", "f2.npz", "f10.npz"], {0: 3}),
        (["000001_0.npz", "000001_1.npz", "000002_0.npz"], {0: 2, 1: 1}),
        (["²1.npz", "²2.npz"], {0: 2}),
    ],
)
def test_folders_of_results_are_read(names, wanted, tmp_path):
    for name in names:
        npz(tmp_path, name)
    assert detect(Source.open(tmp_path)) == "video_mocap"
    counts = {number: len(clip.points) for number, clip in points_of(tmp_path).items()}
    assert counts == wanted


def test_files_of_several_frames_in_a_folder_follow_one_another(tmp_path):
    given = {f"{frame:04}.jpg": person() for frame in range(3)}
    for name in ("a.pkl", "b.pkl"):
        (tmp_path / name).write_bytes(joblib_file(given))
    stacked = {key: np.stack([value] * 2) for key, value in person().items() if value is not None}
    np.savez(tmp_path / "c.npz", **stacked)
    (clip,) = points_of(tmp_path).values()
    assert (len(clip.points), clip.timing.rows.tolist()) == (8, [*range(8)])


def test_files_of_several_people_in_a_folder_are_different_people(tmp_path):
    for name in ("a_person0.pkl", "a_person1.pkl"):
        (tmp_path / name).write_bytes(joblib_file([person(), person()]))
    assert [*points_of(tmp_path)] == [0, 1, 2, 3]


def test_folders_of_other_files_are_not_results(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04 broken")
    with pytest.raises(FormatError) as caught:
        detect(Source.open(tmp_path))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.unknown-folder"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"pred_cam_t": np.zeros(2)}, "F002.value"),
        ({"pred_vertices": np.zeros((20, 2))}, "F002.value"),
        ({"shape_params": np.full(45, np.inf)}, "F003.frames-lost"),
        ({"pred_cam_t": np.full(3, 1e20)}, "F003.frames-lost"),
        ({"pred_global_rots": np.zeros((5, 3, 3))}, "F002.value"),
    ],
)
def test_inconsistent_arrays_are_refused(changes, key, tmp_path):
    with pytest.raises(FormatError) as caught:
        open_results(Source.open(npz(tmp_path, **changes)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == key


def test_people_with_different_numbers_of_points_are_refused(tmp_path):
    path = tmp_path / "out.pkl"
    path.write_bytes(joblib_file([person(), person(pred_vertices=waves(7, 3))]))
    with pytest.raises(FormatError) as caught:
        open_results(Source.open(path))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.video-points"


@pytest.mark.skipif(not REAL.is_file(), reason="no real file next to the checkout")
def test_real_file_is_read():
    archive = archive_of(Source.open(REAL))
    found = read_person(archive)
    assert (found.joints.shape, found.vertices.shape) == ((1, 127, 3), (1, 18439, 3))
    head, foot = (found.joints[0, JOINTS.index(name), 1] for name in ("c_head", "l_foot"))
    assert head > foot
    assert found.rotations is not None
    # A knee is on the x axis of its thigh, as in the rest pose of the rig.
    knee, hip = JOINTS.index("l_lowleg"), JOINTS.index("l_upleg")
    along = found.rotations[0, hip].T @ (found.joints[0, knee] - found.joints[0, hip])
    assert_allclose(along / np.linalg.norm(along), [1, 0, 0], atol=0.03)
    intrinsic = intrinsics_seen(archive, found)
    assert intrinsic is not None
    assert_allclose(intrinsic[:2, 2], [960, 445], atol=1e-3)
    assert found.parameters["mhr_model_params"].shape == (1, 204)
