"""Batches on Dask workers, with real schedulers and processes, some of which are killed."""

import itertools
import os
import signal
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

import viewer
from tests.batching.batch_jobs import add_numbers, write_numbers
from tests.batching.engines.cluster_jobs import (
    Careful,
    Job,
    Missing,
    half_written,
    items,
    read_nothing,
    write_elsewhere,
)
from viewer.batching.engines import Limits, _task_size
from viewer.batching.engines._remote import Reply
from viewer.batching.engines._task_size import LONGEST
from viewer.batching.items import Result
from viewer.errors import ViewerError
from viewer.version import VERSION

pytest.importorskip("distributed")
import dask

from viewer.batching.engines import dask_cluster

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]

_METHOD = "distributed.worker.multiprocessing-method"


@pytest.fixture(scope="module", autouse=True)
def forked():
    """Fork workers from a process that has imported Dask, which takes each of them a second."""
    with dask.config.set({_METHOD: "forkserver"}):
        yield


@pytest.fixture
def spawned():
    """Start workers as batches do, where no test changes it."""
    with dask.config.set({_METHOD: "spawn"}):
        yield


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory):
    """A cluster of two worker processes, of which the second declares a GPU."""
    from distributed import Nanny, Scheduler, SpecCluster

    common = {"host": "tcp://127.0.0.1", "nthreads": 1, "memory_limit": None,
              "local_directory": str(tmp_path_factory.mktemp("dask"))}  # fmt: skip
    workers = {
        0: {"cls": Nanny, "options": common},
        1: {"cls": Nanny, "options": common | {"resources": {"GPU": 1}}},
    }
    options = {"host": "tcp://127.0.0.1", "dashboard_address": ":0", "port": 0}
    scheduler = {"cls": Scheduler, "options": options}
    # Workers that a test kills have this long to restart.
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "60s"}),
        SpecCluster(workers, scheduler, silence_logs=50) as cluster,
    ):
        yield cluster


@pytest.fixture
def address(two_workers):
    """The address of a scheduler that has both of its workers; a test may kill one."""
    two_workers.wait_for_workers(2, timeout=60)
    return two_workers.scheduler_address


def finished(job, some, limits, on_result=lambda result: None):
    """Run items; check that no item is lost or repeated; return results by index."""
    results = []
    for result in dask_cluster.run(some, job, limits):
        results.append(result)
        on_result(result)
    counts = Counter(result.item.index for result in results)
    assert counts == Counter(item.index for item in some)
    return {result.item.index: result for result in results}


def test_items_of_a_killed_worker_run_on_another_worker(address, tmp_path, monkeypatch):
    monkeypatch.setattr(_task_size, "_MOST", 1)
    some = [replace(item, output=str(tmp_path / str(item.index))) for item in items(60)]
    first = []

    def kill(result):
        if not first and result.item.index > 10:
            first.append(int((tmp_path / str(result.item.index)).read_text()))
            os.kill(first[0], signal.SIGKILL)

    found = finished(Job(seconds=0.02), some, Limits(2, cluster=address), kill)
    assert {one.status for one in found.values()} == {"done"} and first
    runs = [len(path.read_text().split()) for path in tmp_path.iterdir()]
    assert len(runs) == 60
    # At most the items of the killed worker were run again: each was a task.
    assert sum(runs) <= 60 + 2 * dask_cluster._PER_WORKER


@pytest.mark.parametrize("where", ["local", "address"])
def test_worker_killed_within_a_task_of_many_items(where, request, tmp_path):
    cluster = where if where == "local" else request.getfixturevalue(where)
    some = items(600, killed=400)
    some = [replace(item, output=str(tmp_path / str(item.index))) for item in some]
    Path(some[590].output).touch()
    os.utime(some[590].output, (1e9, 1e9))  # not written by this batch
    found = finished(Careful(seconds=0.005), some, Limits(2, cluster=cluster))
    failed = {n: one.message for n, one in found.items() if one.status != "done"}
    assert failed == {590: f"{some[590].output}: already exists (--force replaces it)"}
    runs = {item.index: Path(item.output).read_text().split() for item in some}
    assert not runs.pop(590) and all(runs.values())
    # Elsewhere, the scheduler repeats the task.
    assert half_written(some[400].output).exists() == (where != "local")
    # A killed worker also loses results that were not yet fetched.
    again = {n for n, pids in runs.items() if len(pids) > 1}
    assert 400 in again and len(again) <= 2 * LONGEST / 0.005


