"""The orbit camera: projected points, calculated by hand and with plain numpy."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.moving import FILMED, RATE, SIZE, moving_camera, pixel

from viewer.rendering.camera import (
    VIEWS,
    Camera,
    camera_axes,
    camera_from_view,
    eye,
    facing_camera,
    fit,
    follow_view,
    front_azimuth,
    look_from,
    orbit,
    pan,
    zoom,
)
from viewer.rendering.camera_views import drawn_cameras, with_cameras
from viewer.rendering.options import DisplayOptions
from viewer.rendering.projection import picture_scale, project, project_segments, unproject
from viewer.rendering.recorder import Recording, _Cameras
from viewer.rendering.view import view_of
from viewer.rigs.captures.cameras import view_at
from viewer.rigs.scene import Scene

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
ANGLES = [(0, 0), (35, 15), (-120, -60), (180, 0), (90, 90), (-30, -90), (10, 89.999)]


def projected(camera: Camera, points, aspect: float = 1.0, box=BOX):
    """Return normalised device coordinates: x right, y up, z depth, each from -1 to 1."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    clip = camera.projection_matrix(aspect, box) @ camera.view_matrix()
    x = np.column_stack([points, np.ones(len(points))]) @ clip.T
    return x[:, :3] / x[:, 3:]


@pytest.mark.parametrize(
    ("up", "azimuth", "inclination", "wanted"),
    [
        ("y", 0, 0, (0, 0, 4)),
        ("y", 90, 0, (4, 0, 0)),
        ("y", -90, 0, (-4, 0, 0)),
        ("y", 180, 0, (0, 0, -4)),
        ("y", 0, 90, (0, 4, 0)),
        ("y", 0, -90, (0, -4, 0)),
        ("y", 0, 30, (0, 2, 4 * math.sqrt(0.75))),
        ("z", 0, 0, (0, -4, 0)),
        ("z", 90, 0, (4, 0, 0)),
        ("z", 0, 90, (0, 0, 4)),
        ("z", 180, 0, (0, 4, 0)),
    ],
)
def test_eye_position_follows_the_angles(up, azimuth, inclination, wanted):
    camera = Camera(distance=4.0, azimuth=azimuth, inclination=inclination, up=up)
    np.testing.assert_allclose(eye(camera), wanted, atol=1e-12)
    camera.target = np.array([10.0, 20.0, 30.0])
    np.testing.assert_allclose(eye(camera), np.add(wanted, camera.target), atol=1e-12)


@pytest.mark.parametrize(
    ("view", "right", "up"),
    [
        ("front", (1, 0, 0), (0, 1, 0)),
        ("back", (-1, 0, 0), (0, 1, 0)),
        ("left", (0, 0, -1), (0, 1, 0)),
        ("right", (0, 0, 1), (0, 1, 0)),
        ("top", (1, 0, 0), (0, 0, -1)),
        ("bottom", (1, 0, 0), (0, 0, 1)),
    ],
)
def test_named_views_show_their_side(view, right, up):
    azimuth, inclination = VIEWS[view]
    camera = Camera(azimuth=azimuth, inclination=inclination)
    found = camera_axes(camera)
    np.testing.assert_allclose(found[0], right, atol=1e-12)
    np.testing.assert_allclose(found[1], up, atol=1e-12)
    np.testing.assert_allclose(np.cross(found[0], found[1]), found[2], atol=1e-12)


def test_z_up_shows_z_upwards():
    camera = Camera(distance=4.0, azimuth=0.0, inclination=0.0, up="z")
    right, up, backward = camera_axes(camera)
    np.testing.assert_allclose(
        [right, up, backward], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12
    )


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(("azimuth", "inclination"), ANGLES)
def test_view_matrix_is_a_rigid_motion_with_the_target_ahead(up, azimuth, inclination):
    target = np.array([1.0, -2.0, 3.0])
    camera = Camera(target, 5.0, azimuth, inclination, up=up)
    view = camera.view_matrix()
    np.testing.assert_allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(view) == pytest.approx(1.0)
    np.testing.assert_allclose(view @ [*target, 1.0], [0, 0, -5.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(view @ [*eye(camera), 1.0], [0, 0, 0, 1.0], atol=1e-9)
    np.testing.assert_allclose(view[:3, :3], np.stack(camera_axes(camera)), atol=1e-9)


def test_matrices_belong_to_the_caller():
    camera, box = Camera(np.ones(3), 4.0, 20.0, 10.0), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 1.0]])
    expected = camera.view_matrix().tolist(), camera.projection_matrix(1.5, box).tolist()
    camera.view_matrix()[:] = 0.0
    camera.projection_matrix(1.5, box)[:] = 0.0
    assert (camera.view_matrix().tolist(), camera.projection_matrix(1.5, box).tolist()) == expected


