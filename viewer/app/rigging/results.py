"""Results of rigging: display in place of the target, their section of the Rig panel, saving."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.theme import WARNING, text_color
from viewer.app.core.widgets import (
    button,
    checkbox,
    explain,
    note_item,
    radio,
    same_line_if_room,
    warning,
    with_key,
)
from viewer.app.files.files import ask_where_to_write
from viewer.app.files.saving import save_in_background
from viewer.app.rigging.placing import target_place
from viewer.app.rigging.rigging import Comparison, Result, Rigging, is_intact, no_results
from viewer.autorig.confidence import doubts
from viewer.autorig.rigged import clip_for, start_of_clips
from viewer.exporters._rigged_files import RIGGED_SUFFIXES, files_of, write_rigged
from viewer.formats import file_stem
from viewer.phrases import capitalized, printable
from viewer.rigs.annotations import VertexField
from viewer.rigs.arrays import Ints
from viewer.rigs.comparison.pairs import Pairs, row_distances
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_animation import baked
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton
from viewer.rigs.skin import Skin, owners

MATCH_COLORS = {
    "class:match": "matched or not",
    "field:match distance": "distance",
    "field:match angle": "angle",
}
"""Scalar quantities that show how the target matches the template, with their labels."""
_RESULT_COLORS = {
    "class:confidence": "confidence",
    "field:distance": "distance",
    "class:guarded": "rest position",
}
"""Scalar quantities that show how the weights of a result were found, with their labels."""
TARGET = "target"
"""Key of the original mesh among the versions; the others are named after methods."""
_TRIAL = "trial motion"
"""Name of the clip."""
_ANGLE = math.radians(35.0)
_LONGEST, _WHOLE = 0.9, 20.0
"""Maximum duration of the motion of one joint, and of all joints, in seconds."""
_LINES_HEIGHT = 9.0  # number of visible lines of the report


def compare(first: Result, second: Result) -> Comparison:
    """Return the differences between the weights of two results for one target."""
    one, other = first.rigged.figure.skin, second.rigged.figure.skin
    assert one is not None and other is not None  # both figures are rigged
    joints = np.arange(one.n_joints, dtype=np.int32)
    distances = row_distances(one, other, Pairs(joints, joints, ()))
    same = _dominant(one) == _dominant(other)
    return Comparison(float(distances.mean()), float(same.mean()))


def _dominant(skin: Skin) -> Ints:
    """Return each vertex's dominant joint, -1 if it has no influence: (V,)."""
    order = np.lexsort((-skin.joints, skin.weights, owners(skin)))
    last = np.cumsum(np.diff(skin.starts)) - 1
    has_some = np.diff(skin.starts) > 0
    found = np.full(skin.n_vertices, -1)
    found[has_some] = skin.joints[order][last[has_some]]
    return found


def put_results(state: AppState, results: list[Result], comparison: Comparison | None) -> None:
    """Add rigged meshes to the scene, and show the first in place of the target."""
    view, actors = state.of(Rigging), state.scene.actors
    target = results[0].target
    if not any(actor is target for actor in actors):
        state.say("The mesh that was rigged no longer exists")
        return
    if view.target is not target:
        view.results = {}
    chosen = state.actor
    for result in results:
        old = view.results.get(result.method)
        row = _row(actors, old.actor) if old is not None and is_intact(old) else -1
        if row >= 0:
            actors[row] = result.actor
        elif not any(
            _row(actors, one.actor) >= 0 and is_intact(one) for one in view.results.values()
        ):
            # The target moves to the end, so that the other actors keep their numbers.
            actors[_row(actors, target)] = result.actor
            actors.append(target)
        else:
            actors.append(result.actor)
        view.results[result.method] = result
        state.of(SavedWork).made.add(result.rigged.figure)
    view.target, view.comparison, view.tool = target, comparison, ""
    view.ghost, view.scrolls = "", 2
    _look(state, results[0].method)
    if any(chosen is actor for actor in (target, *(one.actor for one in results))) or (
        _row(actors, chosen) < 0
    ):
        state.choose_actor(_row(actors, results[0].actor))
    if state.options.scalar in MATCH_COLORS:
        show_colors(state, "")  # only the target has these quantities
    _play(state, results[0])
    state.say_status(f"Rigged: {printable(target.name, 60)}; A shows the original mesh")


def _play(state: AppState, result: Result) -> None:
    """Show the joints of a result, and play the template's motion or a trial motion."""
    state.options.xray = True
    _set_motion(state, result, plays=not _no_motion_of(result))
    if result.actor.clip is None:
        _set_trial(state, result, plays=True)
    if result.actor.clip is not None:
        state.clock.follow(state.actor)
        state.clock.seek(state.clock.start)
        state.clock.playing = True


