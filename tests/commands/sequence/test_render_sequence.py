"""``viewer render`` of motions as numbered images, videos and contact sheets."""

import json
from pathlib import Path

import numpy as np
import pytest
from app.tiny import write_rig
from commands.drawn_motions import anim_text, frames, names, picture
from exporters.small_rigs import clip_text, write_twist
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.commands._frames import Numbering, Range, numbering_of, parse_range
from viewer.commands._sequence import Turntable, parse_turntable
from viewer.errors import OutputError, ViewerError
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, pose_actors

pytestmark = pytest.mark.slow
av = pytest.importorskip("av")
NOTHING_MOVES = "nothing moves: no file has a motion (--turntable rotates the camera)"


def single(files, seconds, camera, box, size=(64, 48), **options) -> np.ndarray:
    """Return the image at one time, rendered without the code of the command."""
    from viewer.rendering.offscreen import Offscreen

    scene = viewer.load(*files)
    for actor in scene.actors:
        pose_actors([actor], seconds)
    with Offscreen() as offscreen:
        shown = viewer.DisplayOptions(**options)
        return offscreen.render(scene, size, camera, shown, box).astype(int)


# Numbered images


def test_numbered_images_match_the_frames(draw, walk, tmp_path):
    said = draw(walk, "f_{frame:03}.png", "--frames", "0:31:15", "--no-grid", "--follow", "root")
    assert said.out.startswith(f"{tmp_path / 'f_000.png'} to f_030.png: 3 frames, 0.1 s, 64 x 48")
    assert said.err == "" and names(tmp_path, ".png") == ["f_000.png", "f_015.png", "f_030.png"]
    # The camera follows the root, so only the arm and the background appear to move.
    first, last = picture(tmp_path / "f_000.png"), picture(tmp_path / "f_030.png")
    assert (first != last).any()
    np.testing.assert_allclose(first[40:], last[40:], atol=60)


def test_pictures_before_a_failed_one_are_kept_and_counted(walk, tmp_path, capsys, monkeypatch):
    from viewer.media import picture_sinks

    save = picture_sinks.save_image

    def fill(path, pixels):
        if path.name == "f_004.png":
            raise OutputError(f"{path}: No space left on device")
        return save(path, pixels)

    monkeypatch.setattr(picture_sinks, "save_image", fill)
    monkeypatch.setattr(picture_sinks, "_MOST_WORKERS", 1)
    files = [*map(str, walk), "-o", str(tmp_path / "f_{frame:03}.png")]
    assert run(["render", *files, "--frames", "0:9", "--size", "32x32", "--quality", "draft"]) == 5
    err = capsys.readouterr().err.splitlines()
    count = len(names(tmp_path, ".png"))
    assert 4 <= count < 9 and f"{count} of 9 pictures were written, and are kept" in err[-2]
    assert err[-1] == f"viewer: {tmp_path / 'f_004.png'}: No space left on device"


def test_sequence_equals_single_frames(draw, walk, tmp_path):
    """At a given distance only the target is fitted, to the middle of all frames."""
    options = ("--distance", "30", "--no-grid", "--background", "transparent")
    axis = ("--front", "+z")  # like a camera that is independent of the figures
    draw(walk, "{frame}.png", "--frames", "0:31", *axis, *options)
    assert len(names(tmp_path, ".png")) == 31
    scene = viewer.load(*walk)
    clouds = []
    for frame in range(31):
        pose_actors([scene.actors[0]], frame / 30)
        clouds.append(viewer.deform(scene.actors[0].figure, scene.actors[0].pose)[0])
    cloud = np.concatenate(clouds)
    box = np.array([cloud.min(axis=0), cloud.max(axis=0)])
    camera = viewer.Camera(box.mean(axis=0), 30.0)
    for frame in (0, 7, 30):
        wanted = single(walk, frame / 30, camera, box, grid=False, background="transparent")
        assert (picture(tmp_path / f"{frame}.png") == wanted).all(), frame


def test_whole_motion_is_in_frame(draw, walk, tmp_path):
    draw(walk, "{frame}.png", "--no-grid", "--background", "transparent", size="128x72")
    assert len(names(tmp_path, ".png")) == 31
    drawn = sum(picture(tmp_path / f"{frame}.png")[..., 3] for frame in range(31)) > 0
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    room = columns[0], 127 - columns[-1], rows[0], 71 - rows[-1]
    # The motion is not clipped, and the smallest margin is at most 8 %.
    assert 1 <= min(room) <= 6


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        (["--frames", "2:5"], [2, 3, 4]),
        (["--frames", ":3"], [0, 1, 2]),
        (["--frames", "28:"], [28, 29, 30]),
        (["--frames", "5:30:10"], [5, 15, 25]),
        (["--frames", "0:3", "--fps", "2"], [0, 1, 2]),
        (["--fps", "2"], [0, 1, 2]),
        (["--turntable", "0.1"], [0, 1, 2]),
        (["--turntable", "90deg", "--frames", "4:6"], [4, 5]),
    ],
)
def test_frames_are_numbered_from_0_at_the_given_fps(draw, walk, tmp_path, options, wanted):
    draw(walk, "{frame}.png", *options, size="16x16")
    assert names(tmp_path, ".png") == sorted(f"{frame}.png" for frame in wanted)


