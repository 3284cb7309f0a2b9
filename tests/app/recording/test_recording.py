"""Recording from the window: the dialog, output files, progress, and cancelling."""

import numpy as np
import pytest
from imgui_bundle import imgui
from numpy.testing import assert_allclose
from PIL import Image

from viewer.app.files.files import Files
from viewer.app.recording.recording import (
    RecordedMarks,
    RecordingState,
    RecordSettings,
    playback_frames,
    recorded_times,
)
from viewer.app.weights.weights_panel import pin_vertex, unpin
from viewer.rendering.overlay.joint_marks import HIGHLIGHT
from viewer.rendering.recorder import copied
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.scene import pose_actors


@pytest.fixture
def moving(drive, rig):
    """A test driver on the tiny figure, whose root moves right at 0.5 per second for a second."""
    hand = drive(*rig, size=(1000, 700), samples=1, pixels_per_point=1.0)
    channel = Channel(0, np.array([0.0, 1.0]), np.array([0.0, 0.5]), (("linear", "linear"),) * 2)
    hand.state.actor.clip = Clip("slide", (channel,), 0.0, 1.0)
    hand.step(3)
    return hand


def start(hand, path, **settings):
    hand.state.of(RecordingState).settings = RecordSettings(**settings)
    hand.state.of(RecordingState).wanted = path
    hand.step(1)


def finish(hand):
    for _ in range(3000):
        if hand.state.job is None:
            return
        hand.step(1)
    raise AssertionError("recording did not end")


def test_menu_opens_the_dialog_and_escape_closes_it(moving):
    moving.click("menu File")
    moving.click("Record pictures or video…")
    moving.step(2)
    assert "Save as…" in moving.state.item_rects
    moving.click("Save as…")
    moving.step()  # the dialog takes the keys once it has been shown
    assert moving.state.of(Files).dialog is not None and moving.state.of(
        Files
    ).dialog.name.endswith(".mp4")
    moving.key("escape")
    moving.key("escape")
    moving.step(2)
    assert moving.state.of(RecordingState).settings is None


def test_typed_suffix_selects_the_video_format(moving, tmp_path):
    settings = RecordSettings(size="own", own_size=(64, 64), rate=5.0)
    moving.state.of(RecordingState).settings = settings
    moving.step(2)
    moving.click("Save as…")
    moving.step(2)
    moving.type("ada.gif")  # replaces only the stem
    moving.key("enter")
    finish(moving)
    assert settings.kind == ".gif"
    with Image.open(tmp_path / "ada.gif") as picture:
        assert picture.format == "GIF"


def test_preview_is_kept_as_long_as_the_panels_show_it(moving):
    moving.menu("menu File", "Record pictures or video…")
    moving.screen()
    moving.state.of(RecordingState).settings.size = "1080x1920"
    moving.screen()
    for is_down in (True, False):
        moving.io.add_key_event(imgui.Key.escape, is_down)
        moving.step()
        moving.app.pixels()
    assert moving.state.of(RecordingState).settings is None
    assert moving.app.context.error == "GL_NO_ERROR"


def test_numbered_pictures_match_the_view_in_the_window(moving, tmp_path):
    (tmp_path / "out").mkdir()
    start(moving, tmp_path / "out" / "f_{frame:03}.png", kind="pictures", rate=4.0)
    finish(moving)
    assert moving.state.error == ""
    files = sorted((tmp_path / "out").iterdir())
    assert [file.name for file in files] == [f"f_{n:03}.png" for n in range(5)]
    differences = np.zeros((5, 5))
    for number in range(5):
        moving.state.clock.seek(number / 4)
        moving.step(2)
        shown = moving.scene_picture()
        for other, file in enumerate(files):
            with Image.open(file) as picture:
                found = np.array(picture.convert("RGB")).astype(int)
            height, width = found.shape[:2]
            # An odd row or column of the view is omitted, which shifts edges by a fraction.
            differences[number, other] = np.abs(found - shown[:height, :width, :3]).mean()
    assert (differences.argmin(axis=1) == range(5)).all()
    assert np.diag(differences).max() < 2.0 < differences[0, 1]


def test_annotations_and_legend_are_drawn_in_every_frame(moving, tmp_path):
    state = moving.state
    pin_vertex(state, 0, 4)
    state.selected_joint = 1
    state.options.joint_names = state.options.xray = True
    moving.step(4)
    start(moving, tmp_path / "a_{frame}.png", kind="pictures", rate=2.0)
    finish(moving)
    unpin(state)
    state.options.joint_names = state.options.xray = False
    moving.step(2)
    start(moving, tmp_path / "b_{frame}.png", kind="pictures", rate=2.0)
    finish(moving)
    middles = []
    for number in range(3):
        with (
            Image.open(tmp_path / f"a_{number}.png") as marked,
            Image.open(tmp_path / f"b_{number}.png") as plain,
        ):
            pictures = [np.array(one.convert("RGB")).astype(int) for one in (marked, plain)]
        changed = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8
        # The dot of the selected joint is 1.5 times as large as the others.
        yellow = np.abs(pictures[0] - 255 * np.array(HIGHLIGHT[:3])).max(axis=-1) < 6
        assert yellow.sum() > 20 and changed[yellow].any()
        # The white dot of the vertex moves with the figure.
        white = changed & (pictures[0].min(axis=-1) > 250)
        middles.append(np.nonzero(white)[1].max())
    assert middles[0] < middles[1] < middles[2]


