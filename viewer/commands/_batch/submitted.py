"""Submissions as items of ``batch diff``: folders and archives, opened by the comparing worker."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from viewer.batching.engines import Job
from viewer.batching.execution import attempt
from viewer.batching.inputs import is_recording
from viewer.batching.items import Item, Result
from viewer.batching.submissions import Submission, is_archive, opened, patterns_of
from viewer.batching.tables import comparisons
from viewer.commands._diff.inputs import input_files
from viewer.data_classes import dataclass
from viewer.media.unfinished import new_prefix
from viewer.phrases import printable

__all__ = ["SubmissionJob", "submission_job"]


@dataclass(frozen=True)
class SubmissionJob:
    """A job that opens submissions; files and recordings are passed on.

    ``job``: compares the files.
    ``expected``, ``alike``: patterns of the files; see ``choose``.
    ``temporary``: folder for unpacked files, which is removed when the batch ends, even if a worker
      was killed.
    """

    job: Job
    expected: tuple[str, ...]
    alike: tuple[str, ...]
    temporary: str

    def __call__(self, item: Item) -> Result:
        """Run one item in this process."""
        result = self._compared(item)
        errors = [one["error"] for one in comparisons(result) if one.get("error")]
        # Otherwise, the message would be about an image missing because the comparison failed.
        return replace(result, message=printable(errors[0], 2000)) if errors else result

    def _compared(self, item: Item) -> Result:
        path = item.files[0]
        if not is_archive(path) and (not os.path.isdir(path) or is_recording(path)):
            return self.job(item)
        with ExitStack() as stack:
            entered: list[Submission] = []

            def enter(_: Item) -> None:
                # Errors caused by an archive or a full disk affect this item only.
                one = opened(path, self.expected, self.alike, Path(self.temporary))
                entered.append(stack.enter_context(one))

            failed = attempt(item, enter)
            if not entered:
                return failed
            (found,) = entered
            files = "+".join(map(str, found.files))
            result = replace(self.job(replace(item, files=(files,))), item=item)
        if found.base is None:
            return result
        shown = (f"{found.base}{os.sep}", f"{path}/")
        return replace(
            result,
            message=result.message.replace(*shown),
            text=result.text.replace(*shown),
            values=_replaced(result.values, *shown),
            diagnostics=_replaced(result.diagnostics, *shown),
        )


def submission_job(job: Job, reference: str, expected: list[str]) -> SubmissionJob:
    """Return the job of ``batch diff``.

    ``job``: compares files with the reference.
    ``reference``: the argument; without patterns, submissions need files of the same kinds.
    ``expected``: patterns of the files in each submission.
    """
    alike = patterns_of(input_files(reference))
    return SubmissionJob(job, tuple(expected), tuple(alike), _temporary_folder())


@cache
def _temporary_folder() -> str:
    """Return a folder that is removed when this process ends."""
    folder = tempfile.mkdtemp(prefix=new_prefix(tempfile.gettempdir(), "viewer-batch"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _replaced(value: Any, old: str, new: str) -> Any:
    """Return JSON data with a substring replaced in all strings."""
    if isinstance(value, str):
        return value.replace(old, new)
    if isinstance(value, dict):
        return {key: _replaced(one, old, new) for key, one in value.items()}
    if isinstance(value, list):
        return [_replaced(one, old, new) for one in value]
    return value
