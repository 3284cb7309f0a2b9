"""Unsaved edits of the scene (keys, poses, joint matches, rigs) and the dialogs that save them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from viewer.app.core.edited_animations import Animations, edited_aside
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.curves.clip_actions import ask_for_clip
from viewer.app.files.motion_dialog import ask_for_motion
from viewer.app.playback.animations import choose_animation
from viewer.app.posing.pose_actions import ask_for_pose, pose_of_file
from viewer.app.retargeting.drive_changes import shown_drive
from viewer.app.retargeting.match_actions import ask_where_to_save
from viewer.app.rigging.results import shown_result
from viewer.app.rigging.results_section import ask_where_to_save_rig
from viewer.app.rigging.state import Rigging
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.spring_motion import release_springs
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose, pose_of
from viewer.rig.scene import Actor, figure_pose

__all__ = ["Unsaved", "unsaved_edits"]

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


@dataclass(frozen=True, slots=True, eq=False)
class Unsaved:
    """Edits that would be lost.

    Attributes
    ----------
    text : str
        Description of the edits.
    ask : callable
        Opens the dialog that saves them, given the state.
    """

    text: str
    ask: Callable[[AppState], None]


def unsaved_edits(state: AppState) -> list[Unsaved]:
    """Return the edits that no file contains; those that were undone are not listed."""
    return [*_keys(state), *_poses(state), *_matches(state), *_rigs(state)]


def _keys(state: AppState) -> list[Unsaved]:
    """Return the edited keys, including those of animations that are not being played."""
    saved, found = state.of(SavedWork), list[Unsaved]()
    for row, actor in enumerate(state.scene.actors):
        name, clip = printable(actor.name, _LONGEST), actor.clip
        is_read = any(animation.plays(clip) for animation in actor.figure.animations)
        if isinstance(clip, Clip | TransformClip) and clip not in saved and not is_read:
            text = f"{name}: keys of {printable(clip.name, _LONGEST)}"
            found.append(Unsaved(text, partial(_ask_for_keys, row=row, index=-1)))
        for index, aside in edited_aside(state.of(Animations), actor).items():
            if aside not in saved:
                text = f"{name}: keys of {printable(aside.name, _LONGEST)}"
                found.append(Unsaved(text, partial(_ask_for_keys, row=row, index=index)))
    return found


def _ask_for_keys(state: AppState, row: int, index: int) -> None:
    """Ask where to save an actor's keys; ``index``: the animation to play first, -1 for none."""
    state.choose_actor(row)
    if index >= 0:
        choose_animation(state, index)
    if isinstance(state.actor.clip, Clip):
        ask_for_clip(state)
        return
    # Only an export of the whole motion contains all keys.
    state.clock.set_range(*state.clock.whole)
    ask_for_motion(state, ".glb")


def _poses(state: AppState) -> list[Unsaved]:
    """Return the poses and shapes that were made by hand."""
    return [
        Unsaved(f"{printable(actor.name, _LONGEST)}: pose", partial(_ask_for_pose, row=row))
        for row, actor in enumerate(state.scene.actors)
        if _is_posed_by_hand(state, actor)
    ]


def _is_posed_by_hand(state: AppState, actor: Actor) -> bool:
    """Return whether an actor's pose was edited, and is neither saved, reset nor that of its clip.

    A clip overrides an edited pose when the time changes, but not the values that it does not
    animate, such as the shape.
    """
    first = state.history.first_poses.get(actor)
    if first is None or actor.pose is None:
        return False
    return not any(
        _is_same(actor, pose)
        or (actor.clip is not None and _is_same(actor, state.clock.posed(actor, pose)))
        for key in (first, *state.of(SavedWork).poses_of(actor))
        for pose in _with_resets(actor.figure, pose_of(key))
    )


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
        np.allclose(getattr(own.pose, name), getattr(other.pose, name), rtol=_SAME, atol=_SAME)
        for name in _VALUES
    )


def _ask_for_pose(state: AppState, row: int) -> None:
    state.choose_actor(row)
    ask_for_pose(state)


def _matches(state: AppState) -> list[Unsaved]:
    """Return the joint matches chosen by hand; people of a capture have one in common."""
    saved, found = state.of(SavedWork), dict[int, Unsaved]()
    for row, actor in enumerate(state.scene.actors):
        drive = shown_drive(state, actor)
        joint_map = None if drive is None else drive.joint_map
        if joint_map is not None and joint_map not in saved:
            text = f"{printable(actor.name, _LONGEST)}: joint match"
            found.setdefault(id(joint_map), Unsaved(text, partial(_ask_for_match, row=row)))
    return [*found.values()]


def _ask_for_match(state: AppState, row: int) -> None:
    state.choose_actor(row)
    ask_where_to_save(state)


def _rigs(state: AppState) -> list[Unsaved]:
    """Return the rig that the Rig panel shows; the other method's is an alternative to it."""
    if state.of(Rigging).scene is not state.scene:
        return []
    result = shown_result(state)
    if result is None or result in state.of(SavedWork):
        return []
    text = f"{printable(result.target.name, _LONGEST)}: rig"
    return [Unsaved(text, lambda state: ask_where_to_save_rig(state, result))]
