"""Lint panel: check of the scene in a thread, errors in rigs and motions, and their remedies."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import field, replace

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.clock import PosedFor
from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.scene_version import ActorVersion, SceneVersion
from viewer.app.core.state import AppState
from viewer.app.core.theme import WARNING, ink, text_color
from viewer.app.core.widgets import (
    button,
    choice,
    explain,
    filter_field,
    note_item,
    same_line_if_room,
    slider,
    warning,
)
from viewer.app.layout import show_panel
from viewer.app.playback.animations import choose_animation
from viewer.app.view.picks import take_pick
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.linting import (
    SEVERITIES,
    Finding,
    LintOptions,
    describe,
    finding_text,
    recheck,
    summary,
    worst_first,
)
from viewer.linting.captures import LOW_FRACTION, LOW_FRAMES
from viewer.linting.fixes import FIXES, fix_scene
from viewer.phrases import counted, printable
from viewer.rendering.overlay.annotation import Marks
from viewer.rendering.picking import Pick
from viewer.rendering.recorder import copied
from viewer.rigs.mesh import box_size
from viewer.rigs.pose import PoseKey
from viewer.rigs.scene import Actor, Scene, scene_unit

_COLORS = {
    "error": (1.0, 0.42, 0.36, 1.0),
    "warning": WARNING,
    "note": (0.52, 0.74, 1.0, 1.0),
}
_GROUNDS = {
    "auto": "estimated from the feet",
    "height": "at a height",
    "none": "none: feet are not checked",
}
_LONGEST = 400  # maximum length of a message in the list, characters
_LIMITS_WIDTH = 24.0  # width of the limits, in font sizes
_FASTEST = 100.0  # highest speed that can be set, units per second
_TIP_WIDTH = 30.0  # width of tooltips, in font sizes
_TITLE = "Checking the rig"
_FIXING = "Fixing the rig"


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """Result of a check."""

    source: Scene
    """The scene that the window shows."""
    scene: Scene
    """A copy of the scene, made when the check began."""
    version: SceneVersion
    """The scene at that time."""
    options: LintOptions
    """Limits of the check."""
    findings: tuple[Finding, ...]
    """Findings, most severe first."""
    n_files: int = 0
    """Number of files of the scene that were read again."""
    notes: tuple[str, ...] = ()
    """Changes of these files since they were opened."""


@dataclass(slots=True, eq=False)
class _Running:
    """A check that runs in a thread, which stores its result here."""

    job: ThreadJob | None = None
    result: Checked | None = None


@dataclass(slots=True)
class Linting:
    """State of the Lint panel."""

    options: LintOptions = field(default_factory=LintOptions)
    """Limits of the next check."""
    checked: Checked | None = None
    """The last completed check."""
    running: _Running | None = None
    """The check in progress."""
    was_shown: bool = False
    """Whether the panel has been shown before: showing it for the first time starts a check."""
    severities: set[str] = field(default_factory=lambda: set(SEVERITIES))
    """Severities to list."""
    text: str = ""
    """Text that listed findings must contain."""
    chosen: int = -1
    """Index of the chosen finding, -1 for none."""
    wants_aim: bool = False
    """Whether the camera moves to the chosen finding once the scene is posed."""
    wants_check: bool = False
    """Whether the scene is checked as soon as no job runs: faults were fixed."""
    is_edited: bool = False
    """Whether a moving actor was posed by hand since the check."""
    seen: tuple[PosedFor | None, SceneVersion] | None = None
    """Key of the clock's poses, and the scene, in the previous frame."""
    marks: Marks | None = None
    """Marks of the chosen finding."""
    marks_key: object = None
    """Key that identifies the marks."""
    marks_note: str = ""
    """Note about parts of the finding that are not marked; empty if all are."""

    @property
    def finding(self) -> Finding | None:
        """The chosen finding."""
        known = self.checked
        if known is None or not 0 <= self.chosen < len(known.findings):
            return None
        return known.findings[self.chosen]


