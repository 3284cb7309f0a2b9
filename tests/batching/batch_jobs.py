"""Jobs that worker processes import; the name of an item selects the failure."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from viewer.batching.items import Item
from viewer.errors import ViewerError
from viewer.media.output_checks import check_targets
from viewer.media.saving import save_parts


def misbehave(item: Item) -> dict[str, int]:
    """Return the process ID, or crash, hang, allocate 1 GB or raise, as the name states."""
    if item.name == "crash.txt":
        os._exit(3)
    if item.name == "term.txt":
        os.kill(os.getpid(), signal.SIGTERM)  # like a batch system at the time limit of a job
    if item.name in ("hang.txt", "term.txt"):
        time.sleep(100)
    if item.name == "hog.txt":
        data = bytearray(1 << 30)
        data[:: 1 << 12] = b"1" * (1 << 18)
    if item.name == "raise.txt":
        raise KeyError("left knee")
    if item.files:
        add_numbers(item)
    return {"process": os.getpid()}


def add_numbers(item: Item) -> None:
    """Write the sum of the numbers in a file."""
    words = Path(item.files[0]).read_text().split()
    try:
        text = f"{sum(map(int, words))}"
    except ValueError:
        raise ViewerError(f"{item.files[0]}:1: expected numbers") from None
    if item.output:
        Path(item.output).parent.mkdir(exist_ok=True)
        Path(item.output).write_text(text)


def items_called(*names: str) -> list[Item]:
    """Return items without files."""
    return [Item(index, (), "", name) for index, name in enumerate(names)]


def write_numbers(folder: Path, count: int) -> list[str]:
    """Write small files, of which one in 20 is broken; return the names of the broken files."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        text = "1 zero" if index % 20 == 7 else f"1 {index}"
        (folder / f"pose{index}.txt").write_text(text)
    return [f"pose{index}.txt" for index in range(7, count, 20)]


def kill_while_writing(item: Item) -> None:
    """Kill the process while it writes the output, as the system does if memory runs out."""

    def parts() -> Iterator[bytes]:
        yield b"1"
        os.kill(os.getpid(), signal.SIGKILL)

    save_parts(item.output, parts())


def crash_after_writing(item: Item) -> None:
    """Write the output like a command without --force, and kill the first process that does so."""
    path = Path(item.output)
    check_targets([path], (), force=False)
    is_first = not path.with_suffix(".started").exists()
    path.with_suffix(".started").touch()
    path.write_text("1")
    if is_first:
        os.kill(os.getpid(), signal.SIGKILL)
