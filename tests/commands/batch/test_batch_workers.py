"""Number of workers of a batch: as requested, as assigned by SLURM, at most one per item."""

import os

import pytest

import viewer
from viewer.commands._batch.planning import Request, plan_of
from viewer.errors import ViewerError


def plan(folder, count, **options):
    """Return the plan of a batch with a number of files."""
    for number in range(count):
        (folder / f"{number}.bvh").touch()
    return plan_of(Request(paths=[str(folder)], **options))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"workers": 3}, ("processes", 3)),
        ({"workers": 64}, ("processes", 20)),
        ({"workers": 0}, ("sequential", 5)),
        ({}, ("processes", 5)),
        ({"cluster": "local"}, ("dask_cluster", 5)),
        ({"cluster": "slurm:partition=a"}, ("dask_cluster", 1)),
        ({"cluster": "slurm:cpus=16"}, ("dask_cluster", 16)),
        ({"cluster": "slurm:cpus=16", "workers": 64}, ("dask_cluster", 20)),
    ],
)
def test_number_of_workers(tmp_path, monkeypatch, options, expected) -> None:
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)
    monkeypatch.delenv("SLURM_CPUS_ON_NODE", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(5), raising=False)
    settings = plan(tmp_path, 20, **options).settings
    assert (settings.engine, settings.limits.workers) == expected


def test_tasks_of_slurm_use_their_own_cores_only(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(64), raising=False)
    monkeypatch.setenv("SLURM_CPUS_ON_NODE", "8")
    assert plan(tmp_path, 20).settings.limits.workers == 8
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "4")
    assert plan(tmp_path, 20).settings.limits.workers == 4
    assert plan(tmp_path, 20, workers=10).settings.limits.workers == 10


def test_workers_that_have_no_effect_are_noted(tmp_path) -> None:
    notes = plan(tmp_path, 2, cluster="tcp://node:8786", workers=3).notes
    assert notes == ("--workers has no effect: all workers of tcp://node:8786 are used",)
    with pytest.raises(ViewerError, match="--cluster: expected --workers 1 or more, found 0"):
        plan(tmp_path, 2, cluster="local", workers=0)


def test_reports_in_python_have_the_notes(tmp_path) -> None:
    (tmp_path / "a.bvh").touch()
    (tmp_path / "b.unknown").touch()
    found = viewer.batch(tmp_path, "info", workers=0)
    assert found.notes == ["1 file in folders skipped: unknown suffix"]
