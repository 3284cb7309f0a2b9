"""A calibrated camera: the point of view of one that recorded a motion."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rig.arrays import Floats, frozen

__all__ = ["CameraView"]


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A pinhole camera as OpenCV has it: x right, y down, z forward.

    A scene point X is seen at the pixel K (R X + T), divided by its third number.

    Attributes
    ----------
    name : str
        What the files call it.
    intrinsic : (3, 3)
        K, pixels.
    rotation : (3, 3)
        R, scene to camera.
    translation : (3,)
        T, scene units.
    size : (int, int) or None
        Width and height of its pictures, if the files say.
    distortion : (N,)
        OpenCV's coefficients k1 k2 p1 p2 k3; zeros mean none.
    """

    name: str
    intrinsic: Floats
    rotation: Floats
    translation: Floats
    size: tuple[int, int] | None = None
    distortion: Floats = ()  # type: ignore[assignment]  # made an array below

    def __post_init__(self) -> None:
        shapes = {"intrinsic": (3, 3), "rotation": (3, 3), "translation": (3,)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        object.__setattr__(self, "distortion", frozen("distortion", self.distortion, (None,)))