def draw(state: AppState) -> None:
    """Draw the panel; when it is first shown, it starts a check."""
    view = state.of(Linting)
    _take_findings(state)
    if not view.was_shown or (view.wants_check and state.job is None):
        view.was_shown, view.wants_check = True, False
        start_check(state)
    known = view.checked
    if button(state, "Check" if known is None else "Recheck", no_job_room(state)):
        start_check(state)
    explain("check rigs, meshes and motions in their current state, and the files")
    same_line_if_room("Fix")
    if button(state, "Fix", no_job_room(state) or _nothing_to_fix(view)):
        _start_fixing(state)
    explain(
        "fix what has a fix in the open scene, such as stray weights and pops; files stay as they "
        "are, and undo restores the scene"
    )
    same_line_if_room("Limits…")
    if button(state, "Limits…"):
        imgui.open_popup("lint limits")
    _draw_limits(state)
    why = "" if known is not None and known.findings else "there are no findings to copy"
    same_line_if_room("Copy text")
    if button(state, "Copy text", why):
        _copy_findings(state, as_json=False)
    explain("all findings, as the command viewer lint prints them")
    same_line_if_room("Copy JSON")
    if button(state, "Copy JSON", why):
        _copy_findings(state, as_json=True)
    if view.running is not None:
        _draw_progress(state)
    if known is None:
        if view.running is None:
            imgui.text_wrapped("This scene has not been checked yet.")
        return
    if _is_stale(state):
        warning("The figure, pose or limits have changed since the check.")
    for note in known.notes:
        warning(note)
    _draw_filters(state, known)
    if view.chosen >= 0 and view.marks_note:
        imgui.text_wrapped(view.marks_note)
    _draw_list(state, known)


def _draw_limits(state: AppState) -> None:
    """Draw the limits that depend on the user's intent."""
    # Fields fill the width of the window, which would otherwise shrink with them.
    imgui.set_next_window_size((_LIMITS_WIDTH * imgui.get_font_size(), 0.0))
    if not imgui.begin_popup("lint limits"):
        return
    view = state.of(Linting)
    options = view.options
    rotation = np.degrees(options.max_rotation)
    moved = slider(state, "Largest rotation", rotation, 90.0, 10_000.0, "%.0f\N{DEGREE SIGN}/s")
    explain("rotation of a joint relative to its parent, between two frames")
    if moved != rotation:
        view.options = replace(view.options, max_rotation=float(np.radians(max(moved, 0.0))))
    speed = options.max_speed or 0.0
    unit = scene_unit(state.scene) or "units"
    text = f"%.2f {unit}/s" if speed else "automatic"
    moved = slider(state, "Largest speed", speed, 0.0, _FASTEST, text)
    explain("speed of joints and captured points; 0 for 15 times the figure's size per second")
    if moved != speed:
        view.options = replace(view.options, max_speed=moved if moved > 0.0 else None)
    sure = options.confidence
    moved = slider(state, "Low confidence", sure, 0.0, 1.0)
    explain(
        "report a captured point if its confidence is below this in more than "
        f"{100.0 * LOW_FRACTION:g} % of the frames with the point, and in at least {LOW_FRAMES}"
    )
    if moved != sure:
        view.options = replace(view.options, confidence=moved)
    _draw_ground(state)
    if button(state, "Default limits"):
        view.options = LintOptions()
    imgui.end_popup()


def _draw_ground(state: AppState) -> None:
    """Draw the choice of the ground: estimated, at a height, or none."""
    view = state.of(Linting)
    ground = view.options.ground
    is_given = not isinstance(ground, str)
    chosen = choice(state, "Ground", "height" if is_given else str(ground), _GROUNDS)
    explain("feet may be at most 1 % of the figure's height below the ground")
    if chosen == "height":
        height = float(ground) if is_given else 0.0
        size = box_size(state.box) or 1.0
        ground = slider(state, "Ground height", height, -size, size, "%.3f")
    elif chosen == "auto":
        ground = "auto"
    else:
        ground = "none"
    if ground != view.options.ground:
        view.options = replace(view.options, ground=ground)