def _row(actors: list[Actor], actor: Actor) -> int:
    """Return an actor's index, or -1 if it is not in the list."""
    return next((row for row, one in enumerate(actors) if one is actor), -1)


def _versions(state: AppState) -> dict[str, Actor]:
    """Return the versions that A cycles through: the target and its results in the scene."""
    view, actors = state.of(Rigging), state.scene.actors
    if view.target is None:
        return {}
    found = {TARGET: view.target}
    found |= {name: one.actor for name, one in view.results.items() if is_intact(one)}
    return {name: actor for name, actor in found.items() if _row(actors, actor) >= 0}


def _shown_version(state: AppState) -> str:
    """Return the key of the visible version; empty if none is visible."""
    return next((name for name, actor in _versions(state).items() if actor.visible), "")


def shown_result(state: AppState) -> Result | None:
    """Return the visible result, or the last one in the scene."""
    known = _versions(state)
    present = [one for name, one in state.of(Rigging).results.items() if name in known]
    visible = [one for one in present if one.actor.visible]
    return (visible or present)[-1] if present else None


def switch_version(state: AppState) -> None:
    """Show the next version, the target or one of its results, in place of the current one."""
    known = list(_versions(state))
    if len(known) < 2:
        why = no_results(state) if state.of(Rigging).results else ""
        state.say_status(f"A/B: {why or 'nothing is rigged yet, see Window > Rig'}")
        return
    shown = _shown_version(state)
    following = known[(known.index(shown) + 1) % len(known)] if shown else known[0]
    _show_version(state, following)


def _show_version(state: AppState, name: str) -> None:
    """Show one of ``_versions`` without recording an undo step."""
    # Other changes in this frame keep their own undo step.
    state.observe()
    _look(state, name)
    state.history.accept(state.update_version())
    text = "Original mesh" if name == TARGET else f"Rigged, method {name}"
    state.say_status(text)


def _look(state: AppState, name: str) -> None:
    known = _versions(state)
    was_chosen = any(state.actor is actor for actor in known.values())
    for key, actor in known.items():
        actor.visible = key == name
    if was_chosen:
        state.choose_actor(_row(state.scene.actors, known[name]))


def show_match(
    state: AppState, actor: Actor, fields: tuple[VertexField, ...], fraction: float
) -> None:
    """Colour the target by its match with the template."""
    rigging = state.of(Rigging)
    names = {field.name for field in fields}
    kept = tuple(field for field in actor.figure.fields if field.name not in names)
    actor.figure = replace(actor.figure, fields=(*fields, *kept))
    rigging.match_fraction, rigging.ghost = fraction, ""
    if not actor.visible:
        _look(state, TARGET)
    show_colors(state, "class:match")


def show_colors(state: AppState, view: str) -> None:
    """Show a scalar quantity, or plain shading if its name is empty."""
    options = state.options
    if view:
        options.shading, options.scalar, options.scalar_range = "scalar", view, None
    elif options.shading == "scalar":
        options.shading = "auto"


def plays_motion(result: Result) -> bool:
    """Return whether a result plays the motion of its template."""
    return result.actor.clip is not None and not plays_trial(result)


def plays_trial(result: Result) -> bool:
    """Return whether a result plays the trial motion."""
    clip = result.actor.clip
    return clip is not None and clip.kind == "curves" and clip.name == _TRIAL


def _no_trial_of(result: Result) -> str:
    """Return the reason why a result cannot play the trial motion."""
    skeleton = result.rigged.figure.skeleton
    found = None if skeleton is None else trial_clip(skeleton, result.rigged.pose)
    return "" if found is not None else "no joint of the template can rotate"


def _set_trial(state: AppState, result: Result, plays: bool) -> None:
    """Play the trial motion in the pose of the target, or stop it."""
    _set_motion(state, result, plays=False)
    skeleton = result.rigged.figure.skeleton
    if plays and skeleton is not None:
        result.actor.clip = trial_clip(skeleton, result.rigged.pose)
        state.of(SavedWork).add(result.actor.clip)
        result.actor.offset = 0.0


def _no_motion_of(result: Result | None) -> str:
    """Return the reason why a result cannot play the motion of its template."""
    if result is None:
        return "nothing is rigged yet: press Run"
    if result.template.clip is not None and result.template.clip.points is None:
        return ""
    return "the template has no motion: it needs one before Run is pressed"


