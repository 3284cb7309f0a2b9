"""Actors panel: visibility, colour, start time and position of each actor."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.actors.following import Following, stop_following, toggle_following
from viewer.app.core.camera_moves import look_through_view
from viewer.app.core.fields import begin_field, drag_float, in_row
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import (
    button,
    checkbox,
    choice,
    explain,
    note_item,
    plain_zero,
    same_line_if_room,
    visible_rows,
)
from viewer.app.retargeting.drive_changes import (
    keeps_hands,
    no_edit,
    plants_feet,
    toggle_feet,
    toggle_hands,
)
from viewer.phrases import printable
from viewer.rigs.captures.keypoint_layouts import fitted_body, keypoint_distances
from viewer.rigs.mesh import box_size
from viewer.rigs.scalars import length_unit
from viewer.rigs.scene import Actor
from viewer.rigs.springs.simulation import has_springs, release_springs, springs_for

_PLAIN = (0.75, 0.72, 0.68)  # button colour of actors without their own colour
_LONGEST_WINDOW = 1e4  # maximum extent of a motion path, seconds
_LOOK = (
    imgui.ColorEditFlags_.no_inputs | imgui.ColorEditFlags_.no_label | imgui.ColorEditFlags_.float
)


def draw(state: AppState) -> None:
    """Draw the panel."""
    _draw_list(state)
    _draw_space(state)
    actor = state.actor
    imgui.separator()
    if actor.clip is not None:
        shown = plain_zero(actor.offset, "%.3f s")
        changed, value = drag_float(state, begin_field("Start time"), shown, 0.01, "%.3f s")
        note_item(state, "Start time")
        if changed and abs(value) < 1e6:
            actor.offset = value
        explain("time of the scene at which the actor's motion starts, seconds")
    size = box_size(state.box) or 1.0

    def draw_axis(hidden: str, axis: int) -> None:
        shown = plain_zero(float(actor.placement[axis, 3]), "%.3f")
        changed, moved = drag_float(state, hidden, shown, 0.002 * size, "%.3f")
        if changed and abs(moved) < 1e6 * size:
            placement = actor.placement.copy()
            placement[axis, 3] = moved
            actor.placement = placement

    in_row(begin_field("Position"), range(3), draw_axis)
    note_item(state, "Position")
    if has_springs(actor):
        is_on = actor.springs is not None
        if checkbox(state, "Springs", is_on) != is_on:
            toggle_springs(state)
        explain(
            "simulate hair and clothes while a motion plays; exported motions do not include this"
        )
    if actor.drive is not None and actor.clip is not None:
        why, is_on = no_edit(state), plants_feet(state)
        if checkbox(state, "Feet on the ground", is_on, why) != is_on:
            toggle_feet(state)
        explain(
            "keep feet in place, with their soles on the ground, while the feet of the source "
            "motion do not move"
        )
        is_on = keeps_hands(state)
        if checkbox(state, "Hands at the body", is_on, why) != is_on:
            toggle_hands(state)
        explain(
            "keep hands at hips, thighs, head or each other where those of the source motion are"
        )
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted("Camera follows")
    for text, joint in (("Actor", -1), ("Joint", state.selected_joint)):
        if text == "Joint" and joint < 0:
            continue
        same_line_if_room(text)
        is_on = state.of(Following).target == (state.chosen_actor, joint)
        if checkbox(state, f"{text}##follow", is_on) != is_on:
            toggle_following(state, state.chosen_actor, joint)
    if state.of(Following).target is not None:
        same_line_if_room("None")
        if button(state, "None"):
            stop_following(state)
    _draw_motion_paths(state, actor)
    _draw_fit(state, actor)


def _draw_list(state: AppState) -> None:
    actors = state.scene.actors
    rows = min(len(actors), 8)
    height = rows * imgui.get_frame_height_with_spacing() + 4.0
    if imgui.begin_child("##list", (0.0, height)):
        for index in visible_rows(len(actors), imgui.get_frame_height_with_spacing()):
            imgui.push_id(index)
            actor = actors[index]
            actor.visible = imgui.checkbox("##visible", actor.visible)[1]
            note_item(state, f"visible {index}")
            explain("show or hide this actor")
            imgui.same_line()
            shown = actor.color or _PLAIN
            changed, color = imgui.color_edit3("##color", list(shown), _LOOK)
            note_item(state, f"color {index}")
            if imgui.is_item_clicked(imgui.MouseButton_.right):
                actor.color = None
            elif changed:
                actor.color = (color[0], color[1], color[2])
            explain("colour; right-click to restore the default")
            imgui.same_line()
            absent = "" if actor.is_present else "  (absent)"
            text = f"{printable(actor.name, 60)}{absent}"
            if imgui.selectable(text, index == state.chosen_actor)[0]:
                state.select_actor(index)
            note_item(state, f"actor {index}")
            imgui.pop_id()
    imgui.end_child()


def _draw_motion_paths(state: AppState, actor: Actor) -> None:
    """Draw the choice of joints whose motion paths are shown."""
    options, joint = state.options, state.selected_joint
    key = (state.chosen_actor, joint)
    if actor.clip is not None and joint >= 0:
        shown = key in options.path_joints
        if checkbox(state, "Motion path of the selected joint", shown) != shown:
            others = tuple(one for one in options.path_joints if one != key)
            options.path_joints = others if shown else (*others, key)
    if options.path_joints:
        if button(state, "Clear motion paths"):
            options.path_joints = ()
        changed, value = drag_float(
            state, begin_field("Time window"), options.path_seconds, 0.02, "%.2f s", low=0.0
        )
        note_item(state, "Time window")
        explain("seconds of the path before and after the current time; 0 shows the whole motion")
        if changed:
            options.path_seconds = min(value, _LONGEST_WINDOW)


def _draw_fit(state: AppState, actor: Actor) -> None:
    """Draw the distances of a person's captured keypoints from the joints of the fitted body."""
    same = [a for a in state.scene.actors if a.points is not None and a.person == actor.person]
    points = actor if actor.points is not None else next(iter(same), None)
    body = None if points is None else fitted_body(points, state.scene.actors)
    if points is None or body is None:
        return
    distances = keypoint_distances(points, body)
    if not distances:
        return
    factor, unit = length_unit(body.figure)
    mean = sum(distances.values()) / len(distances)
    imgui.separator()
    text = f"Mean distance of keypoints from joints: {factor * mean:.1f} {unit}###fit"
    if imgui.tree_node(text):
        for name, distance in sorted(distances.items(), key=lambda item: -item[1]):
            imgui.text_unformatted(f"{factor * distance:8.1f} {unit}  {printable(name, 40)}")
        imgui.tree_pop()
    note_item(state, "fit")


