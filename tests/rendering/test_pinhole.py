"""Calibrated cameras, for which points project to the pixels of OpenCV's formula."""

import math

import numpy as np
import pytest
from rendering.drawn_figures import square

from viewer.errors import RigError
from viewer.rendering.camera import Camera, camera_axes, camera_from_view, eye, orbit
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.pinhole import distortion_error
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
K = np.array([[800.0, 0.0, 300.0], [0.0, 820.0, 260.0], [0.0, 0.0, 1.0]])


def camera_view(**changes) -> CameraView:
    """Return an upright camera 5 in front of the origin of a y-up scene, looking along -z."""
    parts = {
        "name": "01",
        "intrinsic": K,
        "rotation": np.diag([1.0, -1.0, -1.0]),
        "translation": [0.0, 0.0, 5.0],
        "size": (640, 480),
    }
    return CameraView(**{**parts, **changes})


def pixel(view: CameraView, point, size) -> np.ndarray:
    """Return a scene point projected by our matrices, in pixels from the centre of the first pixel.
    OpenGL's window coordinates start at the lower left corner of the image.
    """
    camera = Camera(fixed=view)
    clip = camera.projection_matrix(size[0] / size[1], BOX) @ camera.view_matrix() @ [*point, 1.0]
    assert -1.0 <= clip[2] / clip[3] <= 1.0
    x, y = clip[:2] / clip[3]
    return np.array([0.5 * (1.0 + x) * size[0] - 0.5, 0.5 * (1.0 - y) * size[1] - 0.5])


@pytest.mark.parametrize(
    ("point", "wanted"),
    [
        ((0.0, 0.0, 0.0), (300.0, 260.0)),  # on the axis: the principal point
        ((1.0, 0.0, 0.0), (460.0, 260.0)),  # 800 / 5 to the right
        ((0.0, 1.0, 0.0), (300.0, 96.0)),  # 820 / 5 upwards
        ((-0.5, -1.0, 1.0), (200.0, 465.0)),  # nearer: 0.5 * 800 / 4, 820 / 4
    ],
)
def test_points_project_to_their_observed_pixels(point, wanted):
    assert pixel(camera_view(), point, (640, 480)) == pytest.approx(wanted, abs=1e-9)


def test_every_point_projects_by_the_intrinsic_matrix():
    rng = np.random.default_rng(0)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + math.sin(0.4) * cross + (1 - math.cos(0.4)) * cross @ cross
    skewed = K.copy()
    skewed[0, 1] = 12.0
    for scale in (1.0, 2.5):
        view = camera_view(
            intrinsic=scale * skewed,
            rotation=turn @ np.diag([1.0, -1.0, -1.0]),
            translation=[0.2, -0.1, 6.0],
        )
        for point in rng.uniform(-1.0, 1.0, (50, 3)):
            seen = skewed @ (view.rotation @ point + view.translation)
            found = pixel(view, point, (640, 480))
            assert found == pytest.approx(seen[:2] / seen[2], abs=1e-8)


def test_larger_image_shows_the_same_view():
    point = (0.4, -0.3, 0.2)
    small, large = (pixel(camera_view(), point, size) for size in ((640, 480), (1920, 1440)))
    assert large + 0.5 == pytest.approx(3.0 * (small + 0.5))


def test_images_of_another_aspect_ratio_are_letterboxed():
    point = (0.4, -0.3, 0.2)
    small = pixel(camera_view(), point, (640, 480))
    assert pixel(camera_view(), point, (800, 480)) == pytest.approx(small + np.array([80.0, 0.0]))
    assert pixel(camera_view(), point, (640, 500)) == pytest.approx(small + np.array([0.0, 10.0]))


