"""Jobs for workers of test clusters."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from viewer.batching.items import Item, Result
from viewer.batching.worker_process import worker_rank
from viewer.errors import OutputError
from viewer.media.output_checks import check_targets
from viewer.media.unfinished import temporary_prefix


@dataclass
class Job:
    """Append a line to the file of an item; some names crash, hang, fail or are killed once."""

    uses_gpu: bool = False
    seconds: float = 0.0

    def __call__(self, item: Item) -> Result:
        """Run one item."""
        if item.output:
            with Path(item.output).open("a") as file:
                file.write(f"{os.getpid()}\n")
        if item.name == "crash":
            # A worker reports the end of a task some milliseconds later. If it crashed before, it
            # would seem to have been running the task before this one.
            time.sleep(0.2)
            os._exit(3)
        if item.name == "killed" and len(Path(item.output).read_text().split()) == 1:
            half_written(item.output).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if item.name == "hang":
            time.sleep(60)
        if item.name == "raise":
            raise ZeroDivisionError("in the job")
        time.sleep(self.seconds)
        return Result(item, "done", text=str(worker_rank()))


class Careful(Job):
    """Write an output of which there must not be one yet, as commands do without --force."""

    def __call__(self, item: Item) -> Result:
        """Run one item."""
        try:
            check_targets([Path(item.output)], (), force=False)
        except OutputError as problem:
            return Result(item, "failed", 5, message=str(problem))
        return super().__call__(item)


def half_written(output: str) -> Path:
    """Return the temporary file that a process leaves when it is killed while it writes."""
    return Path(output).with_name(f"{temporary_prefix(Path(output).name)}abcd0123")


def read_nothing(item: Item) -> Result:
    """Fail as if the input did not exist."""
    return Result(item, "failed", 2, message=f"{item.files[0]}: no such file")


def write_elsewhere(item: Item) -> Result:
    """Return an output that does not exist on this machine."""
    return Result(item, "done", outputs=(item.output,))


class Missing:
    """A job that can be pickled but not unpickled, because the worker lacks a module."""

    def __reduce__(self):
        return fail, ()


def fail() -> None:
    raise ModuleNotFoundError("No module named 'viewer.batching'", name="viewer.batching")


def items(count: int, **names: int) -> list[Item]:
    """Return items, with special names for some indices."""
    by_index = {index: name for name, index in names.items()}
    return [Item(n, (), "", by_index.get(n, f"{n}.x")) for n in range(count)]