def test_annotations_follow_the_pose_of_each_frame(moving):
    pin_vertex(moving.state, 0, 4)
    moving.step(4)
    marks = RecordedMarks(moving.state)
    unpin(moving.state)
    scene = copied(moving.state.scene)
    places = []
    for seconds in (0.0, 1.0):
        pose_actors(scene.actors, seconds, False)
        (found,) = marks.at(scene, (960, 720))
        places.append(found.segments.starts[-1])
    assert_allclose(places[1] - places[0], [0.5, 0.0, 0.0], atol=1e-12)
    scene.actors[0].visible = False
    assert marks.at(scene, (960, 720)) == []


def test_dialog_offers_the_legend_only_if_there_is_one(moving):
    moving.state.of(RecordingState).settings = RecordSettings()
    moving.step(2)
    moving.click("Legend in pictures")
    assert not moving.state.options.legend
    moving.state.options.shading = "scalar"
    moving.step(2)
    moving.click("Legend in pictures")
    assert moving.state.options.legend


def test_recording_leaves_the_scene_unchanged(moving, tmp_path):
    moving.state.clock.seek(0.25)
    moving.step(2)
    before, steps = moving.dofs(), moving.undo_steps
    start(moving, tmp_path / "f_{frame}.png", kind="pictures", rate=4.0)
    finish(moving)
    assert (moving.dofs() == before).all()
    assert moving.state.clock.time == 0.25
    assert moving.undo_steps == steps


def test_contact_sheet_has_the_requested_number_of_cells(moving, tmp_path):
    start(moving, tmp_path / "s.png", kind="sheet", n_cells=4, size="own", own_size=(400, 300))
    finish(moving)
    with Image.open(tmp_path / "s.png") as picture:
        assert picture.size == (400, 300)
        cells = np.array(picture.convert("L")).reshape(2, 150, 2, 200).swapaxes(1, 2)
    flat = cells.reshape(4, -1)
    assert all((flat[i] != flat[j]).any() for i in range(4) for j in range(i))


def test_video_has_every_frame(moving, tmp_path):
    av = pytest.importorskip("av")
    start(moving, tmp_path / "v.mp4", rate=10.0, size="own", own_size=(320, 240))
    finish(moving)
    assert moving.state.error == ""
    with av.open(str(tmp_path / "v.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height, stream.average_rate) == (320, 240, 10)
        assert sum(1 for _ in container.decode(stream)) == 11


def test_dialog_shows_the_frames_that_are_recorded(moving):
    state, settings = moving.state, RecordSettings()
    # In 7.6 frames the last one that begins is number 7, even if the end has single precision.
    for end, n_frames in ((7.6 / 30.0, 8), (float(np.float32(7.0 / 30.0)), 8), (6.9 / 30.0, 7)):
        state.clock.set_range(0.0, end)
        assert playback_frames(state) == (0, n_frames - 1)
        times, numbers, _ = recorded_times(state, settings)
        assert numbers == list(range(n_frames)) and times[-1] <= end
    state.clock.set_range(2.5 / 30.0, 7.6 / 30.0)  # 5.1 frames
    first, last = playback_frames(state)
    assert (first, last) == (2, 7)
    assert recorded_times(state, settings)[1] == list(range(first, last + 1))


def test_cancelling_leaves_no_files(moving, tmp_path):
    pytest.importorskip("av")
    (tmp_path / "out").mkdir()
    start(moving, tmp_path / "out" / "v.mp4", rate=500.0, size="own", own_size=(64, 64))
    moving.step(5)
    done, total, unit = moving.state.job.progress
    assert 0 < done < total == 501 and unit == "frames"
    assert "Cancel" in moving.state.item_rects
    moving.key("escape")
    moving.step(3)
    assert moving.state.job is None
    assert list((tmp_path / "out").iterdir()) == []
    assert moving.scene_picture().std() > 1.0  # the window keeps drawing


def test_window_stays_responsive_while_recording(moving, tmp_path):
    start(moving, tmp_path / "f_{frame}.png", kind="pictures", rate=60.0)
    moving.step(3)
    azimuth = moving.state.camera.azimuth
    x, y = moving.middle[0], moving.middle[1] + 80  # next to the progress bar
    moving.pull((x, y), (x + 40, y))
    assert moving.state.camera.azimuth != azimuth
    finish(moving)
    assert len(list(tmp_path.glob("f_*.png"))) == 61


def test_still_scene_is_recorded_as_a_turntable(drive, rig, tmp_path):
    hand = drive(*rig, size=(600, 400), samples=1)
    (tmp_path / "t").mkdir()
    start(
        hand,
        tmp_path / "t" / "f_{frame}.png",
        kind="pictures",
        rate=4.0,
        turntable=True,
        seconds=1.0,
    )
    finish(hand)
    assert len(list((tmp_path / "t").iterdir())) == 4


def test_file_pattern_without_a_frame_number_is_refused(moving, tmp_path):
    start(moving, tmp_path / "same.png", kind="pictures")
    moving.step(2)
    assert moving.state.error.startswith(f"{tmp_path / 'same.png'}: expected a name with {{frame}}")
    assert moving.state.job is None


def test_existing_images_are_not_replaced(moving, tmp_path):
    (tmp_path / "f_2.png").write_bytes(b"precious")
    start(moving, tmp_path / "f_{frame}.png", kind="pictures", rate=4.0)
    moving.step(2)
    assert moving.state.error.startswith(f"{tmp_path / 'f_2.png'}: already exists")
    assert (tmp_path / "f_2.png").read_bytes() == b"precious"


def test_input_images_are_not_replaced(moving, tmp_path):
    """The texture is not opened directly; the file of the figure refers to it."""
    texture = tmp_path / "cloth.png"
    texture.write_bytes(b"precious")
    moving.state.scene.files = [texture]
    start(moving, texture, kind="sheet")
    moving.step(2)
    assert moving.state.error == f"{texture}: input files are never overwritten"
    assert texture.read_bytes() == b"precious" and moving.state.job is None