def test_principal_point_is_in_the_middle_without_a_size():
    # Pixels are counted from the centre of the first pixel: the centre of 601 pixels is 300.
    assert camera_view(size=None).picture_size == (601.0, 521.0)
    assert camera_view(size=None, intrinsic=2.0 * K).picture_size == (601.0, 521.0)
    assert pixel(camera_view(size=None), (0, 0, 0), (601, 521)) == pytest.approx([300.0, 260.0])
    # On the axis of the camera, and so in the middle of pictures of any size.
    centre = pixel(camera_view(size=None), (0, 0, 0), (1202, 1042))
    assert centre == pytest.approx([600.5, 520.5])
    with pytest.raises(RigError) as caught:
        _ = camera_view(size=None, intrinsic=np.diag([800.0, 800.0, 1.0])).picture_size
    assert str(caught.value) == (
        "camera 01: expected a principal point above 0 or the size of the pictures, found 0, 0"
    )


def test_rendered_points_match_the_projection():
    """Two captured points, 1 apart, and the corners of a square."""
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2)), [-1, -1])
    dots = Actor(Figure("dots", points=layout))
    dots.points = np.array([[0.3, 0.2, 0.1, 1.0], [-0.7, 0.2, 0.1, 1.0]])
    wall = Actor(Figure("wall", square(z=-3.0, half=0.5)))
    camera = camera_from_view(camera_view(), (640, 480), "y")
    options = DisplayOptions(background="transparent", grid=False, samples=1)
    with Offscreen() as offscreen:
        alone = offscreen.render(Scene([wall]), (640, 480), camera, options, BOX)
        marks = offscreen.render(Scene([dots]), (640, 480), camera, options, BOX)
    rows, columns = np.nonzero(alone[..., 3])
    # Corners at +-0.5 and a distance of 8 are at 300 +- 50 and 260 +- 51.25; the outermost
    # pixels may or may not be covered.
    assert (columns.min(), columns.max()) in ((250, 350), (250, 349), (251, 350), (251, 349))
    assert (rows.min(), rows.max()) == (209, 311)
    rows, columns = np.nonzero(marks[..., 3])
    right = columns > 300
    # The point is at 300 + 800 * 0.3 / 4.9 and 260 - 820 * 0.2 / 4.9.
    assert (columns[right].mean(), rows[right].mean()) == pytest.approx((348.98, 226.53), abs=0.5)
    # The other point is at 300 - 800 * 0.7 / 4.9.
    assert (columns[~right].mean(), rows[~right].mean()) == pytest.approx((185.71, 226.53), abs=0.5)


def test_depth_range_covers_the_scene_also_from_inside():
    for distance in (0.5, 3.0, 30.0):
        view = camera_view(translation=[0.0, 0.0, distance])
        camera = Camera(fixed=view)
        matrix = camera.projection_matrix(1.0, BOX) @ camera.view_matrix()
        for z in (-1.0, 0.0, min(1.0, distance - 0.2)):
            clip = matrix @ [0.0, 0.0, z, 1.0]
            assert -1.0 <= clip[2] / clip[3] <= 1.0


@pytest.mark.parametrize("up", ["y", "z"])
def test_leaving_the_fixed_view_keeps_the_camera_position(up):
    """The resulting orbit camera has the same position and viewing direction."""
    start = Camera(np.array([0.3, 0.2, -0.1]), 4.0, 40.0, -20.0, up=up)
    right, upward, backward = camera_axes(start)
    rotation = np.stack([right, -upward, -backward])
    view = camera_view(rotation=rotation, translation=-rotation @ eye(start))
    camera = camera_from_view(view, (640, 480), up, BOX)
    assert camera.fixed is view and not camera.is_parallel
    assert camera.copy().fixed is view
    assert np.allclose(camera.view_matrix(), start.view_matrix(), atol=1e-12)
    camera.fixed = None
    assert np.allclose(camera.view_matrix(), start.view_matrix(), atol=1e-12)
    assert (camera.azimuth, camera.inclination) == pytest.approx((40.0, -20.0))
    # 480 rows at a focal length of 820: 2 atan(240 / 820).
    assert camera.fov == pytest.approx(math.degrees(2.0 * math.atan(240 / 820)))
    orbit(camera, 10.0, 0.0)
    assert camera.azimuth == pytest.approx(50.0)


