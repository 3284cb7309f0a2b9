"""Engine that runs items one after another in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from viewer.batching.engines import Job, Limits
from viewer.batching.items import Item, Result


def run(items: Iterable[Item], job: Job, limits: Limits) -> Iterator[Result]:
    """Run items in order; time and memory are not limited, because the process cannot be killed."""
    for item in items:
        if limits.is_stopping():
            return
        yield job(item)
