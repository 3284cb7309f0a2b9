"""Values of --cluster, and the job script submitted to SLURM."""

from __future__ import annotations

import signal
from importlib.util import find_spec

import pytest

from viewer.batching.engines import Limits
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.errors import ViewerError


def test_names_of_clusters_are_recognised() -> None:
    assert parse_cluster("local").kind == "local"
    found = parse_cluster("tcp://10.0.0.1:8786")
    assert (found.kind, found.address) == ("address", "tcp://10.0.0.1:8786")
    assert parse_cluster("slurm").options == {}
    found = parse_cluster("slurm:partition=gpu,--time=2:00:00,exclusive")
    assert found.kind == "slurm"
    assert found.options == {"partition": "gpu", "time": "2:00:00", "exclusive": ""}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lokal", 'found "lokal"; did you mean local?'),
        ("tcp://host", "an address such as tcp://host:8786, or slurm, found"),
        ("slurm:", "expected local, an address"),
        ("slurm:gpu=1,=2", 'expected options such as partition=gpu,time=2:00:00, found "=2"'),
        ("slurm:partition=a\nb", "found "),
    ],
)
def test_unknown_cluster_names_are_refused(text, message) -> None:
    with pytest.raises(ViewerError) as caught:
        parse_cluster(text)
    assert message in str(caught.value)


# Importing dask-jobqueue here would replace the Ctrl-C handler of the test process.
needs_jobqueue = pytest.mark.skipif(find_spec("dask_jobqueue") is None, reason="no dask-jobqueue")


@pytest.mark.slow
@needs_jobqueue
def test_job_script_contains_the_slurm_options() -> None:
    from viewer.batching.engines._clusters import slurm_cluster

    name = parse_cluster("slurm:partition=gpu,time=2:00:00,cpus=4,gres=gpu:1,exclusive,account=lab")
    with slurm_cluster(name, Limits(memory=2 << 30)) as cluster:
        lines = cluster.job_script().splitlines()
    for wanted in ("-p gpu", "-A lab", "-t 2:00:00", "--cpus-per-task=4", "--gres=gpu:1"):
        assert f"#SBATCH {wanted}" in lines
    assert "#SBATCH --exclusive" in lines
    # All four workers have 2 GiB and declare a GPU.
    assert "#SBATCH --mem=8G" in lines
    command = lines[-1]
    for wanted in ("--nworkers 4", "--nthreads 1", "--resources GPU=1", "--memory-limit 2.00GiB"):
        assert wanted in command
    with pytest.raises(ViewerError, match='cpus: expected 1 or more, found "many"'):
        slurm_cluster(parse_cluster("slurm:cpus=many"), Limits())


@needs_jobqueue
def test_missing_sbatch_is_reported(monkeypatch) -> None:
    from viewer.batching.engines import dask_cluster

    monkeypatch.setenv("PATH", "")
    with pytest.raises(ViewerError, match="sbatch was not found"):
        next(dask_cluster.run([], lambda item: item, Limits(cluster="slurm")))


@pytest.mark.slow
@needs_jobqueue
def test_handlers_of_signals_survive_the_import_of_dask_jobqueue() -> None:
    from viewer.batching.engines._clusters import slurm_cluster

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(ViewerError):
        slurm_cluster(parse_cluster("slurm:cpus=0"), Limits())
    assert signal.getsignal(signal.SIGINT) is before
