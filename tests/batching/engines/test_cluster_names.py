"""Names of clusters, and how many items one of their tasks computes."""

import pytest

from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.engines._task_size import TaskSize
from viewer.errors import ViewerError


def test_names_of_clusters_are_recognised():
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
def test_unknown_cluster_names_are_refused(text, message):
    with pytest.raises(ViewerError) as caught:
        parse_cluster(text)
    assert message in str(caught.value)


def test_workers_per_slurm_job_are_its_cores():
    assert parse_cluster("slurm:partition=a").workers_per_job == 1
    assert parse_cluster("slurm:cpus=16").workers_per_job == 16
    for count in ("many", "0", ""):
        with pytest.raises(ViewerError, match="cpus: expected 1 or more, found"):
            _ = parse_cluster(f"slurm:cpus={count}").workers_per_job


def test_tasks_begin_with_one_item_and_grow_to_half_a_second():
    size = TaskSize()
    sizes = []
    for _ in range(60):
        sizes.append(size.now(0, 2))
        size.add(0.02 * sizes[-1], sizes[-1])
    assert sizes[:9] == [1] * 8 + [2]
    assert sizes == sorted(sizes)
    assert sizes[-1] == 25  # of 0.02 s each


def test_tasks_of_the_shortest_items_are_limited():
    size = TaskSize()
    for _ in range(1000):
        size.add(0.0, 1)
    assert size.now(0, 2) == 64


def test_long_items_are_tasks_of_their_own():
    size = TaskSize()
    for _ in range(1000):
        size.add(0.251, 1)
    assert size.now(0, 2) == 1


def test_last_tasks_leave_two_for_each_worker():
    size = TaskSize()
    for _ in range(1000):
        size.add(0.01, 1)
    assert [size.now(n_left, 2) for n_left in (1000, 200, 41, 8, 3, 1)] == [50, 50, 10, 2, 1, 1]
    assert size.now(64, 16) == 2


def test_tasks_grow_again_after_a_worker_died():
    size = TaskSize()
    size.add(0.2, 200)
    assert size.now(0, 2) == 26  # 1 + 200 // 8
    size.restart()
    assert size.now(0, 2) == 1
    size.add(0.008, 8)
    assert size.now(0, 2) == 2