def _draw_progress(state: AppState) -> None:
    running = state.of(Linting).running
    if running is None or running.job is None or running.job is not state.job:
        return
    job = running.job
    done, total, _ = job.progress
    fraction = done / total if total else -imgui.get_time()
    imgui.progress_bar(fraction, (-1.0, 0.0), f"{done} of {total}" if total else "")
    if button(state, "Cancel check", "it is being cancelled" if job.is_cancelled else ""):
        job.cancel()
        state.say_status("Cancelled")


def _draw_filters(state: AppState, known: Checked) -> None:
    view = state.of(Linting)
    counts = Counter(finding.severity for finding in known.findings)
    for severity in reversed(SEVERITIES):
        text = f"{counts[severity]:,} {severity}{'s' * (counts[severity] != 1)}"
        if severity != SEVERITIES[-1]:
            same_line_if_room(text)
        with text_color(_COLORS[severity]):
            changed, _ = imgui.checkbox(f"{text}###{severity}", severity in view.severities)
        note_item(state, f"lint {severity}")
        if changed:
            view.severities ^= {severity}
    view.text = filter_field(state, "Filter findings", view.text, "Filter findings")


def _draw_list(state: AppState, known: Checked) -> None:
    view = state.of(Linting)
    shown = [
        index
        for index, finding in enumerate(known.findings)
        if finding.severity in view.severities and view.text.lower() in _searched_text(finding)
    ]
    if not shown:
        imgui.text_disabled("no finding matches" if known.findings else "no findings")
        return
    flags = imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_inner_h
    if not imgui.begin_table("findings", 2, flags):
        return
    imgui.table_setup_column("code", imgui.TableColumnFlags_.width_fixed)
    imgui.table_setup_column("finding", imgui.TableColumnFlags_.width_stretch)
    several = len(state.scene.actors) > 1
    for index in shown:
        imgui.push_id(index)
        _draw_row(state, index, known.findings[index], several)
        imgui.pop_id()
    imgui.end_table()


def _searched_text(finding: Finding) -> str:
    """Return the text that the filter searches, in lower case."""
    parts = [finding.code, finding.severity, finding.title, finding.message]
    return " ".join((*parts, finding.name, finding.motion, _place(finding))).lower()


def _place(finding: Finding) -> str:
    """Return the file's name, and the line or the JSON pointer; empty if there is none."""
    return finding.place(60, is_short=True)


def _draw_row(state: AppState, index: int, finding: Finding, several: bool) -> None:
    """Draw a finding: title, actor and message; the whole row can be clicked."""
    imgui.table_next_row()
    imgui.table_set_column_index(1)
    title, message = finding.title, printable(finding.message, _LONGEST)
    if several and finding.name:
        title = f"{printable(finding.name, 60)}: {title}"
    if finding.motion:
        title = f"{printable(finding.motion, 60)}: {title}"
    if _place(finding):
        title = f"{title} ({_place(finding)})"
    room = max(imgui.get_content_region_avail().x, 1.0)
    heights = [imgui.calc_text_size(text, False, room).y for text in (title, message)]
    imgui.text_wrapped(title)
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))
    imgui.text_wrapped(message)
    imgui.pop_style_color()
    imgui.table_set_column_index(0)
    place = imgui.get_cursor_screen_pos()
    flags = imgui.SelectableFlags_.span_all_columns
    size = (0.0, sum(heights) + imgui.get_style().item_spacing.y)
    if imgui.selectable("##finding", index == state.of(Linting).chosen, flags, size)[0]:
        if _is_in_scene(state, finding):
            _choose_finding(state, index)
        else:
            _copy_place(state, finding)
    note_item(state, f"finding {index}")
    if imgui.is_item_hovered(imgui.HoveredFlags_.delay_normal) and imgui.begin_tooltip():
        imgui.push_text_wrap_pos(_TIP_WIDTH * imgui.get_font_size())
        imgui.text_colored(ink(_COLORS[finding.severity]), f"{finding.severity} {finding.code}")
        imgui.text_unformatted(finding.title)
        if finding.place():
            imgui.text_unformatted(finding.place())
        imgui.text_unformatted(printable(finding.message, 2000))
        imgui.text_unformatted(f"Remedy: {finding.hint}")
        imgui.text_disabled(_click_text(state, finding))
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
    imgui.set_cursor_screen_pos(place)
    _draw_severity(finding.severity)
    imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
    imgui.text_colored(ink(_COLORS[finding.severity]), finding.code)


