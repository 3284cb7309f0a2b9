"""Joint match panel: which joint of a motion drives each joint of the figure, and joint maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_drive
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.theme import WARNING, faint, ink
from viewer.app.core.widgets import (
    button,
    checkbox,
    disabled,
    explain,
    filter_field,
    note_item,
    same_line_if_room,
    visible_rows,
    warning,
)
from viewer.app.files.files import ask_for_files, ask_where_to_write
from viewer.app.files.saving import save_files
from viewer.app.retargeting.drive_changes import NOT_DRIVEN, change_drive, no_edit, shown_drive
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.formats import Source, file_stem
from viewer.formats._joint_map import read_joint_map, write_joint_map
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import aligned_rests, front_axes, full_map, matches_of
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.skeleton import joint_label, joint_labels, shown_joints

_ORIGINS = {
    "map": ("edited", "chosen by hand or in a joint map"),
    "hierarchy": ("same skeleton", "both skeletons have the same names and hierarchy"),
    "humanoid": ("human bones", "the file assigns its joints to human bones, as VRM files do"),
    "name": ("known name", "both names are known names of this joint"),
    "place": ("hierarchy", "recognised by its position in the hierarchy"),
    "same name": ("same name", "both joints have this name"),
    "": ("at rest", "no joint of the motion drives this joint"),
}
_AT_REST = "(at rest)"
_WIDE = 44.0  # font sizes: a narrower panel has the skeletons below the table
_TABLE = 0.56  # fraction of a wide panel's width
_MOST_DRIVEN = 3  # maximum number of names listed after a joint that is already used
_MATCHED = (0.45, 0.78, 1.0, 1.0)
_HOVERED = (1.0, 0.86, 0.35, 1.0)
_NEAR = 0.7  # distance in font sizes within which a joint is hovered
_DOT = 0.16  # radius of a joint, font sizes
_DRAG = 0.01  # radians per pixel
_Box = tuple[float, float, float, float]
_LONG = 1.3  # ratio of length to width from which a body is shown from the side
_SIDE_VIEW = -1.1  # yaw of the view from the side, radians
_SUFFIXES = (".txt",)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One of the two skeletons."""

    name: str
    """Name of the figure or the motion."""
    labels: tuple[str, ...]
    """Labels of its joints."""
    joints: Ints
    """Joints that are shown: (N,) int32."""
    parents: Ints
    """Parents of its joints: (J,)."""
    points: Floats
    """(J, 3): joints at rest seen from the front: to the body's left, up, and forward."""


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """A match of joints with everything that the panel draws."""

    drive: Drive
    figure: Figure
    """The drive and the figure that were matched."""
    target: _Side
    source: _Side
    """The figure and the motion."""
    partners: Ints
    """Joint of the motion for each joint of the figure, -1 for none: (J,)."""
    origins: tuple[str, ...]
    """How each joint was matched, see ``Matches``."""
    driven: dict[int, list[int]]
    """Joints of the figure that each joint of the motion drives."""

    @property
    def n_driven(self) -> int:
        """Number of joints of the figure that are driven."""
        return int((self.partners[self.target.joints] >= 0).sum())

    @property
    def unused(self) -> list[int]:
        """Joints of the motion that drive no joint."""
        return [joint for joint in self.source.joints.tolist() if joint not in self.driven]


@dataclass(slots=True)
class JointMatch:
    """State of the panel."""

    filter: str = ""
    """Text that the names of a listed pair must contain."""
    source_filter: str = ""
    """Text that the names offered in an open list must contain."""
    only_unmatched: bool = False
    """Whether only joints without a partner are listed."""
    yaw: float = 0.0
    """Rotation of the drawn skeletons about the up axis, radians."""
    hovered: tuple[set[int], set[int]] = field(default_factory=lambda: (set(), set()))
    """Joints of the figure and of the motion under the mouse, and their partners."""
    scrolls_to: int = -1
    """Joint to whose row the table scrolls, -1 for none."""
    shown: _Shown | None = None
    """The match, computed again when the drive or the figure changes."""


