"""Edits of the joint match: each retargets the motion, and can be undone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from viewer.app.core.reasons import no_drive
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.saving import save_files
from viewer.app.files.state import Files
from viewer.app.retargeting.drive_changes import change_drive, no_edit, shown_drive
from viewer.errors import ViewerError
from viewer.formats import Source, file_stem
from viewer.formats._joint_map import read_joint_map, write_joint_map
from viewer.phrases import printable
from viewer.rig.retargeting.driven_clip import full_map
from viewer.rig.retargeting.joint_map import JointMap
from viewer.rig.skeleton import joint_label

__all__ = [
    "ask_for_map",
    "ask_where_to_save",
    "is_automatic",
    "match_automatically",
    "match_joint",
]

_SUFFIXES = (".txt",)


def is_automatic(state: AppState) -> str:
    """Return the reason why the match cannot be reset; empty if it can."""
    drive = state.actor.drive
    why = no_edit(state)
    return why or ("" if drive is not None and drive.joint_map else "the match is automatic")


def match_joint(state: AppState, joint: int, partner: int) -> None:
    """Let another joint of the motion drive a joint of the chosen figure.

    Parameters
    ----------
    state : AppState
        State with a driven actor.
    joint : int
        Joint of the figure.
    partner : int
        Joint of the motion; -1 to keep the figure's joint at rest.
    """
    actor = state.actor
    if actor.drive is None:
        return
    source = actor.drive.motion.figure.require_skeleton()
    label = joint_label(actor.figure.require_skeleton(), joint)
    chosen = joint_label(source, partner) if partner >= 0 else ""
    known = full_map(actor.drive, actor.figure)
    pairs = tuple((mine, chosen if mine == label else theirs) for mine, theirs in known.pairs)
    does = f"follows {printable(chosen, 60)}" if chosen else "stays at rest"
    text = f"{printable(label, 60)} {does}"
    _apply(state, JointMap(pairs), lambda: state.say_status(text))


def match_automatically(state: AppState) -> None:
    """Match all joints of the chosen figure automatically."""
    if is_automatic(state):
        state.say_status(is_automatic(state))
    else:
        _apply(state, None, lambda: state.say_status("Joints matched automatically"))


def ask_for_map(state: AppState) -> None:
    """Open the dialog that loads a joint map."""
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths), _load, "open", "Load joint map", _SUFFIXES, is_single=True
    )


def ask_where_to_save(state: AppState) -> None:
    """Open the dialog that saves the match as a joint map."""
    name = f"{file_stem(state.actor.figure.name)}_joints{_SUFFIXES[0]}"
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths), _save, "save", "Save joint map", _SUFFIXES, name
    )


def _load(state: AppState, paths: list[Path]) -> None:
    """Apply a joint map file to the chosen figure."""
    if no_edit(state):
        state.say_status(no_edit(state))
        return
    try:
        joint_map = read_joint_map(Source.open(paths[0]))
    except ViewerError as problem:
        state.error = str(problem)
        return
    state.of(SavedWork).add(joint_map)
    text = f"Joints matched by {printable(paths[0], 200)}"
    _apply(state, joint_map, lambda: state.say_status(text))


def _save(state: AppState, paths: list[Path]) -> None:
    """Write the match of the chosen figure."""
    actor = state.actor
    drive = shown_drive(state, actor)
    if drive is None:
        state.say_status(no_drive(state))
        return
    titles = drive.motion.figure.name, actor.figure.name

    def act() -> None:
        write_joint_map(full_map(drive, actor.figure), paths[0], titles)

    save_files(state, act, paths, saved=drive.joint_map)


def _apply(state: AppState, joint_map: JointMap | None, tell: Callable[[], None]) -> None:
    """Set the joint match of the chosen actor, and of all people of its capture."""
    change_drive(state, lambda drive: replace(drive, joint_map=joint_map), tell)
