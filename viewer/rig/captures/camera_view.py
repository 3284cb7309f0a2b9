"""Calibrated cameras that recorded a motion."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rig.arrays import Floats, frozen

__all__ = ["CameraView"]


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A pinhole camera in OpenCV's convention: x right, y down, z forward.

    A scene point X is projected to the pixel K (R X + T), divided by its third component.

    Attributes
    ----------
    name : str
        Name in the files.
    intrinsic : (3, 3)
        K, pixels.
    rotation : (3, 3)
        R, scene to camera.
    translation : (3,)
        T, scene units.
    size : (int, int) or None
        Width and height of its images, if the files give them.
    distortion : (N,)
        OpenCV's coefficients k1 k2 p1 p2 k3; zeros mean none.
    """

    name: str
    intrinsic: Floats
    rotation: Floats
    translation: Floats
    size: tuple[int, int] | None = None
    distortion: Floats = ()  # type: ignore[assignment]  # converted to an array below

    def __post_init__(self) -> None:
        shapes = {"intrinsic": (3, 3), "rotation": (3, 3), "translation": (3,)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        object.__setattr__(self, "distortion", frozen("distortion", self.distortion, (None,)))
