"""Videos and folders of images for the cameras of captures: camera, rate, size, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from formats.capture_files import body, write_frames
from formats.filmed_capture import SIDE, write_filmed
from media.small_videos import counting, write
from PIL import Image

from viewer.errors import FormatError, RigError
from viewer.loading import MotionSettings, load
from viewer.loading.driving import filmed
from viewer.media.video import VideoSink
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.capture import Capture

SIZE = (64, 48)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("video") / "film.mp4"
    write(VideoSink(path, SIZE, 25.0), [counting(n) for n in range(10)])
    return path


def view(name: str, size=None) -> CameraView:
    return CameraView(name, np.diag([50.0, 50.0, 1.0]), np.eye(3), np.zeros(3), size)


def capture(**changes) -> Capture:
    return replace(Capture("take", 8, 0, lambda: iter(())), **changes)


def grey(image) -> int:
    return round(float(image.pixels[..., :3].mean()) / 20.0)


def test_single_camera_gets_the_video_and_its_size(video):
    views, images, notes = filmed(capture(), [view("01")], MotionSettings(video=video), 25.0)
    assert views[0].size == SIZE and notes == []
    assert images.cameras == ("01",) and images.size_of("01") == SIZE
    assert [grey(images.at("01", n / 25.0)) for n in (0, 5, 3)] == [0, 5, 3]
    assert images.at("01", 3 / 25.0) is images.at("01", 3 / 25.0)
    assert images.at("02", 0.0) is None and images.notes_of("01") == []


def test_frames_of_the_capture_have_the_numbers_of_the_video(video):
    views, images, _ = filmed(
        capture(first_frame=4, n_frames=9),
        [view("01", (640, 480))],
        MotionSettings(video=video),
        25.0,
    )
    assert views[0].size == (640, 480)
    assert grey(images.at("01", 2 / 25.0)) == 6
    assert images.at("01", 7 / 25.0) is None  # frame 11 of 10
    (note,) = images.notes_of("01")
    assert "the video ends at 0.40 s, the capture at 0.52 s" in note


def test_camera_with_the_name_of_the_video_gets_it(video):
    settings = MotionSettings(video=video)
    views, images, _ = filmed(capture(), [view("01"), view("film")], settings, 25.0)
    assert images.cameras == ("film",) and [each.size for each in views] == [None, SIZE]
    with pytest.raises(RigError) as found:
        filmed(capture(), [view("01"), view("02")], settings, 25.0)
    assert found.value.cause.key == "F001.video-cameras"


def test_people_in_camera_space_get_a_camera_with_the_size_of_the_video(video):
    settings = MotionSettings(video=video)
    views, images, notes = filmed(capture(is_in_camera=True), [], settings, 25.0)
    assert views[0].size == SIZE and images.cameras == (views[0].name,)
    # By 3-4-5, the diagonal of 64 x 48 is 80; the principal point is the centre.
    np.testing.assert_allclose(views[0].intrinsic, [[80, 0, 32], [0, 80, 24], [0, 0, 1]])
    assert [note.key for note in notes] == ["F007.assumed-camera"]
    with pytest.raises(RigError) as found:
        filmed(capture(space="world"), [], settings, 25.0)
    assert found.value.cause.key == "F001.video-camera"


def test_different_frame_rate_is_reported_and_frames_matched_by_time(video):
    _, images, notes = filmed(capture(), [view("01")], MotionSettings(video=video), 50.0)
    assert [note.key for note in notes] == ["F007.video-rate"]
    assert grey(images.at("01", 6 / 50.0)) == 3


def test_capture_without_a_rate_has_that_of_the_video(tmp_path, video):
    take = write_filmed(tmp_path / "take")
    scene = load(take, motion=MotionSettings(video=video))
    assert scene.actors[0].clip.timing.frame_rate == 25.0
    assert video in scene.files
    scene = load(take, motion=MotionSettings(video=video, frame_rate=50.0))
    assert scene.actors[0].clip.timing.frame_rate == 50.0


@pytest.mark.parametrize(("rate", "keys"), [(None, ["F007.no-rate"]), (25.0, [])])
def test_assumed_frame_rate_is_reported_once(tmp_path, rate, keys):
    write_frames(tmp_path / "take" / "smpl", {n: [body(0), body(1)] for n in range(3)})
    scene = load(tmp_path / "take", motion=MotionSettings(frame_rate=rate))
    assert scene.actors[0].clip.timing.frame_rate == (rate or 30.0)
    found = [note for note in scene.diagnostics if note.key.endswith("no-rate")]
    assert [note.key for note in found] == keys
    assert all("--fps" in str(note) for note in found)


def test_single_frame_needs_no_frame_rate(tmp_path):
    write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    keys = [note.key for note in load(tmp_path / "take").diagnostics]
    assert "F007.no-rate" not in keys


@pytest.mark.parametrize("option", ["video", "images"])
def test_footage_of_several_captures_is_refused(tmp_path, video, option):
    takes = [write_filmed(tmp_path / name) for name in ("a", "b")]
    (tmp_path / "flat" / "01").mkdir(parents=True)
    given = MotionSettings(**{option: video if option == "video" else tmp_path / "flat"})
    with pytest.raises(RigError, match=f"expected one capture with --{option}, found 2") as found:
        load(*takes, motion=given)
    assert found.value.cause.key == "F001.several-captures"


def test_folder_of_images_numbered_from_1_is_assigned_to_the_only_camera(tmp_path):
    take = write_filmed(tmp_path / "take")
    for number in (1, 2, 3):
        pixels = np.full((SIDE, SIDE, 3), 50 * number, dtype=np.uint8)
        (tmp_path / "flat").mkdir(exist_ok=True)
        Image.fromarray(pixels).save(tmp_path / "flat" / f"img_{number:04}.png")
    scene = load(take, motion=MotionSettings(images=tmp_path / "flat"))
    found = [scene.images.at("01", n / 30).pixels[0, 0, 0] for n in range(3)]
    assert found == [50, 100, 150]


def test_images_of_people_in_camera_space_need_no_calibration(tmp_path):
    (tmp_path / "flat").mkdir()
    Image.new("RGB", (30, 40)).save(tmp_path / "flat" / "000000.png")
    settings = MotionSettings(images=tmp_path / "flat")
    views, images, _ = filmed(capture(is_in_camera=True), [], settings, 25.0)
    assert views[0].size == (30, 40) and images.at("video", 0.0) is not None
    assert views[0].intrinsic[0, 0] == 50.0


def test_text_file_is_refused_as_a_video(tmp_path):
    write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    (tmp_path / "a.mp4").write_text("no video")
    with pytest.raises(FormatError):
        load(tmp_path / "take", motion=MotionSettings(video=tmp_path / "a.mp4"))
