"""Orbit camera: distance, azimuth and inclination about a target. The only importer of pyrr."""

from __future__ import annotations

import math
import warnings
from dataclasses import field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass, setting
from viewer.rigs.arrays import Floats
from viewer.rigs.checked_fields import checked
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import bounding_box, box_size

with warnings.catch_warnings():
    # pyrr's docstrings have invalid escapes: compiling it warns, or fails if warnings are errors.
    warnings.simplefilter("ignore")
    from pyrr import matrix44

if TYPE_CHECKING:
    from viewer.rigs.captures.cameras import CameraView
    from viewer.rigs.inspection.front import Front
    from viewer.rigs.scene import Scene


NamedView: TypeAlias = Literal["front", "back", "right", "left", "top", "bottom"]
VIEWS: dict[NamedView, tuple[float, float]] = {
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "right": (-90.0, 0.0),
    "left": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}
"""Azimuth from the front and inclination, degrees; "left" shows the figure's left side."""

_USUAL_AZIMUTH = 35.0  # initial angle from the front

_MARGIN = 1.08  # margin around a framed figure
SMALLEST = 1e-9
"""Minimum distance, for framing a single point, and minimum field of view in degrees."""


@checked
@dataclass(slots=True)
class Camera:
    """Position, orientation and projection of an orbit camera."""

    target: Floats = field(default_factory=lambda: np.zeros(3), metadata={"shape": (3,)})
    """(3,). Point that the camera orbits, scene space."""
    distance: float = setting(3.0, limits=(SMALLEST, math.inf))
    """Distance from eye to target, scene units."""
    azimuth: float = _USUAL_AZIMUTH
    inclination: float = 15.0
    """Degrees about the up axis, and above the horizon. At 0, 0, the camera looks along -z if y is
    up, along +y if z is up."""
    fov: float = setting(35.0, limits=(SMALLEST, 180.0))
    """Vertical field of view, degrees."""
    orthographic: bool = False
    """Whether the projection is parallel, with the same height at the target."""
    up: Up = "y"
    """The scene's up axis."""
    fixed: CameraView | None = None
    """A calibrated camera to look through. It provides the matrices; the other fields have an
    effect only while this field is None."""
    front: float = 0.0
    """Azimuth of the front view; named views are relative to it."""
    seen: CameraView | None = None
    """``fixed`` at the time and in the pose of the scene; None if it does not move."""

    def __post_init__(self) -> None:
        # Cameras are moved in place: not with them the array that they were made of.
        self.target = self.target.copy()

    def copy(self) -> Camera:
        """Return an independent copy."""
        return replace(self)

    @property
    def pinhole(self) -> CameraView | None:
        """The calibrated camera to look through, where it is now; None if there is none."""
        return None if self.fixed is None else self.seen or self.fixed

    @property
    def is_parallel(self) -> bool:
        """Whether the projection is parallel; always False for a calibrated camera."""
        return self.orthographic and self.fixed is None

    def rotation(self) -> Floats:
        """Return the rotation from scene to camera space, for column vectors: (3, 3)."""
        pinhole = self.pinhole
        if pinhole is not None:
            from viewer.rendering.pinhole import pinhole_view

            return pinhole_view(pinhole)[:3, :3]
        return np.array(camera_axes(self))

    def view_matrix(self) -> Floats:
        """Return the matrix from scene to camera space, for column vectors: (4, 4)."""
        pinhole = self.pinhole
        if pinhole is not None:
            from viewer.rendering.pinhole import pinhole_view

            return pinhole_view(pinhole)
        target = tuple(map(float, self.target))
        orbit = self.azimuth, self.inclination, self.distance, *target, self.up
        return _look_at(*orbit).copy()

    def projection_matrix(self, aspect: float, box: Floats) -> Floats:
        """Return the matrix from camera to clip space, for column vectors.

        Parameters
        ----------
        aspect
            Width / height.
        box : (2, 3)
            Bounds that must lie between the near and the far plane, scene space.

        Returns
        -------
        (4, 4)
            OpenGL clip space, z in -1..1.
        """
        pinhole = self.pinhole
        if pinhole is not None:
            from viewer.rendering.pinhole import pinhole_projection

            return pinhole_projection(pinhole, aspect, box)
        lens = self.distance, self.fov, self.orthographic, aspect
        places = *map(float, self.target), *box.ravel().tolist()
        return _projection(*lens, *places).copy()

    @property
    def half_height(self) -> float:
        """Half the visible height at the target, scene units."""
        return self.distance * math.tan(math.radians(self.fov) / 2)


