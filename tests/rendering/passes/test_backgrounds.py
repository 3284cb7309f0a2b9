"""Passes behind figures: background, ground and images of a camera."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, sphere
from rendering.moving import FILMED, RATE, SIZE, moving_camera, pixel
from rendering.plain_pictures import draw, front, plain

from viewer.formats._video_images import VideoImages
from viewer.media.video import VideoSink
from viewer.rendering.camera import Camera, camera_from_view
from viewer.rendering.options import DisplayOptions
from viewer.rigs.captures.carried_view import view_in
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene, pose_actors

EMPTY = Scene([])


@pytest.mark.parametrize("samples", [1, 4])
def test_every_frame_has_the_same_gradient(offscreen, samples):
    options = plain(background="gradient", samples=samples)
    sizes = [(60, 40), (60, 40), (60, 40), (40, 30), (60, 40)]
    found = [draw(offscreen, EMPTY, options, size=size) for size in sizes]
    # The first background is computed, the second copied, and other sizes do not change it.
    for frame in (found[1], found[2], found[4]):
        np.testing.assert_array_equal(frame, found[0])
    # The dithered sRGB colours are 0.36, 0.43, 0.52 at the upper and 0.80, 0.83, 0.86 at the lower
    # edge.
    for row, color in ((0, (0.36, 0.43, 0.52)), (-1, (0.80, 0.83, 0.86))):
        step = (np.array((0.80, 0.83, 0.86)) - (0.36, 0.43, 0.52)) / 80.0
        expected = 255.0 * (np.array(color) + (step if row == 0 else -step))
        np.testing.assert_allclose(found[0][row, :, :3].mean(axis=0), expected, atol=1.0)


@pytest.mark.parametrize(
    "background, color",
    [("white", (255, 255, 255, 255)), ("#336699", (51, 102, 153, 255)), ("transparent", (0,) * 4)],
)
def test_color_fills_the_image_exactly(offscreen, background, color):
    for samples in (1, 4):
        picture = draw(offscreen, EMPTY, plain(background=background, samples=samples))
        assert (picture == color).all()


def test_frame_shows_no_pixels_of_the_previous_frame(offscreen):
    options = plain(background="gradient")
    empty = draw(offscreen, EMPTY, options)
    draw(offscreen, scene_of(sphere(8)), options, front())
    np.testing.assert_array_equal(draw(offscreen, EMPTY, options), empty)


def test_flat_mesh_on_the_ground_hides_the_grid(offscreen):
    """Its triangles and those of the grid have the same depth, up to rounding."""
    corners = np.array([[-1.7, 0, -1.3], [1.6, 0, -1.4], [1.9, 0, 1.2], [-1.8, 0, 1.5]])
    mesh = Mesh(
        positions=100.0 * corners,
        normals=np.tile([0.0, 1.0, 0.0], (4, 1)),
        triangles=np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32),
    )
    scene = scene_of(mesh)
    options = plain(background="#ff0000")
    for azimuth in (10.0, 40.0, 130.0, 250.0):
        # The camera is so close that the mesh fills the picture.
        camera = Camera(azimuth=azimuth, inclination=40.0, distance=120.0)
        empty = draw(offscreen, scene, replace(options, grid=False), camera, size=(160, 120))
        found = draw(offscreen, scene, replace(options, grid=True), camera, size=(160, 120))
        np.testing.assert_array_equal(found, empty)
        assert (empty[..., 1] > 0).all(), "the background is visible"


pytest.importorskip("av")


PLACES = np.array([[0.3, 0.7, -0.4], [-0.6, 0.2, 0.3]])
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Write a black video of the camera with a white disc at each point."""
    path, view = tmp_path_factory.mktemp("video") / "film.mp4", moving_camera()
    sink = VideoSink(path, SIZE, RATE, quality=100.0)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    for frame in range(FILMED):
        pixels = np.zeros((SIZE[1], SIZE[0], 4), dtype=np.uint8)
        for place in PLACES:
            u, v = pixel(view, frame, place)
            pixels[(x - u) ** 2 + (y - v) ** 2 < 7.0**2] = 255
        sink.write(frame, pixels)
    sink.close()
    return path


def scene_with(path) -> Scene:
    """Return a scene of two points, drawn in colours, and the video."""
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2), np.int32), np.array([-1, 1]))
    rows = np.hstack([PLACES, [[1.0], [1.0]]])[None]
    clip = PointClip("two", Timing(RATE, np.zeros(FILMED, np.int32)), rows)
    images = VideoImages(path, 0.0, FILMED / RATE, ("video",))
    actor = Actor(Figure("two", points=layout), clip=clip)
    return Scene([actor], views=(moving_camera(),), images=images)


@pytest.mark.parametrize("frame", [0, 3, 1])
def test_points_are_drawn_over_their_markers_in_the_video(path, offscreen, frame):
    scene = scene_with(path)
    scene.time = frame / RATE
    pose_actors([scene.actors[0]], scene.time)
    camera = camera_from_view(scene.views[0], SIZE, "y", seen=view_in(scene.views[0], scene))
    options = DisplayOptions(grid=False, image_brightness=1.0, quality="draft", samples=1)
    drawn = offscreen.render(scene, SIZE, camera, options, BOX)[..., :3].astype(int)
    image = scene.images.at("video", scene.time).pixels[..., :3].astype(int)
    # The background is exactly the frame of that time; only the pixels of the points differ.
    y, x = np.nonzero(np.abs(drawn - image).max(axis=2) > 25)
    assert image[y, x].min() > 200  # all are over a white disc
    expected = np.array([pixel(scene.views[0], frame, place) for place in PLACES])
    nearest = np.hypot(*(np.stack([x, y], axis=1) - expected[:, None]).T).argmin(axis=1)
    for point in (0, 1):
        of_point = nearest == point
        assert of_point.any()
        found = [x[of_point].mean(), y[of_point].mean()]
        np.testing.assert_allclose(found, expected[point], atol=0.8)  # a few full pixels
