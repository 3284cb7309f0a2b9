"""Opening of the first files in a thread: results, errors, progress and cancelling."""

import threading
from contextvars import ContextVar

import pytest

from viewer.app import opening
from viewer.app.opening import Opening, watch
from viewer.errors import ViewerError
from viewer.progress import Cancelled, report

setting = ContextVar("setting", default="")


def test_result_is_that_of_the_function_in_its_callers_context():
    setting.set("given")
    began = Opening("a.bvh", lambda: (setting.get(), threading.current_thread()))
    text, thread = began.result()
    assert text == "given" and thread is not threading.current_thread()


def test_errors_are_raised_by_the_result():
    def act():
        raise ViewerError("a.bvh: cut short")

    began = Opening("a.bvh", act)
    assert began.wait(10.0)
    with pytest.raises(ViewerError, match="cut short"):
        began.result()


def test_work_is_cancelled_at_its_next_report():
    reported, goes_on = threading.Event(), threading.Event()

    def act():
        report(3, 5, "MB")
        reported.set()
        goes_on.wait()
        report(4, 5, "MB")

    began = Opening("a.bvh", act)
    assert reported.wait(10.0) and began.progress == (3, 5, "MB")
    assert not began.wait(0.0)
    began.cancel()
    goes_on.set()
    with pytest.raises(Cancelled):
        began.result()
    assert began.progress == (3, 5, "MB")


def test_quick_work_opens_no_window(monkeypatch):
    monkeypatch.setattr(opening, "_PATIENCE", 10.0)
    assert watch(Opening("a.bvh", lambda: 1)) is None