def test_items_at_fault_are_found_within_tasks(tmp_path):
    some = items(400, crash=200, hang=300, **{"raise": 380})
    some = [replace(item, output=str(tmp_path / str(item.index))) for item in some]
    found = finished(Job(seconds=0.005), some, Limits(2, retries=1, timeout=1.0, cluster="local"))
    faults = {n: (one.status, one.attempts) for n, one in found.items() if one.status != "done"}
    assert faults == {200: ("crashed", 2), 300: ("timeout", 2), 380: ("failed", 1)}
    assert {one.attempts for one in found.values() if one.status == "done"} == {1}
    assert found[300].message == "no result after 1 s"
    assert found[380].message == "ZeroDivisionError: in the job"
    assert {one.text for one in found.values() if one.status == "done"} <= set("0123")  # ranks
    # Once in a task with others, and then alone.
    assert len(Path(some[200].output).read_text().split()) == 3


def test_workers_that_dask_gives_up_are_replaced(spawned, monkeypatch):
    monkeypatch.setitem(dask_cluster._CONFIG, "distributed.deploy.lost-worker-timeout", "1ms")
    monkeypatch.setattr(dask_cluster, "_FETCH", 0.5)  # results of such a worker are lost
    monkeypatch.setattr(dask_cluster, "_ABSENT", 15.0)  # if it ends before Dask watches it
    # Dask may close a worker that has just restarted and runs another item: that is tried again.
    # Forked workers restart so fast that it may happen twice to an item.
    found = finished(Job(), items(20, crash=5), Limits(1, retries=1, cluster="local"))
    assert {n for n, one in found.items() if one.status != "done"} == {5}


def test_workers_that_end_unseen_by_dask_are_replaced(monkeypatch):
    monkeypatch.setattr(dask_cluster, "_ABSENT", 0.5)
    limits = Limits(2, cluster="local")
    with dask_cluster._connected(dask_cluster.parse_cluster("local"), limits) as (client, check):
        cluster = client.cluster
        first, scaled, scale = cluster.workers[1], [], cluster.scale
        monkeypatch.setattr(cluster, "scale", lambda n: scaled.append(n) or scale(n))
        monkeypatch.setattr(first, "_on_worker_exit", unseen)
        os.kill(first.pid, signal.SIGKILL)
        end = time.monotonic() + 60.0
        # Not checked once there is a new one, which may also need longer than _ABSENT to connect.
        while cluster.workers.get(1, first) is first or connected(client) != {"0", "1"}:
            assert time.monotonic() < end, (scaled, cluster.workers)
            if 2 not in scaled:
                check(connected(client))
            time.sleep(0.05)
        assert scaled == [1, 2]


async def unseen(exit_code):
    """Do nothing, like a nanny that does not watch its worker yet."""


def connected(client):
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    return {str(one["name"]) for one in workers}


def test_two_thousand_files_of_which_some_are_broken(address, tmp_path):
    broken = write_numbers(tmp_path / "in", 2000)
    report = viewer.batch(
        str(tmp_path / "in" / "*.txt"), add_numbers, tmp_path / "out", to="sum", cluster=address
    )
    names = [result.item.name for result in report.results]
    assert len(names) == len(set(names)) == 2000
    assert sorted(one.item.name for one in report.failures) == sorted(broken)
    assert len(broken) == 100
    for number in range(2000):
        path = tmp_path / "out" / f"pose{number}.sum"
        assert path.exists() == (f"pose{number}.txt" not in broken)
        assert not path.exists() or path.read_text() == str(1 + number)


def test_drawing_runs_on_workers_that_declare_gpus(address, tmp_path):
    some = [replace(item, output=str(tmp_path / str(item.index))) for item in items(12)]
    finished(Job(uses_gpu=True), some, Limits(2, cluster=address))
    assert len({path.read_text() for path in tmp_path.iterdir()}) == 1
    finished(Job(seconds=0.05), some, Limits(2, cluster=address))
    assert len({path.read_text().split()[1] for path in tmp_path.iterdir()}) == 2


def test_shards_together_cover_all_items(address):
    whole = items(30)
    parts = [finished(Job(), whole[shard::3], Limits(cluster=address)) for shard in range(3)]
    assert sorted(n for part in parts for n in part) == list(range(30))