@shows_errors
def _set_motion(state: AppState, result: Result, plays: bool) -> None:
    """Play the template's motion at the target's position, or pose the result like the target."""
    state.framing.extent.note_choice()  # the camera may fit other motions, but follows no edits
    actor, rigged, clip = result.actor, result.rigged, result.template.clip
    place = target_place(result.target)
    if clip is not None and clip.kind == "transforms":
        clip = baked(result.template.figure, clip, base=result.template.pose)
    if not plays or clip is None or clip.points is not None:
        actor.clip, actor.pose = None, rigged.pose.copy()
        actor.placement = place @ rigged.placement
        return
    actor.clip = clip_for(rigged, clip)
    state.of(SavedWork).add(actor.keyed)
    # The clip sets the same DOFs as the template's; the target's rotation is not part of it.
    actor.pose = start_of_clips(rigged)
    actor.offset = result.template.actor.offset if result.template.actor else 0.0
    # From the template's space to the target's, without scale.
    matrix, alignment = rigged.placement, rigged.alignment
    if alignment is not None:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = alignment.similarity.rotation, alignment.similarity.shift
    actor.placement = place @ matrix


@shows_errors
def _save_rigged(state: AppState, result: Result, path: Path) -> None:
    """Write a result in the background: all of its files or none."""
    files = files_of(path)
    inputs = result.template.paths
    act = partial(write_rigged, result.rigged, path)
    saved = [result, result.rigged.figure]
    save_in_background(state, act, files, inputs, saved, is_rig=True)


def trial_clip(skeleton: Skeleton, pose: Pose) -> Clip | None:
    """Return a motion from a pose and back that moves each joint about its widest axis, or None."""
    order = depth_first(skeleton.parents)
    dofs = [dof for joint in order.tolist() if (dof := _bending_dof(skeleton, joint)) >= 0]
    if not dofs:
        return None
    seconds = min(_LONGEST, _WHOLE / len(dofs))
    channels = []
    for number, dof in enumerate(dofs):
        # The joint bends one way and back the other way, and ends where it began.
        value, (low, high) = float(pose.dofs[dof]), skeleton.dof_limits[dof]
        bent = np.clip([value, value + _ANGLE, value - _ANGLE, value], low, high)
        bent[[0, 3]] = value
        times = number * seconds + seconds * np.array([0.0, 0.3, 0.7, 1.0])
        channels.append(Channel(dof, times, bent, (("smooth", "smooth"),) * 4))
    return Clip(_TRIAL, tuple(channels), 0.0, seconds * len(dofs))


def _bending_dof(skeleton: Skeleton, joint: int) -> int:
    """Return the rotation DOF of a joint with the widest range; -1 if it has none or is a root."""
    if skeleton.parents[joint] < 0:
        return -1
    own = np.flatnonzero((skeleton.dof_joints == joint) & (skeleton.dof_kinds >= FIRST_ROTATION))
    ranges = np.ptp(skeleton.dof_limits[own], axis=1)
    own, ranges = own[ranges > 0.0], ranges[ranges > 0.0]
    return int(own[np.argmax(ranges)]) if len(own) else -1


def draw_results(state: AppState) -> None:
    """Draw the choice of version and colours, the statistics of each method, and the report."""
    why, result = no_results(state), shown_result(state)
    if why or result is None:
        imgui.text_wrapped(f"{capitalized(why)}.")
        return
    _draw_question(state, result)
    shown = _shown_version(state)
    for number, name in enumerate(_versions(state)):
        text = "original" if name == TARGET else name
        if number:
            same_line_if_room(text)
        label, tip = f"{text}###version {name}", with_key(state, "cycle through the versions", "A")
        if radio(state, label, name == shown, f"version {name}", tip) and name != shown:
            _show_version(state, name)
    _draw_colors(state)
    moves = plays_motion(result)
    still = _no_motion_of(result)
    plays = checkbox(state, "Move like the template", moves, still)
    explain("play the template's motion at the target's position")
    if plays != moves:
        _set_motion(state, result, plays)
    tries, still = plays_trial(result), _no_trial_of(result)
    chosen = checkbox(state, "Trial motion", tries, still)
    explain("bend each joint in both directions, to see how the weights deform the mesh")
    if chosen != tries:
        _set_trial(state, result, chosen)
    _draw_table(state)
    if button(state, "Save rigged…", _no_answer(state, result) or no_job_room(state)):
        ask_where_to_save_rig(state, result)
    same_line_if_room("Copy report")
    if button(state, "Copy report"):
        imgui.set_clipboard_text("\n".join(line.labelled for line in result.rigged.lines))
        state.say_status("Report copied")
    height = _LINES_HEIGHT * imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("report", (0.0, height), imgui.ChildFlags_.borders):
        for line in result.rigged.lines:
            with text_color(WARNING if line.severity == "warning" else None):
                imgui.text_wrapped(printable(line.labelled, 400))
    imgui.end_child()
    note_item(state, "report")


