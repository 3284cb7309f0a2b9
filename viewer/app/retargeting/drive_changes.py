"""Changes to how a motion drives a figure: it is retargeted immediately, and undo reverts it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from viewer.app.core.reasons import no_drive
from viewer.app.core.state import AppState
from viewer.app.files.state import Files
from viewer.errors import ViewerError
from viewer.rig.motion.retimed import with_rate
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.drive import Drive
from viewer.rig.retargeting.driven_clip import driven_clip
from viewer.rig.scene import Actor

__all__ = ["change_drive", "no_edit"]


def no_edit(state: AppState) -> str:
    """Return the reason why the chosen actor's retargeting cannot be changed; empty if it can."""
    why = no_drive(state)
    if not why and state.of(Files).stream is not None:
        why = "wait until the capture has been read"
    return why


def change_drive(state: AppState, change: Callable[[Drive], Drive]) -> bool:
    """Retarget the motion of the chosen actor, and those of all people of its capture.

    Parameters
    ----------
    state : AppState
        State with a driven actor.
    change : callable
        Returns the changed drive.

    Returns
    -------
    bool
        Whether it succeeded; otherwise a message is shown and nothing changes.
    """
    first = state.actor
    together = [actor for actor in state.scene.actors if _is_together(actor, first)]
    try:
        changed = [_retargeted(actor, change) for actor in together]
    except ViewerError as problem:
        state.error = str(problem)
        return False
    for actor, found in zip(together, changed, strict=True):
        actor.clip, actor.drive = found.clip, found.drive
        state.clock.pose(actor, again=True)
    return True


def _is_together(actor: Actor, first: Actor) -> bool:
    """Return whether an actor is the first one or another person of the same capture."""
    if actor is first:
        return True
    if actor.drive is None or first.drive is None or not isinstance(actor.clip, SampledClip):
        return False
    is_same = actor.figure is first.figure and actor.title == first.title
    return is_same and actor.drive.joint_map is first.drive.joint_map


def _retargeted(actor: Actor, change: Callable[[Drive], Drive]) -> Actor:
    """Return a copy of an actor with its motion retargeted by a changed drive."""
    assert actor.drive is not None and isinstance(actor.clip, SampledClip)  # checked by ``no_edit``
    drive = change(actor.drive)
    clip = driven_clip(drive, actor.figure)[0]
    if drive.finish is not None:
        clip = drive.finish(clip)
    return replace(
        actor, drive=drive, clip=with_rate(clip, actor.clip.timing.frame_rate), pose=actor.pose
    )
