"""Changes to the drive of a figure: its motion is retargeted, and each change can be undone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_drive, no_job_room
from viewer.app.core.state import AppState
from viewer.app.files.files import Files
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.progress import part_of_work
from viewer.rigs.motion.sampled_clip import SampledClip, with_rate
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.scene import Actor

NOT_DRIVEN = "too few joints match, so the motion does not move this figure: choose its joints"
"""What to do if a motion does not move a figure yet."""
_SHORT = 1000  # maximum number of frames, of all people together, that are retargeted without a job


def no_edit(state: AppState) -> str:
    """Return the reason why the chosen actor's retargeting cannot be changed; empty if it can."""
    why = no_drive(state)
    if not why and state.of(Files).stream is not None:
        why = "wait until the capture has been read"
    return why


@dataclass(slots=True)
class _Change:
    """The drives that a job is computing."""

    job: ThreadJob | None = None
    drives: dict[Actor, Drive] = field(default_factory=dict)


def shown_drive(state: AppState, actor: Actor) -> Drive | None:
    """Return an actor's drive, or the changed one whose motion is being computed."""
    change = state.of(_Change)
    is_computed = change.job is not None and change.job is state.job
    if is_computed and change.job is not None and not change.job.is_cancelled:
        return change.drives.get(actor, actor.drive)
    return actor.drive


def change_drive(
    state: AppState, change: Callable[[Drive], Drive], tell: Callable[[], None]
) -> None:
    """Retarget the motion of the chosen actor, and those of all people of its capture.

    Long motions are retargeted in the background. If retargeting fails or is cancelled, or the
    drive is changed meanwhile, as by redo, a message is shown and nothing changes.
    """
    if no_job_room(state):
        state.say_status(no_job_room(state))
        return
    first, scene = state.actor, state.scene
    together = [actor for actor in scene.actors if _is_together(actor, first)]
    work = [(actor, change(actor.drive)) for actor in together if actor.drive is not None]
    before = [actor.drive for actor, _ in work]
    changed: list[SampledClip] = []

    def act() -> None:
        for number, (actor, drive) in enumerate(work):
            span = number / len(work), (number + 1) / len(work)
            with part_of_work(f"Retargeting {printable(actor.title, 60)}", span):
                clip = driven_clip(drive, actor.figure)[0]
                changed.append(clip if drive.finish is None else drive.finish(clip))

    def finish() -> None:
        if state.scene is not scene:
            return
        if any(actor.drive is not old for (actor, _), old in zip(work, before, strict=True)):
            state.say_status("Retargeting discarded: the motion was changed meanwhile")
            return
        for (actor, drive), clip in zip(work, changed, strict=True):
            rate = (clip if actor.clip is None else actor.clip).frame_rate
            actor.clip, actor.drive = with_rate(clip, rate), drive
            state.clock.pose(actor, again=True)
        tell()

    if sum(drive.motion.clip.n_rows for _, drive in work) > _SHORT:
        job = state.job = ThreadJob(f"Retargeting {printable(first.title, 60)}", act, finish)
        state.put(_Change(job, dict(work)))
        return
    try:
        act()
    except ViewerError as problem:
        state.error = str(problem)
    else:
        finish()


def _is_together(actor: Actor, first: Actor) -> bool:
    """Return whether two actors are the same, or people of the same capture."""
    if actor is first:
        return True
    if actor.drive is None or first.drive is None or actor.captured is None:
        return False
    is_same = actor.figure is first.figure and actor.title == first.title
    return is_same and actor.drive.joint_map is first.drive.joint_map


def plants_feet(state: AppState) -> bool:
    """Return whether the feet of the chosen actor are planted, or will be after retargeting."""
    drive = shown_drive(state, state.actor)
    return drive is not None and drive.plants_feet


def toggle_feet(state: AppState) -> None:
    """Switch planted feet on or off for the chosen actor and all people of its capture."""
    if not _can_change(state):
        return
    is_on = not plants_feet(state)
    text = f"Feet: {'kept on the ground' if is_on else 'as retargeted'}"
    change_drive(
        state, lambda drive: replace(drive, plants_feet=is_on), lambda: state.say_status(text)
    )


def keeps_hands(state: AppState) -> bool:
    """Return whether hands of the chosen actor stay at its body, or will after retargeting."""
    drive = shown_drive(state, state.actor)
    return drive is not None and drive.keeps_hands


def toggle_hands(state: AppState) -> None:
    """Switch hands at the body on or off for the chosen actor and all people of its capture."""
    if not _can_change(state):
        return
    is_on = not keeps_hands(state)
    text = f"Hands: {'kept at the body' if is_on else 'as retargeted'}"
    change_drive(
        state, lambda drive: replace(drive, keeps_hands=is_on), lambda: state.say_status(text)
    )


def _can_change(state: AppState) -> bool:
    """Return whether the motion of the chosen actor can be computed again; say why not."""
    why = no_edit(state) or ("" if state.actor.clip is not None else NOT_DRIVEN)
    if why:
        state.say_status(why)
    return not why
