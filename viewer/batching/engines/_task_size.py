"""Number of items per task of a cluster: several short ones, so that fewer tasks are scheduled."""

from __future__ import annotations

from collections import deque
from statistics import median

__all__ = ["TaskSize"]

_SECONDS = 0.2  # duration of a task at which scheduling takes a few percent of its time
_MOST = 32  # maximum number of items per task
_GROWTH = 8  # items that finish before tasks grow by one item
_RECENT = 32  # number of items whose times are used


class TaskSize:
    """The number of items that a task has, from the times of the latest items.

    The first tasks have one item each, as do all tasks whose items take more than 0.1 s.
    """

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=_RECENT)
        self._n_finished = 0

    def add(self, seconds: float, count: int) -> None:
        """Record a finished task: its duration in seconds, and its number of items."""
        self._seconds.extend([seconds / count] * count)
        self._n_finished += count

    def restart(self) -> None:
        """Begin again with one item per task, because all items of a task were lost."""
        self._n_finished = 0

    def now(self) -> int:
        """Return the number of items for the next task, from 1 to 32."""
        # Not the mean, because a worker's first item also loads modules.
        each = median(self._seconds) if self._seconds else _SECONDS
        fitting = int(_SECONDS / max(each, _SECONDS / _MOST))
        return max(1, min(fitting, 1 + self._n_finished // _GROWTH))
