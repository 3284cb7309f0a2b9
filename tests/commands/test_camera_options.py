"""Cameras of a picture: images of a capture, `--front`, and notes on lenses."""

import argparse

import numpy as np
import pytest
from app.hand_made_figures import sided_skel
from formats.capture_files import points, write_frames
from formats.filmed_capture import CENTER, SIDE, write_filmed
from PIL import Image

import viewer
from viewer.cli import run
from viewer.commands._settings import settings_of
from viewer.commands._view import ViewOptions, add_camera_arguments, camera_of
from viewer.rendering.camera import Camera, fit
from viewer.rendering.offscreen import default_camera
from viewer.rendering.pinhole import frustum_corners
from viewer.rigs.scene import scene_points

pytestmark = pytest.mark.slow
_QUICK = ("--quality", "draft", "--force")


@pytest.fixture
def filmed(tmp_path):
    return write_filmed(tmp_path / "take")


def drawn(recording, out, *options):
    size = f"{SIDE}x{SIDE}"
    still = ("--view", "01", "--no-grid", "--size", size, "--samples", "1", *_QUICK)
    assert run(["render", str(recording), "-o", str(out), *still, *options]) == 0
    return np.array(Image.open(out).convert("RGB")).astype(int)


def test_undistorted_image_is_drawn_behind_the_scene(filmed, tmp_path, capsys):
    pixels = drawn(filmed, tmp_path / "a.png", "--frame", "0")
    row = pixels[int(CENTER), :, 0]
    # The image is dimmed to 60 %, and the line is at its position without distortion.
    assert row[2] == 60 and int(np.argmin(row[80:])) + 80 == 90
    error = capsys.readouterr().err
    assert "images/01: 1 of 3 frames have no image: 1\n" in error
    assert "its lens distortion of up to 7.1 pixels is removed from its images\n" in error
    assert drawn(filmed, tmp_path / "a.png", "--frame", "2")[50, 2, 0] == 120


def test_frame_without_image_has_the_background(filmed, tmp_path):
    pixels = drawn(filmed, tmp_path / "a.png", "--frame", "1", "--background", "#ff0000")
    assert pixels[2, 2].tolist() == [255, 0, 0]


def test_images_with_a_different_aspect_ratio_are_reported_and_not_drawn(filmed, tmp_path, capsys):
    for path in (filmed / "images" / "01").iterdir():
        Image.new("RGB", (60, 30), (9, 9, 9)).save(path)
    pixels = drawn(filmed, tmp_path / "a.png", "--background", "#ff0000", "--frame", "0")
    assert pixels[2, 2].tolist() == [255, 0, 0]
    error = capsys.readouterr().err
    assert "its images have 60 x 30 pixels, the calibration 101 x 101: they do not match" in error


def test_images_are_read_from_the_given_folder(filmed, tmp_path, capsys):
    (filmed / "images").rename(tmp_path / "elsewhere")
    elsewhere = ("--images", str(tmp_path / "elsewhere"))
    assert drawn(filmed, tmp_path / "a.png", *elsewhere, "--frame", "0")[50, 2, 0] == 60
    out = str(tmp_path / "b.png")
    assert run(["render", str(filmed), "-o", out, "--images", str(filmed)]) == 2
    expected = "take: expected a folder of images for a camera (01), found none\n"
    assert capsys.readouterr().err.endswith(expected)


def test_frustum_shows_the_image_in_the_viewing_direction(filmed, tmp_path):
    view = viewer.load(filmed).views[0]
    # The frustum ends 2 in front of (0, -5, 0), where half of 101 pixels are 1.01 to the left and
    # up.
    corners = frustum_corners(view, 2.0)
    np.testing.assert_allclose(corners[0], [-1.01, -3.0, 1.01], atol=1e-12)
    np.testing.assert_allclose(corners[2], [1.01, -3.0, -1.01], atol=1e-12)
    out = tmp_path / "c.png"
    options = ("--cameras", "--no-grid", "--front", "-y", "--azimuth", "180", "--frame", "2")
    assert run(["render", str(filmed), "-o", str(out), "--size", "480x360", *_QUICK, *options]) == 0
    pixels = np.array(Image.open(out).convert("RGB")).astype(int)
    assert (pixels == 200).all(axis=2).sum() > 20  # the grey of the image


