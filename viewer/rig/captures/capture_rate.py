"""Frame rate of a capture: requested, stored in its files, taken from its video, or assumed."""

from __future__ import annotations

from viewer.rig.motion.timing import DEFAULT_RATE

__all__ = ["capture_rate"]


def capture_rate(requested: float | None, own: float | None, video: float | None) -> float:
    """Return the first rate that is known, otherwise ``DEFAULT_RATE``, in frames per second.

    Parameters
    ----------
    requested : float or None
        Rate requested by the user.
    own : float or None
        Rate of the files, or of the tool that wrote them.
    video : float or None
        Rate of the source video.

    >>> capture_rate(None, None, 25.0), capture_rate(None, None, None)
    (25.0, 30.0)
    """
    return requested or own or video or DEFAULT_RATE
