"""Unsaved changes: whether the window may close, or files may replace the scene, or a question."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.jobs import Job
from viewer.app.core.saved_work import Animations, SavedWork, edited_aside
from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_dialog, button, explain, same_line_if_room
from viewer.app.curves.editing import ask_for_clip
from viewer.app.files.files import Files
from viewer.app.files.motion_export import ask_for_motion
from viewer.app.playback.animations import choose_animation
from viewer.app.posing.posing import ask_for_export, ask_for_pose, pose_of_file
from viewer.app.retargeting.drive_changes import shown_drive
from viewer.app.retargeting.joint_match_panel import ask_where_to_save
from viewer.app.rigging.results import ask_where_to_save_rig, shown_result
from viewer.app.rigging.rigging import Rigging
from viewer.data_classes import dataclass
from viewer.formats import opened_text
from viewer.phrases import printable
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.pose import Pose, PoseKey, pose_of
from viewer.rigs.scene import Actor
from viewer.rigs.springs.simulation import release_springs

_MOST_LISTED = 6
_LONGEST = 40  # maximum length of a name in characters
# Rounding of a clip that is evaluated for one actor or for many, in lengths and radians.
_SAME = 1e-9
_VALUES = (
    "dofs",
    "translations",
    "rotations",
    "scales",
    "shape_weights",
    "figure_scale",
    "figure_translation",
)
_WIDTH = 28.0  # in font sizes


@dataclass(frozen=True, slots=True, eq=False)
class _Question:
    """A question with buttons."""

    title: str
    """Title of its dialog."""
    lines: tuple[str, ...]
    """Its paragraphs."""
    answers: tuple[tuple[str, str, Callable[[AppState], None]], ...]
    """Label, tooltip and action of each button."""


@dataclass(frozen=True, slots=True, eq=False)
class _Unsaved:
    """Edits that would be lost."""

    text: str
    """Description of the edits."""
    ask: Callable[[AppState], None]
    """Opens the dialog that saves them, given the state."""


@dataclass(slots=True)
class Closing:
    """Progress of a request to quit; also used before files replace the scene."""

    is_requested: bool = False
    """Whether the user asked to quit."""
    waits: bool = False
    """Whether the running job is finished first."""
    discards: bool = False
    """Whether the user agreed to lose the unsaved edits."""
    is_over: bool = False
    """Whether the window closes."""

    def withdraw(self) -> None:
        """Keep the window open until the user asks to quit again."""
        self.is_requested = self.waits = self.discards = False


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
    if _edits(state):
        return False
    state.of(Closing).discards = False  # the agreement to lose edits concerned these files
    return True


def keep_open(state: AppState) -> None:
    """Answer the question with Cancel: keep the window open, and the scene as it is."""
    closing, files = state.of(Closing), state.of(Files)
    if not closing.is_requested:
        files.loader = None
        state.say_status("Opening cancelled")
    closing.withdraw()


def question_of(state: AppState) -> _Question | None:
    """Return the question to ask now; None while there is none, or a dialog answers it."""
    closing, files = state.of(Closing), state.of(Files)
    if state.error or files.dialog is not None or closing.is_over:
        return None
    job = _job(state)
    if closing.is_requested and job is not None:
        if closing.waits or job.is_cancelled:
            return None
        answers = (
            ("Finish first", "the window closes when it is finished", _wait),
            (f"Cancel {job.output} and quit", "existing files are kept", _cancel_job),
            ("Keep working", "keep the window open", keep_open),
        )
        return _Question("Unfinished work", (f"{job.title} is not finished yet.",), answers)
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


def _edits(state: AppState) -> list[_Unsaved]:
    """Return the unsaved edits that the user has not agreed to lose."""
    # The edits of this frame count too.
    state.observe()
    return [] if state.of(Closing).discards else unsaved_edits(state)


def _wait(state: AppState) -> None:
    state.of(Closing).waits = True


def _cancel_job(state: AppState) -> None:
    if state.job is not None:
        state.job.cancel()


def _about_edits(edits: list[_Unsaved], purpose: str) -> _Question:
    listed = [edit.text for edit in edits[:_MOST_LISTED]]
    if len(edits) > _MOST_LISTED:
        listed.append(f"and {len(edits) - _MOST_LISTED:,} more")

    def save(state: AppState) -> None:
        state.of(Closing).waits = state.of(Closing).is_requested  # for the job that writes it
        edits[0].ask(state)

    def discard(state: AppState) -> None:
        state.of(Closing).discards = True

    return _Question(
        "Unsaved changes",
        (f"Save changes before {purpose}?", *listed),
        (
            ("Save…", "choose a file for the first of these changes", save),
            ("Discard", "lose these changes", discard),
            ("Cancel##closing", "continue as before", keep_open),
        ),
    )


def unsaved_edits(state: AppState) -> list[_Unsaved]:
    """Return the edits that no file contains; those that were undone are not listed."""
    poses = [
        _Unsaved(f"{printable(actor.name, _LONGEST)}: pose", _for_actor(row, ask_for_pose))
        for row, actor in enumerate(state.scene.actors)
        if _is_posed_by_hand(state, actor)
    ]
    return [*_keys(state), *poses, *_matches(state), *_rigs(state)]


def _for_actor(row: int, ask: Callable[[AppState], None]) -> Callable[[AppState], None]:
    """Return an action that chooses an actor and then asks where to save something of it."""

    def choose_and_ask(state: AppState) -> None:
        state.choose_actor(row)
        ask(state)

    return choose_and_ask


def _keys(state: AppState) -> list[_Unsaved]:
    """Return the edited keys, including those of animations that are not being played."""
    saved, found = state.of(SavedWork), list[_Unsaved]()
    for row, actor in enumerate(state.scene.actors):
        name, clip = printable(actor.name, _LONGEST), actor.keyed
        animations = actor.figure.animations
        is_read = clip not in saved.edited and any(one.plays(clip) for one in animations)
        if clip is not None and clip not in saved and not is_read:
            text = f"{name}: keys of {printable(clip.name, _LONGEST)}"
            found.append(_Unsaved(text, _for_actor(row, _ask_for_keys)))
        if actor.captured in saved.edited and actor.captured not in saved:
            found.append(_Unsaved(f"{name}: motion", _for_actor(row, _ask_for_keys)))
        others = {
            index: motion
            for index, one in enumerate(animations)
            for motion in saved.edited
            if motion is not clip and one.plays(motion)
        }
        for index, aside in (others | edited_aside(state.of(Animations), actor)).items():
            if aside not in saved:
                text = f"{name}: keys of {printable(aside.name, _LONGEST)}"
                ask = partial(_ask_for_keys, index=index)
                found.append(_Unsaved(text, _for_actor(row, ask)))
    return found


def _ask_for_keys(state: AppState, index: int = -1) -> None:
    """Ask where to save the chosen actor's keys, those of an animation if it has an index."""
    if index >= 0:
        choose_animation(state, index)
    if state.actor.keyed is not None and state.actor.transforms is None:
        ask_for_clip(state)
        return
    # Only an export of the whole motion contains all keys.
    state.clock.set_range(*state.clock.whole)
    ask_for_motion(state, ".glb")