def test_damaged_image_is_reported_and_not_drawn(filmed, tmp_path, capsys):
    (filmed / "images" / "01" / "000000.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    drawn(filmed, tmp_path / "a.png", "--frame", "0")
    assert "camera 01: its first image is not readable" in capsys.readouterr().err


SIZE = (64, 48)


@pytest.fixture
def draw_turned(tmp_path):
    """A function that draws a figure facing -z with the given options."""
    skel, out = sided_skel(tmp_path / "turned.skel", "-z"), tmp_path / "out.png"

    def draw_with(*options):
        words = ["render", str(skel), "-o", str(out), "--force", "--size", "64x48", *options]
        words += ["--quality", "normal"]  # the same as in the library without options
        assert run(words) == 0
        return np.array(Image.open(out).convert("RGBA"))

    draw_with.scene = viewer.load(skel)
    return draw_with


def _seen_from(scene, azimuth):
    camera = Camera(azimuth=azimuth)
    fit(camera, scene_points(scene), SIZE[0] / SIZE[1])
    return viewer.render(scene, SIZE, camera)


def test_first_view_is_from_the_front(draw_turned):
    assert (draw_turned() == _seen_from(draw_turned.scene, 35 - 180)).all()
    assert (draw_turned() == viewer.render(draw_turned.scene, SIZE)).all()


@pytest.mark.parametrize(
    ("front", "azimuth"), [("+z", 35), ("+x", 125), ("-x", -55), ("-z", -145), ("auto", -145)]
)
def test_front_is_overridden(draw_turned, front, azimuth):
    assert (draw_turned(f"--front={front}") == _seen_from(draw_turned.scene, azimuth)).all()


def test_azimuth_is_measured_from_the_axes_for_any_front(draw_turned):
    for front in ("+z", "-x"):
        assert (
            draw_turned(f"--front={front}", "--azimuth", "20") == _seen_from(draw_turned.scene, 20)
        ).all()


def test_up_axis_is_refused_as_the_front(tmp_path, capsys):
    skel, out = sided_skel(tmp_path / "a.skel", "+z"), tmp_path / "out.png"
    assert run(["render", str(skel), "-o", str(out), "--front=+y"]) == 2
    problem = capsys.readouterr().err
    assert "--front" in problem and "+x, -x, +z, -z" in problem and "+y" in problem
    assert problem.count("\n") == 1 and not out.exists()
    assert run(["render", str(skel), "-o", str(out), "--front=up"]) == 2
    assert not out.exists()


def test_window_has_the_same_first_view(tmp_path):
    """The first view and the front of the named views are passed to the window."""
    scene = viewer.load(sided_skel(tmp_path / "turned.skel", "-z"))
    parser = argparse.ArgumentParser()
    add_camera_arguments(parser)
    for words, front in (([], 180.0), (["--front=+x"], 90.0)):
        view = settings_of(ViewOptions, parser.parse_args(words))
        camera = camera_of(view, scene, scene_points(scene), SIZE)
        assert camera.front == front
        away = camera.azimuth - front - 35.0
        assert np.cos(np.radians(away)) == pytest.approx(1.0)
    plain = default_camera(scene, SIZE)
    assert (plain.front, plain.azimuth, plain.inclination) == (180.0, -145.0, 15.0)


def test_whole_motion_is_visible_between_the_panels_of_an_image(tmp_path):
    """In the image with panels, the figure is not clipped and not smaller than necessary."""
    from app.captured import people
    from app.tiny import write_rig

    from viewer.app.core.state import AppState
    from viewer.app.core.view_frame import view_frame
    from viewer.app.headless import HeadlessApp
    from viewer.rendering.framing import frame_motion
    from viewer.rendering.options import DisplayOptions
    from viewer.rendering.recorder import Recording
    from viewer.rigs.scene import scene_box

    scene = people(write_rig(tmp_path), [True] * 12)
    state = AppState(scene, Camera(), DisplayOptions(samples=1), scene_box(scene))
    with HeadlessApp(state, (1100, 700)) as app:
        app.picture()
        recording = Recording(scene, np.arange(12) / 10.0, Camera(), SIZE, state.options)
        points, box = frame_motion(recording)
        x, y, width, height = state.view_rect
        seen = view_frame(state).project(points) - (x + width / 2, y + height / 2)
        edge = np.abs(seen).max(axis=0) / (width / 2, height / 2)
    assert edge.max() == pytest.approx(1 / 1.08, abs=1e-6)
    np.testing.assert_allclose(state.box, box, atol=1e-12)


# Cameras without a size have the principal point in the middle, so the picture is 1000 x 1000
# pixels.
_NAMES = "".join(
    f"""{key}_{name}: !!opencv-matrix
  rows: {rows}
  cols: {columns}
  dt: d
  data: [{data}]
"""
    for name, k1 in (("01", "0.0005"), ("02", "0.1"))
    for key, rows, columns, data in (
        ("K", 3, 3, "1000., 0., 500., 0., 1000., 500., 0., 0., 1."),
        ("dist", 1, 5, f"{k1}, 0., 0., 0., 0."),
    )
)
_PLACES = "".join(
    f"""Rot_{name}: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1., 0., 0., 0., 0., -1., 0., 1., 0.]
T_{name}: !!opencv-matrix
  rows: 3
  cols: 1
  dt: d
  data: [0., 0., 5.]
"""
    for name in ("01", "02")
)
_HEAD = '%YAML:1.0\n---\nnames: [ "01", "02" ]\n'


@pytest.fixture
def recording(tmp_path):
    folder = tmp_path / "take"
    write_frames(folder / "keypoints3d", {frame: [points(0)] for frame in range(2)})
    (folder / "intri.yml").write_text(_HEAD + _NAMES)
    (folder / "extri.yml").write_text(_HEAD + _PLACES)
    return folder


def draw(recording, out, *options):
    return run(
        [
            "render",
            str(recording),
            "-o",
            str(out),
            "--size",
            "32x32",
            "--quality",
            "draft",
            *options,
        ]
    )


# The corner (0, 0) is at x = y = -1/2, so r^2 = 1/2; k1 = 0.1 moves it by k1 r^2 of its distance
# from the middle, 0.1 * 0.5 * 500 sqrt(2) = 35.36 pixels.
NOTE = "warning: camera 02: its lens distortion of up to 35.4 pixels is not drawn\n"


@pytest.mark.parametrize("view", ["02", "2"])
def test_ignored_lens_distortion_is_reported_with_its_size(recording, tmp_path, capsys, view):
    assert draw(recording, tmp_path / "a.png", "--view", view) == 0
    assert capsys.readouterr().err.endswith(NOTE)


def test_sequences_report_distortion_once(recording, tmp_path, capsys):
    assert draw(recording, tmp_path / "a_{frame}.png", "--view", "02") == 0
    assert capsys.readouterr().err.count(NOTE) == 1


@pytest.mark.parametrize("options", [[], ["--view", "01"]])
def test_invisible_distortion_is_not_reported(recording, tmp_path, capsys, options):
    # 0.0005 * 0.5 * 500 sqrt(2) = 0.18 pixels.
    assert draw(recording, tmp_path / "a.png", *options) == 0
    assert "lens" not in capsys.readouterr().err


def test_unknown_camera_is_refused(recording, tmp_path, capsys):
    assert draw(recording, tmp_path / "a.png", "--view", "9") == 2
    assert capsys.readouterr().err.endswith(
        '--view: no camera is called "9"; there are 2: 01, 02\n'
    )
    assert draw(recording, tmp_path / "a.png", "--view", "021") == 2
    assert capsys.readouterr().err.endswith("did you mean 01 or 02?\n")
