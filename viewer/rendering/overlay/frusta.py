"""Frusta of calibrated cameras, as segments and labels in the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.phrases import printable
from viewer.rendering.overlay.annotation import LABEL_COLOR, Annotation, Labels
from viewer.rendering.overlay.segments import Segments, SegmentStyle
from viewer.rendering.pinhole import picture_size
from viewer.rendering.projection import picture_scale
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.mesh import box_size

__all__ = [
    "camera_centers",
    "frusta_annotation",
    "frusta_points",
    "frustum_corners",
    "frustum_depth",
]

_DEPTH = 0.2  # distance of the image planes, relative to the size of the scene
_WIDTH = 1.8  # width of lines, pixels
_COLOR = (0.10, 0.13, 0.18, 0.95)  # colour of lines, sRGB and opacity
_TICK = 0.22  # height of the mark above a frustum's upper side, relative to that side's length
_RANK = 1  # rank of the labels: joint names and findings take precedence


def frustum_depth(box: Floats) -> float:
    """Return the distance of image planes from their cameras for a scene, scene units."""
    return _DEPTH * (box_size(box) or 1.0)


def frustum_corners(camera: CameraView, depth: float) -> Floats:
    """Return the corners of a camera's image at a depth: (4, 3), scene space.

    Clockwise from the upper left; these are the corners of the outermost pixels, with
    X = R^T (d K^-1 u - T), without lens distortion.
    """
    width, height = picture_size(camera)
    k = camera.intrinsic / camera.intrinsic[2, 2]
    left, top, right, bottom = -0.5, -0.5, width - 0.5, height - 0.5
    pixels = [[left, top, 1.0], [right, top, 1.0], [right, bottom, 1.0], [left, bottom, 1.0]]
    rays = np.linalg.solve(k, np.transpose(pixels)).T
    return (depth * rays - camera.translation) @ camera.rotation


def camera_centers(cameras: Sequence[CameraView]) -> Floats:
    """Return the positions of cameras, -R^T T: (N, 3), scene space."""
    return np.array([-camera.rotation.T @ camera.translation for camera in cameras]).reshape(-1, 3)


def frusta_points(cameras: Sequence[CameraView], box: Floats) -> Floats:
    """Return the corners and tips of all frusta: (N, 3); ``box`` is the scene's box."""
    depth = frustum_depth(box)
    corners = [frustum_corners(camera, depth) for camera in cameras]
    return np.concatenate([camera_centers(cameras), *corners])


def frusta_annotation(
    cameras: Sequence[CameraView], box: Floats, size: tuple[int, int]
) -> Annotation:
    """Return the frusta of cameras, with their names.

    Parameters
    ----------
    cameras : sequence of CameraView
        At least one.
    box : (2, 3)
        Bounds of the scene, which determine the size of the frusta.
    size : (int, int)
        Width and height of the image, pixels.
    """
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
    return Annotation(segments, SegmentStyle(), labels)
