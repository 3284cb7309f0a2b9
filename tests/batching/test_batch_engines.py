"""Engines, which must return exactly one result per item, even if a worker crashes."""

import os
from itertools import count

import pytest
from batching.batch_jobs import items_called, misbehave

from viewer.batching.engines import ENGINES, IN_FLIGHT, Limits, load_engine
from viewer.batching.execution import FunctionJob
from viewer.batching.items import Item
from viewer.errors import ViewerError

JOB = FunctionJob(misbehave)


@pytest.mark.parametrize("name", ENGINES)
def test_engines_can_be_loaded(name):
    assert callable(load_engine(name).run)


def test_sequential_engine_runs_items_in_order_in_this_process():
    items = items_called("a", "raise.txt", "b")
    found = list(load_engine("sequential").run(items, JOB, Limits()))
    assert [one.item for one in found] == items
    assert [one.status for one in found] == ["done", "failed", "done"]
    assert found[1].message == "KeyError: 'left knee'" and "misbehave" in found[1].text
    assert found[0].values == found[2].values == {"process": os.getpid()}


def test_functions_that_workers_cannot_import_are_refused():
    job = FunctionJob(lambda item: None)
    with pytest.raises(ViewerError, match="top level of a module, or workers=0"):
        list(load_engine("processes").run(items_called("a"), job, Limits()))


@pytest.mark.slow
def test_workers_receive_few_items_and_stop_on_request():
    taken = count()
    finished = []

    def endless():
        for index in taken:
            yield Item(index, (), "", str(index))

    limits = Limits(workers=1, is_stopping=lambda: len(finished) >= 5)
    for result in load_engine("processes").run(endless(), JOB, limits):
        finished.append(result)
    assert all(one.status == "done" for one in finished)
    assert 5 <= len(finished) <= next(taken) <= 5 + IN_FLIGHT
