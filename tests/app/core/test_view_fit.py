"""Camera fit to the unobstructed part of the view, and the ground under changing shapes."""

import numpy as np
import pytest
from app import box_body
from app.captured import people, walk
from app.curves.plotted import clip_text
from app.hand_made_figures import bar, sided_skel
from app.playback import test_timeline
from app.playback.test_timeline import capture, finish
from numpy.testing import assert_allclose

import viewer
from viewer.app.actors.following import toggle_following
from viewer.app.core.view_frame import ViewFrame, view_frame
from viewer.app.curves.editing import place_key
from viewer.app.files.files import Files
from viewer.app.layout import ShownPanels
from viewer.rendering.camera import SMALLEST, Camera, fit
from viewer.rendering.framing import frame_motion
from viewer.rendering.recorder import Recording
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_points

streaming = test_timeline.streaming  # the fixture of the timeline tests
ROOM = 1.08  # margin around a fitted figure


def reach(hand, points=None):
    """Return the horizontal and vertical extent of points relative to the view; 1 is an edge."""
    points = scene_points(hand.state.scene) if points is None else points
    x, y, width, height = hand.state.view_rect
    seen = view_frame(hand.state).project(points) - (x + width / 2, y + height / 2)
    return np.abs(seen).max(axis=0) / (width / 2, height / 2)


def is_fitted(hand, points=None):
    return reach(hand, points).max() == pytest.approx(1 / ROOM, abs=1e-6)


def resize(hand, width, height):
    """Resize the window; the framebuffer of the tests is large enough."""
    hand.io.display_size = (width, height)
    hand.step(4)


@pytest.fixture
def wide(drive, tmp_path):
    """A test driver on a newly opened bar that is ten times as wide as high."""
    hand = drive(bar(tmp_path / "bar.obj"), size=(1200, 700), samples=1)
    hand.state.framing.restart()
    hand.step(2)
    return hand


def test_scene_can_be_smaller_than_the_smallest_distance(drive):
    corners = 1e-14 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    hand = drive(scene=Scene([Actor(viewer.figure(corners, [[0, 1, 2]]))]))
    assert (hand.state.error, hand.state.camera.distance) == ("", SMALLEST)


def test_first_view_fits_between_the_panels(wide):
    assert is_fitted(wide)


def test_fit_follows_changes_of_window_and_panels(wide):
    distance = wide.state.camera.distance
    resize(wide, 900, 700)
    assert is_fitted(wide) and wide.state.camera.distance > distance
    wide.key("tab")
    wide.step(2)
    assert is_fitted(wide) and wide.state.camera.distance < distance
    wide.key("tab")
    wide.state.of(ShownPanels).closed |= {
        "display",
        "skinning",
        "weights",
        "camera",
        "lights",
        "stats",
    }
    wide.step(4)
    assert is_fitted(wide)


def _orbit(hand):
    x, y = hand.middle
    hand.pull((x, y), (x + 30, y))


def _zoom(hand):
    hand.wheel(2, hand.middle)


def _pan(hand):
    x, y = hand.middle
    hand.pull((x, y), (x + 30, y), button=1)


def _slide(hand):
    hand.drag("Distance", 0.7)


@pytest.mark.parametrize("move", [_orbit, _zoom, _pan, _slide])
def test_moving_the_camera_ends_the_fit(wide, move):
    move(wide)
    camera = wide.state.camera.copy()
    wide.key("tab")
    wide.step(3)
    now = wide.state.camera
    assert (now.distance, now.azimuth) == (camera.distance, camera.azimuth)
    assert (now.target == camera.target).all()
    wide.key("f")
    wide.step(2)
    assert is_fitted(wide)
    wide.key("tab")
    wide.step(3)
    assert is_fitted(wide)  # F has framed the view again


def test_following_ends_the_fit(wide):
    toggle_following(wide.state, 0, -1)
    before = wide.state.camera.copy()
    wide.key("tab")
    wide.step(2)
    assert wide.state.camera.distance == before.distance


@pytest.mark.parametrize(
    ("key", "azimuth", "inclination"), [("_1", 0, 0), ("_3", 90, 0), ("_7", 0, 90)]
)
def test_keys_of_named_views_restore_the_fit(wide, key, azimuth, inclination):
    wide.wheel(8, wide.middle)
    wide.key(key)
    wide.step(2)
    camera = wide.state.camera
    assert (camera.azimuth, camera.inclination) == (azimuth, inclination)
    assert is_fitted(wide)


@pytest.mark.parametrize("name", ["Front", "Back", "Right", "Left", "Top", "Bottom"])
def test_buttons_of_named_views_restore_the_fit(wide, name):
    wide.wheel(-5, wide.middle)
    wide.click(name)
    wide.step(2)
    assert is_fitted(wide)


def test_second_file_is_fitted_and_viewed_from_its_front(wide, tmp_path):
    _orbit(wide)
    wide.state.camera.azimuth = 20.0
    wide.open(sided_skel(tmp_path / "turned.skel", "-z"))
    wide.step(3)
    assert wide.state.camera.front == 180
    assert wide.state.camera.azimuth == pytest.approx(-160)  # 20 degrees from the front, as before
    assert is_fitted(wide)
    resize(wide, 1000, 700)
    assert is_fitted(wide)


