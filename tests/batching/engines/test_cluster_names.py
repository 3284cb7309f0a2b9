"""Values of --cluster."""

import pytest

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


def test_workers_per_slurm_job_are_its_cores() -> None:
    assert parse_cluster("slurm:partition=a").workers_per_job == 1
    assert parse_cluster("slurm:cpus=16").workers_per_job == 16
    for count in ("many", "0", ""):
        with pytest.raises(ViewerError, match="cpus: expected 1 or more, found"):
            _ = parse_cluster(f"slurm:cpus={count}").workers_per_job
