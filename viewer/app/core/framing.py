"""Camera fitting state: the points to fit, and whether the camera is still fitted to them."""

from __future__ import annotations

from dataclasses import field

from viewer.app.core.motion_extent import MotionExtent
from viewer.data_classes import dataclass
from viewer.rendering.camera import Camera
from viewer.rig.arrays import Floats

__all__ = ["Framing"]


@dataclass(slots=True)
class Framing:
    """Camera fitting state.

    Attributes
    ----------
    is_fitting : bool
        Whether the camera is refitted when the view is resized or more of the motion is known.
        Cleared as soon as anything else moves the camera.
    extent : MotionExtent
        Extent of the scene over its motion.
    points : (N, 3) or None
        Points to which the camera is fitted; None for those of the extent.
    """

    is_fitting: bool = False
    extent: MotionExtent = field(default_factory=MotionExtent)
    points: Floats | None = None
    _placed: tuple[object, ...] | None = None  # key of the camera's position when it was fitted
    _fitted: tuple[object, ...] | None = None  # size of the view at the last fit
    _is_stale: bool = True  # whether more of the motion is known than at the last fit

    @property
    def is_settled(self) -> bool:
        """Whether the extent is complete."""
        return self.extent.is_done

    def restart(self, fits: bool = True) -> None:
        """Fit the camera to the current scene, and keep fitting it.

        Parameters
        ----------
        fits : bool
            Whether to fit the camera; False leaves it unchanged.
        """
        self.extent.restart()
        self.is_fitting, self.points = fits, None
        self._placed, self._fitted, self._is_stale = None, None, True

    def note_extent(self) -> None:
        """Record that more of the motion's extent is known."""
        # The camera stays still while a shape or motion is edited, so that the change is visible.
        self._is_stale |= not self.extent.was_edited

    def watch(self, camera: Camera) -> None:
        """Stop fitting a camera that the user has moved."""
        if self._placed is not None and self._placed != _place(camera):
            self.is_fitting, self._placed = False, None

    def note_placed(self, camera: Camera) -> None:
        """Remember the position of a fitted camera."""
        self._placed = _place(camera)

    def has_placed(self, camera: Camera) -> bool:
        """Return whether a fitted camera is still where it was last placed."""
        return self.is_fitting and self._placed == _place(camera)

    def is_due(self, view: tuple[object, ...]) -> bool:
        """Return whether the camera must be fitted to a view now, and record that it was."""
        is_due = self._fitted != view or (self._is_stale and self.points is None)
        if is_due:
            self._fitted, self._is_stale = view, False
        return is_due

    @property
    def fitted_points(self) -> Floats:
        """Points to which the camera is fitted: (N, 3), scene space."""
        return self.extent.points if self.points is None else self.points


def _place(camera: Camera) -> tuple[object, ...]:
    """Return a key that identifies a camera's position."""
    lens = camera.fov, id(camera.fixed)
    return camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination, *lens
