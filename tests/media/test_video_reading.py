"""Frames of a video by time: sequential, in any order, rotated, outside the video, and damaged."""

import numpy as np
import pytest
from media.small_videos import write
from PIL import Image

from viewer.errors import FormatError
from viewer.media import video_reading
from viewer.media.video import VideoSink
from viewer.media.video_reading import VideoFrames

pytest.importorskip("av")

RATE, COUNT, SIZE = 25.0, 60, (64, 48)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A video in which the grey value of a frame is four times its number."""
    path = tmp_path_factory.mktemp("video") / "video.mp4"
    frames = [np.full((SIZE[1], SIZE[0], 4), 4 * n, dtype=np.uint8) for n in range(COUNT)]
    write(VideoSink(path, SIZE, RATE), frames)
    return path


def number(pixels) -> int:
    """Return the number of a frame; colours have errors below 2."""
    assert pixels.shape == (SIZE[1], SIZE[0], 4) and pixels.dtype == np.uint8
    return round(float(pixels[..., :3].mean()) / 4.0)


def test_properties_are_known_without_decoding(path):
    video = VideoFrames(path)
    assert (video.size, video.rate, video.n_frames) == (SIZE, RATE, COUNT)


@pytest.mark.parametrize("keeps_all", [True, False])
def test_frames_are_exact_in_any_order(path, keeps_all, monkeypatch):
    if not keeps_all:  # every step back is a seek
        monkeypatch.setattr(video_reading, "_BYTES", 0)
        monkeypatch.setattr(video_reading, "_AHEAD", 0.2)
    video = VideoFrames(path)
    order = [0, 1, 2, 3, 3, 10, 9, 8, 59, 0, 40, 41, 39, 58, 59, 12]
    assert [number(video.at(n / RATE)) for n in order] == order


def test_number_of_cached_frames_is_bounded(path, monkeypatch):
    monkeypatch.setattr(video_reading, "_BYTES", 10 * 2 * SIZE[0] * SIZE[1])
    video = VideoFrames(path)
    for n in range(COUNT):
        video.at(n / RATE)
    assert len(video._kept) == 10


def test_the_nearest_frame_is_shown_between_frames(path):
    video = VideoFrames(path)
    assert [number(video.at(n / RATE)) for n in (6.4, 6.6, 6.49, 7.4)] == [6, 7, 6, 7]


def test_no_frame_is_before_the_first_or_after_the_last(path):
    video = VideoFrames(path)
    assert video.at(-1.0 / RATE) is None
    assert video.at(COUNT / RATE) is None
    assert number(video.at((COUNT - 1) / RATE)) == COUNT - 1
    assert number(video.at(0.0)) == 0


def test_rotated_recordings_are_shown_upright(tmp_path):
    # The upper half is white; then the header is changed to a rotation by 90 degrees.
    pixels = np.zeros((SIZE[1], SIZE[0], 4), dtype=np.uint8)
    pixels[: SIZE[1] // 2] = 255
    path = tmp_path / "turned.mp4"
    write(VideoSink(path, SIZE, RATE), [pixels] * 3)
    data = path.read_bytes()
    # ISO 14496-12, tkhd: x' = a x + c y, y' = b x + d y with rows (a, b, u), (c, d, v), (x, y, w).
    one, minus = b"\x00\x01\x00\x00", b"\xff\xff\x00\x00"
    zero, w = bytes(4), b"\x40\x00\x00\x00"
    plain = one + zero + zero + zero + one + zero + zero + zero + w
    clockwise = zero + one + zero + minus + zero + zero + zero + zero + w
    place = data.index(b"tkhd")
    place = data.index(plain, place)
    path.write_bytes(data[:place] + clockwise + data[place + len(plain) :])
    video = VideoFrames(path)
    assert video.size == (SIZE[1], SIZE[0])
    found = video.at(0.0)
    # After a clockwise rotation, the upper half is at the right.
    assert found[:, -8:, :3].min() > 240 and found[:, :8, :3].max() < 15


@pytest.mark.parametrize("data", [b"", b"no video at all", b"\x00\x00\x00\x18ftypmp42" + bytes(64)])
def test_files_of_other_kinds_are_refused(tmp_path, data):
    path = tmp_path / "a.mp4"
    path.write_bytes(data)
    with pytest.raises(FormatError) as found:
        VideoFrames(path)
    assert found.value.diagnostic.key in ("F002.video", "F002.video-stream")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
def test_pictures_are_refused_as_videos(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    Image.new("RGB", (8, 6)).save(path)
    with pytest.raises(FormatError) as found:
        VideoFrames(path)
    assert found.value.diagnostic.key == "F002.video-picture"


def test_missing_files_are_refused_with_the_reason(tmp_path):
    with pytest.raises(FormatError) as found:
        VideoFrames(tmp_path / "none.mp4")
    assert found.value.diagnostic.key == "F001.video"
