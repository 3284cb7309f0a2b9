"""Grammar of ``--cluster``: ``local``, ``tcp://host:8786`` or ``slurm[:name=value,...]``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from typing import Literal

from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import printable

_ADDRESS = re.compile(r"(tcp|tls)://.+:\d+")
_NAME = re.compile(r"[a-z][a-z0-9-]*")
_KINDS = ("local", "tcp://", "slurm")


@dataclass(frozen=True)
class ClusterName:
    """A parsed value of ``--cluster``."""

    kind: Literal["local", "address", "slurm"]
    """``local``: worker processes on this machine; ``address``: an existing scheduler; ``slurm``:
    jobs that SLURM starts."""
    address: str = ""
    """Address of the scheduler."""
    options: Mapping[str, str] = field(default_factory=dict)
    """Options of the SLURM jobs, named as by ``sbatch``; empty values for flags."""

    @property
    def workers_per_job(self) -> int:
        """Number of workers of each SLURM job, the option ``cpus``: a positive integer."""
        count = self.options.get("cpus", "1")
        if not count.isdecimal() or int(count) < 1:
            raise ViewerError(
                f'--cluster slurm: cpus: expected 1 or more, found "{printable(count, 40)}"'
            )
        return int(count)


def parse_cluster(text: str) -> ClusterName:
    """Parse the value of ``--cluster``.

    >>> parse_cluster("slurm:partition=gpu,time=2:00:00").options
    {'partition': 'gpu', 'time': '2:00:00'}
    """
    kind, colon, rest = text.partition(":")
    if text == "local":
        return ClusterName("local")
    if _ADDRESS.fullmatch(text):
        return ClusterName("address", text)
    if kind == "slurm" and bool(colon) == bool(rest):
        return ClusterName("slurm", options=_options(rest))
    near = did_you_mean(text, _KINDS)
    raise ViewerError(
        "--cluster: expected local, an address such as tcp://host:8786, or slurm, found "
        f'"{printable(text, 60)}"{f"; {near}" if near else ""}'
    )


def _options(text: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        name = name.strip().lstrip("-")
        if not _NAME.fullmatch(name) or not value.isprintable():
            raise ViewerError(
                "--cluster slurm: expected options such as partition=gpu,time=2:00:00, found "
                f'"{printable(part, 60)}"'
            )
        options[name] = value.strip()
    return options