def draw(state: AppState) -> None:
    """Draw the panel."""
    try:
        shown = None if no_drive(state) else shown_match(state)
    except ViewerError as problem:  # the figure has been replaced by another one
        imgui.text_wrapped(str(problem))
        return
    if shown is None:
        imgui.text_wrapped(no_drive(state))
        return
    room = imgui.get_content_region_avail()
    is_wide = room.x > _WIDE * imgui.get_font_size()
    table = (_TABLE * room.x, 0.0) if is_wide else (0.0, 0.55 * room.y)
    hovered = state.of(JointMatch).hovered
    state.of(JointMatch).hovered = set(), set()
    if imgui.begin_child("##matches", table):
        view = state.of(JointMatch)
        text = f"{shown.n_driven} of {counted(len(shown.target.joints), 'joint')} driven"
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(text)
        if shown.unused:
            same_line_if_room(f"{len(shown.unused)} unused")
            imgui.text_colored(ink(WARNING), f"{len(shown.unused)} unused")
            names = [shown.source.labels[joint] for joint in shown.unused]
            explain(f"joints of the motion that drive nothing: {printable(', '.join(names), 1000)}")
        if state.actor.clip is None:
            warning(NOT_DRIVEN)
        for label, act, why, what in _BUTTONS:
            same_line_if_room(label)
            if button(state, label, why(state)):
                act(state)
            explain(what)
        width = imgui.calc_text_size("Only unmatched").x + 2.0 * imgui.get_frame_height()
        width = max(imgui.get_content_region_avail().x - width, width)
        view.filter = filter_field(state, "Filter joints", view.filter, "Filter joints", width)
        imgui.same_line()
        view.only_unmatched = checkbox(state, "Only unmatched", view.only_unmatched)
        _draw_table(state, shown, hovered[0])
    imgui.end_child()
    if is_wide:
        imgui.same_line()
    left = imgui.get_content_region_avail()
    _draw_preview(state, shown, (left.x, left.y))


def _draw_table(state: AppState, shown: _Shown, hovered: set[int]) -> None:
    rows = _listed(state, shown)
    if not rows:
        imgui.text_disabled("no joint matches the filter")
        return
    flags = imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg
    if not imgui.begin_table("joint match", 3, flags):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_setup_column("Joint of the figure", imgui.TableColumnFlags_.width_stretch, 0.36)
    imgui.table_setup_column("Joint of the motion", imgui.TableColumnFlags_.width_stretch, 0.42)
    imgui.table_setup_column("Matched by", imgui.TableColumnFlags_.width_stretch, 0.22)
    imgui.table_headers_row()
    view = state.of(JointMatch)
    wanted = rows.index(view.scrolls_to) if view.scrolls_to in rows else -1
    for row in visible_rows(len(rows), wanted=wanted):
        imgui.push_id(rows[row])
        if rows[row] == view.scrolls_to:
            imgui.set_scroll_here_y(0.5)
            view.scrolls_to = -1
        _draw_row(state, shown, rows[row], rows[row] in hovered)
        imgui.pop_id()
    imgui.end_table()


def _listed(state: AppState, shown: _Shown) -> list[int]:
    """Return the joints of the figure that pass the filter."""
    view = state.of(JointMatch)
    wanted, found = view.filter.lower(), []
    for joint in shown.target.joints.tolist():
        partner = int(shown.partners[joint])
        name = shown.source.labels[partner] if partner >= 0 else ""
        is_listed = wanted in shown.target.labels[joint].lower() or wanted in name.lower()
        if is_listed and not (view.only_unmatched and partner >= 0):
            found.append(joint)
    return found


def _draw_row(state: AppState, shown: _Shown, joint: int, is_hovered: bool) -> None:
    """Draw a pair of joints; ``is_hovered``: whether the pair is hovered in the drawing."""
    label, partner = shown.target.labels[joint], int(shown.partners[joint])
    imgui.table_next_row()
    if is_hovered:
        color = imgui.get_color_u32(imgui.Col_.header_hovered)
        imgui.table_set_bg_color(imgui.TableBgTarget_.row_bg1, color)
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
    is_chosen = joint == state.selected_joint
    size = (0.0, imgui.get_frame_height())
    if imgui.selectable(f"{printable(label, 60)}##joint", is_chosen, flags, size)[0]:
        state.selected_joint = -1 if is_chosen else joint
    note_item(state, f"joint {label}")
    is_over = imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_overlapped_by_item)
    imgui.table_next_column()
    imgui.set_next_item_width(-1.0)
    with disabled(state, no_edit(state)):
        _draw_choice(state, shown, joint, partner)
    imgui.table_next_column()
    text, what = _ORIGINS[shown.origins[joint]]
    imgui.align_text_to_frame_padding()
    if partner >= 0:
        imgui.text_unformatted(text)
    else:
        imgui.text_colored(ink(WARNING), text)
    explain(what)
    if is_over:
        _hover_pair(state, shown, joint)


