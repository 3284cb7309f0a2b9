"""Orbit camera: distance, azimuth and inclination about a target. The only importer of pyrr."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pyrr import matrix44

from viewer.rendering.pinhole import picture_size, pinhole_projection, pinhole_view
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.mesh import bounding_box, box_size

__all__ = [
    "VIEWS",
    "Camera",
    "camera_axes",
    "camera_from_view",
    "eye",
    "facing_camera",
    "fit",
    "front_azimuth",
    "look_from",
    "orbit",
    "pan",
    "zoom",
]

VIEWS = {
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "right": (-90.0, 0.0),
    "left": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}
"""Azimuth from the front, and inclination, in degrees; "left" looks at a left hand's side."""

_USUAL_AZIMUTH = 35.0  # from the front, at first

_MARGIN = 1.08  # room around a fitted figure
_SMALLEST = 1e-9  # distance of a camera that fits nothing


@dataclass(slots=True)
class Camera:
    """Where the picture is taken from.

    Attributes
    ----------
    target : (3,)
        The point it turns about, scene space.
    distance : float
        From eye to target, scene units.
    azimuth, inclination : float
        Degrees about the up axis, and above the horizon. At 0, 0 the camera looks along -z if y
        is up, along +y if z is up.
    fov : float
        Vertical field of view, degrees.
    orthographic : bool
        Parallel projection with the same height at the target.
    up : "y" or "z"
        The scene's up axis.
    fixed : CameraView or None
        A calibrated camera that is looked through: the matrices are then its own, and all else
        says where the camera will be once this is None again.
    front : float
        Azimuth from which the front is seen: named views count from it.
    """

    target: Floats = field(default_factory=lambda: np.zeros(3))
    distance: float = 3.0
    azimuth: float = _USUAL_AZIMUTH
    inclination: float = 15.0
    fov: float = 35.0
    orthographic: bool = False
    up: Literal["y", "z"] = "y"
    fixed: CameraView | None = None
    front: float = 0.0

    def copy(self) -> Camera:
        """Return a camera that shares nothing with this one."""
        return Camera(
            self.target.copy(),
            self.distance,
            self.azimuth,
            self.inclination,
            self.fov,
            self.orthographic,
            self.up,
            self.fixed,
            self.front,
        )

    @property
    def is_parallel(self) -> bool:
        """Whether it projects along parallels: a calibrated camera never does."""
        return self.orthographic and self.fixed is None

    def view_matrix(self) -> Floats:
        """Return the matrix from scene to camera space, for column vectors: (4, 4)."""
        if self.fixed is not None:
            return pinhole_view(self.fixed)
        _, up, _ = camera_axes(self)
        # pyrr's matrices suit row vectors.
        return np.array(matrix44.create_look_at(eye(self), self.target, up, dtype="f8")).T

    def projection_matrix(self, aspect: float, box: Floats) -> Floats:
        """Return the matrix from camera to clip space, for column vectors.

        Parameters
        ----------
        aspect : float
            Width / height.
        box : (2, 3)
            What must lie between the near and the far plane, scene space.

        Returns
        -------
        (4, 4)
            OpenGL clip space, z in -1..1.
        """
        if self.fixed is not None:
            return pinhole_projection(self.fixed, aspect, box)
        reach = box_size(box) + float(np.linalg.norm(box.mean(axis=0) - self.target))
        reach = reach or self.distance  # an empty scene needs a depth range too
        far = self.distance + 20.0 * reach
        if self.orthographic:
            half = self.half_height
            near = self.distance - 20.0 * reach
            matrix = matrix44.create_orthogonal_projection(
                -half * aspect, half * aspect, -half, half, near, far, dtype="f8"
            )
        else:
            near = max(self.distance - reach, 5e-3 * self.distance)
            matrix = matrix44.create_perspective_projection(self.fov, aspect, near, far, dtype="f8")
        return np.array(matrix).T

    @property
    def half_height(self) -> float:
        """Half of what is seen vertically at the target, scene units."""
        return self.distance * math.tan(math.radians(self.fov) / 2)


