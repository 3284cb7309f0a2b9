"""Graphics devices of workers that render."""

from argparse import Namespace

from viewer.batching.items import Item
from viewer.commands import render
from viewer.commands._batch import jobs
from viewer.commands._batch.jobs import CommandJob


def test_workers_that_render_use_separate_devices_unless_one_is_given(monkeypatch) -> None:
    used = []
    monkeypatch.setattr(render, "run", lambda arguments: used.append(arguments.gpu) or 0)
    monkeypatch.setattr(jobs, "_device", lambda: 3)
    item = Item(0, ("a.glb",), "", "a.glb")
    for given in (None, 1):
        job = CommandJob("render", Namespace(files=[], gpu=given))
        assert job(item).status == "done" and job.uses_gpu
    assert used == [3, 1]


def test_process_of_the_batch_uses_the_default_device() -> None:
    assert jobs._device() is None
