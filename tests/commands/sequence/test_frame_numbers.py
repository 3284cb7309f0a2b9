"""Frame numbers on the command line, which are consistent in render, convert and info."""

import json

import numpy as np
import pytest
from app.tiny import write_rig
from export.small_rigs import clip_text, write_twist
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

from viewer.cli import run
from viewer.commands._frames import Numbering, Range, numbering_of, parse_range
from viewer.errors import ViewerError
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor

pytestmark = pytest.mark.slow

LAYOUT = PointLayout("pair", ("nose", "neck"), np.zeros((0, 2)), np.zeros(2))


def capture(count: int, first: int = 0, rate: float = 30.0, start: float = 0.0) -> Actor:
    timing = Timing(rate, np.zeros(count, dtype=np.int32), first, start)
    clip = PointClip("points", timing, np.ones((1, 2, 4)))
    return Actor(Figure("points", points=LAYOUT), clip=clip)


def keyed(start: float, end: float) -> Actor:
    return Actor(Figure("points", points=LAYOUT), clip=Clip("walk", (), start, end))


# Ranges


def test_ranges_are_parsed():
    assert parse_range("3:") == Range(3, None) and parse_range(" :9:2") == Range(None, 9, 2)
    assert [str(parse_range(text)) for text in ("3:", ":9:2", "007:9", ":")] == [
        "3:", ":9:2", "7:9", ":",
    ]  # fmt: skip


# Numbers


def test_capture_frames_are_numbered_as_in_their_files():
    assert numbering_of([capture(30, 100, 25.0)]) == Numbering(100, 30, 0.0, 29 / 25, 25.0, False)


def test_longest_capture_determines_the_frame_count():
    actors = [capture(2, 7), capture(11, 100, start=1.0), keyed(0.5, 1.0)]
    assert numbering_of(actors) == Numbering(100, 41, 0.0, 1.0 + 1.0 / 3.0, 30.0, True)


def test_frames_at_other_rates_and_of_keyed_clips_are_numbered_from_0():
    assert numbering_of([capture(30, 100)], 60.0) == Numbering(0, 59, 0.0, 29 / 30, 60.0, False)
    assert numbering_of([keyed(1.0, 2.0)]) == Numbering(0, 31, 1.0, 2.0, 30.0, True)
    assert numbering_of([keyed(1.0, 2.0)], 10.0) == Numbering(0, 11, 1.0, 2.0, 10.0, True)
    assert numbering_of([Actor(Figure("points", points=LAYOUT))]).count == 1


HUNDRED = Numbering(100, 30, 0.0, 29 / 30, 30.0, False)


@pytest.mark.parametrize(
    ("text", "span"),
    [
        (":", (0, 30)),
        ("100:130", (0, 30)),
        ("110:", (10, 30)),
        (":105", (0, 5)),
        ("129:", (29, 30)),
    ],
)
def test_range_is_relative_to_the_first_frame(text, span):
    assert HUNDRED.span(parse_range(text)) == span
    assert HUNDRED.span(None) == (0, 30)


@pytest.mark.parametrize("text", ["0:10", "100:131", "130:", "130:140", ":50", "90:110"])
def test_range_outside_a_capture_is_refused_with_the_valid_range(text):
    with pytest.raises(ViewerError) as caught:
        HUNDRED.span(parse_range(text))
    assert str(caught.value) == (
        f"--frames: expected a range within 100:130 (frames 100 to 129), found {text}"
    )


def test_keyed_clips_extrapolate():
    clip = Numbering(0, 31, 0.0, 1.0, 30.0, True)
    assert clip.span(Range(29, 60)) == (29, 60) and clip.span(Range(50, 60)) == (50, 60)
    assert clip.time_of(300) == 10.0 and clip.checked_time(-7.0) == -7.0
    with pytest.raises(ViewerError) as caught:
        clip.span(Range(31, None))
    assert str(caught.value) == (
        "--frames: expected a range within 0:31 (frames 0 to 30), found 31:"
    )
    with pytest.raises(ViewerError) as caught:
        clip.time_of(-1)
    assert str(caught.value) == "--frame: expected 0 or more, found -1"


def test_capture_times_match_its_frames():
    assert HUNDRED.time_of(100) == 0.0 and HUNDRED.time_of(115) == 0.5
    # The printed value is accepted, although 0.966667 is slightly more than 29 / 30.
    assert HUNDRED.checked_time(0.966667) == 29 / 30 and HUNDRED.checked_time(0.4) == 0.4
    for time in (-0.02, 0.985):
        with pytest.raises(ViewerError) as caught:
            HUNDRED.checked_time(time)
        assert str(caught.value) == f"--time: expected 0 to 0.966667 seconds, found {time:g}"


# Commands


@pytest.fixture
def hundred(tmp_path):
    """A model, and frames 100 to 104 of a person who moves by 1 along y per frame."""
    np.savez(tmp_path / "SMPL.npz", **model("smpl", 32))
    straight = {"Rh": [[0.0, 0.0, 0.0]], "poses": [[0.0] * 72], "shapes": [[0.0] * 10]}
    frames = {100 + n: [body(0, Th=[[0.0, float(n), 0.0]], **straight)] for n in range(5)}
    folder = write_frames(tmp_path / "take" / "smpl", frames)
    model_path = str(tmp_path / "SMPL.npz")
    return [str(folder), "--model", model_path, "--up", "y", "--fps", "30"]


