"""Settings for cleaning up captured motions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from viewer.data_classes import dataclass

if TYPE_CHECKING:
    from viewer.rig.cleanup.smoothing import OneEuro, SavitzkyGolay

__all__ = ["CleanUp"]


@dataclass(frozen=True, slots=True)
class CleanUp:
    """Requested changes to captured motions, in the order in which they are applied.

    Attributes
    ----------
    merged : tuple of tuple of int
        Numbers of people whose tracks belong to one person, who keeps the first number.
    interpolates : bool
        Whether gaps are interpolated.
    longest_gap : int or float
        Longest gap to interpolate: frames as an integer, seconds as a float.
    smoothing : OneEuro, SavitzkyGolay or None
        The filter.
    locks_feet : bool
        Whether feet are held in place during ground contact.
    grounds : bool
        Whether people are moved up or down until their feet rest at height 0.
    frames : (int or None, int or None) or None
        First frame to keep and the frame after the last one, numbered as in the file; None for the
        motion's own ends.
    rate : float or None
        New frame rate, frames per second.
    """

    merged: tuple[tuple[int, ...], ...] = ()
    interpolates: bool = False
    longest_gap: int | float = 1.0
    smoothing: OneEuro | SavitzkyGolay | None = None
    locks_feet: bool = False
    grounds: bool = False
    frames: tuple[int | None, int | None] | None = None
    rate: float | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing is requested."""
        return self == CleanUp()
