"""A video behind the scene, seen through a moving camera, with markers at the scene's points."""

import numpy as np
import pytest
from rendering.moving import FILMED, RATE, SIZE, moving_camera, pixel

from viewer.formats._video_images import VideoImages
from viewer.media.video import VideoSink
from viewer.rendering.camera import camera_from_view
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rig.captures.carried_view import view_in
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor, Scene

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


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as kept:
        yield kept


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
