"""Joints panel: the joint tree with a filter, DOF sliders, and actions on the whole pose."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import slider_float
from viewer.app.core.state import AppState
from viewer.app.core.theme import ink
from viewer.app.core.widgets import (
    button,
    checkbox,
    filter_field,
    is_reset,
    menu_item,
    note_item,
    plain_zero,
    radio,
    same_line_if_room,
    visible_rows,
    with_key,
)
from viewer.app.curves.editing import Curves
from viewer.app.files.files import offer_files
from viewer.app.posing.joint_transform import (
    draw_own_numbers,
    draw_scale,
    draw_translation,
    draw_vector_component,
    is_ball,
    moved_joints,
    toggle_transform,
    unlocked_joints,
)
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.posing.posing import (
    Posing,
    copy_numbers,
    copy_pose,
    mirror,
    paste_pose,
    pause_for_edit,
    reset_joint,
    reset_pose,
)
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import box_size
from viewer.rigs.number_text import angle_text, number_text
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import (
    DOF_KINDS,
    FIRST_ROTATION,
    Skeleton,
    joint_labels,
    shown_joints,
    shown_parents,
)

_LABEL_WIDTH = 1.6  # width of a label, in font sizes
_INDENT = 0.6  # indentation per level, in font sizes
_DEEPEST = 14  # maximum number of indented levels: chains of thousands must stay readable
_AXIS_COLORS = ((0.95, 0.45, 0.42, 1.0), (0.48, 0.85, 0.45, 1.0), (0.45, 0.65, 1.0, 1.0))
_MAY_TYPE_BEYOND = int(imgui.SliderFlags_.none)
_STAYS_WITHIN = int(imgui.SliderFlags_.always_clamp)
_Rows: TypeAlias = tuple[tuple[int, int, int], ...]
_OWN_NUMBERS = -2
"""Value used instead of a DOF for the row with the raw pose values of the body model."""
_TRANSLATION, _SCALE = -3, -4
"""Values used instead of a DOF for the rows with the translation and the scale of a joint."""
_LONGEST = 60  # maximum length of a name in characters
_known_labels: Memo[Skeleton, tuple[str, ...]] = Memo()
_known_rows: Memo[Skeleton, _Rows] = Memo(kept=4)
_ON_POSES = (
    ("Copy as JSON", copy_pose),
    ("Copy as raw pose values", copy_numbers),
    ("Paste", paste_pose),
    ("Mirror", mirror),
)
"""Menu of actions on the whole pose."""
_SEEN, _DOUBTFUL = (0.30, 0.55, 0.38, 1.0), (0.62, 0.42, 0.22, 1.0)
_NODE = int(
    imgui.TreeNodeFlags_.no_tree_push_on_open
    | imgui.TreeNodeFlags_.open_on_arrow
    | imgui.TreeNodeFlags_.span_avail_width
)
_SELECTED = int(imgui.TreeNodeFlags_.selected)
_NAME_WIDTH = 0.55  # width of the names, as a fraction of the panel's width


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor."""
    _draw_actor_choice(state)
    actor = state.actor
    if actor.figure.points is not None:
        _draw_captured_points(state, actor, actor.figure.points)
        return
    if actor.figure.skeleton is None or actor.own_pose is None:
        offer_files(
            state,
            "This figure has no skeleton: open it together with its .skel, or create one with "
            "Window > Rig.",
        )
        return
    _draw_head(state)
    skeleton = actor.figure.skeleton
    if not imgui.begin_child("joints", (0.0, 0.0), imgui.ChildFlags_.nav_flattened):
        imgui.end_child()
        return
    _draw_figure_place(state, actor.own_pose)
    has_own = actor.figure.pose_layout is not None
    tree, moved = joint_tree(state), moved_joints(state)
    shown = joint_rows(skeleton, frozenset(tree.opened), tree.filter, has_own, moved)
    labels = _row_labels(skeleton)
    if not shown:
        imgui.text_disabled("no joint name contains this text")
    # The list scrolls to a joint that was selected elsewhere.
    wanted = -1
    if tree.scrolls_to >= 0:
        own = (row for row, one in enumerate(shown) if one[:2] == (tree.scrolls_to, -1))
        wanted = next(own, -1)
    for row in visible_rows(len(shown), wanted=wanted):
        joint, dof, depth = shown[row]
        indent = _INDENT * imgui.get_font_size() * min(depth, _DEEPEST)
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + indent)
        if dof == _OWN_NUMBERS:
            draw_own_numbers(state, actor.figure, actor.own_pose, joint)
        elif dof == _TRANSLATION:
            draw_translation(state, actor.own_pose, joint, labels[joint])
        elif dof == _SCALE:
            draw_scale(state, actor.own_pose, joint, labels[joint])
        elif dof < 0:
            _draw_joint(state, joint, labels[joint])
        else:
            _draw_dof(state, skeleton, actor.own_pose, dof, labels[joint])
    imgui.end_child()


