"""Wall time of a run, printed next to its budget, and its slowest tests.

``VIEWER_TEST_BUDGET`` is the budget in seconds; ``make test`` and ``make quick`` set it. A run that
takes longer does not fail: that would depend on the machine.
"""

import os
import time
from collections import Counter

import pytest

SHOWN = 10


class RunTime:
    """Durations of all tests, collected from all processes."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._seconds: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._seconds[report.nodeid] += report.duration

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        terminalreporter.section(f"slowest {SHOWN} tests")
        for name, seconds in self._seconds.most_common(SHOWN):
            terminalreporter.line(f"{seconds:7.2f} s  {name}")
        taken = time.monotonic() - self._start
        terminalreporter.line(run_time_line(taken, os.environ.get("VIEWER_TEST_BUDGET")))


def run_time_line(seconds: float, budget: str | None) -> str:
    """Return how long a run took, next to its budget if it has one."""
    line = f"{duration_text(seconds)} in all"
    return line if budget is None else f"{line}, of a budget of {duration_text(float(budget))}"


def duration_text(seconds: float) -> str:
    """Return a time in minutes and seconds.

    >>> duration_text(59.6), duration_text(262.2)
    ('1 min 0 s', '4 min 22 s')
    """
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