def _draw_choice(state: AppState, shown: _Shown, joint: int, partner: int) -> None:
    """Draw the list of the motion's joints, with a filter."""
    view, labels = state.of(JointMatch), shown.source.labels
    label = shown.target.labels[joint]
    current = printable(labels[partner], 60) if partner >= 0 else _AT_REST
    opened = imgui.begin_combo("##source", current, imgui.ComboFlags_.height_large)
    if not opened:
        note_item(state, f"source of {label}")
        return
    if imgui.is_window_appearing():
        view.source_filter = ""
        imgui.set_keyboard_focus_here()
    view.source_filter = filter_field(state, "source filter", view.source_filter, "Filter joints")
    if imgui.selectable(_AT_REST, partner < 0)[0]:
        match_joint(state, joint, -1)
    note_item(state, f"source {_AT_REST}")
    wanted = view.source_filter.lower()
    for other in shown.source.joints.tolist():
        if wanted not in labels[other].lower():
            continue
        drives = [shown.target.labels[each] for each in shown.driven.get(other, ())]
        if imgui.selectable(f"{printable(labels[other], 60)}##{other}", other == partner)[0]:
            match_joint(state, joint, other)
        note_item(state, f"source {labels[other]}")
        if drives:
            more = ", …" if len(drives) > _MOST_DRIVEN else ""
            imgui.same_line()
            text = f"drives {printable(', '.join(drives[:_MOST_DRIVEN]), 60)}{more}"
            imgui.text_disabled(text)
    imgui.end_combo()


def _draw_preview(state: AppState, shown: _Shown, size: tuple[float, float]) -> None:
    """Draw both skeletons at rest; a click selects a joint of the figure, a drag orbits."""
    view = state.of(JointMatch)
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("##preview", (max(size[0], 1.0), max(size[1], 1.0)))
    note_item(state, "preview")
    is_over = imgui.is_item_hovered()
    if imgui.is_item_active():
        view.yaw += _DRAG * imgui.get_io().mouse_delta.x
    half = 0.5 * size[0]
    boxes = [(corner.x + k * half, corner.y, corner.x + (k + 1) * half, corner.y + size[1])
             for k in range(2)]  # fmt: skip
    placed = [
        _placed(side, view.yaw, box)
        for side, box in zip((shown.target, shown.source), boxes, strict=True)
    ]
    if is_over:
        _hover(state, shown, placed)
    draw_list = imgui.get_window_draw_list()
    draw_list.push_clip_rect((corner.x, corner.y), (corner.x + size[0], corner.y + size[1]), True)
    target = shown.target, {j for j in shown.target.joints.tolist() if shown.partners[j] >= 0}
    source = shown.source, set(shown.driven)
    for number, (side, used) in enumerate((target, source)):
        title = f"{('Figure', 'Motion')[number]}: {printable(side.name, 40)}"
        place = boxes[number][0] + 0.4 * imgui.get_font_size(), corner.y
        draw_list.add_text(place, imgui.get_color_u32(imgui.Col_.text), title)
        _draw_side(side, placed[number], used, view.hovered[number])
    draw_list.pop_clip_rect()


def _hover_pair(state: AppState, shown: _Shown, joint: int) -> None:
    """Highlight a joint of the figure and the joint that drives it."""
    partner = int(shown.partners[joint])
    state.of(JointMatch).hovered = {joint}, {partner} if partner >= 0 else set()