def camera_axes(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Return the camera's right, up and backward axes in scene space, each (3,).

    Up is the derivative of the backward axis by inclination, so it is defined at the poles too.
    """
    azimuth, inclination = math.radians(camera.azimuth), math.radians(camera.inclination)
    sin_a, cos_a = math.sin(azimuth), math.cos(azimuth)
    sin_i, cos_i = math.sin(inclination), math.cos(inclination)
    right = np.array([cos_a, 0.0, -sin_a])
    up = np.array([-sin_i * sin_a, cos_i, -sin_i * cos_a])
    backward = np.array([cos_i * sin_a, sin_i, cos_i * cos_a])
    if camera.up == "z":
        # Turn y up into z up: (x, y, z) -> (x, -z, y).
        right, up, backward = (np.array([a[0], -a[2], a[1]]) for a in (right, up, backward))
    return right, up, backward


def front_azimuth(front: str, up: Literal["y", "z"]) -> float:
    """Return the azimuth of a camera that sees a front, as ``"+x"``, from straight ahead: degrees.

    >>> front_azimuth("+z", "y"), front_azimuth("+x", "z"), front_azimuth("-z", "y")
    (0.0, 90.0, 180.0)
    """
    sign = 1.0 if front[0] == "+" else -1.0
    if front[1] == "x":
        return 90.0 * sign
    ahead = sign if up == "y" else -sign  # +z if y is up, -y if z is up
    return 0.0 if ahead > 0.0 else 180.0


def facing_camera(front: str, up: Literal["y", "z"], orthographic: bool = False) -> Camera:
    """Return a camera that looks at a front from a little to its left and above, not yet fitted."""
    ahead = front_azimuth(front, up)
    azimuth = _wrapped(ahead + _USUAL_AZIMUTH)
    return Camera(azimuth=azimuth, orthographic=orthographic, up=up, front=ahead)


def look_from(camera: Camera, view: str) -> None:
    """Turn to a named view, a key of ``VIEWS``."""
    azimuth, camera.inclination = VIEWS[view]
    camera.azimuth = _wrapped(camera.front + azimuth)


def _wrapped(angle: float) -> float:
    """Return an angle in degrees as -180 to 180; half a turn keeps its sign."""
    return angle if -180.0 <= angle <= 180.0 else (angle + 180.0) % 360.0 - 180.0


def eye(camera: Camera) -> Floats:
    """Return the position of the camera in scene space: (3,)."""
    return camera.target + camera.distance * camera_axes(camera)[2]


def camera_from_view(
    view: CameraView, size: tuple[int, int], up: Literal["y", "z"], box: Floats | None = None
) -> Camera:
    """Return a camera that looks through a calibrated one.

    Setting its ``fixed`` to None leaves an orbit camera at the same place that looks along the same
    axis, about as wide; it stands upright, and the picture's middle is on the axis.

    Parameters
    ----------
    view : CameraView
        In scene space.
    size : (int, int)
        Width and height of what is drawn, pixels.
    up : "y" or "z"
        The scene's up axis.
    box : (2, 3), optional
        What will be orbited about, scene space; the origin if omitted.

    Raises
    ------
    RigError
        If nothing says how large the camera's pictures are.
    """
    width, height = picture_size(view)
    aspect = size[0] / size[1]
    seen = max(height, width / aspect)  # the picture's rows, and what is seen above and below
    backward = -view.rotation[2]
    place = -view.rotation.T @ view.translation
    middle = np.zeros(3) if box is None else box.mean(axis=0)
    distance = float((place - middle) @ backward)
    if distance <= _SMALLEST:  # it is behind the camera
        distance = float(np.linalg.norm(place - middle)) or 1.0
    x, y, z = backward if up == "y" else (backward[0], backward[2], -backward[1])
    focal = float(view.intrinsic[1, 1] / view.intrinsic[2, 2])
    return Camera(
        target=place - distance * backward,
        distance=distance,
        azimuth=math.degrees(math.atan2(x, z)),
        inclination=math.degrees(math.atan2(y, math.hypot(x, z))),
        fov=math.degrees(2.0 * math.atan2(0.5 * seen, focal)),
        up=up,
        fixed=view,
    )


def fit(camera: Camera, points: Floats, aspect: float, free_height: float = 1.0) -> None:
    """Aim at the middle of some points and step back until all are seen; direction stays.

    Parameters
    ----------
    camera : Camera
        Changed in place: target and distance.
    points : (N, 3)
        What to see, scene space.
    aspect : float
        Width / height of the picture.
    free_height : float
        How much of the picture's height is to be used, about its middle; 0 to 1.
    """
    camera.target = bounding_box(points).mean(axis=0)
    across, upward, near = ((points - camera.target) @ np.stack(camera_axes(camera)).T).T
    tangent = math.tan(math.radians(camera.fov) / 2)
    wide, high = tangent * aspect / _MARGIN, tangent * min(free_height, 1.0 / _MARGIN)
    needed = np.maximum(np.abs(across) / wide, np.abs(upward) / high)
    # Perspective makes what is near larger, so a near point needs the camera further away.
    distance = float((needed if camera.orthographic else needed + near).max(initial=0.0))
    camera.distance = distance if distance > _SMALLEST else 1.0


def orbit(camera: Camera, azimuth: float, inclination: float) -> None:
    """Turn about the target by angles in degrees; the poles are not crossed."""
    camera.azimuth = (camera.azimuth + azimuth + 180.0) % 360.0 - 180.0
    camera.inclination = min(max(camera.inclination + inclination, -90.0), 90.0)


def pan(camera: Camera, across: float, upward: float) -> None:
    """Move the target in the picture's plane, in units of the picture's height."""
    right, up, _ = camera_axes(camera)
    height = 2.0 * camera.half_height
    camera.target = camera.target + height * (across * right + upward * up)


def zoom(camera: Camera, factor: float, x: float = 0.0, y: float = 0.0) -> None:
    """Scale the distance and keep the point under the pointer in place.

    Parameters
    ----------
    camera : Camera
        Changed in place: target and distance.
    factor : float
        New distance over old distance.
    x, y : float
        The pointer from the middle of the picture, right and up, in picture heights.
    """
    distance = min(max(camera.distance * factor, _SMALLEST), 1e12)
    factor = distance / camera.distance  # at the end of the range nothing moves any more
    pan(camera, x * (1.0 - factor), y * (1.0 - factor))
    camera.distance = distance
