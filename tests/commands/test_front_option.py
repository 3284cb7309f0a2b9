"""The option --front and the first view, equal in images, images with panels, and the window."""

import argparse

import numpy as np
import pytest
from app.hand_made_figures import sided_skel
from PIL import Image

import viewer
from viewer.cli import run
from viewer.commands._settings import settings_of
from viewer.commands._view import ViewOptions, add_camera_arguments, camera_of
from viewer.rendering.camera import Camera, fit
from viewer.rendering.offscreen import default_camera
from viewer.rig.scene import scene_points

pytestmark = pytest.mark.slow

SIZE = (64, 48)


@pytest.fixture
def draw(tmp_path):
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


def test_first_view_is_from_the_front(draw):
    assert (draw() == _seen_from(draw.scene, 35 - 180)).all()
    assert (draw() == viewer.render(draw.scene, SIZE)).all()


@pytest.mark.parametrize(
    ("front", "azimuth"), [("+z", 35), ("+x", 125), ("-x", -55), ("-z", -145), ("auto", -145)]
)
def test_front_is_overridden(draw, front, azimuth):
    assert (draw(f"--front={front}") == _seen_from(draw.scene, azimuth)).all()


def test_azimuth_is_measured_from_the_axes_for_any_front(draw):
    for front in ("+z", "-x"):
        assert (draw(f"--front={front}", "--azimuth", "20") == _seen_from(draw.scene, 20)).all()


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
    from viewer.rig.scene import scene_box

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
