"""``viewer render`` of motions as videos with all frames at their rate and one camera."""

import signal
import sys
import time

import numpy as np
import pytest
from commands.drawn_motions import anim_text, frames, names, picture
from forked_programs import VIEWER
from PIL import Image

import viewer

pytestmark = pytest.mark.slow
av = pytest.importorskip("av")


@pytest.fixture
def fox(tmp_path) -> list[str]:
    """The files of the bundled fox, and a clip of half a second that rotates its head."""
    from viewer.loading import bundled_files

    channels = 3 + 3 * viewer.load().actors[0].figure.skeleton.n_joints
    clip = tmp_path / "fox.anim"
    clip.write_text(anim_text(0.5, channels, {2: (0.0, 0.3), 4: (0.0, 0.6)}))
    return [*map(str, bundled_files()), str(clip)]


def n_frames(path) -> int:
    with Image.open(path) as animation:
        return animation.n_frames


# Videos


def test_videos_show_the_whole_clip(draw, fox, tmp_path):
    draw(fox, "{frame}.png")
    for suffix in (".mp4", ".webm", ".gif"):
        path = tmp_path / f"head{suffix}"
        said = draw(fox, path.name)
        wanted = f"{path}: 16 frames, 0.533 s, 64 x 48, 30 frames per second, "
        assert said.out.startswith(wanted) and said.out.endswith(" MB\n")
        shown = frames(path)
        assert len(shown) == 16 and shown[0].shape == (48, 64, 3)
        for frame in (0, 8, 15):
            difference = np.abs(shown[frame] - picture(tmp_path / f"{frame}.png")[..., :3])
            # The colours have half the resolution, or there are only 256.
            assert difference.mean() < 4.0, (suffix, frame)
        assert np.abs(shown[0] - shown[15]).mean() > 1.0


@pytest.mark.parametrize(
    ("options", "count", "rate"),
    [
        (["--fps", "10"], 11, 10),
        (["--frames", "10:20"], 10, 30),
        (["--frames", "0:20:4"], 5, 7.5),
        (["--frames", "0:20:4", "--fps", "30"], 5, 30),
        (["--frames", "0:20:4", "--speed", "0.5"], 10, 7.5),
        (["--frames", ":20:4", "--turntable", "2"], 15, 7.5),
        (["--speed", "0.5"], 61, 30),
        (["--speed", "2"], 16, 30),
        (["--speed", "-1", "--frames", "0:10"], 10, 30),
        (["--turntable"], 31, 30),
        (["--turntable", "2"], 60, 30),
        (["--turntable", "1", "--fps", "12.5"], 12, 12.5),
    ],
)
def test_video_has_the_requested_number_of_frames(draw, walk, tmp_path, options, count, rate):
    draw(walk, "x.mp4", *options, size="32x32")
    with av.open(str(tmp_path / "x.mp4")) as container:
        assert float(container.streams.video[0].average_rate) == rate
    assert len(frames(tmp_path / "x.mp4")) == count


def test_video_that_skips_frames_keeps_the_speed(draw, walk):
    said = draw(walk, "x.mp4", "--frames", "0:30:3", size="32x32")
    wanted = "10 frames, 1 s, 32 x 32, 10 frames per second (one of 3 frames, at the motion's own "
    assert f"{wanted}speed; --fps sets it), " in said.out and said.err == ""
    said = draw(walk, "y.mp4", "--frames", "0:30:3", "--fps", "30", size="32x32")
    assert "10 frames, 0.333 s, 32 x 32, 30 frames per second, " in said.out
    said = draw(walk, "z.gif", "--frames", "0:31:3", size="32x32")
    assert "11 frames, 1.1 s, 32 x 32, 10 frames per second (one of 3 frames" in said.out
    said = draw(walk, "{frame}.png", "--frames", "0:31:3", size="16x16")
    assert "one of" not in said.out  # images have no speed


def test_speed_below_0_plays_backwards(draw, walk, tmp_path):
    draw(walk, "there.mp4", "--frames", "0:20", "--video-quality", "95")
    draw(walk, "back.mp4", "--frames", "0:20", "--video-quality", "95", "--speed", "-1")
    there, back = frames(tmp_path / "there.mp4"), frames(tmp_path / "back.mp4")
    assert np.abs(there[0] - back[-1]).mean() < 2.0 and np.abs(there[-1] - back[0]).mean() < 2.0
    assert np.abs(there[0] - back[0]).mean() > 4.0


def test_turntable_loops_and_needs_no_motion(draw, tmp_path):
    draw([], "x.mp4", "--turntable", "1", "--no-grid", "--video-quality", "95")
    shown = frames(tmp_path / "x.mp4")
    assert len(shown) == 30
    steps = [np.abs(a - b).mean() for a, b in zip(shown, [*shown[1:], shown[0]], strict=True)]
    # The step from the last frame to the first is like the others, and no step is zero.
    assert min(steps) > 0.3 * max(steps)