def no_springs(state: AppState) -> str:
    """Return the reason why springs cannot be switched; empty if they can."""
    return "" if has_springs(state.actor) else f"{state.actor.name} has no spring joints"


def toggle_springs(state: AppState) -> None:
    """Switch the simulation of the chosen actor's springs on or off, and pose it again."""
    actor = state.actor
    if not has_springs(actor):
        state.say_status(no_springs(state))
        return
    if actor.springs is None:
        actor.springs = springs_for(actor, state.scene.up)
    else:
        actor.springs = None
        release_springs(actor)
    state.clock.pose(actor, again=True)
    state.say_status(f"Springs: {'off' if actor.springs is None else 'on'}")


_SPACES = {"world": "World", "camera": "Camera"}


def _draw_space(state: AppState) -> None:
    """Draw the choice of the space if the files of the people contain both."""
    if state.scene.in_space is None:
        return
    chosen = choice(state, "Space", state.scene.space, _SPACES)
    explain(
        "space of the people: the world, or the camera that filmed them; switching discards edits"
    )
    if chosen != state.scene.space:
        switch_space(state, chosen)


@shows_errors
def switch_space(state: AppState, space: str) -> None:
    """Read the people again in another space, which discards edits of their motions and undo."""
    old = state.scene
    if old.in_space is None:
        return
    scene = old.in_space(space)
    for actor in scene.actors:
        _dress(actor, old.actors)
    time, chosen, joint = state.clock.time, state.actor, state.selected_joint
    was_selected, mode, speed = state.is_actor_selected, state.clock.mode, state.clock.speed
    is_playing, fixed = state.clock.playing, state.camera.fixed
    state.show_scene(scene, state.paths)
    state.clock.seek(time)
    state.clock.mode, state.clock.speed, state.clock.playing = mode, speed, is_playing
    index = next((i for i, a in enumerate(scene.actors) if _is_same(a, chosen)), 0)
    state.choose_actor(index)
    state.is_actor_selected, state.selected_joint = was_selected, joint
    state.clock.pose(state.actor, again=True)
    view = next((v for v in scene.views if fixed is not None and v.name == fixed.name), None)
    if view is not None:
        look_through_view(state, view)
        state.framing.is_fitting = False


def _is_same(actor: Actor, other: Actor) -> bool:
    """Return whether two actors are the same person or figure of the same files."""
    is_point = actor.figure.points is None
    return (actor.person, actor.title, is_point) == (
        other.person,
        other.title,
        other.figure.points is None,
    )


def _dress(actor: Actor, others: list[Actor]) -> None:
    """Give an actor the appearance that it had in the other space."""
    for other in others:
        if _is_same(actor, other):
            actor.color, actor.visible, actor.opacity = other.color, other.visible, other.opacity
            actor.hidden_parts = other.hidden_parts
            actor.offset = other.offset
            return