def test_poles_are_reached_without_a_jump():
    for sign in (1, -1):
        at = Camera(azimuth=40.0, inclination=90.0 * sign).view_matrix()
        near = Camera(azimuth=40.0, inclination=(90.0 - 1e-6) * sign).view_matrix()
        np.testing.assert_allclose(at, near, atol=1e-6)


def test_perspective_matrix_has_the_textbook_entries():
    """fov 90: cot(45) = 1, over the aspect across."""
    camera = Camera(distance=4.0, azimuth=0.0, inclination=0.0, fov=90.0)
    matrix = camera.projection_matrix(2.0, BOX)
    assert matrix[0, 0] == pytest.approx(0.5)
    assert matrix[1, 1] == pytest.approx(1.0)
    np.testing.assert_allclose(matrix[3], [0, 0, -1, 0], atol=1e-12)


def test_perspective_projects_a_known_point_correctly():
    """At a half angle of 45 degrees, 1.5 up at 3 ahead is halfway up; 1 to the right is a third."""
    camera = Camera(distance=4.0, azimuth=0.0, inclination=0.0, fov=90.0)
    np.testing.assert_allclose(projected(camera, [1.0, 1.5, 1.0])[0, :2], [1 / 3, 0.5], atol=1e-9)
    np.testing.assert_allclose(
        projected(camera, [1.0, 1.5, 1.0], aspect=2.0)[0, :2], [1 / 6, 0.5], atol=1e-9
    )


def test_orthographic_projection_ignores_depth():
    """Half of the visible height at the target is 4 tan 45 = 4."""
    camera = Camera(distance=4.0, azimuth=0.0, inclination=0.0, fov=90.0, orthographic=True)
    for depth in (-1.0, 0.0, 1.0):
        np.testing.assert_allclose(
            projected(camera, [1.0, 2.0, depth])[0, :2], [0.25, 0.5], atol=1e-9
        )


def test_both_projections_agree_at_the_target():
    points = np.array([[0.3, 0.4, 0.0], [-0.5, 0.1, 0.0]])
    flat = Camera(distance=4.0, azimuth=0.0, inclination=0.0)
    parallel = Camera(distance=4.0, azimuth=0.0, inclination=0.0, orthographic=True)
    np.testing.assert_allclose(
        projected(flat, points)[:, :2], projected(parallel, points)[:, :2], atol=1e-9
    )


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("distance", [0.5, 4.0, 400.0])
def test_depth_covers_the_box_in_order(orthographic, distance):
    camera = Camera(distance=distance, azimuth=0.0, inclination=0.0, orthographic=orthographic)
    ahead = min(1.0, 0.9 * distance)
    depths = projected(camera, [[0, 0, ahead], [0, 0, 0], [0, 0, -1]])[:, 2]
    assert (np.diff(depths) > 0).all()
    assert np.abs(depths).max() < 1.0


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("aspect", [0.3, 1.0, 2.5])
@pytest.mark.parametrize(("azimuth", "inclination"), ANGLES)
def test_fit_shows_every_point_with_little_free_space(
    up, orthographic, aspect, azimuth, inclination
):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(200, 3)) * [1.0, 3.0, 0.5] + [100.0, -50.0, 7.0]
    box = np.stack([points.min(axis=0), points.max(axis=0)])
    camera = Camera(azimuth=azimuth, inclination=inclination, orthographic=orthographic, up=up)
    fit(camera, points, aspect)
    seen = projected(camera, points, aspect, box)
    assert np.abs(seen).max() < 1.0
    assert np.abs(seen[:, :2]).max() > 0.85
    assert (camera.azimuth, camera.inclination) == (azimuth, inclination)


def test_fit_distance_matches_hand_calculation():
    """Two points are 1 from the middle, seen at a half angle of 45 degrees with a margin of 8 %."""
    points = np.array([[-1.0, 5.0, 0.0], [1.0, 5.0, 0.0]])
    for orthographic in (False, True):
        camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, orthographic=orthographic)
        fit(camera, points, 1.0)
        assert camera.distance == pytest.approx(1.08)
        assert camera.target.tolist() == [0.0, 5.0, 0.0]
        fit(camera, points, 2.0)
        assert camera.distance == pytest.approx(0.54)