def _hover(state: AppState, shown: _Shown, placed: list[Floats]) -> None:
    """Highlight the joint under the mouse and its partners; a click selects the figure's joint."""
    view = state.of(JointMatch)
    near = _NEAR * imgui.get_font_size()
    mouse = np.array([imgui.get_mouse_pos().x, imgui.get_mouse_pos().y])
    number, joint = -1, -1
    for index, side in enumerate((shown.target, shown.source)):
        distances = np.linalg.norm(placed[index][side.joints] - mouse, axis=1)
        if len(distances) and distances.min() < near:
            near = float(distances.min())
            number, joint = index, int(side.joints[distances.argmin()])
    if number == 0:
        _hover_pair(state, shown, joint)
    elif number == 1:
        view.hovered = set(shown.driven.get(joint, ())), {joint}
    chosen = sorted(view.hovered[0]) if number >= 0 else []
    delta = imgui.get_mouse_drag_delta(imgui.MouseButton_.left)
    was_dragged = abs(delta.x) + abs(delta.y) > imgui.get_io().mouse_drag_threshold
    if chosen and imgui.is_mouse_released(imgui.MouseButton_.left) and not was_dragged:
        state.selected_joint = view.scrolls_to = chosen[0]


def _placed(side: _Side, yaw: float, box: _Box) -> Floats:
    """Return the joints in window coordinates, scaled to fit the box: (J, 2)."""
    letter = imgui.get_font_size()
    flat = np.stack(
        [
            np.cos(yaw) * side.points[:, 0] + np.sin(yaw) * side.points[:, 2],
            -side.points[:, 1],
        ],
        axis=1,
    )
    low, high = flat[side.joints].min(axis=0), flat[side.joints].max(axis=0)
    # The title is above, and labels of the outer joints need some room.
    room = np.array([box[2] - box[0] - 3.0 * letter, box[3] - box[1] - 3.0 * letter])
    # The width must not change during a rotation about the up axis.
    wide = float(np.ptp(side.points[side.joints][:, [0, 2]], axis=0).max())
    extent = np.array([max(wide, 1e-9), max(float(high[1] - low[1]), 1e-9)])
    scale = float((np.maximum(room, letter) / extent).min())
    middle = np.array([0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]) + 0.6 * letter])
    placed: Floats = middle + scale * (flat - 0.5 * (low + high))
    return placed


def _draw_side(side: _Side, placed: Floats, used: set[int], hovered: set[int]) -> None:
    """Draw one skeleton; ``used``: joints with a partner."""
    draw_list, letter = imgui.get_window_draw_list(), imgui.get_font_size()
    bone = imgui.get_color_u32(faint(0.35))
    shown = set(side.joints.tolist())
    for joint in side.joints.tolist():
        parent = int(side.parents[joint])
        if parent in shown:
            draw_list.add_line(_at(placed[parent]), _at(placed[joint]), bone, 0.12 * letter)
    colors = {True: imgui.get_color_u32(ink(_MATCHED)), False: imgui.get_color_u32(ink(WARNING))}
    for joint in side.joints.tolist():
        is_used = joint in used
        if is_used:
            draw_list.add_circle_filled(_at(placed[joint]), _DOT * letter, colors[True])
        else:
            draw_list.add_circle(_at(placed[joint]), _DOT * letter, colors[False], 0, 1.5)
    marked = imgui.get_color_u32(ink(_HOVERED))
    for joint in sorted(hovered & shown):
        draw_list.add_circle(_at(placed[joint]), 2.2 * _DOT * letter, marked, 0, 0.14 * letter)
        _draw_label(printable(side.labels[joint], 40), placed[joint])


def _draw_label(text: str, at: Floats) -> None:
    """Draw the name of a joint on a background, so that bones do not cross it."""
    draw_list, letter = imgui.get_window_draw_list(), imgui.get_font_size()
    size = imgui.calc_text_size(text)
    x, y = float(at[0]) + 0.6 * letter, float(at[1]) - 0.5 * size.y
    edge = draw_list.get_clip_rect_max().x
    x = min(x, edge - size.x - 0.3 * letter)
    plate = imgui.get_color_u32(imgui.Col_.popup_bg)
    draw_list.add_rect_filled(
        (x - 0.2 * letter, y), (x + size.x + 0.2 * letter, y + size.y), plate, 0.2 * letter
    )
    draw_list.add_text((x, y), imgui.get_color_u32(imgui.Col_.text), text)


