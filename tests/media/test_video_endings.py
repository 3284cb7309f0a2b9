"""Videos that are refused, aborted or too large for the disk, and leave no partial files."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from media.small_videos import counting, decoded, write

from viewer.errors import OutputError, UnsupportedFormatError, ViewerError
from viewer.media import video_kinds
from viewer.media.video import VideoSink
from viewer.media.video_kinds import video_kind

pytestmark = pytest.mark.slow
av = pytest.importorskip("av")
ROOT = Path(__file__).resolve().parents[2]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# Refusals


def test_missing_encoder_is_refused_in_one_line(tmp_path, monkeypatch):
    kind = video_kinds.VideoKind("MP4 video (H.264)", ("no_such", "nor_this"), False, True)
    monkeypatch.setitem(video_kinds.VIDEOS, ".mp4", kind)
    path = tmp_path / "x.mp4"
    with pytest.raises(ViewerError) as caught:
        VideoSink(path, (64, 48), 25.0)
    assert str(caught.value) == (
        f"{path}: the installed PyAV has no encoder for MP4 video (H.264): no_such or nor_this"
    )


def test_missing_library_is_refused_with_the_install_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ViewerError) as caught:
        VideoSink(tmp_path / "x.mp4", (64, 48), 25.0)
    assert str(caught.value) == ("videos need PyAV, which is not installed: pip install av")


@pytest.mark.parametrize(
    ("name", "rate", "quality", "words"),
    [
        ("x.mp4", 25.0, 101.0, "video quality: expected 0 to 100, found 101"),
        ("x.mp4", 0.0, 75.0, "x.mp4: expected 0.01 to 1000 frames per second, found 0"),
        ("x.gif", 60.0, 75.0, "x.gif: expected 0.01 to 50 frames per second, found 60"),
    ],
)
def test_invalid_settings_are_refused(tmp_path, name, rate, quality, words):
    with pytest.raises(ViewerError) as caught:
        VideoSink(tmp_path / name, (64, 48), rate, quality)
    assert str(caught.value).endswith(words)


def test_formats_are_listed_for_other_suffixes():
    with pytest.raises(UnsupportedFormatError) as caught:
        video_kind(Path("x.avi"))
    assert str(caught.value) == ('videos cannot be written as ".avi"; supported: .mp4, .webm, .gif')


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("missing/x.mp4", "does not exist"),
        ("folder.mp4", "is a folder"),
        ("pipe.mp4", "is not a regular file, and a video must be written to one"),
    ],
)
def test_unwritable_video_paths_are_refused_before_recording(tmp_path, name, words):
    (tmp_path / "folder.mp4").mkdir()
    os.mkfifo(tmp_path / "pipe.mp4")
    with pytest.raises(OutputError) as caught:
        VideoSink(tmp_path / name, (64, 48), 25.0)
    assert str(caught.value).endswith(words)


# Complete or no files


def test_video_appears_only_when_complete(tmp_path):
    path = tmp_path / "x.mp4"
    path.write_bytes(b"precious")
    path.chmod(0o640)
    sink = VideoSink(path, (64, 48), 25.0)
    for frame in range(6):
        sink.write(frame, counting(frame))
        assert path.read_bytes() == b"precious"
    sink.close()
    assert names(tmp_path) == ["x.mp4"] and len(decoded(path)) == 6
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


@pytest.mark.parametrize("n_frames", [0, 1, 30])
@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_aborted_video_leaves_no_file(tmp_path, suffix, n_frames):
    path = tmp_path / f"x{suffix}"
    path.write_bytes(b"precious")
    sink = VideoSink(path, (64, 48), 25.0)
    for frame in range(n_frames):
        sink.write(frame, counting(frame % 12))
    sink.abort()
    sink.abort()
    assert names(tmp_path) == [path.name] and path.read_bytes() == b"precious"


def test_abort_after_close_keeps_the_video(tmp_path):
    sink = VideoSink(tmp_path / "x.mp4", (64, 48), 25.0)
    write(sink, [counting(1)])
    sink.abort()
    assert len(decoded(tmp_path / "x.mp4")) == 1


def test_link_is_followed(tmp_path):
    (tmp_path / "real.gif").write_bytes(b"old")
    (tmp_path / "link.gif").symlink_to(tmp_path / "real.gif")
    write(VideoSink(tmp_path / "link.gif", (64, 48), 25.0), [counting(1)])
    assert (tmp_path / "link.gif").is_symlink() and len(decoded(tmp_path / "real.gif")) == 1


_FULL = """
import resource, sys
import numpy as np
from pathlib import Path
from viewer.errors import OutputError
from viewer.media.video import VideoSink

def write(path):
    sink = VideoSink(path, (320, 240), 25.0)
    try:
        for frame in range(20):
            sink.write(frame, np.roll(noise, frame, axis=1))
        sink.close()
    except OutputError as problem:
        sink.abort()
        print(problem)
    return sink.n_bytes

noise = np.random.default_rng(0).integers(0, 255, (240, 320, 4), dtype=np.uint8)
noise[..., 3] = 255
path = Path(sys.argv[1])
size = write(path)
path.write_bytes(b"precious")
# The sizes of two .mp4 files of the same frames may differ by some bytes.
last = size - (100 if path.suffix == ".mp4" else 1)
for limit in (0, 1000, size // 3, size - 40_000, size - 1000, last):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    write(path)
"""


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_full_disk_is_reported_in_one_line_and_leaves_no_file(tmp_path, suffix):
    """A limit on file sizes simulates a full disk."""
    path = tmp_path / f"x{suffix}"
    run = subprocess.run(
        [sys.executable, "-c", _FULL, str(path)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert run.stdout == f"{path}: File too large\n" * 6, run.stderr
    assert names(tmp_path) == [path.name] and path.read_bytes() == b"precious"