def test_stopping_finishes_running_items_and_starts_no_more(address):
    results = []
    stopping = Limits(2, cluster=address, is_stopping=lambda: len(results) >= 3)
    for result in dask_cluster.run(iter(items(1000)), Job(seconds=0.02), stopping):
        results.append(result)
    assert 3 <= len(results) <= 3 + 2 * dask_cluster._PER_WORKER
    assert {one.status for one in results} == {"done"}


def test_workers_without_the_package_or_with_another_version_are_refused(address, monkeypatch):
    def refusal(job):
        with pytest.raises(ViewerError) as caught:
            list(dask_cluster.run(items(5), job, Limits(cluster=address)))
        return str(caught.value)

    assert f"a worker has no viewer {VERSION} (No module named 'viewer.batching')" in refusal(
        Missing()
    )
    monkeypatch.setattr(dask_cluster, "VERSION", "99.1")
    assert f"has viewer {VERSION}, expected 99.1: install the same version" in refusal(Job())


def test_paths_are_relative_to_the_folder_of_the_batch(address, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    some = [replace(item, output=f"{item.index}.txt") for item in items(5)]
    finished(Job(), some, Limits(cluster=address))
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{n}.txt" for n in range(5)]
    monkeypatch.setattr(os, "getcwd", lambda: "/absent/folder")
    with pytest.raises(ViewerError, match=r"cannot enter /absent/folder \(No such file"):
        list(dask_cluster.run(some, Job(), Limits(cluster=address)))
    absolute = [replace(item, output=str(tmp_path / item.output)) for item in some]
    finished(Job(), absolute, Limits(cluster=address))


def test_workers_that_do_not_share_files_are_reported(address, tmp_path, monkeypatch):
    absent = str(tmp_path / "absent.npz")
    some = [replace(item, files=(absent,), output=str(tmp_path / "none.bvh")) for item in items(3)]
    notes = []
    limits = Limits(cluster=address, note=notes.append)
    # A file that is missing on this machine too causes an error of its item only.
    assert {one.status for one in finished(read_nothing, some, limits).values()} == {"failed"}
    finished(write_elsewhere, some[:1], limits)
    assert len(notes) == 1 and f"wrote {some[0].output}, which does not exist" in notes[0]
    checks = dask_cluster.WorkerChecks(notes.append)
    outputs = [str(tmp_path / name) for name in ("a", "b", "absent/a", "absent/b", "gone/a")]
    Path(outputs[0]).touch()
    for path in outputs:
        # One in each folder is looked for, and one note is given.
        checks.accepted(Reply("tcp://w", [Result(some[0], "done", outputs=(path,))], 0.0))
    assert len(notes) == 2 and f"wrote {outputs[2]}, which" in notes[1]
    monkeypatch.setattr(os.path, "lexists", lambda path: True)
    with pytest.raises(ViewerError, match=rf"cannot find {absent}: workers need access"):
        list(dask_cluster.run(some, read_nothing, limits))


def test_scheduler_without_workers_is_reported(monkeypatch):
    from distributed import Scheduler, SpecCluster

    options = {"host": "tcp://127.0.0.1", "dashboard_address": ":0", "port": 0}
    with SpecCluster({}, {"cls": Scheduler, "options": options}, silence_logs=50) as cluster:
        limits = Limits(cluster=cluster.scheduler_address)
        # Ctrl-C once the tasks have been submitted ends a batch that waits for workers.
        asked = itertools.count()
        stopping = replace(limits, is_stopping=lambda: next(asked) > 10)
        assert not list(dask_cluster.run(items(30), Job(), stopping))
        monkeypatch.setattr(dask_cluster, "_ALONE", 0.1)
        monkeypatch.setattr(dask_cluster, "_COUNT_EVERY", 0.1)
        with pytest.raises(ViewerError, match=r"has had no workers for 0\.1 s; start some with: "):
            list(dask_cluster.run(items(3), Job(), limits))


def test_address_without_a_scheduler_is_reported(monkeypatch):
    monkeypatch.setattr(dask_cluster, "_CONNECT", 0.3)
    with pytest.raises(ViewerError, match=r"no scheduler answers at tcp://127\.0\.0\.1:1 "):
        next(dask_cluster.run(items(1), Job(), Limits(cluster="tcp://127.0.0.1:1")))