def _at(point: Floats) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def shown_match(state: AppState) -> _Shown | None:
    """Return the chosen actor's match, even while its motion is retargeted; None without one."""
    view, actor = state.of(JointMatch), state.actor
    drive, figure = shown_drive(state, actor), actor.figure
    if drive is None:
        return None
    shown = view.shown
    if shown is None or shown.drive is not drive or shown.figure is not figure:
        is_other = shown is None or shown.drive.motion is not drive.motion
        matches = matches_of(drive, figure)
        driven: dict[int, list[int]] = {}
        for joint, partner in enumerate(matches.partners.tolist()):
            if partner >= 0:
                driven.setdefault(partner, []).append(joint)
        source, target = aligned_rests(drive, figure)
        mine = target @ front_axes(target, matches, figure.up, is_source=False).T
        theirs = source @ front_axes(source, matches, figure.up, is_source=True).T
        sides = _side(figure, mine), _side(drive.motion.figure, theirs)
        shown = view.shown = _Shown(
            drive, figure, *sides, matches.partners, matches.origins, driven
        )
        if is_other:
            lengths = np.ptp(shown.target.points, axis=0)
            view.yaw = _SIDE_VIEW if lengths[2] > _LONG * lengths[0] else 0.0
            view.filter, view.only_unmatched = "", False
    return shown


def _side(figure: Figure, points: Floats) -> _Side:
    skeleton = figure.require_skeleton()
    joints = shown_joints(skeleton)
    return _Side(figure.name, joint_labels(skeleton), joints, skeleton.parents, points)


def is_automatic(state: AppState) -> str:
    """Return the reason why the match cannot be reset; empty if it can."""
    drive = state.actor.drive
    why = no_edit(state)
    return why or ("" if drive is not None and drive.joint_map else "the match is automatic")


def match_joint(state: AppState, joint: int, partner: int) -> None:
    """Let another joint of the motion drive a joint of the chosen figure."""
    actor = state.actor
    if actor.drive is None:
        return
    source = actor.drive.motion.figure.require_skeleton()
    label = joint_label(actor.figure.require_skeleton(), joint)
    chosen = joint_label(source, partner) if partner >= 0 else ""
    known = full_map(actor.drive, actor.figure)
    pairs = tuple((mine, chosen if mine == label else theirs) for mine, theirs in known.pairs)
    does = f"follows {printable(chosen, 60)}" if chosen else "stays at rest"
    text = f"{printable(label, 60)} {does}"
    _apply(state, JointMap(pairs), lambda: state.say_status(text))


def match_automatically(state: AppState) -> None:
    """Match all joints of the chosen figure automatically."""
    if is_automatic(state):
        state.say_status(is_automatic(state))
    else:
        _apply(state, None, lambda: state.say_status("Joints matched automatically"))


def ask_for_map(state: AppState) -> None:
    """Open the dialog that loads a joint map."""
    ask_for_files(state, _load, "Load joint map", _SUFFIXES, is_single=True)


def ask_where_to_save(state: AppState) -> None:
    """Open the dialog that saves the match as a joint map."""
    name = f"{file_stem(state.actor.figure.name)}_joints{_SUFFIXES[0]}"
    ask_where_to_write(state, _save, "Save joint map", _SUFFIXES, name)


@shows_errors
def _load(state: AppState, paths: list[Path]) -> None:
    """Apply a joint map file to the chosen figure."""
    if no_edit(state):
        state.say_status(no_edit(state))
        return
    joint_map = read_joint_map(Source.open(paths[0]))
    state.of(SavedWork).add(joint_map)
    text = f"Joints matched by {printable(paths[0], 200)}"
    _apply(state, joint_map, lambda: state.say_status(text))


def _save(state: AppState, path: Path) -> None:
    """Write the match of the chosen figure."""
    actor = state.actor
    drive = shown_drive(state, actor)
    if drive is None:
        state.say_status(no_drive(state))
        return
    titles = drive.motion.figure.name, actor.figure.name

    def act() -> None:
        write_joint_map(full_map(drive, actor.figure), path, titles)

    save_files(state, act, [path], saved=[drive.joint_map])


_BUTTONS = (
    ("Automatic", match_automatically, is_automatic, "match all joints automatically"),
    ("Load map…", ask_for_map, no_edit, "match the joints as in a joint map file"),
    (
        "Save map…",
        ask_where_to_save,
        lambda _: "",
        "write the match as a text file, to edit or load it",
    ),
)
"""Buttons of the panel: label, action, reason why it is disabled, and tooltip."""


def _apply(state: AppState, joint_map: JointMap | None, tell: Callable[[], None]) -> None:
    """Set the joint match of the chosen actor, and of all people of its capture."""
    change_drive(state, lambda drive: replace(drive, joint_map=joint_map), tell)
