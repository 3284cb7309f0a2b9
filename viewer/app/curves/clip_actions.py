"""Actions on a whole keyed clip: create one from a pose, add keys, save it."""

from __future__ import annotations

from pathlib import Path

from viewer.app.core.state import AppState
from viewer.app.curves.editing import keyed_of
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.saving import save_files
from viewer.app.files.state import Files
from viewer.formats import FORMATS, file_stem, write
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.clip_edit import clip_from_pose
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.number_text import number_text
from viewer.rig.scene import Motion

__all__ = ["ask_for_clip", "can_have_keys", "key_present_pose", "new_clip", "save_clip"]

_SECONDS = 2.0  # duration of a new clip


def can_have_keys(state: AppState) -> bool:
    """Return whether the chosen actor can get a clip: it has joints and no motion yet."""
    return state.actor.pose is not None and state.actor.clip is None


def new_clip(state: AppState) -> None:
    """Create a clip of the chosen actor's constant pose, with one key per DOF."""
    actor = state.actor
    if actor.pose is None or actor.figure.skeleton is None or actor.clip is not None:
        return
    actor.clip = clip_from_pose(actor.figure.skeleton, actor.pose, actor.title, 0.0, _SECONDS)
    state.say_status("New clip: this pose held for two seconds")


def key_present_pose(state: AppState, only_changed: bool = False) -> None:
    """Key the pose at the current time."""
    actor, keyed = state.actor, keyed_of(state.actor)
    if keyed is None or actor.pose is None:
        return
    time = state.clock.time - actor.offset
    before = _n_keys(actor.clip)
    actor.clip = keyed.posed(actor, time, only_changed)
    added = _n_keys(actor.clip) - before
    state.say_status(f"Pose keyed at {number_text(time, '.3f')} s: {added} new keys")


def _n_keys(clip: Motion | None) -> int:
    """Return the number of keys of a clip."""
    if not isinstance(clip, Clip | TransformClip):
        return 0
    return sum(len(channel.times) for channel in clip.channels)


def ask_for_clip(state: AppState) -> None:
    """Ask where to save the chosen actor's clip."""
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_clip(state, paths[0]),
        "save",
        "Save clip: .anim",
        FORMATS["anim"].suffixes,
        f"{file_stem(state.actor.name)}_edited.anim",
    )


def save_clip(state: AppState, path: Path) -> None:
    """Write the chosen actor's clip if it is keyed."""
    clip = state.actor.clip
    if isinstance(clip, Clip):
        save_files(state, lambda: write(clip, path), [path], saved=clip)
