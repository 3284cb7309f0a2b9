"""Calibrated cameras: fixed, moving in frames, or carried by a joint of a figure; their images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bytes, Floats, freeze_fields
from viewer.rigs.geometry.quaternion import slerp
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.motion.timing import Timing

if TYPE_CHECKING:
    from viewer.rigs.file_record import FileRecord
    from viewer.rigs.motion.transform_clip import Animation
    from viewer.rigs.skeleton import Skeleton


# OpenCV's cameras look along z with y down, those of glTF along -z with y up.
_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, eq=False)
class CameraMotion:
    """Placement of a moving camera in each frame."""

    timing: Timing
    """Frame rate, and the row of each frame."""
    rotations: Floats
    """(N, 3, 3). R of each row, scene to camera."""
    translations: Floats
    """(N, 3). T of each row, scene units."""
    intrinsics: Floats | None = None
    """(N, 3, 3) or None. K of each row, pixels, if it changes."""

    def __post_init__(self) -> None:
        count = len(self.rotations)
        freeze_fields(self, rotations=(count, 3, 3), translations=(count, 3))
        freeze_fields(self, intrinsics=(count, 3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class CameraPath:
    """The nodes that move a camera outside all figures."""

    nodes: Skeleton
    """A chain of nodes as joints, which ends with the camera."""
    animations: tuple[Animation, ...]
    """The animations of the file that move them, with joints of ``nodes``."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraMount:
    """The joint or the nodes that move a camera."""

    record: FileRecord
    """Record of the figure with the joint, or of one that plays the same animations as the nodes.
    Edits of the figure keep it."""
    joint: int
    """Index of the joint; -1 if the camera moves in the space of the figure."""
    matrix: Floats
    """(4, 4). Camera to joint space at rest; here the camera looks along -z with y up, as in
    glTF."""
    path: CameraPath | None = None
    """The nodes that move the camera; None if they are still."""

    def __post_init__(self) -> None:
        freeze_fields(self, matrix=(4, 4))


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A pinhole camera in OpenCV's convention: x right, y down, z forward.

    A scene point X is projected to the pixel K (R X + T), divided by its third component.
    """

    name: str
    """Name in the files."""
    intrinsic: Floats
    """(3, 3). K, pixels."""
    rotation: Floats
    """(3, 3). R, scene to camera."""
    translation: Floats
    """(3,). T, scene units."""
    size: tuple[int, int] | None = None
    """Width and height of its images, if the files state them."""
    distortion: Floats = ()  # type: ignore[assignment]  # converted to an array below
    """(N,). OpenCV's coefficients k1 k2 p1 p2 k3; zeros mean none."""
    motion: CameraMotion | None = None
    """Its placement over time if it moves; the fields above then apply to the first frame."""
    near: float | None = None
    far: float | None = None
    """Distances of the clipping planes that its file states, scene units. They are not used."""
    mount: CameraMount | None = None
    """The joint or the nodes that move it; rotation and translation then apply to the rest pose."""

    def __post_init__(self) -> None:
        freeze_fields(self, intrinsic=(3, 3), rotation=(3, 3), translation=(3,))
        freeze_fields(self, distortion=(None,))

    @property
    def picture_size(self) -> tuple[float, float]:
        """Width and height of its images, pixels."""
        # If the files do not state the size, the principal point is assumed to be the image centre:
        # (W - 1) / 2 and (H - 1) / 2, because pixel coordinates begin at the centre of the first
        # pixel.
        if self.size is not None:
            return float(self.size[0]), float(self.size[1])
        across, down = self.intrinsic[:2, 2] / self.intrinsic[2, 2]
        width, height = 2.0 * across + 1.0, 2.0 * down + 1.0
        if not (across > 0.0 and down > 0.0):
            raise RigError(
                f"camera {self.name}: expected a principal point above 0 or the size of the "
                f"pictures, found {across:g}, {down:g}"
            )
        return float(width), float(height)


def view_at(view: CameraView, seconds: float) -> CameraView:
    """Return a camera at a time; the camera itself if it does not move."""
    motion = view.motion
    if motion is None:
        return view
    before, after, fractions = motion.timing.locate(np.array([seconds]), interpolate=True)
    first, second, fraction = int(before[0]), int(after[0]), fractions[0]
    if first < 0:
        return view
    # The rotation is interpolated spherically, the centre -R^T T linearly; gaps too. Outside the
    # motion, the first or last frame is used.
    ends = motion.rotations[[first, second]]
    centers = -np.einsum("nba,nb->na", ends, motion.translations[[first, second]])
    quaternions = matrix_to_quaternion(ends)
    rotation = quaternion_to_matrix(slerp(quaternions[0], quaternions[1], fraction))
    rotation = ends[0] if fraction == 0.0 else rotation
    center = (1.0 - fraction) * centers[0] + fraction * centers[1]
    intrinsic = view.intrinsic
    if motion.intrinsics is not None:
        low, high = motion.intrinsics[[first, second]]
        intrinsic = (1.0 - fraction) * low + fraction * high
    return replace(
        view, intrinsic=intrinsic, rotation=rotation, translation=-rotation @ center, motion=None
    )


def extrinsics(world: Floats) -> tuple[Floats, Floats]:
    """Return R and T, without scale, of a camera-to-scene matrix that looks along -z with y up."""
    rotation = _FLIP @ nearest_rotations(world[:3, :3])[0].T
    return rotation, -rotation @ world[:3, 3]


def motion_times(view: CameraView, most: int) -> Floats:
    """Return at most ``most`` sample times (T,) with both ends; only 0 for a fixed camera."""
    if view.motion is None:
        return np.zeros(1)
    timing = view.motion.timing
    there = np.flatnonzero(timing.present)
    chosen = np.linspace(0, max(len(there) - 1, 0), min(max(len(there), 1), most)).round()
    frames = there[chosen.astype(int)] if len(there) else np.zeros(1)
    return timing.start + frames / timing.frame_rate


def placed_view(view: CameraView, placement: Floats) -> CameraView:
    """Return a camera that is moved with its scene by a rotation, uniform scale and translation."""
    scale, place = float(np.linalg.norm(placement[:3, 0])), placement[:3, 3]
    turn = placement[:3, :3] / scale
    # With the placement X' = s P X + p, R X + T is unchanged up to s for R' = R P^T and T' = s T -
    # R' p.
    rotation = view.rotation @ turn.T
    translation = scale * view.translation - rotation @ place
    near, far = (None if one is None else scale * one for one in (view.near, view.far))
    moved = replace(view, rotation=rotation, translation=translation, near=near, far=far)
    if view.motion is None:
        return moved
    rotations = view.motion.rotations @ turn.T
    translations = scale * view.motion.translations - rotations @ place
    motion = replace(view.motion, rotations=rotations, translations=translations)
    return replace(moved, motion=motion)


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """One image: its pixels (H, W, 4) uint8, sRGB, first row at the top, with lens distortion."""

    pixels: Bytes


class CameraImages(Protocol):
    """Source of camera images, which are read when they are drawn."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that have images."""

    def at(self, camera: str, seconds: float) -> CameraImage | None:
        """Return a camera's image at a time, the same object while it stays; None if none."""

    def size_of(self, camera: str) -> tuple[int, int] | None:
        """Return the width and height of a camera's images, pixels; None if it has no images."""

    def notes_of(self, camera: str) -> list[str]:
        """Return messages about a camera's missing or unusable images, one line each."""
