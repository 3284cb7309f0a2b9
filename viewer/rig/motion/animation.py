"""Named animations of a figure, whose keys are read on first playback."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.rig.motion.transform_clip import TransformClip

__all__ = ["Animation"]


class Animation:
    """An animation of a figure.

    Parameters
    ----------
    name : str
        As in the file; may repeat or be empty.
    start, end : float
        Playback range in seconds.
    read : callable
        Returns the keys, or raises a ``FormatError``; called at most once.
    place : str
        JSON pointer to the animation in the file; empty if unknown.
    number : int
        Index of the animation in its file, which may move several figures; -1 if unknown.
    """

    __slots__ = ("_clip", "_read", "end", "name", "number", "place", "start")

    def __init__(
        self,
        name: str,
        start: float,
        end: float,
        read: Callable[[], TransformClip],
        place: str = "",
        number: int = -1,
    ) -> None:
        self.name, self.start, self.end, self._read = name, start, end, read
        self.place, self.number = place, number
        self._clip: TransformClip | None = None

    def plays(self, clip: object) -> bool:
        """Return whether a motion is the clip of this animation."""
        return clip is not None and clip is self._clip

    def clip(self) -> TransformClip:
        """Return the motion; always the same object.

        Raises
        ------
        FormatError
            If the file's keys are invalid, or the file can no longer be read.
        """
        if self._clip is None:
            self._clip = self._read()
        return self._clip
