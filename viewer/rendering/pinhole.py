"""Geometry of calibrated cameras: OpenGL matrices, lens distortion, frusta."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.mesh import box_size

if TYPE_CHECKING:
    from viewer.rigs.captures.cameras import CameraView

_FLIP = np.diag([1.0, -1.0, -1.0])  # OpenCV looks along z with y down, OpenGL along -z with y up
_UNBOUNDED = 1e9  # value that replaces an infinite distortion
_THINNEST = 1e-6  # minimum depth in front of and behind the scene, relative to its distance
_DEPTH = 0.2  # distance of the image planes of frusta, relative to the size of the scene
_NEAREST = 5e-3  # minimum near plane, relative to the distance of the scene's centre


def pinhole_view(view: CameraView) -> Floats:
    """Return the matrix from scene to OpenGL's camera space, F [R | T]: (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = _FLIP @ view.rotation
    matrix[:3, 3] = _FLIP @ view.translation
    return matrix


def pinhole_projection(view: CameraView, aspect: float, box: Floats) -> Floats:
    """Return the matrix, (4, 4), from camera to clip space that reproduces the camera's image.

    OpenCV's pixel coordinates start at the centre of the first pixel, OpenGL's at its corner. So
    for u from K and the image's width W, x = 2 (u + 1/2) / W - 1 in -1..1. An image with a
    different aspect ratio shows all of the camera's image in its centre, with margins on two sides.
    ``box``: (2, 3), bounds that must lie between the near and the far plane, scene space.
    """
    width, height = view.picture_size
    k = view.intrinsic / view.intrinsic[2, 2]
    distance = float(np.linalg.norm(view.rotation @ box.mean(axis=0) + view.translation))
    reach = box_size(box) or distance or 1.0
    # At very large distances, rounding would put both planes at the same distance.
    before, behind = max(reach, _THINNEST * distance), max(20.0 * reach, _THINNEST * distance)
    near, far = max(distance - before, _NEAREST * (distance + reach)), distance + behind
    matrix = np.zeros((4, 4))
    # OpenGL's camera space is OpenCV's with y and z negated, so w is -z.
    matrix[0, :3] = 2.0 * k[0, 0] / width, -2.0 * k[0, 1] / width, _offset(k[0, 2], width)
    matrix[1, :3] = 0.0, 2.0 * k[1, 1] / height, -_offset(k[1, 2], height)
    matrix[2, 2:] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    matrix[3, 2] = -1.0
    own = width / height
    matrix[0] *= min(own / aspect, 1.0)
    matrix[1] *= min(aspect / own, 1.0)
    return matrix


def _offset(principal: float, side: float) -> float:
    """Return the offset from the principal point to the centre, in half image sizes."""
    return 1.0 - 2.0 * (principal + 0.5) / side


def distortion_error(view: CameraView) -> float:
    """Return the largest displacement of an image corner by lens distortion, pixels.

    This is the error of a view through the camera that neglects the distortion. OpenCV's model is,
    with r^2 = x^2 + y^2: x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2
    p1 x y + p2 (r^2 + 2 x^2), and likewise y' with p1 and p2 exchanged. The coefficients are k1 k2
    p1 p2 k3 k4 k5 k6, of which trailing ones may be missing; the thin prism coefficients after them
    are ignored.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = np.append(view.distortion, np.zeros(8))[:8]
    width, height = view.picture_size
    k = view.intrinsic / view.intrinsic[2, 2]
    corners = [[u, v, 1.0] for u in (0.0, width - 1.0) for v in (0.0, height - 1.0)]
    x, y, _ = np.linalg.solve(k, np.transpose(corners))
    r2 = x * x + y * y
    # Where the divisor is 0, the model is undefined at the corner.
    with np.errstate(divide="ignore", invalid="ignore"):
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    radial = np.where(np.isfinite(radial), radial, _UNBOUNDED)
    dx = x * (radial - 1.0) + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    dy = y * (radial - 1.0) + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    moved = k[:2, :2] @ np.stack([dx, dy])
    return float(np.linalg.norm(moved, axis=0).max())


def frustum_depth(box: Floats) -> float:
    """Return the distance of image planes from their cameras for a scene, scene units."""
    return _DEPTH * (box_size(box) or 1.0)


def frustum_corners(camera: CameraView, depth: float) -> Floats:
    """Return the corners of a camera's image at a depth: (4, 3), scene space."""
    # They are clockwise from the upper left, at the corners of the outermost pixels: X = R^T (d
    # K^-1 u - T), without lens distortion.
    width, height = camera.picture_size
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
