"""A SLURM job that stores its refusal by ``sbatch`` instead of logging a traceback."""

from __future__ import annotations

from dask_jobqueue.slurm import SLURMJob
from distributed import Status

from viewer.phrases import printable

__all__ = ["Job"]


class Job(SLURMJob):  # type: ignore[misc]  # the package has no types
    """A job that runs workers.

    ``refusal``: the reason why it was not submitted; empty if it was.
    """

    refusal = ""

    async def start(self) -> None:
        """Submit the job."""
        try:
            await super().start()
        except (RuntimeError, OSError, ValueError) as problem:
            lines = str(problem).splitlines()
            # Dask's message also has the command, its exit code and its empty output.
            said = [line for line in lines if line.startswith("sbatch: ")] or lines
            self.refusal = printable("; ".join(filter(None, said)), 500)
            # Dask waits for this status; closing the job then does nothing, as it has no number.
            self.status = Status.running

    async def close(self) -> None:
        """Cancel the job."""
        await super().close()
        self.status = Status.closed
