"""``viewer render --overlay`` and ``--video``: people drawn over the video of their camera."""

from pathlib import Path

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.tool_files import gvhmr
from media.small_videos import counting, write
from PIL import Image

from viewer.cli import run
from viewer.media.video import VideoSink

SIZE = (128, 72)
GREY = 60  # of frame 3, see counting


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """Return a person who stands in front of the camera in 4 frames, and the camera's video."""
    given = gvhmr()
    given["smpl_params_incam"]["body_pose"][:] = 0.0
    given["smpl_params_incam"]["global_orient"][:] = [np.pi, 0.0, 0.0]
    given["smpl_params_incam"]["transl"][:] = [0.0, 0.0, 6.0]
    (tmp_path / "a.pt").write_bytes(torch_zip(given))
    sink = VideoSink(tmp_path / "v.mp4", SIZE, 30.0)
    write(sink, [counting(frame, SIZE) for frame in range(4)])
    return str(tmp_path / "a.pt"), str(tmp_path / "v.mp4")


def drawn(tmp_path: Path, *options: str) -> np.ndarray:
    out = tmp_path / "out.png"
    quick = ("--quality", "draft", "--force", "--frame", "3", "--samples", "1", "-o", str(out))
    assert run(["render", *options, *quick]) == 0
    return np.array(Image.open(out).convert("RGB")).astype(int)


@pytest.mark.slow
def test_people_are_drawn_over_their_video(files: tuple[str, str], tmp_path: Path) -> None:
    pixels = drawn(tmp_path, files[0], "--overlay", files[1])
    assert pixels.shape == (SIZE[1], SIZE[0], 3)
    is_body = np.abs(pixels - GREY).max(axis=2) > 12
    # K projects x / z to 1000 x / z + 640 of 1280 pixels: the pelvis is in the middle, and a body
    # of 1.7 m, 6 m away, is 1000 * 1.7 / 6 / 10 = 28 pixels high. Nothing else is drawn.
    rows, columns = np.nonzero(is_body)
    assert abs(rows.max() - rows.min() - 28) <= 3
    assert abs((columns.max() + columns.min()) / 2 - SIZE[0] / 2) <= 2
    assert is_body[SIZE[1] // 2, SIZE[0] // 2]


@pytest.mark.slow
def test_a_video_implies_the_view_of_its_camera(files: tuple[str, str], tmp_path: Path) -> None:
    options = (files[0], "--space", "camera", "--video", files[1], "--no-grid", "--size", "128x72")
    pixels = drawn(tmp_path, *options)
    assert abs(pixels[2, 2] - 0.6 * GREY).max() <= 3  # dimmed to 60 %


@pytest.mark.slow
def test_a_video_without_its_view_is_reported(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn(tmp_path, files[0], "--video", files[1], "--azimuth", "30", "--size", "32x32")
    assert "--video: not drawn, because --azimuth asks for another view" in capsys.readouterr().err


@pytest.mark.parametrize("other", ["--video=v.mp4", "--view=1", "--images=a", "--distance=3"])
def test_options_that_contradict_an_overlay_are_refused(
    other: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["render", "a.pt", "--overlay", "v.mp4", other, "-o", str(tmp_path / "a.png")]
    assert run(command) == 2
    name = other.partition("=")[0]
    assert capsys.readouterr().err.endswith(
        f"--overlay and {name}: expected one of them, found both\n"
    )


def test_overlay_of_people_in_the_world_only_is_refused(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "world.pkl"
    path.write_bytes(joblib_file({"rotmat": np.tile(np.eye(3), (2, 24, 1, 1)),
                                  "trans": np.zeros((2, 3))}))  # fmt: skip
    out = str(tmp_path / "a.png")
    assert run(["render", str(path), "--overlay", files[1], "-o", out]) == 2
    assert "expected people in camera space, found them only in world" in capsys.readouterr().err


@pytest.mark.slow
def test_people_in_camera_space_only_get_an_assumed_camera(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "camera.pkl"
    turned = np.tile(np.diag([1.0, -1.0, -1.0]), (4, 1, 1, 1))
    poses = np.concatenate([turned, np.tile(np.eye(3), (4, 23, 1, 1))], axis=1)
    path.write_bytes(joblib_file({"rotmat": poses, "cam_t": np.tile([0.0, 0.0, 6.0], (4, 1))}))
    pixels = drawn(tmp_path, str(path), "--overlay", files[1])
    is_body = np.abs(pixels - GREY).max(axis=2) > 12
    # The focal length is the diagonal, 147 pixels: 147 * 1.7 / 6 = 42 pixels.
    rows = np.flatnonzero(is_body.any(axis=1))
    assert abs(np.ptp(rows) - 42) <= 3
    assert "a focal length of 147 pixels, the diagonal of 128 x 72, is assumed" in (
        capsys.readouterr().err
    )
