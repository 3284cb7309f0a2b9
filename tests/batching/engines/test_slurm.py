"""SLURM jobs, with substitutes for SLURM's commands that start real workers on this machine."""

import os
import signal
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from tests.batching.engines.cluster_jobs import Job, items
from viewer.batching.engines import Limits, _slurm, dask_cluster
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.engines._slurm import slurm_cluster
from viewer.errors import ViewerError

pytest.importorskip("dask_jobqueue")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]

# ``$JOBS`` has a file per submitted job with its process; jobs above the number in
# ``$JOBS/most`` are refused.
SBATCH = """#!/bin/sh
number=$(($(ls "$JOBS" | grep -c job) + 1))
until mkdir "$JOBS/job$number" 2>/dev/null; do number=$((number + 1)); done
if [ $number -gt $(cat "$JOBS/most") ]; then
    echo "sbatch: error: QOSMaxSubmitJobPerUserLimit" >&2
    exit 1
fi
cp "$1" "$JOBS/job$number/script"
setsid sh "$JOBS/job$number/script" > "$JOBS/job$number/output" 2>&1 &
echo $! > "$JOBS/job$number/process"
echo "Submitted batch job $number"
"""
SQUEUE = """#!/bin/sh
for job in "$JOBS"/job*; do
    kill -0 $(cat "$job/process") 2>/dev/null && basename "$job" | tr -d job
done
exit 0
"""
SCANCEL = """#!/bin/sh
kill -TERM -- -$(cat "$JOBS/job$1/process")
"""


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    """Return the folder of submitted jobs."""
    folder = tmp_path / "jobs"
    folder.mkdir()
    (folder / "most").write_text("100")
    for name, text in (("sbatch", SBATCH), ("squeue", SQUEUE), ("scancel", SCANCEL)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("JOBS", str(folder))
    root = Path(__file__).resolve().parents[3]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(root), *sys.path]))
    monkeypatch.setattr(_slurm, "_ASK_EVERY", 0.3)
    monkeypatch.setattr(_slurm, "_PATIENCE", 0.0)
    monkeypatch.setattr(dask_cluster, "_COUNT_EVERY", 0.2)
    return folder


def process_of(folder: Path) -> int:
    return int((folder / "process").read_text())


def wait_for_end(folder: Path) -> None:
    """Wait until a job that was cancelled has ended."""
    limit = time.monotonic() + 60.0
    while time.monotonic() < limit:
        try:
            os.kill(process_of(folder), 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail(f"{folder.name} still runs")


def test_jobs_that_end_are_submitted_again(jobs, tmp_path):
    some = [replace(item, output=str(tmp_path / f"{item.index}")) for item in items(60)]
    notes, results = [], []
    limits = Limits(1, cluster="slurm:interface=lo", note=notes.append)
    for result in dask_cluster.run(some, Job(seconds=0.02), limits):
        if len(results) == 10:
            os.killpg(process_of(jobs / "job1"), signal.SIGKILL)  # as at the job's time limit
        results.append(result)
    assert Counter(one.item.index for one in results) == Counter(range(60))
    assert {one.status for one in results} == {"done"}
    assert notes == [
        "waiting for SLURM to start 1 job (squeue --me lists the queue)",
        "SLURM job 1 has ended and is submitted again",
    ]
    assert sorted(path.name for path in jobs.glob("job*")) == ["job1", "job2"]
    for job in jobs.glob("job*"):
        wait_for_end(job)
    # Workers use the settings of the scheduler.
    script = (jobs / "job1" / "script").read_text()
    assert "export DASK_DISTRIBUTED__WORKER__MEMORY__PAUSE=False" in script


def test_results_of_a_job_that_ends_before_they_are_fetched(jobs, monkeypatch):
    from distributed import Client

    def gather(self, futures, **options):
        if not ended and futures:
            os.killpg(process_of(jobs / "job1"), signal.SIGKILL)
            while self.scheduler_info()["workers"]:
                time.sleep(0.05)
            ended.append(futures)
        return fetch(self, futures, **options)

    fetch, ended = Client.gather, []
    monkeypatch.setattr(Client, "gather", gather)
    monkeypatch.setattr(dask_cluster, "_FETCH", 0.5)
    results = list(dask_cluster.run(items(10), Job(), Limits(1, cluster="slurm:interface=lo")))
    assert ended
    assert Counter(one.item.index for one in results) == Counter(range(10))
    assert {one.status for one in results} == {"done"}


def test_refused_jobs_are_reported(jobs):
    (jobs / "most").write_text("0")
    with pytest.raises(ViewerError) as caught:
        list(dask_cluster.run(items(3), Job(), Limits(2, cluster="slurm:interface=lo")))
    reason = "sbatch: error: QOSMaxSubmitJobPerUserLimit"
    assert str(caught.value) == f"--cluster slurm: no job was accepted: {reason}"
    for job in jobs.glob("job*"):
        job.rmdir()
    (jobs / "most").write_text("1")
    notes = []
    limits = Limits(2, cluster="slurm:interface=lo", note=notes.append)
    results = list(dask_cluster.run(items(3), Job(), limits))
    assert {one.status for one in results} == {"done"} and len(results) == 3
    assert f"SLURM accepted only 1 of 2 jobs: {reason}" in notes


def test_jobs_that_end_before_their_workers_connect_end_the_batch(jobs, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(ViewerError, match=r"3 jobs ended before .* in the output of 3, by default"):
        list(dask_cluster.run(items(3), Job(), Limits(1, cluster="slurm:interface=lo")))


def test_job_script_contains_the_slurm_options(jobs):
    name = parse_cluster("slurm:partition=gpu,time=2:00:00,cpus=4,gres=gpu:1,exclusive,account=lab")
    before = signal.getsignal(signal.SIGINT)
    with slurm_cluster(name, 2 << 30, {"distributed.a-b.c": False}) as cluster:
        lines = cluster.job_script().splitlines()
    # The import of dask-jobqueue replaces the handler of Ctrl-C.
    assert signal.getsignal(signal.SIGINT) is before
    for wanted in ("-p gpu", "-A lab", "-t 2:00:00", "--cpus-per-task=4", "--gres=gpu:1"):
        assert f"#SBATCH {wanted}" in lines
    assert "#SBATCH --exclusive" in lines
    assert "export DASK_DISTRIBUTED__A_B__C=False" in lines
    # All four workers have 2 GiB and declare a GPU.
    assert "#SBATCH --mem=8G" in lines
    command = lines[-1]
    for wanted in ("--nworkers 4", "--nthreads 1", "--resources GPU=1", "--memory-limit 2.00GiB"):
        assert wanted in command


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("interface=none0", "'none0' is not a valid network interface"),
        ("mem=lots", 'mem: expected a size such as 64G, found "lots"'),
    ],
)
def test_wrong_options_are_reported(jobs, options, message):
    with pytest.raises(ViewerError, match=rf"--cluster slurm: .*{message}"):
        slurm_cluster(parse_cluster(f"slurm:{options}"), None, {})


def test_missing_sbatch_is_reported(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ViewerError, match="sbatch was not found"):
        next(dask_cluster.run([], lambda item: item, Limits(cluster="slurm")))
