"""Write errors of videos at every write and fill level: one line is printed and no file is left."""

import errno
import io
import os
import stat
import subprocess
import sys
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from media.small_videos import counting, decoded, write

from viewer.errors import OutputError, UnsupportedFormatError, ViewerError
from viewer.media import video_kinds
from viewer.media.video import VideoFile, VideoSink
from viewer.media.video_kinds import video_kind

pytestmark = pytest.mark.slow


pytest.importorskip("av")


ROOT = Path(__file__).resolve().parents[2]
SUFFIXES = [".mp4", ".webm", ".gif"]
SIZE = (96, 72)
FULL = "No space left on device"


def noisy_frames(n_frames: int, n_more: int = 0) -> list[np.ndarray]:
    """Return incompressible frames, followed by frames of one colour."""
    noise = np.random.default_rng(1).integers(0, 255, (n_frames, *SIZE[::-1], 4), dtype=np.uint8)
    noise[..., 3] = 255
    return [*noise, *[np.full((*SIZE[::-1], 4), 255, dtype=np.uint8)] * n_more]


def record(path: Path, frames: list[np.ndarray]) -> list[str]:
    """Write a video like the recorder, which still has queued frames after a failure."""
    sink, said = VideoSink(path, SIZE, 25.0), []
    for index, pixels in enumerate(frames):
        try:
            sink.write(index, pixels)
        except OutputError as problem:
            said.append(str(problem))
    if not said:
        try:
            sink.close()
        except OutputError as problem:
            said.append(str(problem))
    if said:
        sink.abort()
    return said


class Disk:
    """A raw file that is full from the n-th write on. Half of that write succeeds."""

    def __init__(self, number: int, is_kept: bool = True) -> None:
        self.calls, self.number, self.is_kept = 0, number, is_kept

    @property
    def has_struck(self) -> bool:
        return self.calls >= self.number

    def opened(self, path: Path) -> io.FileIO:
        disk = self

        class Raw(io.FileIO):
            def write(self, data):
                disk.calls += 1
                if disk.calls == disk.number and len(data) > 1:
                    return super().write(data[: len(data) // 2])
                if disk.has_struck and (disk.is_kept or disk.calls == disk.number + 1):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                return super().write(data)

        return Raw(path, "r+b")


@pytest.mark.parametrize("is_kept", [True, False], ids=["stays full", "has room again"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_failure_at_any_write_keeps_the_old_file(tmp_path, monkeypatch, suffix, is_kept):
    path = tmp_path / f"x{suffix}"
    n_frames = {".gif": 8, ".mp4": 16, ".webm": 24}[suffix]  # more if written in larger parts
    frames = noisy_frames(n_frames)
    path.write_bytes(b"precious")
    for number in count(1):
        disk = Disk(number, is_kept)
        with monkeypatch.context() as patch:
            original = Path.open

            def opened(self, mode="r", *rest, disk=disk, original=original, **settings):
                return (
                    disk.opened(self) if mode == "r+b" else original(self, mode, *rest, **settings)
                )

            patch.setattr(Path, "open", opened)
            said = record(path, frames)
        if not said:
            break
        # Every frame after the first error raises the same error.
        assert set(said) == {f"{path}: {FULL}"}
        assert [each.name for each in tmp_path.iterdir()] == [path.name]
        assert path.read_bytes() == b"precious"
    assert not disk.has_struck and number > 6
    assert path.read_bytes() != b"precious"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_failure_on_close_is_reported(tmp_path, monkeypatch, suffix):
    """Network drives report a full disk only on close."""
    path = tmp_path / f"x{suffix}"
    path.write_bytes(b"precious")

    class Raw(io.FileIO):
        def close(self):
            if not self.closed:
                super().close()
                raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))

    original = Path.open
    monkeypatch.setattr(
        Path,
        "open",
        lambda self, mode="r", *rest, **more: (
            Raw(self, mode) if mode == "r+b" else original(self, mode, *rest, **more)
        ),
    )
    assert record(path, noisy_frames(2)) == [f"{path}: {os.strerror(errno.EDQUOT)}"]
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == b"precious"


def test_video_file_reports_positions_like_a_file(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"")
    file = VideoFile(path)
    assert file.write(b"abcdef") == 6 and file.tell() == 6
    assert file.seek(2) == 2 and file.write(b"XY") == 2 and file.tell() == 4
    assert file.seek(1, io.SEEK_CUR) == 5 and file.seek(0, io.SEEK_END) == 6
    file.finish()
    assert path.read_bytes() == b"abXYef" and file.closed


_LEVELS = """
import sys
from pathlib import Path
from media.test_video_faults import noisy_frames, record

folder, suffix = Path(sys.argv[1]), sys.argv[2]
for level in range(17):
    (folder / "fill").write_bytes(bytes(4096 * level))
    said = record(folder / f"x{suffix}", noisy_frames(2, 20))
    left = sorted(path.name for path in folder.iterdir() if path.name != "fill")
    print(level, len(set(said)), said[0] if said else "", *left, sep="|")
    (folder / f"x{suffix}").unlink(missing_ok=True)
"""


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_disk_fill_level_results_in_one_message_or_a_video(tiny_disk, suffix):
    """The test runs in a separate process, because FFmpeg could crash with a segmentation fault."""
    folders = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    run = subprocess.run(
        [sys.executable, "-c", _LEVELS, str(tiny_disk), suffix],
        env={**os.environ, "PYTHONPATH": folders},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    rows = [line.split("|") for line in run.stdout.splitlines()]
    assert [int(row[0]) for row in rows] == list(range(17))
    refused = ["1", f"{tiny_disk / 'x'}{suffix}: {FULL}"]
    for row in rows:
        assert row[1:] in (refused, ["0", "", f"x{suffix}"])
    # The disk has 16 blocks; a full disk has no room for a video.
    assert rows[16][1:] == refused


av = pytest.importorskip("av")


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
    sink = VideoSink(path, (128, 96), 25.0)
    try:
        for frame in range(20):
            sink.write(frame, np.roll(noise, frame, axis=1))
        sink.close()
    except OutputError as problem:
        sink.abort()
        print(problem)
    return sink.n_bytes

noise = np.random.default_rng(0).integers(0, 255, (96, 128, 4), dtype=np.uint8)
noise[..., 3] = 255
path = Path(sys.argv[1])
size = write(path)
path.write_bytes(b"precious")
# The sizes of two .mp4 files of the same frames may differ by some bytes.
last = size - (100 if path.suffix == ".mp4" else 1)
for limit in (0, 1000, size // 3, 2 * size // 3, size - 1000, last):
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
