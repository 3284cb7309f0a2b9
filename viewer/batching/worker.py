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
    """Return this worker's rank, which selects its graphics card; None in the main process."""
    if not _name and multiprocessing.parent_process() is None:
        return None
    number = re.search(r"\d+$", _name or multiprocessing.current_process().name)
    return int(number.group()) if number else 0
