"""Background work that counts its steps: progress, output lines, errors, and cancellation."""

from __future__ import annotations

import threading

from viewer.app.core.jobs import CountedJob, Report
from viewer.errors import RigError


def test_counted_job_reports_progress_and_result() -> None:
    reached, go = threading.Event(), threading.Event()

    def act(report: Report) -> list[str]:
        report(2, 5, "weights")
        reached.set()
        go.wait(10)
        return ["done"]

    job = CountedJob("Checking", act)
    reached.wait(10)
    assert (job.progress, job.title, job.is_done) == ((2, 5), "weights", False)
    go.set()
    job.wait()
    assert job.is_done and job.lines == ["done"] and job.error == ""


def test_counted_job_keeps_its_title_if_no_step_is_named() -> None:
    def act(report: Report) -> list[str]:
        report(0, 1, "")
        return []

    job = CountedJob("Checking", act)
    job.wait()
    assert job.title == "Checking"


def test_cancelled_job_ends_before_its_next_step_and_is_done_once_its_thread_has_ended() -> None:
    reached, go, after = threading.Event(), threading.Event(), []

    def act(report: Report) -> list[str]:
        report(0, 2, "first")
        reached.set()
        go.wait(10)
        report(1, 2, "second")
        after.append(1)
        return ["never"]

    job = CountedJob("Checking", act)
    reached.wait(10)
    job.cancel()
    assert job.is_cancelled and not job.is_done
    go.set()
    job.wait()
    assert job.is_done
    assert not after and job.lines == [] and job.error == "" and job.title == "first"


def test_errors_are_stored_as_messages() -> None:
    def refuse(report: Report) -> list[str]:
        raise RigError("figure box has no mesh")

    def grow(report: Report) -> list[str]:
        raise MemoryError

    jobs = [CountedJob("Checking", act) for act in (refuse, grow)]
    for job in jobs:
        job.wait()
    assert [job.error for job in jobs] == ["figure box has no mesh", "Checking: not enough memory"]


def test_the_result_of_a_job_is_applied_in_the_frame_loop() -> None:
    applied: list[int] = []

    def refuse(report: Report) -> list[str]:
        raise RigError("no")

    job = CountedJob("Working", lambda report: [], lambda: applied.append(threading.get_ident()))
    job.wait()
    assert not job.is_done and applied == []
    job.step()
    job.step()
    assert job.is_done and applied == [threading.get_ident()]
    failed = CountedJob("Working", refuse, lambda: applied.append(0))
    failed.wait()
    failed.step()
    cancelled = CountedJob("Working", lambda report: [], lambda: applied.append(0))
    cancelled.wait()
    cancelled.cancel()
    cancelled.step()
    assert failed.is_done and cancelled.is_done and len(applied) == 1
