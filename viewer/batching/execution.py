"""Execution of one item in this process; its output and errors become a result."""

from __future__ import annotations

import contextlib
import io
import os
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from viewer.batching.items import Item, Result
from viewer.data_classes import dataclass
from viewer.diagnostics import described
from viewer.diagnostics.record import JsonObject, Record, recorded
from viewer.errors import ViewerError, reason_of
from viewer.interrupts import watched
from viewer.phrases import printable

_BAD_INPUT, _UNWRITTEN, _DEFECT = 2, 5, 1  # exit codes
_LONGEST = 2000  # maximum length of a message in characters


@dataclass(frozen=True)
class FunctionJob:
    """A plain function as a job."""

    function: Callable[[Item], object]
    """Called with an ``Item``; must be importable by its name if items run in other processes. A
    dict that it returns is the ``values`` of the result, anything else ``values["value"]``. The
    folder of the item's output exists; if it writes the output, that is listed in the result."""

    def __call__(self, item: Item) -> Result:
        """Run one item in this process."""
        result = attempt(item, self._values)
        is_written = result.status == "done" and item.output and os.path.lexists(item.output)
        if is_written and item.output not in result.outputs:
            # Recorded so that the item is run again if the output is lost.
            result = replace(result, outputs=(*result.outputs, item.output))
        return result

    def _values(self, item: Item) -> JsonObject:
        if item.output:
            Path(item.output).parent.mkdir(parents=True, exist_ok=True)
        returned = self.function(item)
        if isinstance(returned, dict):
            return {str(name): value for name, value in returned.items()}
        return {} if returned is None else {"value": returned}


def attempt(item: Item, call: Callable[[Item], object]) -> Result:
    """Run one item; a failure becomes a result, and only a signal is raised.

    An int that ``call`` returns is the exit code, where 0 and 1 stand for success; a dict is the
    values of the result; anything else is ignored. The result also has the captured text, the
    recorded diagnostics and the outputs.
    """
    out, err = io.StringIO(), io.StringIO()
    start = time.perf_counter()
    with recorded() as record, contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        # Also interrupts an item that is writing, although writing defers signals until the block
        # ends.
        stack.enter_context(watched())
        result = _outcome(item, call, record)
    return replace(
        result,
        seconds=time.perf_counter() - start,
        diagnostics=record.diagnostics,
        outputs=tuple(record.outputs) if result.status == "done" else (),
        text=out.getvalue() + err.getvalue() + result.text,
        values=record.values | result.values,
    )


def _outcome(item: Item, call: Callable[[Item], object], record: Record) -> Result:
    try:
        returned = call(item)
    except ViewerError as problem:
        if problem.diagnostic is not None:
            record.diagnostics.append(described(problem.diagnostic))
        return Result(item, "failed", problem.exit_code, message=printable(problem, _LONGEST))
    except MemoryError:
        return Result(item, "memory", _BAD_INPUT, message="not enough memory")
    except OSError as problem:
        where = "" if problem.filename is None else f"{problem.filename}: "
        reason = printable(f"{where}{reason_of(problem)}", _LONGEST)
        return Result(item, "failed", _UNWRITTEN, message=reason)
    except (Exception, SystemExit) as problem:
        # The only place that catches all exceptions: a batch runs unattended for hours, and a bug
        # triggered by one file must not discard the results of all others.
        reason = printable(f"{type(problem).__name__}: {problem}", _LONGEST)
        return Result(item, "failed", _DEFECT, message=reason, text="".join(traceback.format_exc()))
    if isinstance(returned, int):
        return Result(item, "done" if returned in (0, 1) else "failed", returned)
    return Result(item, "done", values=returned if isinstance(returned, dict) else {})
