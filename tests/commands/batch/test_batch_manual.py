"""Commands of the manual's page about batches."""

import re
import shlex
from pathlib import Path

import pytest

import viewer
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.naming import template_of
from viewer.batching.running import shard_of
from viewer.commands._batch.jobs import JOBS, job_parser

PAGE = Path(viewer.__file__).parent / "manual" / "batches.md"


def commands() -> list[str]:
    """Return the command lines in the page's blocks, with continued lines joined."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith("viewer batch ")]


def test_page_has_a_command_of_each_kind() -> None:
    assert {line.split()[2] for line in commands()} == JOBS.keys() - {"rig"}


@pytest.mark.parametrize("line", commands())
def test_command_of_the_page_is_valid(line) -> None:
    line = line.replace("$SLURM_ARRAY_TASK_ID", "0").replace("$SLURM_ARRAY_TASK_COUNT", "8")
    words = shlex.split(line, comments=True)[2:]
    parser = job_parser(words[0])
    parser.check_options(words)
    arguments = parser.parse_intermixed_args(words)
    if arguments.cluster:
        parse_cluster(arguments.cluster)
    if arguments.shard:
        assert shard_of(range(8), arguments.shard) == [0]
    if getattr(arguments, "output", None):
        assert template_of(arguments.output, arguments.to or JOBS[words[0]].suffix)