def test_named_views_are_relative_to_the_front_and_the_panel_overrides_it(drive, tmp_path):
    hand = drive(sided_skel(tmp_path / "turned.skel", "-z"), size=(1200, 900), samples=1)
    hand.state.set_front("auto")
    hand.key("_1")
    assert abs(hand.state.camera.azimuth) == 180
    hand.key("_3")
    assert hand.state.camera.azimuth == -90
    hand.pick("Front axis", 0)
    assert hand.state.camera.front == 90  # +x is the front now
    assert abs(hand.state.camera.azimuth) == 180  # the camera still views its left hand
    hand.key("_1")
    assert hand.state.camera.azimuth == 90
    hand.pick("Front axis", 4)
    assert hand.state.camera.front == 180


def test_whole_motion_is_framed_as_in_a_recording(drive, rig):
    scene = people(rig, [True] * 40)
    hand = drive(scene=scene, size=(1200, 700), samples=1)
    hand.state.framing.restart()
    hand.step(3)
    assert hand.state.framing.is_settled
    times = np.arange(40) / 10.0
    points, box = frame_motion(
        Recording(scene, times, Camera(), (64, 36), hand.state.options, moves=True)
    )
    np.testing.assert_allclose(hand.state.box, box, atol=1e-12)
    assert is_fitted(hand, points)
    actor = scene.actors[0].copy()
    for time in times:
        pose_actors([actor], float(time))
        assert reach(hand, scene_points(viewer.Scene([actor]))).max() < 1.0
    hand.key("space")
    camera = hand.state.camera.copy()
    hand.step(20)
    assert hand.state.clock.time > 0
    assert (hand.state.camera.target == camera.target).all()
    assert hand.state.camera.distance == camera.distance


def test_fit_follows_a_capture_while_it_loads(streaming):
    streaming.start(capture(100, 5, 3))
    finish(streaming)
    streaming.step(40)
    state = streaming.state
    assert state.of(Files).stream is None and state.framing.is_settled
    assert state.box[1, 0] - state.box[0, 0] > 99.0  # x is the frame's number
    recording = Recording(
        state.scene, np.arange(100) / 10.0, Camera(), (64, 36), state.options, moves=True
    )
    points, box = frame_motion(recording)
    np.testing.assert_allclose(state.box, box, atol=1e-12)
    assert is_fitted(streaming, points)


def test_fit_keeps_a_camera_moved_while_a_capture_loads(streaming):
    streaming.start(capture(100, 5, 3))
    _zoom(streaming)
    camera = streaming.state.camera.copy()
    finish(streaming)
    streaming.step(40)
    assert streaming.state.camera.distance == camera.distance
    assert (streaming.state.camera.target == camera.target).all()
    assert streaming.state.box[1, 0] > 98.0  # the ground still extends as far


@pytest.mark.parametrize("edit", ["key", "offset and key", "undo"])
def test_views_fit_the_edited_motion(drive, rig, tmp_path, edit):
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(*rig, tmp_path / "wave.anim", size=(1200, 700), samples=1)
    hand.state.framing.restart()
    hand.step(3)
    before = hand.state.camera.distance
    if edit == "offset and key":
        hand.state.actor.offset = 0.5
        hand.step(3)
    place_key(hand.state, (0, 1), value=20.0)  # root x at the last key
    hand.step(3)
    assert hand.state.camera.distance == before  # the edit must be visible
    if edit == "undo":
        hand.key("z", "ctrl")
        hand.step(3)
    hand.key("_1")
    reach_at_most = 20.0 if edit != "undo" else 1.0
    wide = hand.state.framing.extent.box[1, 0] - hand.state.framing.extent.box[0, 0]
    assert reach_at_most < wide < reach_at_most + 3.0
    actor = hand.state.actor.copy()
    for time in np.linspace(0.0, 2.0, 21) + actor.offset:
        pose_actors([actor], float(time))
        assert reach(hand, scene_points(viewer.Scene([actor]))).max() < 1.0


def test_toolbar_does_not_cover_the_fitted_figure(drive, tmp_path):
    hand = drive(sided_skel(tmp_path / "tall.skel", "+z", 3.0), size=(1200, 700), samples=1)
    points = scene_points(hand.state.scene)
    fit(hand.state.camera, points, hand.state.aspect)
    assert _is_covered(hand, points)  # the fit if the whole view were free
    hand.state.framing.restart()
    hand.step(3)
    assert not _is_covered(hand, points)
    assert reach(hand).max() > 0.7


def _is_covered(hand, points):
    x0, _, _, y1 = hand.state.item_rects["##tools"]
    seen = view_frame(hand.state).project(points)
    return ((seen[:, 0] > x0) & (seen[:, 1] < y1)).any()


