"""Decision whether the window may close, or files may replace the scene, or the user is asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from viewer.app.closing.state import Closing
from viewer.app.core.jobs import Job
from viewer.app.core.state import AppState
from viewer.app.files.state import Files
from viewer.data_classes import dataclass
from viewer.formats import opened_text
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.app.closing.unsaved import Unsaved

__all__ = [
    "Question",
    "advance_closing",
    "keep_open",
    "may_replace_scene",
    "question_of",
    "request_quit",
]

_MOST_LISTED = 6


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """A question with buttons.

    Attributes
    ----------
    title : str
        Title of its dialog.
    lines : tuple of str
        Its paragraphs.
    answers : tuple of (str, str, callable)
        Label, tooltip and action of each button.
    """

    title: str
    lines: tuple[str, ...]
    answers: tuple[tuple[str, str, Callable[[AppState], None]], ...]


def request_quit(state: AppState) -> None:
    """Quit as soon as nothing is lost without a question; further requests ask it again."""
    closing, files = state.of(Closing), state.of(Files)
    closing.is_requested, closing.waits = True, False
    # An open dialog or message would cover the question.
    files.dialog, state.error = None, ""
    advance_closing(state)


def advance_closing(state: AppState) -> None:
    """Close the window after a request if nothing would be lost."""
    closing = state.of(Closing)
    if closing.is_requested and _job(state) is None and not _edits(state):
        closing.is_over = True


def may_replace_scene(state: AppState) -> bool:
    """Return whether files that were read may replace the scene: nothing would be lost."""
    return not _edits(state)


def keep_open(state: AppState) -> None:
    """Answer the question with Cancel: keep the window open, and the scene as it is."""
    closing, files = state.of(Closing), state.of(Files)
    if not closing.is_requested:
        files.loader = None
        state.say_status("Opening cancelled")
    closing.withdraw()


def question_of(state: AppState) -> Question | None:
    """Return the question to ask now; None while there is none, or a dialog answers it."""
    closing, files = state.of(Closing), state.of(Files)
    if state.error or files.dialog is not None or closing.is_over:
        return None
    job = _job(state)
    if closing.is_requested and job is not None:
        return None if closing.waits or job.is_cancelled else _about_job(job)
    loader = files.loader
    if closing.is_requested:
        purpose = "quitting"
    elif loader is not None and loader.is_done and loader.scene is not None and job is None:
        purpose = f"opening {printable(opened_text(loader.paths[-1]), 60)}"
    else:
        return None
    edits = _edits(state)
    return _about_edits(edits, purpose) if edits else None


def _job(state: AppState) -> Job | None:
    """Return the running job if its output would be lost."""
    job = state.job
    return None if job is None or not job.output or job.is_done else job


def _edits(state: AppState) -> list[Unsaved]:
    """Return the unsaved edits that the user has not agreed to lose."""
    # Imports panels, which are otherwise loaded on first use.
    from viewer.app.closing.unsaved import unsaved_edits

    # The edits of this frame count too.
    state.history.observe(state.scene, state.options, busy=False)
    return [] if state.of(Closing).discards else unsaved_edits(state)


def _about_job(job: Job) -> Question:
    return Question(
        "Unfinished work",
        (f"{job.title} is not finished yet.",),
        (
            ("Finish first", "the window closes when it is finished", _wait),
            (f"Cancel {job.output} and quit", "existing files are kept", _cancel_job),
            ("Keep working", "keep the window open", keep_open),
        ),
    )


def _wait(state: AppState) -> None:
    state.of(Closing).waits = True


def _cancel_job(state: AppState) -> None:
    if state.job is not None:
        state.job.cancel()


def _about_edits(edits: list[Unsaved], purpose: str) -> Question:
    listed = [edit.text for edit in edits[:_MOST_LISTED]]
    if len(edits) > _MOST_LISTED:
        listed.append(f"and {len(edits) - _MOST_LISTED:,} more")

    def save(state: AppState) -> None:
        state.of(Closing).waits = state.of(Closing).is_requested  # for the job that writes it
        edits[0].ask(state)

    def discard(state: AppState) -> None:
        state.of(Closing).discards = True

    return Question(
        "Unsaved changes",
        (f"Save changes before {purpose}?", *listed),
        (
            ("Save…", "choose a file for the first of these changes", save),
            ("Discard", "lose these changes", discard),
            ("Cancel##closing", "continue as before", keep_open),
        ),
    )
