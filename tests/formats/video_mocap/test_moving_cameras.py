"""TRAM, PromptHMR and SLAHMR results: people and moving cameras in world space."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.synthetic_smpl import model
from formats.torch.torch_bytes import object_npy
from formats.video_mocap.tool_files import (
    assert_drawn,
    drawn,
    matrices,
    prompthmr,
    scene_of,
    slahmr,
    tram_camera,
    tram_track,
    vertices,
)
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results
from viewer.rigs.captures.cameras import view_at

TRACKS = {0: [0, 1, 2, 3], 3: [2, 4, 5]}


def tram_folder(folder: Path, camera: dict[str, Any] | None = None) -> Path:
    found = folder / "results" / "clip"
    (found / "hps").mkdir(parents=True)
    for track, frames in TRACKS.items():
        data = object_npy(tram_track(frames, float(track)))
        (found / "hps" / f"hps_track_{track}.npy").write_bytes(data)
    data = object_npy(tram_camera() if camera is None else camera)
    (found / "camera.npy").write_bytes(data)
    (found / "tracks.npy").write_bytes(b"")
    return found


def tram_vertices(track: int, row: int) -> np.ndarray:
    found = tram_track(TRACKS[track], float(track))
    turned, betas = found["pred_rotmat"][row], found["pred_shape"][row]
    return vertices("smpl", model("smpl"), betas, turned, found["pred_trans"][row, 0])[0]


def seen(scene: Any, person: int, frame: int) -> np.ndarray:
    """Return the vertices of a person in the space of the moving camera."""
    timing = scene.actors[0].clip.timing
    view = view_at(scene.views[0], timing.time(frame - timing.first_frame))
    actor = scene.actors[0]
    placed = drawn(scene, person, frame) @ actor.placement[:3, :3].T
    return placed @ view.rotation.T + view.translation


@pytest.mark.parametrize("prefix", ["world", "pred"])
def test_tram_people_are_placed_in_world_space_by_the_camera(prefix, tmp_path):
    camera = tram_camera()
    if prefix == "pred":
        del camera["world_cam_R"], camera["world_cam_T"]
    path = tram_folder(tmp_path, camera)
    assert detect(Source.open(path)) == "video_mocap"
    scene = scene_of(path, "smpl")
    for track, frames in TRACKS.items():
        for row, frame in enumerate(frames):
            turned, placed = (camera[f"{prefix}_cam_{part}"][frame] for part in "RT")
            wanted = tram_vertices(track, row) @ turned.T + placed
            assert_drawn(scene, track, frame, wanted)
            assert_allclose(seen(scene, track, frame), tram_vertices(track, row), atol=2e-6)


def test_tram_people_are_read_in_camera_space(tmp_path):
    scene = scene_of(tram_folder(tmp_path), "smpl", "camera")
    for track, frames in TRACKS.items():
        for row, frame in enumerate(frames):
            assert_drawn(scene, track, frame, tram_vertices(track, row))
    assert scene.views[0].size == (1280, 720)
    assert scene.views[0].intrinsic[0, 0] == 900.0


def test_tram_up_axis_depends_on_the_stored_world(tmp_path):
    assert open_results(Source.open(tram_folder(tmp_path))).up == "y"
    camera = {key: value for key, value in tram_camera().items() if "world" not in key}
    path = tram_folder(tmp_path / "old", camera)
    assert open_results(Source.open(path)).up == "-y"


def test_single_tram_person_files_are_read(tmp_path):
    path = tram_folder(tmp_path)
    alone = path / "hps" / "hps_track_3.npy"
    capture = open_results(Source.open(alone))
    assert [*next(iter(capture.parts())).bodies] == [3]
    assert (capture.first_frame, capture.n_frames, capture.space) == (2, 4, "world")
    (path / "camera.npy").unlink()
    assert open_results(Source.open(alone)).in_space is None
    assert [*next(iter(open_results(Source.open(path / "hps")).parts())).bodies] == [0, 3]


def test_tram_rotations_of_six_numbers_are_read(tmp_path):
    track = tram_track([0, 1], 0.0)
    del track["pred_rotmat"]
    path = tmp_path / "hps_track_0.npy"
    path.write_bytes(object_npy(track))
    vectors = next(iter(open_results(Source.open(path)).parts())).bodies[0].vectors
    wanted = tram_track([0, 1], 0.0)["pred_rotmat"]
    assert_allclose(matrices(vectors), wanted, atol=1e-6)


def test_tram_cameras_with_too_few_frames_are_refused(tmp_path):
    with pytest.raises(FormatError) as caught:
        open_results(Source.open(tram_folder(tmp_path, tram_camera(5))))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.video-camera"


def test_tram_folders_whose_people_are_a_file_are_not_recognised(tmp_path):
    (tmp_path / "hps").write_bytes(b"")
    (tmp_path / "camera.npy").write_bytes(object_npy(tram_camera()))
    with pytest.raises(FormatError) as caught:
        open_results(Source.open(tmp_path))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.unknown-folder"


def prompthmr_file(folder: Path, given: dict[str, Any] | None = None) -> Path:
    path = folder / "results.pkl"
    path.write_bytes(joblib_file(prompthmr() if given is None else given))
    return path


def prompthmr_vertices(space: str, row: int) -> np.ndarray:
    """The tool calls smplx with flat hands, given here as 55 rotations."""
    body = prompthmr()["people"][1][{"world": "smplx_world", "camera": "smplx_cam"}[space]]
    if space == "world":
        turned = matrices(body["pose"][row].reshape(55, 3))
    else:
        turned = np.where(
            body["rotmat"][row].any(axis=(1, 2), keepdims=True), body["rotmat"][row], np.eye(3)
        )
    return vertices("smplx", model("smplx"), body["shape"][row], turned, body["trans"][row])[0]


@pytest.mark.parametrize("space", ["world", "camera"])
def test_prompthmr_follows_the_tools_formula(space, tmp_path):
    path = prompthmr_file(tmp_path)
    assert detect(Source.open(path)) == "video_mocap"
    scene = scene_of(path, "smplx", space)
    for row in range(4):
        assert_drawn(scene, 1, row + 1, prompthmr_vertices(space, row))


@pytest.mark.parametrize("names", [("Rcw", "Tcw"), ("Rwc", "Twc"), ("pred_cam_R", "pred_cam_T")])
def test_prompthmr_cameras_are_read(names, tmp_path):
    given = prompthmr()
    world = given["camera_world"]
    turned, placed = world.pop("Rcw"), world.pop("Tcw")
    if names[0] != "Rcw":
        placed = -np.einsum("nji,nj->ni", turned, placed)
        turned = np.swapaxes(turned, 1, 2)
    world |= dict(zip(names, (turned, placed), strict=True))
    capture = open_results(Source.open(prompthmr_file(tmp_path, given)))
    (view,) = capture.views
    original = prompthmr()["camera_world"]
    for row in range(4):
        at = view_at(view, row / 30)
        assert_allclose(at.rotation, original["Rcw"][row + 1], atol=1e-6)
        assert_allclose(at.translation, original["Tcw"][row + 1], atol=1e-6)
    assert (view.size, capture.up) == ((1280, 720), "y")


def slahmr_file(folder: Path, name: str = "clip_000060_world_results.npz", **changes: Any) -> Path:
    path = folder / name
    arrays = slahmr() | changes
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return path


def slahmr_vertices(person: int, frame: int) -> np.ndarray:
    given = slahmr()
    pose = np.vstack(
        [given["root_orient"][person, frame], given["pose_body"][person, frame].reshape(21, 3)]
    )
    turned = np.concatenate([matrices(pose), np.tile(np.eye(3), (30, 1, 1))])
    betas, place = given["betas"][person][:10], given["trans"][person, frame]
    return vertices("smplh", model("smplh"), betas, turned, place)[0]


def test_slahmr_people_are_read_in_both_spaces(tmp_path):
    path = slahmr_file(tmp_path)
    assert detect(Source.open(path)) == "video_mocap"
    world, camera = scene_of(path, "smplh"), scene_of(path, "smplh", "camera")
    for person in range(2):
        for frame in range(4):
            wanted = slahmr_vertices(person, frame)
            assert_drawn(world, person, frame, wanted)
            turned, placed = slahmr()["cam_R"][0, frame], slahmr()["cam_t"][0, frame]
            assert_drawn(camera, person, frame, wanted @ turned.T + placed)
            assert_allclose(seen(world, person, frame), wanted @ turned.T + placed, atol=2e-6)
    assert_allclose(np.diag(world.views[0].intrinsic), [900, 910, 1])


@pytest.mark.parametrize(
    ("intrins", "notes", "sizes"),
    [
        ([900.0, 900, 640, 360], [], [(1280, 720)]),
        ([900.0, 900, 0, 0], [], [None]),
        ([0.0, 900, 640, 360], ["F007.video-focal"], []),
        ([900.0, -1, 640, 360], ["F007.video-focal"], []),
    ],
)
def test_cameras_that_cannot_be_drawn_are_omitted(intrins, notes, sizes, tmp_path):
    capture = open_results(Source.open(slahmr_file(tmp_path, intrins=np.array(intrins))))
    assert [note.key for note in capture.warnings] == notes
    assert [view.size for view in capture.views] == sizes


def test_slahmr_file_without_a_camera_is_read(tmp_path):
    path = slahmr_file(tmp_path, cam_R=None, intrins=None)
    capture = open_results(Source.open(path))
    assert (capture.in_space, capture.views, capture.up) == (None, (), "-y")


def test_slahmr_tracks_determine_who_is_present(tmp_path):
    tracks = {
        "7": {"index": 1, "vis_mask": [1, 0, 1, 1]},
        "3": {"index": 0, "vis_mask": [-1, 1, 1, -1]},
    }
    (tmp_path / "track_info.json").write_text(json.dumps({"tracks": tracks, "meta": {}}))
    (tmp_path / "smooth_fit").mkdir()
    capture = open_results(Source.open(slahmr_file(tmp_path / "smooth_fit")))
    bodies = next(iter(capture.parts())).bodies
    assert {person: body.timing.present.tolist() for person, body in bodies.items()} == {
        3: [False, True, True, False],
        7: [True, True, True, True],
    }


@pytest.mark.parametrize("text", ["{", "[]", '{"tracks": {"1": {"index": 0, "vis_mask": [1]}}}'])
def test_inconsistent_slahmr_tracks_are_ignored_with_a_note(text, tmp_path):
    (tmp_path / "track_info.json").write_text(text)
    capture = open_results(Source.open(slahmr_file(tmp_path)))
    assert [note.key for note in capture.warnings] == ["F007.video-tracks"]
    assert [*next(iter(capture.parts())).bodies] == [0, 1]


def test_last_slahmr_iteration_of_a_folder_is_read(tmp_path):
    slahmr_file(tmp_path, "clip_000009_world_results.npz", trans=np.zeros((2, 4, 3)))
    slahmr_file(tmp_path, "clip_000060_world_results.npz")
    slahmr_file(tmp_path, "clip_000000_init_world_results.npz", trans=np.zeros((2, 4, 3)))
    source = Source.open(tmp_path)
    assert detect(source) == "video_mocap"
    body = next(iter(open_results(source).parts())).bodies[0]
    assert_allclose(body.translations, slahmr()["trans"][0])
    keys = [one.key for one in source.diagnostics.warnings]
    assert keys == ["F007.video-last", "F007.no-rate"]


def test_slahmr_folder_whose_result_lacks_the_axis_of_people_is_refused(tmp_path):
    slahmr_file(tmp_path, trans=np.zeros(3))
    with pytest.raises(FormatError) as caught:
        open_results(Source.open(tmp_path))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.value"