# A moving figure is seen from where it was seen in the last frame, and an orbit keeps its lens.
@lru_cache(maxsize=16)
def _look_at(
    azimuth: float, inclination: float, distance: float, x: float, y: float, z: float, up: Up
) -> Floats:
    """Return the view matrix of a camera that orbits the target (x, y, z)."""
    camera = Camera(np.array([x, y, z]), distance, azimuth, inclination, up=up)
    upward = camera_axes(camera)[1]
    # pyrr's matrices are for row vectors.
    return np.array(matrix44.create_look_at(eye(camera), camera.target, upward, dtype="f8")).T


@lru_cache(maxsize=16)
def _projection(
    distance: float, fov: float, orthographic: bool, aspect: float, *places: float
) -> Floats:
    """Return the projection matrix; ``places``: the target and the two corners of the box."""
    target, box = np.array(places[:3]), np.array(places[3:]).reshape(2, -1)
    reach = box_size(box) + float(np.linalg.norm(box.mean(axis=0) - target))
    reach = reach or distance  # even an empty scene needs a depth range
    far = distance + 20.0 * reach
    if orthographic:
        half = Camera(distance=distance, fov=fov).half_height
        near = distance - 20.0 * reach
        matrix = matrix44.create_orthogonal_projection(
            -half * aspect, half * aspect, -half, half, near, far, dtype="f8"
        )
    else:
        near = max(distance - reach, 5e-3 * distance)
        matrix = matrix44.create_perspective_projection(fov, aspect, near, far, dtype="f8")
    return np.array(matrix).T


