"""Commands as jobs of a batch: one parser and one namespace for all items."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path

from viewer.batching.execution import attempt
from viewer.batching.items import Item, Result
from viewer.batching.naming import filled
from viewer.batching.worker_process import worker_rank
from viewer.commands._batch.planning import TIMEOUT, Writes, add_batch_arguments
from viewer.commands._batch.results import add_result_arguments
from viewer.commands._usage import Parser
from viewer.data_classes import dataclass
from viewer.diagnostics.record import JsonObject
from viewer.formats._figure_cache import keeping_figures
from viewer.loading import bundled_body, bundled_files
from viewer.media.array_cache import without_cache
from viewer.phrases import printable
from viewer.plugins import without_plugins


@dataclass(frozen=True)
class JobKind:
    """Properties of a command as a job."""

    title: str
    suffix: str = ""
    """Suffix of the outputs in a folder if ``--to`` is not given."""
    writes: Writes = "never"
    prints: bool = False
    """Whether its text is the result and is therefore printed."""
    few: int = 16
    """Maximum number of items for which no worker process is started."""
    is_folder_input: bool = False
    """Whether each folder is an input."""
    timeout: float | None = TIMEOUT
    """Default time limit in seconds; None if the time depends on the requested frames."""


JOBS = {
    "convert": JobKind("convert many files", writes="always"),
    "render": JobKind(
        "render an image or video of each of many files", "png", "always", few=4, timeout=None
    ),
    "lint": JobKind("check many files", prints=True),
    "diff": JobKind(
        "compare many files or folders with one reference",
        *("png", "maybe"),
        prints=True,
        is_folder_input=True,
    ),
    "rig": JobKind("transfer a rig to many meshes", "glb", "always", few=1),
    "info": JobKind("describe many files", prints=True),
}


def job_parser(job: str) -> Parser:
    """Return the parser of a key of ``JOBS``: the options of its command and those of the batch."""
    parser = Parser(prog=f"viewer batch {job}", description=JOBS[job].title)
    parser.add_argument("job", choices=[job], help=argparse.SUPPRESS)
    add_all_arguments(parser, job)
    return parser


def add_all_arguments(parser: argparse.ArgumentParser, job: str) -> None:
    """Add the arguments of a command, and those of the batch."""
    add_job_arguments(parser, job)
    kind = JOBS[job]
    known = {action.dest for action in parser._actions}
    add_batch_arguments(parser, kind.suffix, kind.writes, "common" in known, kind.timeout)
    add_result_arguments(parser, job)
    if "force" not in known:
        parser.add_argument("--force", action="store_true", help="replace an existing report")
    output = {"always": "-o OUT ", "maybe": "[-o OUT] ", "never": ""}[kind.writes]
    first = "REFERENCE " if job == "diff" else ""
    parser.usage = f"%(prog)s {first}PATHS {output}[options]"


def add_job_arguments(parser: argparse.ArgumentParser, job: str) -> None:
    """Add the arguments of a command; its files become the paths of the batch."""
    import_module(f"viewer.commands.{job}").add_arguments(parser)
    for action in parser._actions:  # argparse has no public name for this table
        if action.dest == "files":
            action.nargs, action.metavar, action.required = "*", "PATHS", False
            action.help = (
                "files, folders, patterns in quotes ('data/**/*.npz'), @list.txt, or - for a list "
                "on standard input"
            )
        elif action.dest == "output":
            action.required, action.metavar = False, "OUT"
            action.help = (
                "a folder, which mirrors the folders of the inputs, or a template: "
                "'out/{parent}/{stem}.bvh'; also {folder}, {name}, {suffix}, {index:05}"
            )


@dataclass(frozen=True)
class CommandJob:
    """A command as a job."""

    command: str
    """A key of ``JOBS``."""
    options: JsonObject
    """Its options by name, and arguments that each item replaces: files and output."""
    fixed: tuple[str, ...] = ()
    """Files that are opened with every item."""
    shared: tuple[str, ...] = ()
    """Files that all items read, including those named by options."""

    @property
    def uses_gpu(self) -> bool:
        """Whether the job runs only on workers with a graphics card, if a cluster has any."""
        return self.command == "render"

    @cached_property
    def _shared(self) -> list[Path]:
        return [*map(Path, self.shared), bundled_body(), *bundled_files()]

    def __call__(self, item: Item) -> Result:
        """Run one item in this process."""
        # Most files are read only once, so caching them would evict files that are read again.
        with keeping_figures(self._shared), without_cache():
            result = attempt(item, self._run)
        if result.status == "failed" and not result.message:
            # Commands that report on several files print the error of a single one.
            lines: Sequence[str] = result.text.strip().splitlines() or [""]
            result = replace(result, message=printable(lines[-1].strip(), 500))
        return result

    def _run(self, item: Item) -> int:
        given = {
            name: [*value] if isinstance(value, list) else value
            for name, value in self.options.items()
        }
        arguments = argparse.Namespace(**given)
        arguments.files = [*self.fixed, *item.files]
        if self.uses_gpu and arguments.gpu is None:
            arguments.gpu = _device()
        if "output" in given:
            arguments.output = item.output or None
        if given.get("save_joint_map"):
            arguments.save_joint_map = filled(arguments.save_joint_map, item)
            Path(arguments.save_joint_map).parent.mkdir(parents=True, exist_ok=True)
        if item.output:
            Path(item.output).parent.mkdir(parents=True, exist_ok=True)
        has_none = given.pop("no_plugins", False)
        with without_plugins() if has_none else nullcontext():
            code: int = import_module(f"viewer.commands.{self.command}").run(arguments)
        return code


@cache
def _device() -> int | None:
    """Return the graphics device of this worker process; None for the default."""
    from viewer.rendering.gpu.egl_devices import device_of_worker

    rank = worker_rank()
    return None if rank is None else device_of_worker(rank)
