"""Items of a batch and their results."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Literal

from viewer.data_classes import dataclass
from viewer.diagnostics.record import JsonObject

if TYPE_CHECKING:
    from viewer.schemas import DiagnosticData, SaidData

Status = Literal["done", "failed", "timeout", "crashed", "memory", "cancelled", "unchanged"]


@dataclass(frozen=True)
class Item:
    """One call of a job."""

    index: int
    """Position in the sorted list of all items of the batch, before it is divided into shards."""
    files: tuple[str, ...]
    """Input files or folders, as passed to the job's command. A member of a zip archive is written
    as ``archive.zip/member``."""
    output: str
    """File or folder that the job writes; empty for jobs that only print."""
    name: str
    """Path relative to the common folder of all inputs, shown in tables and reports."""


@dataclass(frozen=True)
class Result:
    """The result of one item, a line of ``report.jsonl``."""

    item: Item
    status: Status
    """``done``, or the reason why there is no result: ``failed`` (the job's message says why),
    ``timeout``, ``crashed`` (the worker process died), ``memory``, ``cancelled``; ``unchanged``
    if an earlier run finished it."""
    exit_code: int = 0
    """Exit code of the job's command: 0 success, 1 findings or differences, 2 bad input."""
    seconds: float = 0.0
    """Wall time of the last attempt."""
    attempts: int = 1
    """1, or more if the item was retried."""
    message: str = ""
    """The error in one line; empty if there is none."""
    diagnostics: list[DiagnosticData | SaidData] = field(default_factory=list)
    """Warnings and losses, as ``lint --json`` writes them."""
    outputs: tuple[str, ...] = ()
    """Files and folders written."""
    text: str = ""
    """The text that the job's command printed."""
    values: JsonObject = field(default_factory=dict)
    """Data of the job for tables: distances of ``diff``, findings of ``lint``."""
    key: str = ""
    """Hash of the inputs, the options and the program's version, by which ``--resume`` recognises
    finished items."""
    time: float = 0.0
    """Time at which it ended, in seconds since 1970; the latest of several results is used."""
