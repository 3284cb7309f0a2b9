"""Errors and warnings of a call as data: (key, line, values)."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError

Fault = tuple[str, int | None, dict[str, Any]]

NAN = pytest.approx(float("nan"), nan_ok=True)
"""A value that compares equal to NaN, for the values of faults."""

INF = float("inf")


def fault_of(found: Diagnostic) -> Fault:
    """Return the key, line and values of a diagnostic, also of diagnostics among its values."""
    values = {
        name: fault_of(value) if isinstance(value, Diagnostic) else value
        for name, value in found.values.items()
    }
    return found.key, found.line, values


def refusal_of(work: Callable[[], Any]) -> Fault:
    """Return the error that a call raises, which must carry a diagnostic."""
    with pytest.raises(ViewerError) as caught:
        work()
    assert caught.value.diagnostic is not None
    return fault_of(caught.value.diagnostic)


def warnings_of(found: Iterable[Diagnostic]) -> list[Fault]:
    """Return the warnings among diagnostics."""
    return [fault_of(one) for one in found if not one.is_refusal]


def lines(found: Iterable[Diagnostic]) -> list[str]:
    """Return diagnostics as displayed."""
    return list(map(str, found))


def told(found: Iterable[Diagnostic]) -> list[tuple[str, dict[str, Any]]]:
    """Return the keys and values of diagnostics."""
    return [(one.key, dict(one.values)) for one in found]