def _draw_actor_choice(state: AppState) -> None:
    """Draw a list of actors if there are several."""
    if len(state.scene.actors) < 2:
        return
    names = [
        f"{number}  {printable(actor.name, 60)}"
        for number, actor in enumerate(state.scene.actors, 1)
    ]
    imgui.set_next_item_width(-1.0)
    changed, index = imgui.combo("##actor", state.chosen_actor, names)
    note_item(state, "Actor")
    if changed:
        state.select_actor(index)


def _draw_head(state: AppState) -> None:
    posing = state.of(Posing)
    tree = joint_tree(state)
    tree.filter = filter_field(state, "Filter", tree.filter, "Filter joints")
    if button(state, with_key(state, "Reset", "R")):
        reset_pose(state)
    same_line_if_room("Pose…")
    if button(state, "Pose…"):
        imgui.open_popup("pose menu")
    if imgui.begin_popup("pose menu"):
        for text, action in _ON_POSES:
            if menu_item(state, text):
                action(state)
        imgui.end_popup()
    same_line_if_room("deg")
    before = state.in_degrees
    if radio(state, "deg###degrees", before, "degrees", "show angles in degrees"):
        state.in_degrees = True
    same_line_if_room("rad")
    if radio(state, "rad###radians", not before, "radians", "show angles in radians"):
        state.in_degrees = False
    # Curves are fitted again because the scale of their axis changes.
    state.of(Curves).wants_fit |= state.in_degrees != before
    if state.actor.figure.pose_layout is not None:
        posing.as_vectors = checkbox(state, "Rotation vectors", posing.as_vectors)


def _draw_joint(state: AppState, joint: int, label: str) -> None:
    flags = _NODE | _SELECTED if joint == state.selected_joint else _NODE
    imgui.set_next_item_open(joint in joint_tree(state).opened or bool(joint_tree(state).filter))
    imgui.tree_node_ex(f"{label}##joint{joint}", flags)
    note_item(state, f"joint {label}")
    if joint == joint_tree(state).scrolls_to:
        imgui.set_scroll_here_y(0.5)
        joint_tree(state).scrolls_to = -1
    if imgui.is_item_toggled_open():
        joint_tree(state).opened ^= {joint}
    elif imgui.is_item_clicked():
        state.selected_joint = -1 if state.selected_joint == joint else joint
    if imgui.begin_popup_context_item(f"menu of joint {joint}"):
        if menu_item(state, "Reset this joint"):
            reset_joint(state, joint)
        if menu_item(state, "Translation and scale", "", joint in unlocked_joints(state)):
            toggle_transform(state, joint)
        imgui.end_popup()


def _draw_dof(state: AppState, skeleton: Skeleton, pose: Pose, dof: int, label: str) -> None:
    kind = int(skeleton.dof_kinds[dof])
    name = DOF_KINDS[kind]
    imgui.align_text_to_frame_padding()
    start = imgui.get_cursor_pos_x()
    imgui.text_colored(ink(_AXIS_COLORS[kind % 3]), name)
    # All sliders of a joint begin at the same position, regardless of the widths of their labels.
    imgui.same_line(start + _LABEL_WIDTH * imgui.get_font_size())
    imgui.set_next_item_width(-1.0)
    low, high = skeleton.dof_limits[dof]
    locked = low == high
    joint, figure = int(skeleton.dof_joints[dof]), state.actor.figure
    if state.of(Posing).as_vectors and kind >= FIRST_ROTATION and is_ball(figure, joint):
        draw_vector_component(state, figure, pose, joint, kind - FIRST_ROTATION, label)
        return
    imgui.begin_disabled(bool(locked))
    now = float(pose.dofs[dof])
    value = _dof_slider(state, skeleton, now, dof)
    if imgui.is_item_activated():
        pause_for_edit(state)
    imgui.end_disabled()
    note_item(state, f"{label}.{name}")
    in_degrees = state.in_degrees
    if (
        is_reset(lambda: f"{label}.{name}\n{_limits_text(low, high, kind, in_degrees)}")
        and not locked
    ):
        value = float(skeleton.rest_dofs[dof])
    if imgui.begin_popup_context_item(f"menu of DOF {dof}"):
        why = f"locked at {_value_text(low, kind, state.in_degrees)}" if locked else ""
        if menu_item(state, "Reset", why=why):
            value = float(skeleton.rest_dofs[dof])
        outside = "" if low <= 0.0 <= high else "0 is outside its limits"
        if menu_item(state, "Set to 0", why=why or outside):
            value = 0.0
        if menu_item(state, "Copy value"):
            is_angle = state.in_degrees and kind >= FIRST_ROTATION
            shown = math.degrees(now) if is_angle else now
            imgui.set_clipboard_text(repr(shown + 0.0))
        imgui.end_popup()
    if value != now:  # drawing alone keeps a value beyond its limits
        pose.dofs[dof] = min(max(value, low), high)