def test_camera_facing_away_can_orbit():
    view = camera_view(rotation=np.diag([-1.0, -1.0, 1.0]), translation=[0.0, 0.0, 4.0])
    away = camera_view(rotation=np.eye(3), translation=[0.0, 0.0, 0.0])
    for one in (view, away):
        camera = camera_from_view(one, (640, 480), "y")
        assert camera.distance > 0.0 and np.isfinite(camera.view_matrix()).all()


def test_camera_almost_at_the_centre_can_orbit():
    """The distance is too small to be divided by."""
    camera = camera_from_view(camera_view(translation=[0.0, 0.0, 1e-12]), (640, 480), "y")
    assert camera.distance == 1.0


def test_upside_down_images_have_the_same_field_of_view():
    upright = camera_from_view(camera_view(), (640, 480), "y")
    flipped = K * [[1.0], [-1.0], [1.0]]
    assert camera_from_view(camera_view(intrinsic=flipped), (640, 480), "y").fov == upright.fov


def test_wide_images_keep_the_horizontal_field_of_view():
    camera = camera_from_view(camera_view(), (480, 480), "y")
    # The 640 columns fit into the width, so 640 rows are visible.
    assert camera.fov == pytest.approx(math.degrees(2 * math.atan(320 / 820)))


def test_fixed_camera_is_never_orthographic():
    camera = Camera(orthographic=True, fixed=camera_view())
    assert not camera.is_parallel
    camera.fixed = None
    assert camera.is_parallel


def test_distortion_matches_hand_calculation():
    """The corner of the image with K = diag(100, 100, 1) and the principal point at (50, 50)."""
    k = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 50.0], [0.0, 0.0, 1.0]])

    def error(*coefficients):
        view = camera_view(intrinsic=k, size=(101, 101), distortion=coefficients)
        return distortion_error(view)

    assert error() == 0.0
    assert error(0.0, 0.0, 0.0, 0.0, 0.0) == 0.0
    # The corners are at +-0.5, so r^2 = 0.5. k1 = 0.1 moves both axes by 0.5 * 0.05, 2.5 pixels.
    assert error(0.1) == pytest.approx(2.5 * math.sqrt(2))
    assert error(0.0, 0.2) == pytest.approx(2.5 * math.sqrt(2))
    assert error(0.0, 0.0, 0.0, 0.0, 0.4) == pytest.approx(2.5 * math.sqrt(2))
    # At (0.5, 0.5), p1 adds dx = 2 p1 / 4 and dy = p1 (0.5 + 0.5), which are 0.5 and 1 pixels for
    # p1 = 0.01.
    assert error(0.0, 0.0, 0.01) == pytest.approx(math.hypot(0.5, 1.0))
    assert error(0.0, 0.0, 0.0, 0.01) == pytest.approx(math.hypot(0.5, 1.0))
    # k4 = 1 divides by 1.5: the 50 pixels of each axis are reduced by a third.
    assert error(0, 0, 0, 0, 0, 1.0) == pytest.approx(50 / 3 * math.sqrt(2))


def test_camera_very_far_away_has_a_depth_range():
    for distance in (1e9, 1e20, 1e38):
        camera = Camera(fixed=camera_view(translation=[0.0, 0.0, distance]))
        matrix = camera.projection_matrix(1.0, BOX)
        assert np.isfinite(matrix).all()
        clip = matrix @ [0.0, 0.0, -distance, 1.0]
        assert -1.0 <= clip[2] / clip[3] <= 1.0


def test_distortion_with_a_zero_denominator_is_infinite():
    """The corners have r^2 = 0.5, so k4 = -2 makes the divisor 1 - 2 * 0.5 = 0."""
    k = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 50.0], [0.0, 0.0, 1.0]])
    view = camera_view(intrinsic=k, size=(101, 101), distortion=[0.0] * 5 + [-2.0])
    assert distortion_error(view) > 1e9
