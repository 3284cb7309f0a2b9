"""Calibrated cameras in an image: the image behind the scene, frusta with their images, messages.

The messages are about missing images, mismatched sizes and lens distortion.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from viewer.phrases import printable
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.late_passes import LatePasses
from viewer.rendering.pinhole import (
    camera_centers,
    distortion_error,
    frusta_points,
    frustum_corners,
    frustum_depth,
)
from viewer.rendering.projection import picture_scale
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import Scene

if TYPE_CHECKING:
    from viewer.rendering.overlay.annotation import Annotation
    from viewer.rigs.captures.cameras import CameraImage, CameraView

_FRAMED = 24  # number of framed positions along the path of a moving camera
# Frusta.
_WIDTH = 1.8  # width of lines, pixels
_COLOR = (0.10, 0.13, 0.18, 0.95)  # colour of lines, sRGB and opacity
_TICK = 0.22  # height of the mark above a frustum's upper side, relative to that side's length
_RANK = 1  # rank of the labels: joint names and findings take precedence
# Images and messages.
_TOLERANCE = 0.01  # maximum relative difference of aspect ratios: one pixel of a small image
# Minimum reported distortion, in pixels of the camera's images; smaller ones are not visible.
_VISIBLE = 0.5


def drawn_cameras(
    scene: Scene, view_through: CameraView | None, options: DisplayOptions
) -> list[CameraView]:
    """Return the cameras whose frusta are drawn, at the scene's time: all except the one in use."""
    if not options.cameras or not scene.views:
        return []
    from viewer.rigs.captures.carried_view import view_in

    return [view_in(camera, scene) for camera in scene.views if camera is not view_through]


def depth_bounds(
    scene: Scene, view_through: CameraView | None, options: DisplayOptions, box: Floats
) -> Floats:
    """Return the box of a scene and its drawn cameras, for the depth range: (2, 3)."""
    cameras = drawn_cameras(scene, view_through, options)
    if not cameras:
        return box
    return bounding_box(np.concatenate([box, frusta_points(cameras, box)]))


def with_cameras(
    scene: Scene, options: DisplayOptions, points: Floats, poses: Iterable[Scene] | None = None
) -> Floats:
    """Return the points to frame: the figures' points, and the corners of drawn frusta."""
    # Cameras that move in frames are framed along their whole path, those that a figure moves where
    # they are in some poses of the scene; without these, where they are now.
    if not options.cameras or not scene.views:
        return points
    from viewer.rigs.captures.cameras import motion_times, view_at
    from viewer.rigs.captures.carried_view import view_in

    cameras = [
        view_at(camera, seconds)
        for camera in scene.views
        if camera.mount is None
        for seconds in motion_times(camera, _FRAMED).tolist()
    ]
    mounted = [number for number, camera in enumerate(scene.views) if camera.mount is not None]
    if mounted:
        posed = [scene] if poses is None else poses
        cameras += [view_in(each.views[number], each) for each in posed for number in mounted]
    return np.concatenate([points, frusta_points(cameras, bounding_box(points))])


def frusta_of(
    scene: Scene,
    view_through: CameraView | None,
    options: DisplayOptions,
    box: Floats,
    size: tuple[int, int],
) -> list[Annotation]:
    """Return the drawn frusta with the names of their cameras, as at most one annotation."""
    cameras = drawn_cameras(scene, view_through, options)
    if not cameras:
        return []
    from viewer.rendering.overlay.annotation import LABEL_COLOR, Annotation, Labels
    from viewer.rendering.overlay.segments import Segments, SegmentStyle

    depth, centers = frustum_depth(box), camera_centers(cameras)
    starts: list[Floats] = []
    ends: list[Floats] = []
    for camera, center in zip(cameras, centers, strict=True):
        corners = frustum_corners(camera, depth)
        # A mark on the upper side shows the up direction.
        above = 0.5 * (corners[0] + corners[1]) + _TICK * (corners[0] - corners[3])
        starts += [*corners, *corners, corners[0], corners[1]]
        ends += [*np.roll(corners, -1, axis=0), *[center] * 4, above, above]
    count = len(starts)
    segments = Segments(
        np.array(starts),
        np.array(ends),
        np.tile(_COLOR, (count, 1)),
        np.full(count, _WIDTH * picture_scale(size)),
    )
    labels = Labels(
        tuple(printable(camera.name, 30) for camera in cameras),
        centers,
        np.full(len(cameras), _RANK, dtype=np.int32),
        np.tile(LABEL_COLOR, (len(cameras), 1)),
    )
    return [Annotation(segments, SegmentStyle(), labels)]


def draw_image_behind(
    late: LatePasses, scene: Scene, view: View, options: DisplayOptions, size: tuple[int, int]
) -> None:
    """Draw the image of the camera through which the scene is seen, if there is one."""
    camera = view.camera.pinhole
    if camera is None or options.image_brightness <= 0.0 or scene.images is None:
        return
    image = _image(scene, camera)
    if image is not None:
        late.camera_image_pass.draw_behind(camera, image, size, options.image_brightness)


def draw_image_planes(
    late: LatePasses, scene: Scene, view: View, options: DisplayOptions, box: Floats
) -> None:
    """Draw the images of the cameras whose frusta are drawn."""
    if scene.images is None:
        return
    for camera in drawn_cameras(scene, view.camera.fixed, options):
        image = _image(scene, camera)
        if image is not None:
            late.camera_image_pass.draw_plane(camera, image, view, frustum_depth(box))


def _image(scene: Scene, camera: CameraView) -> CameraImage | None:
    """Return a camera's image at the scene's time if it has the calibration's aspect ratio."""
    if scene.images is None:
        return None
    image = scene.images.at(camera.name, scene.time or 0.0)
    return image if image is not None and fits(camera, image.pixels.shape[1::-1]) else None


def fits(camera: CameraView, size: tuple[int, ...]) -> bool:
    """Return whether images of a size have the aspect ratio of a camera's calibration."""
    width, height = camera.picture_size
    return abs(size[0] * height / (size[1] * width) - 1.0) <= _TOLERANCE


def image_notes(scene: Scene, camera: CameraView) -> list[str]:
    """Return messages about a camera's images, one line each; an empty list if it has no images."""
    if scene.images is None:
        return []
    name, size = printable(camera.name, 40), scene.images.size_of(camera.name)
    if camera.name not in scene.images.cameras:
        return [f"camera {name}: there are no images"]
    if size is None:
        return [f"camera {name}: its first image is not readable"]
    notes = scene.images.notes_of(camera.name)
    width, height = map(round, camera.picture_size)
    if size != (width, height):
        sizes = f"its images have {size[0]} x {size[1]} pixels, the calibration {width} x {height}"
        how = "they are scaled" if fits(camera, size) else "they do not match and are not drawn"
        notes.append(f"camera {name}: {sizes}: {how}")
    return notes


def lens_notes(scene: Scene, camera: CameraView) -> list[str]:
    """Return a message about visible lens distortion, which is removed from images or neglected."""
    error = distortion_error(camera)
    if error < _VISIBLE:
        return []
    size = None if scene.images is None else scene.images.size_of(camera.name)
    has_images = size is not None and fits(camera, size)
    how = "removed from its images" if has_images else "not drawn"
    name = printable(camera.name, 40)
    return [f"camera {name}: its lens distortion of up to {error:.1f} pixels is {how}"]