def _dof_slider(state: AppState, skeleton: Skeleton, now: float, dof: int) -> float:
    """Draw the slider in the displayed unit and return the value in radians or lengths."""
    low, high = (float(limit) for limit in skeleton.dof_limits[dof])
    is_rotation = skeleton.dof_kinds[dof] >= FIRST_ROTATION
    # Sliders of unlimited translations reach as far as the scene is large.
    unlimited = math.pi if is_rotation else box_size(state.box) or 1.0
    factor = math.degrees(1.0) if is_rotation and state.in_degrees else 1.0
    text = ("%.1f\N{DEGREE SIGN}" if state.in_degrees else "%.4f rad") if is_rotation else "%.4f"
    if low == high:
        text += "  locked"
    bounded = math.isfinite(low) and math.isfinite(high)
    changed, moved = slider_float(
        state,
        f"##dof{dof}",
        plain_zero(now * factor, text),
        (low if math.isfinite(low) else min(-unlimited, high - unlimited)) * factor,
        (high if math.isfinite(high) else max(unlimited, low + unlimited)) * factor,
        text,
        _STAYS_WITHIN if bounded else _MAY_TYPE_BEYOND,
    )
    # The widget's float32 must not change a value that was not moved; "nan" can be typed.
    return moved / factor if changed and math.isfinite(moved) else now


def _limits_text(low: float, high: float, kind: int, in_degrees: bool) -> str:
    """Return the limits of a DOF for a slider's tooltip, in the displayed unit."""
    texts = [_value_text(limit, kind, in_degrees) for limit in (low, high)]
    if low == high:
        return f"locked at {texts[0]}"
    if not math.isfinite(low) and not math.isfinite(high):
        return "unlimited; Ctrl+click to type any value\ndouble-click to reset"
    span = f"{texts[0]} to {texts[1]}"
    if not math.isfinite(low) or not math.isfinite(high):
        span = f"at most {texts[1]}" if math.isfinite(high) else f"at least {texts[0]}"
    return f"{span}\nCtrl+click to type a value, double-click to reset"


def _value_text(value: float, kind: int, in_degrees: bool) -> str:
    """Return a DOF's value in the displayed unit."""
    return angle_text(value, in_degrees) if kind >= FIRST_ROTATION else number_text(value)


def _row_labels(skeleton: Skeleton) -> tuple[str, ...]:
    """Return the displayed labels of all joints."""

    def make() -> tuple[str, ...]:
        return tuple(printable(label, _LONGEST) for label in joint_labels(skeleton))

    return _known_labels.get(skeleton, None, make)


def joint_rows(
    skeleton: Skeleton,
    opened: frozenset[int],
    wanted: str,
    has_own: bool = False,
    moved: frozenset[int] = frozenset(),
) -> _Rows:
    """Return the listed rows as (joint, DOF or -1 for the joint's own row, depth).

    ``wanted``: if not empty, only joints whose name contains it are listed, without hierarchy.
    ``has_own``: whether a row with the file's own numbers, ``_OWN_NUMBERS``, follows each joint's
    DOFs. ``moved``: joints with rows for ``_TRANSLATION`` and ``_SCALE`` after their DOFs.
    """
    key = (opened, wanted, has_own, moved)
    return _known_rows.get(skeleton, key, lambda: _rows(skeleton, *key))


