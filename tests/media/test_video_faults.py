"""Write errors of videos at every write and fill level: one line is printed and no file is left."""

import errno
import io
import os
import subprocess
import sys
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from viewer.errors import OutputError
from viewer.media.video import VideoFile, VideoSink

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
    frames = noisy_frames(
        12 if suffix == ".gif" else 24
    )  # the other kinds are written in larger parts
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
from test_video_faults import noisy_frames, record

folder, suffix = Path(sys.argv[1]), sys.argv[2]
for level in range(17):
    (folder / "fill").write_bytes(bytes(4096 * level))
    said = record(folder / f"x{suffix}", noisy_frames(2, 60))
    left = sorted(path.name for path in folder.iterdir() if path.name != "fill")
    print(level, len(set(said)), said[0] if said else "", *left, sep="|")
    (folder / f"x{suffix}").unlink(missing_ok=True)
"""


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_disk_fill_level_results_in_one_message_or_a_video(tiny_disk, suffix):
    """The test runs in a separate process, because FFmpeg could crash with a segmentation fault."""
    folders = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "media")])
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