def camera_axes(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Return the camera's right, up and backward axes in scene space, each (3,)."""
    # Up is the derivative of the backward axis with respect to inclination, so it is also defined
    # at the poles.
    azimuth, inclination = math.radians(camera.azimuth), math.radians(camera.inclination)
    sin_a, cos_a = math.sin(azimuth), math.cos(azimuth)
    sin_i, cos_i = math.sin(inclination), math.cos(inclination)
    right = np.array([cos_a, 0.0, -sin_a])
    up = np.array([-sin_i * sin_a, cos_i, -sin_i * cos_a])
    backward = np.array([cos_i * sin_a, sin_i, cos_i * cos_a])
    if camera.up == "z":
        # Rotate y up to z up: (x, y, z) -> (x, -z, y).
        right, up, backward = (np.array([a[0], -a[2], a[1]]) for a in (right, up, backward))
    return right, up, backward


def front_azimuth(front: Front, up: Up) -> float:
    """Return the azimuth, in degrees, of a camera that looks straight at a front such as ``"+x"``.

    >>> front_azimuth("+z", "y"), front_azimuth("+x", "z"), front_azimuth("-z", "y")
    (0.0, 90.0, 180.0)
    """
    sign = 1.0 if front[0] == "+" else -1.0
    if front[1] == "x":
        return 90.0 * sign
    ahead = sign if up == "y" else -sign  # +z if y is up, -y if z is up
    return 0.0 if ahead > 0.0 else 180.0


def facing_camera(front: Front, up: Up, orthographic: bool = False) -> Camera:
    """Return a camera that views a front from slightly left and above, without framing anything."""
    ahead = front_azimuth(front, up)
    azimuth = _wrapped(ahead + _USUAL_AZIMUTH)
    return Camera(azimuth=azimuth, orthographic=orthographic, up=up, front=ahead)


def look_from(camera: Camera, view: NamedView) -> None:
    """Rotate to a named view."""
    azimuth, camera.inclination = VIEWS[view]
    camera.azimuth = _wrapped(camera.front + azimuth)


def _wrapped(angle: float) -> float:
    """Return an angle in degrees wrapped to -180..180; half a revolution keeps its sign."""
    return angle if -180.0 <= angle <= 180.0 else (angle + 180.0) % 360.0 - 180.0


def eye(camera: Camera) -> Floats:
    """Return the position of the camera in scene space: (3,)."""
    return camera.target + camera.distance * camera_axes(camera)[2]


def camera_from_view(
    view: CameraView,
    size: tuple[int, int],
    up: Up,
    box: Floats | None = None,
    seen: CameraView | None = None,
) -> Camera:
    """Return a camera that looks through a calibrated one, in an image of a size in pixels.

    If ``fixed`` is reset to None, it is an upright orbit camera at the same position, with the same
    viewing direction and about the same field of view; its principal point is the image's centre.
    ``box``: (2, 3), bounds of the objects to orbit, scene space; the origin if omitted. ``seen``:
    the camera at the time and in the pose of the scene, from ``view_in``, if it moves.
    """
    fixed, view = view, seen or view
    width, height = view.picture_size
    aspect = size[0] / size[1]
    # Number of rows of the image, including the margins above and below.
    rows = max(height, width / aspect)
    backward = -view.rotation[2]
    place = -view.rotation.T @ view.translation
    middle = np.zeros(3) if box is None else box.mean(axis=0)
    distance = float((place - middle) @ backward)
    if distance <= SMALLEST:  # the object is behind the camera
        distance = float(np.linalg.norm(place - middle))
        distance = distance if distance > SMALLEST else 1.0
    x, y, z = backward if up == "y" else (backward[0], backward[2], -backward[1])
    # Negative where the rows of the images are counted upwards.
    focal = abs(float(view.intrinsic[1, 1] / view.intrinsic[2, 2]))
    return Camera(
        target=place - distance * backward,
        distance=distance,
        azimuth=math.degrees(math.atan2(x, z)),
        inclination=math.degrees(math.atan2(y, math.hypot(x, z))),
        fov=math.degrees(2.0 * math.atan2(0.5 * rows, focal)),
        up=up,
        fixed=fixed,
        seen=seen,
    )


def follow_view(
    camera: Camera, size: tuple[int, int], scene: Scene, box: Floats | None = None
) -> None:
    """Move a camera, in place, with the moving calibrated camera that it looks through, if any."""
    # If ``fixed`` is later reset to None, the camera continues from the current position.
    fixed = camera.fixed
    if fixed is None or (fixed.motion is None and fixed.mount is None):
        return
    from viewer.rigs.captures.carried_view import view_in

    there = camera_from_view(fixed, size, camera.up, box, view_in(fixed, scene))
    camera.target, camera.distance, camera.seen = there.target, there.distance, there.seen
    camera.azimuth, camera.inclination, camera.fov = there.azimuth, there.inclination, there.fov


def fit(camera: Camera, points: Floats, aspect: float, free_height: float = 1.0) -> None:
    """Aim at the centre of points, (N, 3), and step back until all are visible."""
    # Only a fraction ``free_height`` of the image's height, about its centre, is used.
    camera.target = bounding_box(points).mean(axis=0)
    across, upward, near = ((points - camera.target) @ np.stack(camera_axes(camera)).T).T
    tangent = math.tan(math.radians(camera.fov) / 2)
    wide, high = tangent * aspect / _MARGIN, tangent * min(free_height, 1.0 / _MARGIN)
    needed = np.maximum(np.abs(across) / wide, np.abs(upward) / high)
    # Perspective enlarges near points, so they need a larger distance.
    distance = float((needed if camera.orthographic else needed + near).max(initial=0.0))
    camera.distance = distance if distance > SMALLEST else 1.0


def orbit(camera: Camera, azimuth: float, inclination: float) -> None:
    """Rotate about the target by angles in degrees, without crossing the poles."""
    camera.azimuth = (camera.azimuth + azimuth + 180.0) % 360.0 - 180.0
    camera.inclination = min(max(camera.inclination + inclination, -90.0), 90.0)


def pan(camera: Camera, across: float, upward: float) -> None:
    """Move the target in the image's plane, in units of the image's height."""
    right, up, _ = camera_axes(camera)
    height = 2.0 * camera.half_height
    camera.target = camera.target + height * (across * right + upward * up)


def zoom(camera: Camera, factor: float, x: float = 0.0, y: float = 0.0) -> None:
    """Scale the camera's distance, in place, and keep the point under the pointer."""
    distance = min(max(camera.distance * factor, SMALLEST), 1e12)
    # At the ends of the range, the factor is 1, so the camera does not pan.
    factor = distance / camera.distance
    pan(camera, x * (1.0 - factor), y * (1.0 - factor))
    camera.distance = distance
