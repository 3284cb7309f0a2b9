"""Rank, memory limit and signal mask of this worker process."""

from __future__ import annotations

import contextlib
import multiprocessing
import re
import signal
import sys
from collections.abc import Iterator

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


def limit_memory(size: int) -> None:
    """Limit the memory that this process may allocate, in bytes; further calls have no effect."""
    if sys.platform == "win32":
        return
    import resource

    # On Linux, the address space includes mapped files and driver reservations, which use no
    # memory.
    kind = resource.RLIMIT_DATA if sys.platform == "linux" else resource.RLIMIT_AS
    soft, most = resource.getrlimit(kind)
    limit = size if most == resource.RLIM_INFINITY else min(size, most)
    if soft != limit:
        resource.setrlimit(kind, (limit, most))


@contextlib.contextmanager
def signals_blocked() -> Iterator[None]:
    """Block Ctrl-C in threads and processes that are started within the block."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
