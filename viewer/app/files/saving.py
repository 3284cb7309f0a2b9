"""Saving of files, with a message about the result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState, shows_errors
from viewer.app.files.files import drive_saved_rig
from viewer.errors import ViewerError, reason_of
from viewer.formats import all_or_none, check_targets, free_path, save_image
from viewer.phrases import printable
from viewer.progress import report
from viewer.rigs.arrays import Bytes


@shows_errors
def save_files(
    state: AppState, act: Callable[[], object], files: list[Path], saved: Iterable[object] = ()
) -> None:
    """Write files unless the scene was read from one of them, and show the result."""
    # The dialog has already asked whether to replace existing files.
    check_targets(files, state.inputs, force=True)
    act()
    state.of(SavedWork).add(*saved)
    state.say(_saved(files))


@shows_errors
def save_in_background(
    state: AppState,
    act: Callable[[], Iterable[object]],
    files: Sequence[Path],
    inputs: Sequence[Path] = (),
    saved: Iterable[object] = (),
    is_rig: bool = False,
) -> None:
    """Write files in a job, all or none; no input, nor a file of the scene, may be replaced.

    ``is_rig``: whether they contain a rig that was made in the window.
    """
    if why := no_job_room(state):
        state.error = why
        return
    # The dialog has already asked whether to replace existing files.
    check_targets(files, [*state.inputs, *inputs], force=True)

    def write() -> list[str]:
        with all_or_none(files):
            notes = act()
            report(1, 1)  # the last chance to cancel, before the old files are discarded
        return [*map(str, notes), _saved(files)]

    title, known = f"Writing {printable(files[0].name, 60)}", state.of(SavedWork)

    def finish() -> None:
        known.add(*saved)
        if is_rig and state.of(SavedWork) is known:
            drive_saved_rig(state, files)

    state.job = ThreadJob(title, write, finish, "export", names_steps=False)


def _saved(files: Sequence[Path]) -> str:
    return f"Saved {', '.join(printable(file, 200) for file in files)}"


def save_screenshot(state: AppState, picture: Callable[[], Bytes]) -> None:
    """Save an image of the scene under an unused name in the current folder."""
    try:
        path = free_path(Path.cwd(), state.scene.title, ".png")
        save_image(path, picture())
        state.say(f"Saved {printable(path, 200)}")
        if "##legend" in state.item_rects:  # drawn over the image, not into it
            state.say('Saved without the legend: turn on "Legend in pictures" in the Weights panel')
    except ViewerError as problem:
        state.error = str(problem)
    except OSError as problem:
        state.error = f"the current folder: {reason_of(problem)}"
