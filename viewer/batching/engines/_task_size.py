"""Number of items per task of a cluster: several short ones, so that fewer tasks are scheduled."""

from __future__ import annotations

from collections import deque
from statistics import median

_SECONDS = 0.5  # duration of a task for which scheduling takes about 1 % of the time
_MOST = 64  # maximum number of items per task
_GROWTH = 8  # items that finish before tasks grow by one item
_RECENT = 32  # number of items whose times are used

LONGEST = 1.5 * _SECONDS
"""Seconds after which a task starts no further item, because another worker may be idle."""


class TaskSize:
    """The number of items that a task has, from the times of the latest items."""

    # The first tasks have one item each, as do all tasks whose items take more than 0.25 s. The
    # last ones become shorter, so that all workers finish at about the same time.

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

    def now(self, n_left: int, n_workers: int) -> int:
        """Return the size of the next task, 1 to 64; ``n_left`` is 0 if unknown."""
        # Not the mean, because a worker's first item also loads modules.
        each = median(self._seconds) if self._seconds else _SECONDS
        fitting = int(_SECONDS / max(each, _SECONDS / _MOST))
        # Each worker then gets at least two more tasks.
        evenly = n_left // (2 * max(n_workers, 1)) if n_left else fitting
        return max(1, min(fitting, evenly, 1 + self._n_finished // _GROWTH))
