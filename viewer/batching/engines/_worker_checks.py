"""Checks that a cluster's workers have this version of the program, and the same files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable

from viewer.batching.engines._remote import NoFolder, OtherVersion, Reply
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.version import VERSION

__all__ = ["WorkerChecks"]


class WorkerChecks:
    """Checks of the replies of workers.

    Parameters
    ----------
    note : callable
        Called with messages for the user.
    """

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note
        # Workers and the folders in which an output of theirs has been found; "" for a worker that
        # wrote one elsewhere, of which one note is enough.
        self._found: set[tuple[str, str]] = set()

    def accepted(self, reply: Reply | OtherVersion | NoFolder) -> Reply:
        """Return the reply of a suitable worker.

        Raises
        ------
        ViewerError
            If the worker has another version, or cannot read the files of the batch.
        """
        if isinstance(reply, OtherVersion):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} has viewer {printable(reply.version, 40)}, "
                f"expected {VERSION}: install the same version on all workers"
            )
        if isinstance(reply, NoFolder):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} cannot enter {printable(os.getcwd(), 300)} "
                f"({printable(reply.reason, 100)}): start the batch in a folder that all workers "
                "share"
            )
        if reply.missing and os.path.lexists(reply.missing):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} cannot find "
                f"{printable(os.path.abspath(reply.missing), 300)}: workers need access to the "
                "inputs under the same paths"
            )
        for one in reply.results:
            for path in one.outputs:
                self._check_output(reply.worker, path)
        return reply

    def _check_output(self, worker: str, path: str) -> None:
        """Note that the first output of a worker in a folder does not exist on this machine."""
        folder = os.path.dirname(path) or "."
        if not self._found.isdisjoint({(worker, folder), (worker, "")}):
            return
        with contextlib.suppress(OSError):
            # This updates the cache of a network file system.
            os.listdir(folder)
        is_found = os.path.lexists(path)
        self._found.add((worker, folder if is_found else ""))
        if not is_found:
            self._note(
                f"the worker {worker} wrote {printable(path, 300)}, which does not exist on this "
                "machine: write outputs to a folder that all workers share"
            )