def test_fit_steps_back_for_points_in_front():
    """A point 3 nearer than the middle increases the distance by 3."""
    points = np.array([[1.0, 0.0, 3.0], [-1.0, 0.0, -3.0]])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0)
    fit(camera, points, 1.0)
    assert camera.distance == pytest.approx(3.0 + 1.08)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.ones((1, 3)), np.ones((5, 3))])
@pytest.mark.parametrize("orthographic", [False, True])
def test_fit_of_no_point_or_one_point_has_a_usable_distance(points, orthographic):
    camera = Camera(orthographic=orthographic)
    fit(camera, points, 1.0)
    assert camera.distance == 1.0
    assert np.isfinite(camera.view_matrix()).all()
    assert np.isfinite(camera.projection_matrix(1.0, np.zeros((2, 3)))).all()


def test_fit_works_for_tiny_and_huge_figures():
    for scale in (1e-6, 1e6):
        points = scale * np.array([[-1.0, -1, -1], [1, 1, 1]])
        camera = Camera()
        fit(camera, points, 1.0)
        seen = projected(camera, points, 1.0, points)
        assert np.abs(seen).max() < 1.0


def test_orbit_adds_angles_and_wraps_around():
    camera = Camera(azimuth=170.0, inclination=10.0)
    orbit(camera, 20.0, 5.0)
    assert (camera.azimuth, camera.inclination) == (-170.0, 15.0)
    orbit(camera, -720.0, 0.0)
    assert camera.azimuth == -170.0


def test_orbit_stops_at_the_poles():
    camera = Camera(inclination=80.0)
    orbit(camera, 0.0, 50.0)
    assert camera.inclination == 90.0
    orbit(camera, 0.0, -500.0)
    assert camera.inclination == -90.0


def test_orbit_keeps_target_and_distance():
    camera = Camera(np.array([1.0, 2.0, 3.0]), 7.0)
    orbit(camera, 33.0, -12.0)
    assert np.linalg.norm(eye(camera) - [1.0, 2.0, 3.0]) == pytest.approx(7.0)


def test_pan_by_one_moves_by_the_height_of_the_view():
    """At a distance of 4 and a half angle of 45 degrees, 8 units are visible."""
    camera = Camera(distance=4.0, azimuth=0.0, inclination=0.0, fov=90.0)
    pan(camera, 1.0, 0.5)
    np.testing.assert_allclose(camera.target, [8.0, 4.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("orthographic", [False, True])
def test_pan_moves_the_scene_with_the_pointer(orthographic):
    camera = Camera(np.array([1.0, 2.0, 3.0]), 4.0, 30.0, 20.0, orthographic=orthographic)
    point = camera.target.copy()
    pan(camera, -0.25, -0.1)
    # A quarter of the height is half a unit of device coordinates upwards; horizontally it is
    # divided by the aspect 2.
    np.testing.assert_allclose(projected(camera, point, aspect=2.0)[0, :2], [0.25, 0.2], atol=1e-9)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("factor", [0.25, 0.9, 1.0, 3.0])
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.4, -0.3), (-0.7, 0.5)])
def test_zoom_keeps_the_point_under_the_pointer(orthographic, factor, x, y):
    camera = Camera(np.array([1.0, 2.0, 3.0]), 4.0, 30.0, 20.0, orthographic=orthographic)
    right, up, _ = camera_axes(camera)
    point = camera.target + 2.0 * camera.half_height * (x * right + y * up)
    before = projected(camera, point)
    np.testing.assert_allclose(before[0, :2], [2 * x, 2 * y], atol=1e-9)
    zoom(camera, factor, x, y)
    np.testing.assert_allclose(projected(camera, point)[0, :2], before[0, :2], atol=1e-9)
    assert camera.distance == pytest.approx(4.0 * factor)


def test_zoom_never_reaches_zero_or_infinity():
    camera = Camera()
    for factor in (1e-30, 1e-30, 1e300, 1e300):
        zoom(camera, factor, 0.1, 0.1)
        assert 0.0 < camera.distance < math.inf
        assert np.isfinite(camera.target).all()
        assert np.isfinite(camera.view_matrix()).all()


def test_copy_shares_no_array():
    camera = Camera(np.array([1.0, 2.0, 3.0]), 4.0, 5.0, 6.0, 7.0, True, "z")
    twin = camera.copy()
    assert (twin.distance, twin.azimuth, twin.inclination) == (4.0, 5.0, 6.0)
    assert (twin.fov, twin.orthographic, twin.up) == (7.0, True, "z")
    twin.target[0] = 9.0
    assert camera.target[0] == 1.0


AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1)}
AXES["-z"] = (0, 0, -1)
FACING = [("y", front) for front in ("+x", "-x", "+z", "-z")]


FACING += [("z", front) for front in ("+x", "-x", "+y", "-y")]


@pytest.mark.parametrize(("up", "front"), FACING)
def test_front_view_is_on_the_front_axis(up, front):
    camera = facing_camera(front, up)
    look_from(camera, "front")
    np.testing.assert_allclose(camera_axes(camera)[2], AXES[front], atol=1e-12)
    look_from(camera, "back")
    np.testing.assert_allclose(camera_axes(camera)[2], np.negative(AXES[front]), atol=1e-12)
    # left x up = front, so up x front = left
    left = np.cross(AXES[f"+{up}"], AXES[front])
    look_from(camera, "left")
    np.testing.assert_allclose(camera_axes(camera)[2], left, atol=1e-12)
    look_from(camera, "top")
    np.testing.assert_allclose(camera_axes(camera)[2], AXES[f"+{up}"], atol=1e-12)
    np.testing.assert_allclose(camera_axes(camera)[1], np.negative(AXES[front]), atol=1e-12)


@pytest.mark.parametrize(("up", "front"), FACING)
def test_first_view_is_35_degrees_from_the_front(up, front):
    camera = facing_camera(front, up)
    away = camera.azimuth - front_azimuth(front, up)
    assert math.cos(math.radians(away - 35)) == pytest.approx(1.0)
    assert -180 <= camera.azimuth <= 180 and camera.inclination == 15


def test_default_front_results_in_the_default_view():
    for up, front in (("y", "+z"), ("z", "-y")):
        camera, plain = facing_camera(front, up), Camera(up=up)
        assert (camera.azimuth, camera.inclination) == (plain.azimuth, plain.inclination)


@pytest.mark.parametrize("orthographic", [False, True])
def test_fit_leaves_the_requested_margin(orthographic):
    camera = Camera(azimuth=0.0, inclination=0.0, orthographic=orthographic)
    tall = np.array([[-0.1, -1.0, 0.0], [0.1, 1.0, 0.0]])
    fit(camera, tall, 1.0, 0.7)
    np.testing.assert_allclose(np.abs(projected(camera, tall)[:, 1]), 0.7, atol=1e-9)
    wide = tall[:, [1, 0, 2]]
    fit(camera, wide, 1.0, 0.7)
    np.testing.assert_allclose(np.abs(projected(camera, wide)[:, 0]), 1 / 1.08, atol=1e-9)


def test_import_prints_no_warning_when_pyrr_is_compiled(tmp_path):
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(tmp_path)}  # nothing is compiled yet
    command = [sys.executable, "-W", "error", "-c", "import viewer.rendering.camera"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


POINT = np.array([0.3, 0.7, -0.4])


def drawn_pixel(camera) -> np.ndarray:
    """Return the pixel of the point by the camera's matrices; pixel centres are integers."""
    matrix = camera.projection_matrix(SIZE[0] / SIZE[1], BOX) @ camera.view_matrix()
    clip = matrix @ np.append(POINT, 1.0)
    x, y = clip[:2] / clip[3]
    return np.array([(x + 1.0) / 2.0 * SIZE[0], (1.0 - y) / 2.0 * SIZE[1]]) - 0.5


@pytest.mark.parametrize("frame", range(FILMED))
def test_point_is_drawn_at_its_pixel_in_every_frame(frame):
    view = moving_camera()
    camera = camera_from_view(view, SIZE, "y", seen=view_at(view, frame / RATE))
    assert_allclose(drawn_pixel(camera), pixel(view, frame, POINT), atol=1e-9)
    assert camera.fixed is view


def test_time_moves_the_camera_and_released_camera_keeps_the_position():
    view = moving_camera()
    camera = camera_from_view(view, SIZE, "y")
    follow_view(camera, SIZE, Scene([], time=0.4), BOX)
    assert_allclose(drawn_pixel(camera), pixel(view, 4, POINT), atol=1e-9)
    camera.fixed = None
    assert_allclose(eye(camera), [0.8, 0.5, 5.0], atol=1e-9)
    # The camera has rotated by 12 degrees to the left, about +y.
    backward = camera.rotation()[2]
    assert_allclose(backward, [np.sin(np.radians(12)), 0, np.cos(np.radians(12))], atol=1e-9)


def test_released_camera_keeps_its_position():
    camera = camera_from_view(moving_camera(), SIZE, "y")
    camera.fixed = None
    before = camera.view_matrix()
    follow_view(camera, SIZE, Scene([], time=0.4), BOX)
    assert_allclose(camera.view_matrix(), before, atol=0)


def test_frusta_are_at_the_camera_position_of_the_scene_time():
    view, options = moving_camera(), DisplayOptions(cameras=True)
    scene = Scene([], views=(view,), time=0.3)
    (drawn,) = drawn_cameras(scene, None, options)
    assert_allclose(-drawn.rotation.T @ drawn.translation, [0.6, 0.5, 5.0], atol=1e-12)
    assert drawn_cameras(scene, view, options) == []
    framed = with_cameras(scene, options, np.zeros((1, 3)))
    assert framed[:, 0].max() >= 0.8  # the last frame of the camera


def test_recorded_frames_follow_the_time():
    view = moving_camera()
    scene = Scene([], views=(view,))
    camera = camera_from_view(view, SIZE, "y")
    recording = Recording(scene, np.array([0.0, 0.2]), camera, SIZE)
    scene.time = 0.2
    seen = _Cameras(recording).at(1, scene)
    assert_allclose(drawn_pixel(seen), pixel(view, 2, POINT), atol=1e-9)


WIDE = (200, 100)


@pytest.fixture
def view():
    """Return a view of a camera at (0, 0, 4) that looks along -z with 90 degrees."""
    return view_of(Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=4.0), WIDE, BOX)


