"""Advance of the running job after a frame, and the messages when it has ended."""

from __future__ import annotations

from viewer.app.core.state import AppState

__all__ = ["advance_job"]


def advance_job(state: AppState) -> bool:
    """Perform the next step of the running job, and report how it ended.

    Returns
    -------
    bool
        Whether it failed in this frame.
    """
    job = state.job
    if job is None:
        return False
    job.step()
    if not job.is_done:
        return False
    state.job = None
    # A cancelled export may have been finished all the same.
    if job.is_cancelled and not job.output:
        return False
    state.say(*job.lines)
    state.error = job.error or state.error
    return bool(job.error)
