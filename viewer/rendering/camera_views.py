"""Drawing of calibrated cameras: the image behind the scene, and frusta with their images."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.late_passes import LatePasses
from viewer.rendering.view import View
from viewer.rig.arrays import Floats
from viewer.rig.mesh import bounding_box
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.rendering.overlay.annotation import Annotation
    from viewer.rig.captures.camera_images import CameraImage
    from viewer.rig.captures.camera_view import CameraView

__all__ = [
    "draw_image_behind",
    "draw_image_planes",
    "drawn_cameras",
    "fits",
    "frusta_of",
    "reach_of",
    "with_cameras",
]

_FRAMED = 24  # number of framed positions along the path of a moving camera
_TOLERANCE = 0.01  # maximum relative difference of aspect ratios: one pixel of a small image


def drawn_cameras(
    scene: Scene, view_through: CameraView | None, options: DisplayOptions
) -> list[CameraView]:
    """Return the cameras whose frusta are drawn, at the scene's time: all except the one in use."""
    if not options.cameras or not scene.views:
        return []
    from viewer.rig.captures.carried_view import view_in

    return [view_in(camera, scene) for camera in scene.views if camera is not view_through]


def reach_of(
    scene: Scene, view_through: CameraView | None, options: DisplayOptions, box: Floats
) -> Floats:
    """Return the box of a scene and its drawn cameras, for the depth range: (2, 3)."""
    cameras = drawn_cameras(scene, view_through, options)
    if not cameras:
        return box
    from viewer.rendering.overlay.frusta import frusta_points

    return bounding_box(np.concatenate([box, frusta_points(cameras, box)]))


def frusta_of(
    scene: Scene,
    view_through: CameraView | None,
    options: DisplayOptions,
    box: Floats,
    size: tuple[int, int],
) -> list[Annotation]:
    """Return the annotation of the drawn frusta, or None if there are none."""
    cameras = drawn_cameras(scene, view_through, options)
    if not cameras:
        return []
    from viewer.rendering.overlay.frusta import frusta_annotation

    return [frusta_annotation(cameras, box, size)]


def _image(scene: Scene, camera: CameraView) -> CameraImage | None:
    """Return a camera's image at the scene's time if it has the calibration's aspect ratio."""
    if scene.images is None:
        return None
    image = scene.images.at(camera.name, scene.time or 0.0)
    return image if image is not None and fits(camera, image.pixels.shape[1::-1]) else None


def fits(camera: CameraView, size: tuple[int, ...]) -> bool:
    """Return whether images of a size have the aspect ratio of a camera's calibration."""
    from viewer.rendering.pinhole import picture_size

    width, height = picture_size(camera)
    return abs(size[0] * height / (size[1] * width) - 1.0) <= _TOLERANCE


def with_cameras(
    scene: Scene, options: DisplayOptions, points: Floats, poses: Iterable[Scene] | None = None
) -> Floats:
    """Return the points to frame: the figures' points, and the corners of drawn frusta.

    Cameras that move in frames are framed along their whole path, those that a figure moves where
    they are in some poses of the scene; without these, where they are now.
    """
    if not options.cameras or not scene.views:
        return points
    from viewer.rendering.overlay.frusta import frusta_points
    from viewer.rig.captures.camera_view import motion_times, view_at
    from viewer.rig.captures.carried_view import view_in

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
    from viewer.rendering.overlay.frusta import frustum_depth

    for camera in drawn_cameras(scene, view.camera.fixed, options):
        image = _image(scene, camera)
        if image is not None:
            late.camera_image_pass.draw_plane(camera, image, view, frustum_depth(box), 1.0)