def _is_posed_by_hand(state: AppState, actor: Actor) -> bool:
    """Return whether an actor's pose is edited, and is neither saved, reset nor set by its clip."""
    first = state.history.first_poses.get(actor)
    if first is None or actor.own_pose is None:
        return False
    # A clip overrides an edited pose when the time changes, but not the values that it does not
    # animate, such as the shape.
    return not any(
        _is_same(actor, pose)
        or (actor.clip is not None and _is_same(actor, state.clock.posed(actor, pose)))
        for key in (first, *state.of(SavedWork).poses_of(actor))
        if _fits(actor, key)
        for pose in _with_resets(actor.figure, pose_of(key))
    )


def _fits(actor: Actor, key: PoseKey) -> bool:
    """Return whether a pose is one of the actor's joints, which may have been edited since."""
    pose, own = pose_of(key), actor.pose
    return (len(pose.dofs), len(pose.rotations)) == (len(own.dofs), len(own.rotations))


def _with_resets(figure: Figure, pose: Pose) -> list[Pose]:
    """Return a pose, and what it becomes when the pose, the shape or both are reset."""
    poses = [pose, pose_of_file(figure, pose)]
    shape = figure_pose(figure).shape_weights
    return [*poses, *(replace(one, shape_weights=shape) for one in poses)]


def _is_same(actor: Actor, pose: Pose) -> bool:
    """Return whether an actor has a pose, apart from spring joints that swing."""
    own, other = actor.copy(), actor.copy()
    other.pose = pose.copy()
    if actor.springs is not None:
        release_springs(own)
        release_springs(other)
    return all(
        np.allclose(
            getattr(own.own_pose, name), getattr(other.own_pose, name), rtol=_SAME, atol=_SAME
        )
        for name in _VALUES
    )


def _matches(state: AppState) -> list[_Unsaved]:
    """Return the joint matches chosen by hand; people of a capture have one in common."""
    saved, found = state.of(SavedWork), dict[int, _Unsaved]()
    for row, actor in enumerate(state.scene.actors):
        drive = shown_drive(state, actor)
        joint_map = None if drive is None else drive.joint_map
        if joint_map is not None and joint_map not in saved:
            text = f"{printable(actor.name, _LONGEST)}: joint match"
            found.setdefault(id(joint_map), _Unsaved(text, _for_actor(row, ask_where_to_save)))
    return [*found.values()]


def _rigs(state: AppState) -> list[_Unsaved]:
    """Return edited rigs and the one of the Rig panel; the other method's is an alternative."""
    saved, loader = state.of(SavedWork), state.of(Files).loader
    # A rig that the motions of new files drive is not lost.
    kept = None if loader is None or state.of(Closing).is_requested else loader.rig
    found = [
        _Unsaved(
            f"{printable(actor.name, _LONGEST)}: rig",
            _for_actor(row, ask_for_export),
        )
        for row, actor in enumerate(state.scene.actors)
        if actor.figure in saved.edited and actor.figure not in saved and actor.figure is not kept
    ]
    if state.of(Rigging).scene is not state.scene:
        return found
    result = shown_result(state)
    if result is None or result in saved or result.rigged.figure is kept:
        return found
    text = f"{printable(result.target.name, _LONGEST)}: rig"
    return [*found, _Unsaved(text, lambda state: ask_where_to_save_rig(state, result))]


def draw_question(state: AppState) -> None:
    """Draw the question above everything else if there is one, and apply the answer."""
    question = question_of(state)
    if question is None:
        return
    opened, stays = begin_dialog(question.title, _WIDTH * imgui.get_font_size(), "closing")
    if not opened:
        return
    answer: Callable[[AppState], None] | None = None if stays else keep_open
    for line in question.lines:
        imgui.text_wrapped(printable(line, 1000))
    for number, (label, effect, act) in enumerate(question.answers):
        if number:
            same_line_if_room(label)
        if button(state, label):
            answer = act
        explain(effect)
    if answer is not None:
        imgui.close_current_popup()
    imgui.end_popup()
    if answer is not None:
        answer(state)