def root_height(folder, *arguments) -> float:
    out = folder / "one.npz"
    assert run(["convert", *map(str, arguments), "-o", str(out), "--force", "--as", "npz"]) == 0
    with np.load(out) as arrays:
        return float(arrays["joints"][0, 1])


def test_frame_number_matches_the_files(hundred, tmp_path):
    first = root_height(tmp_path, *hundred, "--frame", "100")
    for frame in (101, 104):
        height = root_height(tmp_path, *hundred, "--frame", frame)
        assert_allclose(height - first, frame - 100, atol=1e-9)


def test_render_and_convert_number_frames_equally(hundred, tmp_path):
    names = [f"{frame}" for frame in (101, 102, 103)]
    options = [*hundred, "--frames", "101:104"]
    size = ["--size", "16x16", "--quality", "draft"]
    assert run(["render", *options, *size, "-o", str(tmp_path / "{frame}.png")]) == 0
    assert sorted(path.stem for path in tmp_path.glob("*.png")) == names
    assert run(["convert", *options, "-o", str(tmp_path / "{frame}.obj")]) == 0
    assert sorted(path.stem for path in tmp_path.glob("*.obj")) == names
    assert run(["convert", *options, "-o", str(tmp_path / "m.npz"), "--as", "npz"]) == 0
    with np.load(tmp_path / "m.npz") as arrays:
        assert arrays["frames"].tolist() == [101, 102, 103]
        assert_allclose(np.diff(arrays["joints"][:, 0, 1]), 1.0, atol=1e-9)
    # The mesh at a frame number is that of the file with this number.
    found = {}
    for frame in (101, 103):
        out = tmp_path / f"one{frame}.obj"
        assert run(["convert", *hundred, "--frame", str(frame), "-o", str(out)]) == 0
        found[frame] = out.read_text()
    for frame, text in found.items():
        assert text == (tmp_path / f"{frame}.obj").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--frame", "0"], "--frame: expected 100 to 104, found 0"),
        (["--frame", "105"], "--frame: expected 100 to 104, found 105"),
        (["--time", "0.2"], "--time: expected 0 to 0.133333 seconds, found 0.2"),
        (["--time", "-1"], "--time: expected 0 to 0.133333 seconds, found -1"),
    ],
)
@pytest.mark.parametrize("command", ["info", "render", "convert"])
def test_times_beyond_the_end_of_a_capture_are_refused(
    hundred, tmp_path, capsys, command, options, message
):
    out = {"info": [], "render": ["-o", str(tmp_path / "x.png")], "convert": ["-o", "x.obj"]}
    assert run([command, *hundred, *options, *out[command]]) == 2
    assert capsys.readouterr().err == f"viewer: {message}\n"


@pytest.mark.parametrize("command", ["render", "convert"])
def test_range_beyond_a_capture_quotes_the_request(hundred, tmp_path, capsys, command):
    name = {"render": "{frame}.png", "convert": "w.bvh"}[command]
    assert run([command, *hundred, "--frames", "103:160", "-o", str(tmp_path / name)]) == 2
    assert capsys.readouterr().err == (
        "viewer: --frames: expected a range within 100:105 (frames 100 to 104), found 103:160\n"
    )


def test_range_beyond_a_clip_quotes_the_request(tmp_path, capsys):
    skel, skin = write_rig(tmp_path)
    (tmp_path / "move.anim").write_text(clip_text())  # the clip has two seconds
    files = [str(path) for path in (skel, skin, tmp_path / "move.anim")]
    for command, name in (("render", "{frame}.png"), ("convert", "w.bvh")):
        assert run([command, *files, "--frames", "61:", "-o", str(tmp_path / name)]) == 2
        assert capsys.readouterr().err == (
            "viewer: --frames: expected a range within 0:61 (frames 0 to 60), found 61:\n"
        )


@pytest.mark.parametrize("text", ["0", "-3", "1e9", "100001", "1e-9"])
def test_frame_rates_have_limits(tmp_path, capsys, text):
    files = write_twist(tmp_path)
    assert run(["info", *files, f"--fps={text}"]) == 2
    assert capsys.readouterr().err == (
        f"viewer: argument --fps: expected 0.001 to 100,000 frames per second, found {text} "
        "(viewer info --help lists the options)\n"
    )


def test_highest_rate_is_used(tmp_path, capsys):
    files = write_twist(tmp_path)
    (tmp_path / "move.anim").write_text(clip_text())
    options = ["--fps", "1e5", "--frame", "50000", "--json"]
    assert run(["info", *files, str(tmp_path / "move.anim"), *options]) == 0
    table = json.loads(capsys.readouterr().out)["actors"][0]["skeleton"]["dof_table"]
    assert_allclose(table[0]["value"], 1.0, atol=1e-9)  # the step is half a second at 2 fps