def _rows(
    skeleton: Skeleton, opened: frozenset[int], wanted: str, has_own: bool, moved: frozenset[int]
) -> _Rows:
    dofs: list[list[int]] = [[] for _ in range(skeleton.n_joints)]
    for dof, joint in enumerate(skeleton.dof_joints.tolist()):
        dofs[joint].append(dof)
    for joint in range(skeleton.n_joints):
        dofs[joint] += [_TRANSLATION, _SCALE] if joint in moved else []
        dofs[joint] += [_OWN_NUMBERS] if has_own else []
    listed: list[tuple[int, int, int]] = []
    depths, visible = [0] * skeleton.n_joints, [True] * skeleton.n_joints
    labels, parents = _row_labels(skeleton), shown_parents(skeleton).tolist()
    for joint in shown_joints(skeleton).tolist():
        parent = parents[joint]
        if wanted:
            visible[joint] = wanted.lower() in labels[joint].lower()
        elif parent >= 0:
            depths[joint] = depths[parent] + 1
            visible[joint] = visible[parent] and parent in opened
        if visible[joint]:
            listed.append((joint, -1, depths[joint]))
            if wanted or joint in opened:
                listed += [(joint, dof, depths[joint] + 1) for dof in dofs[joint]]
    # In a skeleton, parents come before their children, but not always immediately before.
    place = np.argsort(depth_first(skeleton.parents)).tolist()
    return tuple(sorted(listed, key=lambda row: place[row[0]]))


def _draw_figure_place(state: AppState, pose: Pose) -> None:
    """Draw translation and scale, which are applied after skinning."""
    imgui.set_next_item_open(state.actor.figure.pose_layout is not None, imgui.Cond_.once)
    is_open = imgui.tree_node_ex("Whole figure", imgui.TreeNodeFlags_.span_avail_width)
    note_item(state, "figure")
    if not is_open:
        return
    reach = box_size(state.box) or 1.0
    for axis, name in enumerate(("tx", "ty", "tz")):
        value = _row(state, name, float(pose.figure_translation[axis]), -reach, reach, 0.0)
        pose.figure_translation[axis] = value
    scale = _row(state, "scale", pose.figure_scale, 0.1, 3.0, 1.0)
    pose.figure_scale = max(scale, 1e-3)
    imgui.tree_pop()


def _row(state: AppState, name: str, value: float, low: float, high: float, rest: float) -> float:
    imgui.align_text_to_frame_padding()
    imgui.text_disabled(name)
    imgui.same_line(4.2 * imgui.get_font_size())
    imgui.set_next_item_width(-1.0)
    changed, moved = slider_float(
        state, f"##figure {name}", plain_zero(value, "%.4f"), low, high, "%.4f"
    )
    note_item(state, f"figure.{name}")
    if is_reset(f"figure.{name}\nCtrl+click to type a value, double-click to reset"):
        return rest
    return moved if changed and math.isfinite(moved) and abs(moved) < 1e9 else value


def _draw_captured_points(state: AppState, actor: Actor, layout: PointLayout) -> None:
    """Draw a description of the captured points, and their list."""
    points = actor.points if actor.is_present else None
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(
        f"{len(layout.names)} captured points ({printable(layout.title, 40)}), not a skeleton: "
        "there are no joints to rotate."
    )
    imgui.text_disabled(_seen_text(state, points))
    imgui.pop_text_wrap_pos()
    tree = joint_tree(state)
    tree.filter = filter_field(state, "Filter", tree.filter, "Filter points")
    wanted = tree.filter.lower()
    shown = [row for row, name in enumerate(layout.names) if wanted in name.lower()]
    if imgui.begin_child("points", (0.0, 0.0)):
        if not shown:
            imgui.text_disabled("no point name contains this text")
        for row in (shown[place] for place in visible_rows(len(shown))):
            name = layout.names[row]
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted(printable(name, 40))
            imgui.same_line(_NAME_WIDTH * imgui.get_content_region_avail().x)
            confidence = 0.0 if points is None else float(points[row, 3])
            if confidence <= 0.0:
                imgui.text_disabled("not detected")
            else:
                color = _SEEN if confidence >= state.options.min_confidence else _DOUBTFUL
                imgui.push_style_color(imgui.Col_.plot_histogram, color)
                imgui.progress_bar(min(confidence, 1.0), (-1.0, 0.0), f"{confidence:.3g}")
                imgui.pop_style_color()
            note_item(state, f"point {name}")
    imgui.end_child()


def _seen_text(state: AppState, points: Floats | None) -> str:
    """Return a sentence with the number of points detected at the current time."""
    if points is None:
        return "Absent at this time."
    confidences, least = points[:, 3], state.options.min_confidence
    text = f"{int((confidences > 0.0).sum())} detected at this time"
    doubtful = int(((confidences > 0.0) & (confidences < least)).sum())
    hidden = f", {doubtful} of them with confidence below {least:g} and not drawn"
    return f"{text}{hidden if doubtful else ''}."