def test_frames_beyond_the_end_are_drawn_with_a_note(draw, walk, tmp_path):
    said = draw(walk, "{frame}.png", "--frames", "29:33", size="16x16")
    assert said.err == "warning: --frames: frames 31 to 32 are beyond the end of the motion\n"
    assert len(names(tmp_path, ".png")) == 4


def test_doubled_braces_are_literal_braces(draw, walk, tmp_path):
    draw(walk, "{{x}}_{frame:02d}.png", "--frames", "0:2", size="16x16")
    assert names(tmp_path, ".png") == ["{x}_00.png", "{x}_01.png"]


@pytest.mark.parametrize(
    "name",
    [
        "x.png",
        "x_{frme}.png",
        "x_{frame.real}.png",
        "x_{frame!r}.png",
        "x_{frame:x}.png",
        "{frame:999}.png",
        "{frame}{.png",
        "{frame}_{0}.png",
        "x_{frame:05.png",
    ],
)
def test_invalid_names_are_refused_before_any_work(draw, tmp_path, name):
    said = draw(["missing.skel"], name, "--frames", "0:2", code=2)
    assert said.err == (
        "viewer: --output: expected {frame} or {frame:05} in the name of numbered images, as in "
        f'frame_{{frame:05}}.png, found "{tmp_path / name}"\n'
    )


@pytest.mark.parametrize("text", ["5", "5:2", "5:5", "-1:3", "a:b", "0:5:0", "1:2:3:4", "", "٣:٤"])
def test_invalid_ranges_are_refused_in_one_line(draw, walk, text):
    said = draw(walk, "{frame}.png", f"--frames={text}", code=2)
    assert said.err == (
        f'viewer: --frames: expected A:B or A:B:STEP with A below B, as in 0:100, found "{text}"\n'
    )


def test_range_starting_beyond_the_end_reports_the_frame_count(draw, walk):
    said = draw(walk, "{frame}.png", "--frames", "31:", code=2)
    assert said.err == (
        "viewer: --frames: expected a range within 0:31 (frames 0 to 30), found 31:\n"
    )


def test_turntables_are_parsed():
    assert parse_turntable("2.5") == Turntable(360.0, 2.5) == parse_turntable("2.5s")
    assert parse_turntable("-45deg") == Turntable(-45.0, None)


@pytest.mark.parametrize("text", ["0", "-3", "0deg", "nan", "fox.skel", "1e9", "99999deg"])
def test_invalid_turntables_are_refused_in_one_line(draw, walk, text):
    said = draw(walk, "x.mp4", f"--turntable={text}", code=2)
    assert said.err == (
        "viewer: --turntable: expected seconds such as 6, or degrees such as 90deg, "
        f'found "{text}"\n'
    )


def test_options_overridden_by_a_motion_are_reported(draw, walk):
    said = draw(walk, "x.mp4", "--dof", "arm.x=1", "--mirror", size="32x32")
    assert said.err.splitlines() == [
        "warning: --dof: applies only to figures without a motion",
        "warning: --mirror: applies only to figures without a motion",
    ]


@pytest.fixture
def pair(tmp_path) -> list[str]:
    """A model, and two frames of persons 3 and 5 at a distance of 4."""
    np.savez(tmp_path / "SMPL.npz", **model("smpl", 32))
    people = [body(person, Th=[[2.0 * person, 0.0, 0.0]]) for person in (3, 5)]
    folder = write_frames(tmp_path / "take" / "smpl", {0: people, 1: people})
    model_path = str(tmp_path / "SMPL.npz")
    return [str(folder), "--model", model_path, "--up", "y", "--fps", "30"]


def test_follow_reports_the_chosen_person_if_two_have_the_joint(draw, pair):
    size = "16x16"
    said = draw(pair, "a.mp4", "--follow", "pelvis", size=size)
    assert said.err == (
        "warning: --follow pelvis: 2 match; the first one, take 3, is chosen "
        "(--follow 5:pelvis selects another)\n"
    )
    for index, name in enumerate(("5:pelvis", "take 3:head", "smpl 5/left_foot", "5", "Take 3")):
        assert draw(pair, f"{index}.mp4", "--follow", name, size=size).err == ""
    said = draw(pair, "x.mp4", "--follow", "4:pelvis", size=size, code=2)
    assert said.err == (
        'viewer: no actor, joint or point is called "4:pelvis"; actors: take 3, take 5\n'
    )


