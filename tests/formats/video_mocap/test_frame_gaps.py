"""Frames with invalid numbers in results of video motion capture: they become gaps."""

from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import aligned_array, joblib_file
from formats.capture_files import waves
from formats.npz_bytes import cost, npz
from formats.pickle_bytes import finished, unicode
from formats.torch.torch_bytes import torch_zip, value
from formats.video_mocap.test_sam3d_body import person
from formats.video_mocap.test_video_tools import image, written
from formats.video_mocap.tool_files import gvhmr, matrices, phalp, prompthmr, slahmr, wham
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import Options
from viewer.formats.video_mocap import read as open_results
from viewer.rigs.captures.capture import Capture

NAN = np.nan


def opened(data: bytes, space: str = "") -> Capture:
    return open_results(Source("a.pkl", data), Options(space=space))


def present(capture: Capture) -> dict[int, list[int]]:
    """Return the frames in which each person is present."""
    part = next(iter(capture.parts()))
    timings = {number: body.timing for number, body in part.bodies.items()}
    timings |= {number: clip.timing for number, (_, clip) in part.points.items()}
    return {
        number: (np.flatnonzero(timing.rows >= 0) + timing.first_frame).tolist()
        for number, timing in timings.items()
    }


def notes(capture: Capture) -> list[str]:
    return [note.message for note in capture.warnings if "invalid" in note.message]


def in_gvhmr(given: dict[str, Any]) -> None:
    given["smpl_params_global"]["body_pose"][2, 5] = NAN


def in_gvhmr_shape(given: dict[str, Any]) -> None:
    given["smpl_params_global"]["betas"][2, 0] = NAN


def in_wham(given: dict[int, Any]) -> None:
    given[0]["trans_world"][2] = 1e30


def in_phalp(given: dict[str, Any]) -> None:
    given["out/img/000003.jpg"]["smpl"][0]["body_pose"][7, 1, 1] = NAN


def in_phalp_flat(given: dict[str, Any]) -> None:
    given["out/img/000003.jpg"]["smpl"][0]["body_pose"][7] = 1.0  # not a rotation


def in_prompthmr(given: dict[str, Any]) -> None:
    first = next(iter(given["people"]))
    given["people"][first]["smplx_world"]["pose"][2] = NAN


def in_slahmr(given: dict[str, Any]) -> None:
    given["pose_body"][0, 2, 3] = NAN


@pytest.mark.parametrize(
    ("write", "given", "spoil"),
    [
        (torch_zip, gvhmr, in_gvhmr),
        (torch_zip, gvhmr, in_gvhmr_shape),
        (joblib_file, wham, in_wham),
        (joblib_file, phalp, in_phalp),
        (joblib_file, phalp, in_phalp_flat),
        (joblib_file, prompthmr, in_prompthmr),
        (lambda given: npz(**given), slahmr, in_slahmr),
    ],
)
def test_one_invalid_frame_is_a_gap_of_one_person(write, given, spoil):
    whole = given()
    before = present(opened(write(whole)))
    spoil(whole)
    capture = opened(write(whole))
    first, *others = before
    number = before[first][2]
    assert present(capture) == {**before, first: [n for n in before[first] if n != number]}
    name = f"person {first}, frame {number}" if others else f"frame {number}"
    (note,) = notes(capture)
    assert note.startswith(f"1 frame with invalid numbers is a gap: {name}; first error: ")


def test_valid_frames_are_unchanged():
    poses, places = waves(6, 72), waves(6, 3)
    given = {"rotmat": matrices(poses.reshape(6, 24, 3)), "cam_t": places.copy()}
    (whole,) = next(iter(opened(joblib_file(given)).parts())).bodies.values()
    given["rotmat"][1, 3] = NAN
    given["cam_t"][[4, 5]] = np.inf
    capture = opened(joblib_file(given))
    (body,) = next(iter(capture.parts())).bodies.values()
    assert body.timing.rows.tolist() == [0, -1, 1, 2, -1, -1]
    assert_array_equal(body.vectors, whole.vectors[[0, 2, 3]])
    assert_array_equal(body.translations, places[[0, 2, 3]])
    (note,) = notes(capture)
    assert note.startswith("3 frames with invalid numbers are gaps: frame 1, frames 4 to 5; first")


def test_one_person_of_an_image_is_lost_without_the_others(tmp_path):
    images = {f"{n:06}.jpg": image(2, n, track_ids=np.array([3, 8])) for n in range(3)}
    images["000001.jpg"]["smpl_thetas"][1, 0] = NAN
    found = present(open_results(Source.open(written(tmp_path, images))))
    assert found == {3: [0, 1, 2], 8: [0, 2]}