def _no_answer(state: AppState, result: Result) -> str:
    """Return the reason why a result cannot be used: a question about it is open."""
    rigged = result.rigged
    if any(rigged is kept for kept in state.of(Rigging).accepted) or not [*doubts(rigged.findings)]:
        return ""
    return "decide first whether to keep this rig"


def _draw_question(state: AppState, result: Result) -> None:
    """Ask whether to keep a rig that is probably wrong."""
    if not _no_answer(state, result):
        return
    warning("Is this rig right? It is probably wrong:")
    for line in doubts(result.rigged.findings):
        imgui.bullet()
        imgui.text_wrapped(str(line))
    imgui.text_wrapped(
        "If so, align by landmarks, or choose another template: From shape for what is no person "
        "and no quadruped."
    )
    if button(state, "Keep it"):
        state.of(Rigging).accepted.append(result.rigged)
    same_line_if_room("Discard it")
    if button(state, "Discard it"):
        discard(state, result)


def discard(state: AppState, result: Result) -> None:
    """Remove a result from the scene, and show the original mesh."""
    view, actors = state.of(Rigging), state.scene.actors
    target = result.target
    # Of the places of both, the target takes the first: it has moved behind the first result.
    row, last = sorted(_row(actors, one) for one in (result.actor, target))
    del actors[last]
    actors[row] = target
    del view.results[result.method]
    view.comparison, target.visible = None, True
    state.choose_actor(row)
    state.say_status("The rig was discarded")


def _draw_colors(state: AppState) -> None:
    options = state.options
    now = options.scalar if options.shading == "scalar" else ""
    for number, (view, text) in enumerate({"": "plain", **_RESULT_COLORS}.items()):
        if number:
            same_line_if_room(text)
        is_on = now == view if view else now not in _RESULT_COLORS
        if radio(state, f"{text}###color {view}", is_on, f"color {view}"):
            show_colors(state, view)


def _draw_table(state: AppState) -> None:
    """Draw the statistics of the methods side by side."""
    view, known = state.of(Rigging), _versions(state)
    found = [one for name, one in view.results.items() if name in known]
    if not imgui.begin_table("methods", 1 + len(found), imgui.TableFlags_.sizing_stretch_same):
        return
    rigged = [one.rigged for one in found]
    _table_row("", "", [one.method for one in found])
    _table_row(
        "matched",
        "vertices whose weights come from the closest points of the template, or from a bone",
        [f"{100.0 * one.weights.matched.mean():.1f} %" for one in rigged],
    )
    _table_row(
        "largest error",
        "largest distance of the posed result from the target, relative to its size",
        [f"{one.residual:.1e}" for one in rigged],
    )
    _table_row(
        "estimated",
        "vertices with a pose too extreme to invert exactly: their rest position is an estimate",
        [f"{int(one.guarded.sum()):,}" for one in rigged],
    )
    _table_row(
        "joints outside",
        "joints outside the mesh that are inside the template",
        [f"{len(one.outside):,}" for one in rigged],
    )
    imgui.end_table()
    if view.comparison is not None and len(found) > 1:
        text = (
            f"weights differ by {view.comparison.weights:.3f} (mean L1), same dominant joint at "
            f"{100.0 * view.comparison.dominant:.1f} % of the vertices"
        )
        imgui.text_wrapped(text)


def _table_row(title: str, meaning: str, cells: list[str]) -> None:
    imgui.table_next_row()
    for text in (title, *cells):
        imgui.table_next_column()
        imgui.text_unformatted(text)
        explain(meaning)


def ask_where_to_save_rig(state: AppState, result: Result) -> None:
    """Ask where to save a rigged mesh."""
    name = f"{file_stem(result.target.name)}_rigged.npz"
    ask_where_to_write(
        state,
        lambda state, path: _save_rigged(state, result, path),
        "Save rigged mesh: .npz, .glb, or .skel with .skin, .obj and .json",
        RIGGED_SUFFIXES,
        name,
        # Other suffixes are rejected on saving.
        written=lambda path: files_of(path) if path.suffix.lower() in RIGGED_SUFFIXES else [path],
    )
