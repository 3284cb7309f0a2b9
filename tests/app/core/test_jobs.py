"""Background work that counts its steps: progress, output lines, errors, and cancellation."""

import threading

from viewer.app.core.jobs import ThreadJob
from viewer.errors import RigError
from viewer.progress import report


def test_job_reports_progress_and_result() -> None:
    reached, go = threading.Event(), threading.Event()

    def act() -> list[str]:
        report(2, 5, "steps", "weights")
        reached.set()
        go.wait(10)
        return ["done"]

    job = ThreadJob("Checking", act)
    reached.wait(10)
    assert (job.progress, job.title, job.is_done) == ((2, 5, "steps"), "weights", False)
    go.set()
    job.wait()
    assert job.is_done and job.lines == ["done"] and job.error == ""


def test_job_keeps_its_title_if_no_step_is_named() -> None:
    def act() -> list[str]:
        report(0, 1)
        return []

    job = ThreadJob("Checking", act)
    job.wait()
    assert job.title == "Checking"


def test_cancelled_job_ends_before_its_next_step_and_is_done_once_its_thread_has_ended() -> None:
    reached, go, after = threading.Event(), threading.Event(), []

    def act() -> list[str]:
        report(0, 2, what="first")
        reached.set()
        go.wait(10)
        report(1, 2, what="second")
        after.append(1)
        return ["never"]

    job = ThreadJob("Checking", act)
    reached.wait(10)
    job.cancel()
    assert job.is_cancelled and not job.is_done
    go.set()
    job.wait()
    assert job.is_done
    assert not after and job.lines == [] and job.error == "" and job.title == "first"


def test_errors_are_stored_as_messages() -> None:
    def refuse() -> list[str]:
        raise RigError("figure box has no mesh")

    def grow() -> list[str]:
        raise MemoryError

    jobs = [ThreadJob("Checking", act) for act in (refuse, grow)]
    for job in jobs:
        job.wait()
    assert [job.error for job in jobs] == ["figure box has no mesh", "Checking: not enough memory"]


def test_the_result_of_a_job_is_applied_in_the_frame_loop() -> None:
    applied: list[int] = []

    def refuse() -> list[str]:
        raise RigError("no")

    job = ThreadJob("Working", lambda: [], lambda: applied.append(threading.get_ident()))
    job.wait()
    assert not job.is_done and applied == []
    job.step()
    job.step()
    assert job.is_done and applied == [threading.get_ident()]
    failed = ThreadJob("Working", refuse, lambda: applied.append(0))
    failed.wait()
    failed.step()
    cancelled = ThreadJob("Working", lambda: [], lambda: applied.append(0))
    cancelled.wait()
    cancelled.cancel()
    cancelled.step()
    assert failed.is_done and cancelled.is_done and len(applied) == 1