def test_a_person_without_a_valid_frame_is_omitted():
    given = wham()
    given[4]["pose_world"][:] = NAN
    capture = opened(joblib_file(given))
    assert [*present(capture)] == [0]
    (note,) = notes(capture) or [n.message for n in capture.warnings]
    assert note.startswith("person 4 omitted: 4 frames, none of them valid; first error: 4.pose")


@pytest.mark.parametrize("space", ["", "world"])
def test_results_without_a_valid_frame_are_refused(space):
    given = gvhmr()
    given["smpl_params_global"]["transl"][:] = NAN
    with pytest.raises(FormatError, match="expected at least one valid frame, found none in 4 fr"):
        opened(torch_zip(given), space)
    assert present(opened(torch_zip(given), "camera")) == {0: [0, 1, 2, 3]}


def test_an_invalid_camera_loses_places_in_the_world_only():
    given = slahmr()
    count = given["trans"].shape[1]
    given["cam_t"][:, 1] = NAN
    world, camera = opened(npz(**given)), opened(npz(**given), "camera")
    every, camera_gap = [*range(count)], [0, *range(2, count)]
    assert all(frames == every for frames in present(world).values())
    assert present(camera) == dict.fromkeys(present(world), camera_gap)
    (note,) = notes(world)
    assert note.startswith("camera: held during 1 frame with invalid numbers (frame 1); first err")
    (view,) = world.views
    assert view.motion is not None
    assert_array_equal(view.motion.translations[1], view.motion.translations[0])


def test_an_invalid_point_is_not_visible():
    frames = [[person(seed=float(frame))] for frame in range(3)]
    frames[1][0]["pred_keypoints_3d"][7] = NAN
    frames[2][0]["pred_cam_t"] = np.full(3, NAN)
    capture = opened(joblib_file(frames))
    ((_, clip),) = next(iter(capture.parts())).points.values()
    assert present(capture) == {0: [0, 1]}
    assert np.flatnonzero(clip.points[1, :70, 3] == 0.0).tolist() == [7]
    assert np.isfinite(clip.points).all()
    assert [note.partition(":")[0] for note in notes(capture)] == [
        "1 frame with invalid numbers is a gap",
        "1 point with invalid numbers is not visible; first error",
    ]


BOUND = 64 << 20  # limit of allocated memory in bytes


def repeated(given: Any, times: int, name: str = "{}") -> bytes:
    """Return a dict with the same value under many keys."""
    pairs = b"".join(unicode(name.format(index)) + b"h\1" for index in range(times))
    return b"}(" + pairs + b"u"


def shared(given: Any, times: int, name: str = "{}", outer: int = 0) -> bytes:
    """Return a file of a dict of dicts that share their values."""
    first = value(given, lambda values: aligned_array(np.asarray(values))) + b"q\1" + b"0"
    body = first + repeated(given, times, name)
    if outer:
        body = body + b"q\1" + b"0" + repeated(given, outer, name)
    return finished(body)


def refused(data: bytes) -> str:
    source = Source("a.pkl", data)
    with pytest.raises(FormatError) as caught:
        if detect(source) == "video_mocap":
            open_results(source)
    assert caught.value.diagnostic is not None
    return caught.value.diagnostic.key


@pytest.mark.slow
def test_people_with_shared_frames_are_refused():
    one = {
        "pose_world": np.zeros((1000, 72), np.float32),
        "trans_world": np.zeros((1000, 3), np.float32),
        "betas": wham()[0]["betas"],
        "frame_ids": np.arange(1000),
    }
    one["betas"] = np.zeros((1000, 10), np.float32)
    data = shared(one, 3000)
    assert refused(data) == "F002.video-rows"
    assert cost(lambda: refused(data)) < BOUND


def test_nested_dicts_without_poses_are_refused():
    assert refused(shared({"a": 1}, 400, outer=400)) == "F002.unknown-archive"


@pytest.mark.slow
def test_pictures_with_the_same_people_are_refused():
    nobody = {key: 1 for key in person() if key != "pred_cam_t"}
    assert refused(shared(nobody, 2000, outer=2000)) == "F002.unknown-archive"


def test_frames_with_the_same_detections_are_refused():
    frame = next(iter(phalp(1).values()))
    frame = {key: value * 90 if isinstance(value, list) else value for key, value in frame.items()}
    frame["tracked_time"] = [1] * len(frame["tid"])
    data = shared(frame, 20, "{}.jpg")
    assert refused(data) == "F002.video-people"