def test_ground_stays_under_the_feet_when_the_shape_changes(box):
    box.state.framing.restart()
    box.step(2)
    camera = box.state.camera.copy()
    assert box.state.box[0, 1] == -box_body.HEIGHT / 2
    box.state.actor.pose.shape_weights[0] = 3.0
    box.step(2)
    taller = box_body.HEIGHT * (1 + 3.0 * box_body.STATURE)
    assert box.state.box[:, 1] == pytest.approx([-taller / 2, taller / 2])
    # The camera does not move, so that the growth of the figure is visible.
    assert box.state.camera.distance == camera.distance
    box.state.actor.pose.shape_weights[0] = 0.0
    box.step(2)
    assert box.state.box[0, 1] == -box_body.HEIGHT / 2


def test_ground_does_not_follow_poses(box):
    box.step(2)
    before = box.state.box.copy()
    box.state.actor.pose.dofs[box.dof_index("joint_0.x")] = 1.0
    box.state.actor.pose.figure_translation[1] = 0.7
    box.step(2)
    box.state.actor.pose.shape_weights[0] = 1.0
    box.step(2)
    taller = box_body.HEIGHT * (1 + box_body.STATURE)
    assert before[0, 1] == -box_body.HEIGHT / 2
    assert box.state.box[0, 1] == pytest.approx(-taller / 2)


def test_view_is_redrawn_when_the_ground_moves(box):
    box.step(2)
    before = box.scene_picture()
    box.state.actor.pose.shape_weights[0] = 3.0
    box.step(2)
    assert (box.scene_picture() != before).any()


def test_ground_of_a_moving_figure_follows_shape_edits(box):
    """The lowest frame is evaluated first, the remaining frames later."""
    actor = box.state.actor
    count = actor.figure.skeleton.n_joints
    actor.clip = walk([True] * 20, count)
    actor.clip.figure_translations.flags.writeable = True
    actor.clip.figure_translations[:, 1] = np.linspace(0.0, -1.9, 20)  # down
    actor.clip.figure_translations.flags.writeable = False
    box.state.framing.restart()
    box.step(3)
    half = box_body.HEIGHT / 2
    assert box.state.box[:, 1] == pytest.approx([-1.9 - half, half])
    camera = box.state.camera.copy()
    actor.pose.shape_weights[0] = 2.0
    box.step(3)
    half *= 1 + 2.0 * box_body.STATURE
    assert box.state.box[:, 1] == pytest.approx([-1.9 - half, half])
    assert box.state.camera.distance == camera.distance


def test_scene_box_follows_a_replaced_figure(box, rig):
    box.step(2)
    other = viewer.load(*rig).actors[0]
    box.state.actor.figure, box.state.actor.pose = other.figure, other.pose
    box.step(3)
    assert box.state.box[1, 1] > 1.5  # the arm's upper end
    box.assert_sane()


BOX = np.array([[-1.0] * 3, [1.0] * 3])
RECT = (100.0, 50.0, 400.0, 200.0)


def frame(**settings) -> ViewFrame:
    """Return the view frame of a camera at (0, 0, 5) looking along -z."""
    camera = Camera(distance=5.0, azimuth=0.0, inclination=0.0, fov=90.0, **settings)
    return ViewFrame(camera.projection_matrix(2.0, BOX) @ camera.view_matrix(), RECT)


def test_points_project_as_through_a_pinhole():
    # With a 90 degree field of view, the height of the upper edge above the axis equals
    # its distance.
    assert_allclose(frame().project(np.zeros(3)), [300, 150], atol=1e-9)
    assert_allclose(frame().project(np.array([0.0, 5.0, 0.0])), [300, 50], atol=1e-9)
    assert_allclose(frame().project(np.array([1.0, 0.0, 3.0])), [300 + 100 / 2, 150], atol=1e-9)


def test_points_behind_the_eye_are_not_visible():
    seen = frame().project(np.array([[0.0, 0, 0], [0, 0, 6], [0, 0, 5]]))
    assert np.isfinite(seen[0]).all() and np.isnan(seen[1:]).all()
    assert frame().place(np.array([0.0, 0, 6])) is None


@pytest.mark.parametrize("parallel", [False, True])
def test_window_positions_unproject_to_points_at_a_depth(parallel):
    view, point = frame(orthographic=parallel), np.array([0.5, -0.3, 1.0])
    found = view.at_depth_of(np.array([0.0, 0.0, 1.0]), view.place(point))
    assert_allclose(found, point, atol=1e-9)


def test_world_size_of_a_pixel_grows_with_depth():
    # At the target, 200 window units are 2 * 5 units of the scene.
    assert frame().unit_length(np.zeros(3)) == pytest.approx(10 / 200)
    assert frame().unit_length(np.array([0.0, 0.0, 3.0])) == pytest.approx(4 / 200)
    assert frame(orthographic=True).unit_length(np.array([0.0, 0, 3])) == pytest.approx(10 / 200)


def test_rays_run_from_the_eye_through_the_pixel():
    origin, direction = frame().ray((350.0, 150.0))
    assert_allclose(direction, np.array([0.5, 0, -1]) / np.hypot(0.5, 1), atol=1e-9)
    assert_allclose(np.cross(origin - [0, 0, 5], direction), 0, atol=1e-9)
    _, parallel = frame(orthographic=True).ray((350.0, 150.0))
    assert_allclose(parallel, [0, 0, -1], atol=1e-9)
