"""Requests for a batch of commands, from the parsed command line."""

from __future__ import annotations

import argparse
import atexit
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from viewer.batching.engines import Job
from viewer.batching.execution import attempt
from viewer.batching.inputs import is_recording
from viewer.batching.items import Item, Result
from viewer.batching.naming import template_of
from viewer.batching.submissions import (
    Submission,
    find_submissions,
    is_archive,
    opened,
    patterns_of,
)
from viewer.batching.tables import comparisons
from viewer.commands._batch.jobs import JOBS, CommandJob, add_job_arguments
from viewer.commands._batch.planning import Request
from viewer.commands._batch.results import check_results, name_in_shard
from viewer.commands._input_files import input_files
from viewer.commands._settings import settings_of
from viewer.commands._usage import Parser
from viewer.data_classes import dataclass
from viewer.diagnostics.record import JsonObject
from viewer.errors import ViewerError
from viewer.media.unfinished import new_prefix
from viewer.models import named_files, use_model_folder
from viewer.phrases import listed, printable
from viewer.plugins import are_enabled
from viewer.rigs.bodies.smpl_family import GENDERS
from viewer.version import VERSION

_NOT_RESULTS = ("files", "output", "force", "model_path", "json")
"""Arguments that do not affect the content of the outputs."""


def request_of(arguments: argparse.Namespace) -> tuple[Request, Job]:
    """Return the request and the job of a command line, parsed by ``job_parser``."""
    name = arguments.job
    kind = JOBS[name]
    output = getattr(arguments, "output", None) or ""
    if kind.writes == "always" and not output:
        raise ViewerError(
            f"expected -o OUT, a folder or a template, found none ({name} writes files)"
        )
    parser = Parser(prog=f"viewer {name}")
    add_job_arguments(parser, name)
    known = {action.dest for action in parser._actions if action.dest != "help"}
    options = {each: getattr(arguments, each) for each in known | parser._defaults.keys()}
    if not are_enabled():
        options["no_plugins"] = True  # for worker processes
    remark = ""
    if options.get("model_path") is not None:
        remark = use_model_folder(options["model_path"])
        if not remark:  # remembered: items need not name it again
            options["model_path"] = None
    shared = getattr(arguments, "fixed", [])
    fixed = [str(path) for file in shared for path in named_files(file)]
    for file in fixed:
        if not os.path.exists(file):
            raise ViewerError(f"--with: {printable(file, 300)}: no such file or folder")
    if arguments.resume and "force" in options:
        # Outputs of items that the report does not list were written by a killed run.
        options["force"] = True
    paths, notes = _inputs(name, arguments.files)
    request = settings_of(
        Request,
        arguments,
        paths=paths,
        output=output,
        # A template includes the suffix.
        to=getattr(arguments, "to", None) or ("" if "{" in output else kind.suffix),
        keeps_folders=kind.is_folder_input,
        identity=_identity(name, options, getattr(arguments, "expect", [])),
        shared=tuple(dict.fromkeys([*fixed, *_files_in(options)])),
        few=kind.few,
        force=arguments.force,
        usual_timeout=kind.timeout,
        notes=[*notes, remark] if remark else notes,
        table=name_in_shard(arguments.table, arguments.shard),
        overview=name_in_shard(arguments.overview, arguments.shard),
        joint_map=getattr(arguments, "save_joint_map", None) or "",
    )
    _check_format(name, request)
    may_replace = arguments.force or arguments.resume
    check_results(name, request.table, request.overview, may_replace, output)
    job: Job = CommandJob(name, options, tuple(fixed), tuple(request.shared))
    if name == "diff":
        alike = patterns_of(input_files(options["reference"]))
        job = _SubmissionJob(job, tuple(arguments.expect), tuple(alike), _temporary_folder())
    return request, job


def _check_format(job: str, request: Request) -> None:
    """Raise for a suffix that the job does not write, rather than for each item."""
    if not request.output:
        return
    template = Path(template_of(request.output, request.to))
    command = import_module(f"viewer.commands.{job}")
    # A suffix with a field of the template is known for each item only.
    if "{" not in template.suffix and hasattr(command, "check_format"):
        command.check_format(template)


def _inputs(job: str, files: list[str]) -> tuple[list[str], list[str]]:
    """Return the paths of the batch, and messages about omitted paths."""
    if job != "diff" or not all(map(os.path.lexists, files)):
        return files, []
    found = find_submissions(files)
    names = listed([printable(path.name, 60) for path in found.ignored])
    note = f"ignored because they are neither folders nor archives: {names}"
    return [*map(str, found.submissions)], [note] if found.ignored else []


def _identity(job: str, options: JsonObject, expected: Sequence[str]) -> str:
    """Return a string that identifies job, options and version, on which results depend."""
    kept = {name: value for name, value in options.items() if name not in _NOT_RESULTS}
    return json.dumps([job, VERSION, kept, *expected], sort_keys=True, default=str)


def _files_in(options: JsonObject) -> Iterator[str]:
    """Yield the files named by options, such as ``--model``."""
    for name, value in sorted(options.items()):
        if name in _NOT_RESULTS or name == "save_joint_map":  # this file is an output
            continue
        for text in value if isinstance(value, list) else [value]:
            if name == "reference":
                yield from map(str, input_files(text))
            elif isinstance(text, str):
                # Each input chooses the model of its own gender.
                for gender in ("", *GENDERS) if name == "model" else ("",):
                    found = named_files(text, gender)
                    yield from (str(path) for path in found if os.path.isfile(path))


@dataclass(frozen=True)
class _SubmissionJob:
    """A job that opens submissions; files and recordings are passed on."""

    # The temporary folder, for unpacked files, is removed when the batch ends, even if a worker was
    # killed.

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