def test_follow_of_unnumbered_figures_reports_the_first(draw, walk):
    said = draw([*walk, *walk[:2]], "x.mp4", "--follow", "arm", size="16x16")
    assert said.err == ("warning: --follow arm: 2 match; the first one, tiny, is chosen\n")


def test_shapes_overridden_by_a_capture_are_reported(draw, pair):
    said = draw(pair, "x.mp4", "--shape", "1", size="16x16")
    assert said.err == "warning: --shape: applies only to figures without a motion\n"


# Contact sheets


def test_contact_sheet_has_one_scale_and_one_ground_line(draw, walk, tmp_path):
    """The figure is in the middle of every cell, with the pixels of a separate picture."""
    still = ("--no-grid", "--background", "#ffffff")
    said = draw(walk, "sheet.png", "--contact-sheet", "4", *still, size="240x180")
    size = said.out.split(" frames of ")[1].split(",")[0]
    width, height = map(int, size.split(" x "))
    sheet = picture(tmp_path / "sheet.png")
    columns, rows = (sheet.shape[1] + 1) // (width + 1), (sheet.shape[0] + 1) // (height + 1)
    assert columns * rows >= 4
    boxes = []
    for index in range(4):
        row, column = divmod(index, columns)
        top, left = row * (height + 1), column * (width + 1)
        cell = sheet[top : top + height, left : left + width]
        dark = (cell[:, :, :3] < 250).any(axis=2)
        dark[-20:, :20] = False  # the number of the cell
        seen = np.flatnonzero(dark.any(axis=1))
        boxes.append((seen[0], seen[-1]))
    lowest = [box[1] for box in boxes]
    assert max(lowest) - min(lowest) <= 1
    assert max(box[1] - box[0] for box in boxes) > 0.5 * height


def test_onion_shows_all_poses_in_one_picture(draw, walk, tmp_path):
    said = draw(walk, "onion.png", "--onion", "3", "--background", "transparent", "--no-grid")
    assert said.out == f"{tmp_path / 'onion.png'}: 64 x 48, poses of frames 0, 15, 30\n"
    alpha = picture(tmp_path / "onion.png")[..., 3]
    assert (alpha == 255).any() and ((alpha > 50) & (alpha < 60)).any()  # 22 % of 255


def test_contact_sheet_has_at_most_one_cell_per_frame(draw, walk, tmp_path):
    said = draw(walk, "sheet.png", "--contact-sheet", "9", "--frames", "0:3", size="240x180")
    assert ": 3 frames of " in said.out
    assert said.err == (
        "warning: --contact-sheet: there are 3 frames, not 9; no frame is shown twice\n"
    )
    said = draw(walk, "one.png", "--contact-sheet", "2", "--frames", "0:1", size="240x180")
    assert said.err == (
        "warning: --contact-sheet: there is 1 frame, not 2; no frame is shown twice\n"
    )


def test_contact_sheet_of_a_turntable_is_drawn(draw, tmp_path):
    said = draw([], "sheet.png", "--contact-sheet", "8", "--turntable", size="320x160")
    assert ": 8 frames of " in said.out


