"""Joint match panel: which joint of a motion drives each joint of the figure."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.ink import WARNING, ink
from viewer.app.core.reasons import no_drive
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import search_field
from viewer.app.core.widgets import (
    button,
    checkbox,
    disabled,
    explain,
    note_item,
    same_line_if_room,
)
from viewer.app.retargeting.drive_changes import NOT_DRIVEN, no_edit
from viewer.app.retargeting.match_actions import (
    ask_for_map,
    ask_where_to_save,
    is_automatic,
    match_automatically,
    match_joint,
)
from viewer.app.retargeting.skeleton_preview import draw_preview, hover_pair
from viewer.app.retargeting.state import JointMatch, Shown, shown_match
from viewer.errors import ViewerError
from viewer.phrases import counted, printable

__all__ = ["draw"]

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
        _draw_buttons(state, shown)
        _draw_table(state, shown, hovered[0])
    imgui.end_child()
    if is_wide:
        imgui.same_line()
    left = imgui.get_content_region_avail()
    draw_preview(state, shown, (left.x, left.y))


def _draw_buttons(state: AppState, shown: Shown) -> None:
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
        imgui.push_style_color(imgui.Col_.text, ink(WARNING))
        imgui.text_wrapped(NOT_DRIVEN)
        imgui.pop_style_color()
    for label, act, why, what in (
        ("Automatic", match_automatically, is_automatic(state), "match all joints automatically"),
        ("Load map…", ask_for_map, no_edit(state), "match the joints as in a joint map file"),
        ("Save map…", ask_where_to_save, "", "write the match as a text file, to edit or load it"),
    ):
        same_line_if_room(label)
        if button(state, label, why):
            act(state)
        if not why:
            explain(what)
    width = imgui.calc_text_size("Only unmatched").x + 2.0 * imgui.get_frame_height()
    imgui.set_next_item_width(max(imgui.get_content_region_avail().x - width, width))
    view.filter = search_field("##match filter", view.filter, "Filter joints")
    note_item(state, "Filter joints")
    imgui.same_line()
    view.only_unmatched = checkbox(state, "Only unmatched", view.only_unmatched)


def _draw_table(state: AppState, shown: Shown, hovered: set[int]) -> None:
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
    clipper = imgui.ListClipper()
    clipper.begin(len(rows))
    view = state.of(JointMatch)
    if view.scrolls_to in rows:
        clipper.include_item_by_index(rows.index(view.scrolls_to))
    while clipper.step():
        for row in range(clipper.display_start, clipper.display_end):
            imgui.push_id(rows[row])
            if rows[row] == view.scrolls_to:
                imgui.set_scroll_here_y(0.5)
                view.scrolls_to = -1
            _draw_row(state, shown, rows[row], rows[row] in hovered)
            imgui.pop_id()
    imgui.end_table()


def _listed(state: AppState, shown: Shown) -> list[int]:
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


def _draw_row(state: AppState, shown: Shown, joint: int, is_hovered: bool) -> None:
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
        hover_pair(state, shown, joint)


def _draw_choice(state: AppState, shown: Shown, joint: int, partner: int) -> None:
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
    imgui.set_next_item_width(-1.0)
    view.source_filter = search_field("##source filter", view.source_filter, "Filter joints")
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
