"""Rank of this worker process within its batch."""

from __future__ import annotations

import multiprocessing
import re

_name = ""


def name_worker(name: object) -> None:
    """Set the name of this process in a cluster; a number at its end is the rank."""
    global _name
    _name = str(name)


def worker_rank() -> int | None:
    """Return the rank of this worker, which determines its graphics card.

    The result is None in the process that runs the batch. Replacement workers get new ranks.
    """
    if not _name and multiprocessing.parent_process() is None:
        return None
    number = re.search(r"\d+$", _name or multiprocessing.current_process().name)
    return int(number.group()) if number else 0