def _click_text(state: AppState, finding: Finding) -> str:
    """Return the tooltip about the effect of a click on a finding."""
    if _is_known_there(state, finding):
        return "click to show it in the view; click again or press Esc to stop"
    if _is_in_scene(state, finding):
        return "click to select the actor: its figure has changed since the check"
    if not finding.place():
        return "this finding has no location in the view"
    copied = "its path" if finding.line is None else "its path and line"
    if finding.pointer:
        copied = "its path and JSON pointer"
    return f"this finding is about the file, not the figure shown: click to copy {copied}"


def _draw_severity(severity: str) -> None:
    """Draw the icon of a severity: a cross in a disc, a triangle with "!", a ring with "i"."""
    size = imgui.get_text_line_height()
    corner = imgui.get_cursor_screen_pos()
    x, y, r = corner.x + 0.5 * size, corner.y + 0.5 * size, 0.42 * size
    draw_list = imgui.get_window_draw_list()
    color, dark = (
        imgui.get_color_u32(ink(_COLORS[severity])),
        imgui.get_color_u32((0.1, 0.1, 0.1, 1)),
    )
    line = max(0.12 * size, 1.0)
    if severity == "error":
        draw_list.add_circle_filled((x, y), r, color)
        arm = 0.45 * r
        draw_list.add_line((x - arm, y - arm), (x + arm, y + arm), dark, line)
        draw_list.add_line((x - arm, y + arm), (x + arm, y - arm), dark, line)
    elif severity == "warning":
        draw_list.add_triangle_filled((x, y - r), (x + r, y + 0.8 * r), (x - r, y + 0.8 * r), color)
        draw_list.add_line((x, y - 0.35 * r), (x, y + 0.25 * r), dark, line)
        draw_list.add_circle_filled((x, y + 0.55 * r), 0.6 * line, dark)
    else:
        draw_list.add_circle((x, y), 0.9 * r, color, 0, 0.7 * line)
        draw_list.add_circle_filled((x, y - 0.4 * r), 0.6 * line, color)
        draw_list.add_line((x, y - 0.1 * r), (x, y + 0.5 * r), color, line)
    imgui.dummy((size, size))


def check_rig(state: AppState) -> None:
    """Show the Lint panel and check the scene."""
    show_panel(state, "lint")
    state.of(Linting).was_shown = True
    start_check(state)


def start_check(state: AppState) -> None:
    """Check the current scene in a thread, unless another job runs."""
    if no_job_room(state):
        return
    source, options, running = state.scene, _options(state), _Running()
    copy, version, paths = copied(source), state.update_version(), state.paths
    settings, since = state.motion_settings, state.opened_at

    def check() -> list[str]:
        found = recheck(copy, paths, options, settings, since)
        findings = tuple(worst_first(found.findings))
        running.result = Checked(
            source, copy, version, options, findings, found.n_files, found.notes
        )
        return [f"Checked: {summary(findings)}"]

    running.job = state.job = ThreadJob(_TITLE, check)
    state.of(Linting).running = running


def _nothing_to_fix(view: Linting) -> str:
    """Return the reason why nothing can be fixed."""
    if view.checked is None:
        return "check the scene first"
    has_fix = any(
        one.code in FIXES and one.actor is not None and one.severity != "note"
        for one in view.checked.findings
    )
    return "" if has_fix else "no error or warning has a fix"


def _start_fixing(state: AppState) -> None:
    """Fix a copy of the scene in a thread; its figures and motions then replace those shown."""
    source, options = state.scene, _options(state)
    copy, before = copied(source), [(one.figure, one.clip) for one in source.actors]
    notes: list[Diagnostic] = []

    def fix() -> list[str]:
        notes.extend(fix_scene(copy, (), options).notes)
        return []

    def show() -> None:
        actors = source.actors if state.scene is source else []
        is_same = len(actors) == len(before) and all(
            actor.figure is figure and actor.clip is clip
            for actor, (figure, clip) in zip(actors, before, strict=True)
        )
        if not is_same:
            state.say_status("Nothing was fixed: the scene changed meanwhile")
            return
        for actor, fixed in zip(actors, copy.actors, strict=True):
            _record_edits(state.of(SavedWork), actor, fixed)
            actor.figure = fixed.figure
            if fixed.clip is not actor.clip:
                # Joints whose keys were deleted are at rest.
                actor.clip, actor.pose = fixed.clip, fixed.pose
        state.say(*notes)
        state.say_status(f"Fixed: {counted(len(notes), 'change')}")
        state.of(Linting).wants_check = True

    state.job = ThreadJob(_FIXING, fix, show)