# Incompatible options


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("x.mp4", "", NOTHING_MOVES),
        ("{frame}.png", "--frames 0:3", NOTHING_MOVES),
        ("x.gif", "--speed 2", NOTHING_MOVES),
        ("x.mp4", "--turntable --frames 0:3", "--frames: no file has a motion"),
        ("x.png", "--speed 2", "--speed: applies to videos only: .mp4, .webm, .gif"),
        (
            "{frame}.png",
            "--video-quality 9",
            "--video-quality: applies to videos only: .mp4, .webm, .gif",
        ),
        (
            "x.gif",
            "--video-quality 9 --turntable",
            "--video-quality: applies to .mp4 and .webm, not to a GIF",
        ),
        ("x.mp4", "--video-quality 900 --turntable", "video quality: expected 0 to 100, found 900"),
        ("x.mp4", "--speed 0", "--speed: expected 0.001 to 1000 or their negatives, found 0"),
        (
            "x.png",
            "--follow root --look-at root",
            "--follow and --look-at: expected one of them, found both",
        ),
        (
            "x.mp4",
            "--follow who --turntable",
            'no actor, joint or point is called "who"; actors: tiny',
        ),
        (
            "x.mp4",
            "--panels",
            "--panels: applies to single images only, not to videos or sequences",
        ),
        (
            "x.mp4",
            "--contact-sheet 4",
            "--contact-sheet: expected an image file name, such as .png, found a video",
        ),
        (
            "x.mp4",
            "--onion 3",
            "--onion: expected the name of a picture, such as .png, found a video",
        ),
        ("x.png", "--onion 1", "--onion: expected 2 to 100 poses, found 1"),
        (
            "x.png",
            "--onion 3 --turntable",
            "--onion and --turntable: expected one of them, found both",
        ),
        ("x.png", "--onion 3", NOTHING_MOVES),
        ("x.png", "--contact-sheet 0", "--contact-sheet: expected 1 to 1000 frames, found 0"),
        (
            "x.png",
            "--contact-sheet 500 --turntable",
            "contact sheet: 500 frames in 64 x 48 pixels are 0 x 2 each, which is too small",
        ),
        (
            "x.mp4",
            "--frames 0:3 --frame 1",
            "--frames and --frame: expected one of them, found both",
        ),
        (
            "x.mp4",
            "--frames 0:3 --time 1",
            "--frames and --time: expected one of them, found both",
        ),
        (
            "x.mp4",
            "--turntable 99999 --fps 1000",
            "expected at most 1,000,000 frames, found 99,999,000",
        ),
    ],
)
def test_contradictory_options_are_refused_in_one_line(draw, walk, tmp_path, name, options, words):
    said = draw(walk[:2], name, *options.split(), code=2)
    assert said.err == f"viewer: {words}\n"
    assert names(tmp_path, ".png", ".mp4", ".gif") == []


# Files


def test_existing_files_are_checked_before_rendering(draw, walk, tmp_path):
    (tmp_path / "f_2.png").write_bytes(b"precious")
    said = draw(walk, "f_{frame}.png", "--frames", "0:3", size="16x16", code=5)
    assert said.err == (f"viewer: {tmp_path / 'f_2.png'}: already exists (--force replaces it)\n")
    assert names(tmp_path, ".png") == ["f_2.png"]
    draw(walk, "f_{frame}.png", "--frames", "0:3", "--force", size="16x16")
    assert len(names(tmp_path, ".png")) == 3 and picture(tmp_path / "f_2.png").shape == (16, 16, 4)


def test_inputs_are_never_replaced(draw, tmp_path):
    skel, skin = write_rig(tmp_path)
    clip = tmp_path / "walk_1.png"  # this clip has an image suffix
    clip.write_text(anim_text(1.0, 9, {}))
    kept = clip.read_bytes()
    said = draw([str(skel), str(skin), str(clip)], "walk_{frame}.png", "--force", code=5)
    assert said.err == f"viewer: {clip}: input files are never overwritten\n"
    assert clip.read_bytes() == kept and names(tmp_path, ".png") == ["walk_1.png"]


@pytest.mark.parametrize("name", ["no/{frame}.png", "no/x.mp4", "no/x.gif"])
def test_missing_folder_is_reported_before_rendering(draw, walk, tmp_path, name):
    said = draw(walk, name, code=5)
    wanted = str(tmp_path / name).replace("{frame}", "0")
    assert said.err == f"viewer: {wanted}: the folder {tmp_path / 'no'} does not exist\n"


def test_walking_wasp_is_rendered(draw, shared, tmp_path):
    files = [str(shared / name) for name in ("wasp.skel", "wasp.skin", "wasp_walk.anim")]
    said = draw(files, "walk.mp4", size="160x90")
    assert ": 121 frames, 4.03 s, 160 x 90, 30 frames per second, " in said.out
    shown = frames(tmp_path / "walk.mp4")
    assert len(shown) == 121 and np.abs(shown[0] - shown[60]).mean() > 1.0


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_numbered_files_are_images(tmp_path, monkeypatch, capsys, suffix):
    monkeypatch.chdir(tmp_path)
    assert run(["render", "missing.skel", "-o", f"f_{{frame}}{suffix}", "--frames", "0:2"]) == 2
    error = capsys.readouterr().err
    assert ".png" in error and f"found {suffix}" in error and "missing" not in error


def test_cells_that_are_too_large_are_refused_with_the_sheet_size(walk, monkeypatch, capsys):
    monkeypatch.chdir(Path(walk[0]).parent)
    arguments = ["-o", "s.png", "--contact-sheet", "4", "--size", "300000x300000"]
    assert run(["render", *map(str, walk), *arguments]) == 2
    error = capsys.readouterr().err
    # There are four columns with gutters of 0.6 % of the height.
    assert "300000 x 300000" in error and "found 73650 x 300000" in error


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
