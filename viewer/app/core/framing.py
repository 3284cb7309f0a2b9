"""State of the camera's fitting: the points it is fitted to, and whether it still is."""

from __future__ import annotations

from dataclasses import dataclass, field

from viewer.app.core.motion_extent import MotionExtent
from viewer.rendering.camera import Camera
from viewer.rig.arrays import Floats

__all__ = ["Framing"]


@dataclass(slots=True)
class Framing:
    """Whether and to what the camera is fitted.

    Attributes
    ----------
    is_fitting : bool
        Whether it is fitted again when the view changes its size, or more of the motion is known.
        Over as soon as the camera stands anywhere else than where it was put.
    extent : MotionExtent
        How far the scene reaches.
    points : (N, 3) or None
        What it is fitted to; None for the extent.
    """

    is_fitting: bool = False
    extent: MotionExtent = field(default_factory=MotionExtent)
    points: Floats | None = None
    _placed: tuple[object, ...] | None = None  # the camera, as it was fitted
    _fitted: tuple[object, ...] | None = None  # the view that it was fitted to
    _is_stale: bool = True  # more of the motion is known than when it was

    @property
    def is_settled(self) -> bool:
        """Whether nothing is left to find out."""
        return self.extent.is_done

    def restart(self, fits: bool = True) -> None:
        """Fit the camera to what is shown now, and keep fitting it.

        Parameters
        ----------
        fits : bool
            False leaves the camera where it is.
        """
        self.extent.restart()
        self.is_fitting, self.points = fits, None
        self._placed, self._fitted, self._is_stale = None, None, True

    def note_extent(self) -> None:
        """Take note that more is known of the motion's extent."""
        # The camera stays where a shape or motion is edited: the change is to be seen.
        self._is_stale |= not self.extent.was_edited

    def watch(self, camera: Camera) -> None:
        """Stop fitting a camera that somebody has moved."""
        if self._placed is not None and self._placed != _place(camera):
            self.is_fitting, self._placed = False, None

    def note_placed(self, camera: Camera) -> None:
        """Remember where a camera stands that was fitted."""
        self._placed = _place(camera)

    def is_due(self, view: tuple[object, ...]) -> bool:
        """Return whether the camera is to be fitted to a view now; it counts as done then."""
        is_due = self._fitted != view or (self._is_stale and self.points is None)
        if is_due:
            self._fitted, self._is_stale = view, False
        return is_due

    @property
    def fitted_points(self) -> Floats:
        """What the camera is fitted to: (N, 3), scene space."""
        return self.extent.points if self.points is None else self.points


def _place(camera: Camera) -> tuple[object, ...]:
    """Return the key of where a camera stands."""
    lens = camera.fov, id(camera.fixed)
    return camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination, *lens