def _record_edits(saved: SavedWork, actor: Actor, fixed: Actor) -> None:
    """Record what differs in an actor that was fixed: its rig, the motion and its animations."""
    old, new = actor.figure, fixed.figure
    if (old.skeleton, old.skin, old.mesh) != (new.skeleton, new.skin, new.mesh):
        saved.edited.add(new)
    for before, after in zip(old.animations, new.animations, strict=True):
        if after is not before:
            saved.edited.add(after.clip())
    if fixed.clip is not None and fixed.clip is not actor.clip:
        saved.edited.add(fixed.clip)


def _options(state: AppState) -> LintOptions:
    """Return the limits of the check, with the timeline's frame rate."""
    return replace(state.of(Linting).options, frame_rate=state.clock.keyed_rate)


def _take_findings(state: AppState) -> None:
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
            view.is_edited, view.seen = False, (state.clock.posed_for, state.version)
    if view.checked is not None and view.checked.source is not state.scene:
        view.checked, view.chosen = None, -1


def _is_stale(state: AppState) -> bool:
    """Return whether the scene, apart from playback, or the limits have changed since the check."""
    view = state.of(Linting)
    known = view.checked
    if known is None:
        return False
    before, view.seen = view.seen, (state.clock.posed_for, state.version)
    if before is not None and before[0] == view.seen[0]:
        view.is_edited |= _moving(before[1]) != _moving(state.version)
    actors, old, options = state.version.actors, known.version.actors, _options(state)
    if [one.clip for one in actors] != [one.clip for one in old]:
        # Other animations may have a different frame rate.
        options = replace(options, frame_rate=known.options.frame_rate)
    return (
        view.is_edited
        or options != known.options
        or len(actors) != len(old)
        or any(map(_differs, actors, old))
    )


def _moving(version: SceneVersion) -> list[PoseKey | None]:
    """Return the poses of moving actors."""
    return [one.pose for one in version.actors if one.clip is not None]


def _differs(now: ActorVersion, old: ActorVersion) -> bool:
    if now.figure is not old.figure:
        return True
    # All animations of the file were checked.
    is_known = any(animation.plays(now.clip) for animation in now.figure.animations)
    if now.clip is not old.clip and not is_known:
        return True
    if now.offset != old.offset or now.placement != old.placement:
        return True
    return now.clip is None and None not in (now.pose, old.pose) and now.pose != old.pose


def _choose_finding(state: AppState, index: int) -> None:
    """Show a finding's actor, joint and time; -1 or the same index again clears the selection."""
    view = state.of(Linting)
    view.chosen = -1 if index == view.chosen else index
    finding = view.finding
    if finding is None or finding.actor is None or not _is_in_scene(state, finding):
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


def _is_in_scene(state: AppState, finding: Finding) -> bool:
    """Return whether a finding is about an actor of the scene; others are about files only."""
    return finding.actor is not None and finding.actor < len(state.scene.actors)


def _is_known_there(state: AppState, finding: Finding) -> bool:
    """Return whether an actor's figure is still the one that was checked."""
    known, index = state.of(Linting).checked, finding.actor
    if known is None or index is None or not _is_in_scene(state, finding):
        return False
    return state.scene.actors[index].figure is known.scene.actors[index].figure


def _copy_place(state: AppState, finding: Finding) -> None:
    """Copy path and line of a finding that is not about an actor, and clear the selection."""
    _choose_finding(state, -1)
    place = finding.place()
    if place:
        imgui.set_clipboard_text(place)
        state.say_status(f"Copied {place}")


def _copy_findings(state: AppState, as_json: bool) -> None:
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