def test_turntable_of_one_frame_of_a_motion_is_drawn(draw, walk, tmp_path):
    draw(walk, "x.mp4", "--turntable", "0.2", "--frame", "15", "--no-grid")
    draw(walk, "x.png", "--frame", "15", "--no-grid")
    assert len(frames(tmp_path / "x.mp4")) == 6


def test_gif_of_a_static_scene_is_a_single_image(draw, walk, tmp_path):
    draw(walk[:2], "still.gif")
    draw(walk, "frame.gif", "--frame", "3")
    draw(walk, "moving.gif", size="32x32")
    found = [n_frames(tmp_path / f"{name}.gif") for name in ("still", "frame", "moving")]
    assert found == [1, 1, 31]


def test_gif_at_a_high_rate_reports_its_effective_rate(draw, walk, tmp_path):
    said = draw(walk, "x.gif", "--fps", "100", size="32x32")
    assert said.err == ("warning: GIFs show at most 50 frames per second: drawn at 50, not 100\n")
    assert "51 frames, 1.02 s" in said.out and n_frames(tmp_path / "x.gif") == 51


def test_videos_may_have_a_transparent_background(draw, walk, tmp_path):
    said = draw(walk, "x.mp4", "--background", "transparent", "--no-grid")
    shown = f"{tmp_path / 'x.mp4'}: this format has no transparency; composited on black"
    assert said.err == f"warning: {shown}\n"
    assert frames(tmp_path / "x.mp4")[0][0, 0].max() <= 3
    said = draw(walk, "x.webm", "--background", "transparent", "--no-grid")
    assert said.err == ""
    with av.open(str(tmp_path / "x.webm")) as container:
        assert container.streams.video[0].metadata["alpha_mode"] == "1"
    draw(walk, "x.gif", "--background", "transparent", "--no-grid")
    with Image.open(tmp_path / "x.gif") as shown:
        alpha = np.array(shown.convert("RGBA"))[..., 3]
    assert alpha[0, 0] == 0 and alpha.max() == 255


def test_missing_library_is_reported_in_one_line(draw, walk, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    said = draw(walk, "x.mp4", code=2)
    assert said.err == ("viewer: videos need PyAV, which is not installed: pip install av\n")
    draw(walk, "{frame}.png", "--frames", "0:2", size="16x16")  # images do not need the library


@pytest.mark.parametrize("name", ["x.mp4", "x.gif", "x.webm"])
def test_existing_video_is_replaced_only_with_force(draw, walk, tmp_path, name):
    (tmp_path / name).write_bytes(b"precious")
    draw(walk, name, size="16x16", code=5)
    assert (tmp_path / name).read_bytes() == b"precious"
    draw(walk, name, "--force", size="16x16")
    assert len(frames(tmp_path / name)) == 31


@pytest.fixture
def start(forker, walk, tmp_path):
    """Return a function that starts a program that draws 6000 frames."""
    options = ["--turntable", "200", "--size", "320x240", "--force"]
    return lambda name: forker.start(
        VIEWER, ["render", *walk, "-o", tmp_path / name, *options], tmp_path
    )


def wait_for(condition) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("name", "number", "code", "word"),
    [
        ("x.mp4", signal.SIGINT, 130, b"interrupted"),
        ("x.webm", signal.SIGTERM, 143, b"terminated"),
        ("x.gif", signal.SIGINT, 130, b"interrupted"),
    ],
)
def test_interrupted_video_leaves_no_file(start, tmp_path, name, number, code, word):
    (tmp_path / name).write_bytes(b"precious")
    process = start(name)
    suffix = name[1:]
    wait_for(lambda: len(names(tmp_path, suffix)) > 1)  # the temporary file exists
    time.sleep(0.1)
    process.send_signal(number)
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error.splitlines()[-1]) == (code, b"viewer: " + word)
    assert names(tmp_path, suffix) == [name] and (tmp_path / name).read_bytes() == b"precious"


def test_interrupted_sequence_leaves_complete_images(start, tmp_path):
    process = start("{frame:04}.png")
    wait_for(lambda: (tmp_path / "0005.png").exists())
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    found = names(tmp_path, ".png")
    said = (
        f"warning: {len(found)} of 6000 pictures were written, and are kept\nviewer: interrupted\n"
    )
    assert (process.returncode, error.decode()) == (130, said)
    assert found == [f"{frame:04}.png" for frame in range(len(found))]
    assert all(picture(tmp_path / name).shape == (240, 320, 4) for name in found)