def test_pixels_are_those_of_a_pinhole(view):
    # Since tan(45 deg) = 1, a unit at a distance of 4 is 50 / 4 pixels from the centre (100, 50).
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 1.0, 2.0], [-2.0, -1.0, -1.0]])
    found = project(view, WIDE, points)
    wanted = [[100, 50], [112.5, 25], [125, 25], [80, 60]]
    assert_allclose(found.pixels, wanted, atol=1e-9)
    assert found.seen.all()
    assert found.depths[2] < found.depths[0] == found.depths[1] < found.depths[3]


def test_points_behind_or_outside_the_view_are_not_visible(view):
    points = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 4.0], [9.0, 0.0, 0.0], [0.0, 4.5, 0.0]])
    assert not project(view, WIDE, points).seen.any()


def test_no_points_project_to_no_points(view):
    assert project(view, WIDE, np.zeros((0, 3))).pixels.shape == (0, 2)


@pytest.mark.parametrize("orthographic", [False, True])
def test_pixels_unproject_to_points_at_a_given_depth(orthographic):
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=4.0, orthographic=orthographic)
    view, points = view_of(camera, WIDE, BOX), np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 2.0]])
    found = unproject(view, WIDE, points, np.array([[112.5, 25.0], [100.0, 75.0]]))
    # A unit is 12.5 pixels at the target; at z = 2 half as much is visible, except with an
    # orthographic camera.
    assert_allclose(found, [[1, 2, 0], [0, -2 if orthographic else -1, 2]], atol=1e-12)


def test_segment_in_front_keeps_both_ends(view):
    ends, seen = project_segments(view, WIDE, np.zeros((1, 3)), np.array([[1.0, 2.0, 0.0]]))
    assert seen.all()
    assert_allclose(ends, [[[100, 50], [112.5, 25]]], atol=1e-9)


def test_segment_that_ends_behind_the_eye_keeps_its_direction(view):
    # In the plane x = y, the segment projects to a line to the right and upwards for any clipping.
    ends, seen = project_segments(
        view, WIDE, np.array([[1.0, 1.0, 0.0]]), np.array([[1.0, 1.0, 9.0]])
    )
    start, end = ends[0]
    assert seen.all()
    assert_allclose(start, [112.5, 37.5], atol=1e-9)
    way = end - start
    assert way[0] > 1.0 and math.isclose(way[0], -way[1], rel_tol=1e-9)


def test_segment_behind_the_eye_is_not_visible(view):
    behind = np.array([[0.0, 0.0, 5.0], [1.0, 0.0, 4.5]])
    assert not project_segments(view, WIDE, behind, behind[::-1])[1].any()


@pytest.mark.parametrize(
    ("size", "scale"),
    [
        ((1280, 720), 1.0),
        ((2560, 1440), 2.0),
        ((720, 1440), 0.8),
        ((99, 99), 0.8),
        ((9999, 9999), 4.0),
    ],
)
def test_marks_grow_with_the_image(size, scale):
    # 720 x 1440 counts as a height of 540 pixels, which is below the minimum for marks.
    assert picture_scale(size) == pytest.approx(scale)
