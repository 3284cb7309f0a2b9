"""Progress of a batch: rate and time left, in a terminal and without one."""

import io
import re
import sys

from viewer.batching.items import Item, Result
from viewer.commands import _progress
from viewer.commands._batch import display
from viewer.commands._batch.display import Display

ITEMS = [Item(index, (), "", f"{index}.anim") for index in range(100)]


class Clock:
    """A clock that tests set."""

    now = 1000.0

    def monotonic(self) -> float:
        return self.now


def shown(monkeypatch, is_terminal, statuses):
    """Return what is written to the error stream if an item finishes every two seconds."""
    stream, clock = io.StringIO(), Clock()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(display, "time", clock)
    monkeypatch.setattr(_progress, "time", clock)
    if is_terminal:
        bar = _progress._bar()
        bar.get_time = clock.monotonic
        monkeypatch.setattr(_progress, "_bar", lambda: bar)
    with Display("convert", ITEMS, prints=False) as batch:
        for item, status in zip(ITEMS, statuses, strict=False):
            clock.now += 2.0
            batch.show(Result(item, status))
    return stream.getvalue()


def test_bar_shows_rate_failures_and_time_left(monkeypatch) -> None:
    text = shown(monkeypatch, True, ["done", "failed", *["done"] * 18])
    last = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).strip().splitlines()[-1]
    assert " 20/100 0.5/s, 1 failed " in last
    # 80 items at 0.5 per second.
    assert last.rstrip().endswith("0:02:40")


def test_bar_is_shown_before_the_first_item_finishes(monkeypatch) -> None:
    assert "  0/100" in shown(monkeypatch, True, [])
    assert shown(monkeypatch, False, []) == ""


def test_lines_without_a_terminal_have_rate_and_time_left(monkeypatch) -> None:
    text = shown(monkeypatch, False, ["unchanged"] * 10 + ["done"] * 40)
    # In the first minute, ten items of 31 are skipped: 21 in 62 s. Later, all are run.
    assert text == "31 of 100, 0.339/s, 3 min 24 s left\n"


def test_rate_is_that_of_the_last_minute(monkeypatch) -> None:
    clock = Clock()
    monkeypatch.setattr(display, "time", clock)
    rate = display._Rate()
    for count in range(1, 101):
        clock.now += 10.0
        slow = rate.at(count)
    assert slow == 0.1
    for count in range(101, 201):
        clock.now += 2.0
        fast = rate.at(count)
    assert fast == 0.5


def test_results_are_counted_although_standard_output_is_closed(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    with Display("lint", ITEMS[:2], prints=True) as batch:
        for item in ITEMS[:2]:
            batch.show(Result(item, "done", text="no findings"))
        assert batch._n_done == 2
