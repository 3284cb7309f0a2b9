"""Actions of the Lint panel and its menu item: check, choose a finding, copy all findings."""

from __future__ import annotations

import json
from dataclasses import replace

from imgui_bundle import imgui

from viewer.app.core.jobs import CountedJob, Report
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.linting.state import Checked, Linting, Running
from viewer.app.playback.animations import choose_animation
from viewer.app.shown_panels import show_panel
from viewer.app.view.picks import take_pick
from viewer.lint import (
    Finding,
    LintOptions,
    describe,
    finding_text,
    recheck,
    summary,
    worst_first,
)
from viewer.loading import bundled_files
from viewer.phrases import counted, printable
from viewer.rendering.picking import Pick
from viewer.rig.pose import pose_key
from viewer.rig.scene import Actor, Scene

__all__ = [
    "check_rig",
    "choose_finding",
    "copy_findings",
    "copy_place",
    "file_place",
    "is_in_scene",
    "is_known_there",
    "is_stale",
    "start_check",
    "take_findings",
]

_TITLE = "Checking the rig"


def check_rig(state: AppState) -> None:
    """Show the Lint panel and check the scene."""
    show_panel(state, "lint")
    state.of(Linting).was_shown = True
    start_check(state)


def start_check(state: AppState) -> None:
    """Check the current scene in a thread, unless another job runs."""
    if no_job_room(state):
        return
    source, options, running = state.scene, _options(state), Running()
    copy, paths = _copied(source), state.paths
    settings, since = state.motion_settings, state.opened_at

    def check(report: Report) -> list[str]:
        # The bundled figure is also read from files.
        files, is_likely = paths or bundled_files(), not paths
        found = recheck(copy, files, options, settings, since, report, is_likely)
        findings = tuple(worst_first(found.findings))
        running.result = Checked(source, copy, options, findings, found.n_files, found.notes)
        return [f"Checked: {summary(findings)}"]

    running.job = state.job = CountedJob(_TITLE, check)
    state.of(Linting).running = running


def _options(state: AppState) -> LintOptions:
    """Return the limits of the check, with the timeline's frame rate."""
    return replace(state.of(Linting).options, frame_rate=state.clock.keyed_rate)


def _copied(scene: Scene) -> Scene:
    """Return a copy of the scene whose poses stay unchanged."""
    return Scene([actor.copy() for actor in scene.actors], world_up=scene.up)


def take_findings(state: AppState) -> None:
    """Show the findings of a finished check; findings about another scene are discarded."""
    view = state.of(Linting)
    running = view.running
    if running is not None and running.job is not state.job:
        view.running = None
        # The result of a cancelled check, or of a scene that was replaced, is not shown.
        was_cancelled = running.job is not None and running.job.is_cancelled
        result = None if was_cancelled else running.result
        if result is not None and result.source is state.scene:
            view.checked, view.chosen = result, -1
            view.is_edited, view.seen = False, _moving(state)
    if view.checked is not None and view.checked.source is not state.scene:
        view.checked, view.chosen = None, -1


def is_stale(state: AppState) -> bool:
    """Return whether the scene or the limits have changed since the check.

    Playback does not count as a change. Called once per frame.
    """
    view = state.of(Linting)
    known = view.checked
    if known is None:
        return False
    before, view.seen = view.seen, _moving(state)
    if before[0] == view.seen[0] and before[1:] != view.seen[1:]:
        view.is_edited = True
    actors, old, options = state.scene.actors, known.scene.actors, _options(state)
    if [actor.clip for actor in actors] != [actor.clip for actor in old]:
        # Other animations may have a different frame rate.
        options = replace(options, frame_rate=known.options.frame_rate)
    return (
        view.is_edited
        or options != known.options
        or len(actors) != len(old)
        or any(map(_differs, actors, old))
    )


def _moving(state: AppState) -> tuple[object, ...]:
    """Return the key of the scene's poses, and the poses of moving actors."""
    poses = [actor.pose for actor in state.scene.actors if actor.clip is not None]
    return (state.clock.posed_for, *(pose_key(pose) for pose in poses if pose is not None))


def _differs(actor: Actor, old: Actor) -> bool:
    if actor.figure is not old.figure:
        return True
    # All animations of the file were checked.
    is_known = any(animation.plays(actor.clip) for animation in actor.figure.animations)
    if actor.clip is not old.clip and not is_known:
        return True
    if actor.offset != old.offset or (actor.placement != old.placement).any():
        return True
    if actor.clip is not None or actor.pose is None or old.pose is None:
        return False
    return pose_key(actor.pose) != pose_key(old.pose)


def choose_finding(state: AppState, index: int) -> None:
    """Show a finding: its actor, joint and time; -1 or the same index again clears the selection.

    Parameters
    ----------
    state : AppState
        State with the camera, which moves to the finding in the next frame.
    index : int
        Index into ``state.of(Linting).checked.findings``.
    """
    view = state.of(Linting)
    view.chosen = -1 if index == view.chosen else index
    finding = view.finding
    if finding is None or finding.actor is None or not is_in_scene(state, finding):
        return
    view.wants_aim = True
    actor = state.scene.actors[finding.actor]
    joint = int(finding.joints[0]) if len(finding.joints) else -1
    if actor.figure.skeleton is None or joint >= actor.figure.skeleton.n_joints:
        joint = -1
    take_pick(state, Pick(finding.actor, joint, -1, -1, actor.placement[:3, 3]), False)
    if finding.animation >= 0:
        choose_animation(state, finding.animation)
    if len(finding.times) and state.clock.has_motion:
        state.clock.playing = False
        seek = finding.times[0] if finding.seek is None else finding.seek
        state.clock.seek(float(seek))
        if finding.seek is not None and finding.code == "C005":
            state.say_status("Last frame before the gap: the person is absent in the next frame")
    if not actor.visible:
        state.say_status(f"{printable(actor.name, 60)} is hidden: see the Actors panel")


def is_in_scene(state: AppState, finding: Finding) -> bool:
    """Return whether a finding is about an actor of the scene; others are about files only."""
    return finding.actor is not None and finding.actor < len(state.scene.actors)


def is_known_there(state: AppState, finding: Finding) -> bool:
    """Return whether an actor's figure is still the one that was checked.

    Parameters
    ----------
    state : AppState
        State with the last check.
    finding : Finding
        A finding of that check.
    """
    known, index = state.of(Linting).checked, finding.actor
    if known is None or index is None or not is_in_scene(state, finding):
        return False
    return state.scene.actors[index].figure is known.scene.actors[index].figure


def file_place(finding: Finding) -> str:
    """Return ``path:line`` or ``path#pointer`` of a finding; empty if it is not about a file."""
    return finding.place()


def copy_place(state: AppState, finding: Finding) -> None:
    """Copy path and line of a finding that is not about an actor, and clear the selection."""
    choose_finding(state, -1)
    place = file_place(finding)
    if place:
        imgui.set_clipboard_text(place)
        state.say_status(f"Copied {place}")


def copy_findings(state: AppState, as_json: bool) -> None:
    """Copy all findings as ``viewer lint`` prints them."""
    known = state.of(Linting).checked
    if known is None:
        return
    if as_json:
        text = json.dumps(describe(known.findings, known.scene), indent=1, allow_nan=False)
    else:
        last = summary(known.findings, known.n_files)
        text = "\n".join([*map(finding_text, known.findings), last])
    imgui.set_clipboard_text(text)
    count = len(known.findings)
    kind = "JSON" if as_json else "text"
    state.say_status(f"{counted(count, 'finding')} copied as {kind}")
