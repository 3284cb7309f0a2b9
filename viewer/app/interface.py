"""One frame of the interface: docked panels, menu, messages. Reads and writes AppState only."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.actions import cancel
from viewer.app.keys import KEYS, MOUSE
from viewer.app.menus import draw_menus
from viewer.app.panels import PANELS, Panel, panel_module
from viewer.app.state import AppState
from viewer.app.widgets import button, number_text
from viewer.errors import printable
from viewer.rendering.colormap import color_at
from viewer.rendering.ground_pass import grid_step
from viewer.rig.scalars import SCALARS, length_unit, missing_part

__all__ = ["draw_hints", "draw_interface"]

_DOCK = "viewer dock"
_LEFT, _RIGHT = (0.235, 0.30, 14.0), (0.27, 0.36, 17.0)
"""Usual and largest share of the window's width, and the letters' heights wanted across."""
_BOTTOM, _LOWEST = 0.2, 10.0
"""Share of the window's height for what lies at the bottom, and the letters' heights it wants."""
_SHOW_PROGRESS_AFTER = 0.3  # seconds
_ERROR_TITLE = "This did not work"


def draw_interface(state: AppState) -> list[Path]:
    """Draw everything but the scene; return files that a menu asked to open."""
    state.item_rects.clear()
    if state.panels_visible:
        chosen = draw_menus(state)
        dock = _draw_dock(state)
        for name, panel in PANELS.items():
            if name not in state.closed_panels and _is_needed(state, panel):
                _draw_panel(state, name, panel)
        node = imgui.internal.dock_builder_get_central_node(dock)
        state.view_rect = (node.pos.x, node.pos.y, node.size.x, node.size.y)
    else:
        chosen = []
        viewport = imgui.get_main_viewport()
        state.view_rect = (viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y)
    _draw_legend(state)
    _draw_notes(state)
    _draw_keys(state)
    _draw_progress(state)
    _draw_error(state)
    return chosen


def _draw_dock(state: AppState) -> int:
    """Draw the dock space, with the first layout if none was remembered."""
    dock = imgui.get_id(_DOCK)
    is_new = imgui.internal.dock_builder_get_node(dock) is None
    if is_new or state.wants_layout_reset:
        _build_layout(dock)
        state.wants_layout_reset = False
        state.closed_panels.clear()
    flags = imgui.DockNodeFlags_.passthru_central_node
    flags |= imgui.DockNodeFlags_.no_docking_over_central_node
    imgui.dock_space_over_viewport(dock, imgui.get_main_viewport(), flags)
    return dock


def _build_layout(dock: int) -> None:
    builder = imgui.internal
    builder.dock_builder_remove_node(dock)
    builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(dock, imgui.get_main_viewport().size)
    left_share, right_share = _share(_LEFT), _share(_RIGHT)
    height = imgui.get_main_viewport().size.y
    share = min(max(_BOTTOM, _LOWEST * imgui.get_font_size() / max(height, 1.0)), 0.4)
    whole = builder.dock_builder_split_node(dock, imgui.Dir.down, share)
    split = builder.dock_builder_split_node(whole.id_at_opposite_dir, imgui.Dir.left, left_share)
    left, rest = split.id_at_dir, split.id_at_opposite_dir
    share = right_share / (1.0 - left_share)
    right = builder.dock_builder_split_node(rest, imgui.Dir.right, share).id_at_dir
    middle = builder.dock_builder_split_node(right, imgui.Dir.down, 0.64)
    bottom = builder.dock_builder_split_node(middle.id_at_dir, imgui.Dir.down, 0.48)
    places = {
        "left": left,
        "bottom": whole.id_at_dir,
        "right 1": middle.id_at_opposite_dir,
        "right 2": bottom.id_at_opposite_dir,
        "right 3": bottom.id_at_dir,
    }
    for panel in PANELS.values():
        builder.dock_builder_dock_window(panel.title, places[panel.place])
    builder.dock_builder_finish(dock)


def _share(side: tuple[float, float, float]) -> float:
    """Return a side's share of the width: the usual one, or more if the window is narrow."""
    usual, largest, wanted = side
    width = max(imgui.get_main_viewport().size.x, 1.0)
    return max(usual, min(largest, wanted * imgui.get_font_size() / width))


def _is_needed(state: AppState, panel: Panel) -> bool:
    if panel.needs in ("motion", "actors"):
        several = panel.needs == "actors" and len(state.scene.actors) > 1
        return state.playback.has_motion or several
    return not panel.needs or getattr(state.actor.figure, panel.needs) not in (None, ())


def _draw_panel(state: AppState, name: str, panel: Panel) -> None:
    # A panel that comes with a figure does not push itself in front of the others.
    is_quiet = panel.needs and not panel.leads
    flags = imgui.WindowFlags_.no_focus_on_appearing if is_quiet else imgui.WindowFlags_.none
    shown, stays = imgui.begin(panel.title, True, flags)
    if shown:
        # Labels stand right of their widgets and must not be cut off.
        imgui.push_item_width(-7.5 * imgui.get_font_size())
        panel_module(name).draw(state)
        imgui.pop_item_width()
    imgui.end()
    if not stays:
        state.closed_panels.add(name)


def _overlay(name: str, x: float, y: float, pivot: tuple[float, float]) -> bool:
    imgui.set_next_window_pos((x, y), imgui.Cond_.always, pivot)
    imgui.set_next_window_bg_alpha(0.86)
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_docking
    flags |= imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_inputs | imgui.WindowFlags_.no_focus_on_appearing
    flags |= imgui.WindowFlags_.no_nav
    return imgui.begin(name, None, flags)[0]


def draw_hints(state: AppState) -> None:
    """Say what the grid measures and where the keys are listed, in the corner of the view.

    Drawn behind the panels like the picture of the scene, so it has to come after that.
    """
    x, y, width, height = state.view_rect
    grid = f"grid {grid_step(state.box):g} units   " if state.options.grid else ""
    text = f"{grid}H keys"
    size = imgui.calc_text_size(text)
    place = (x + width - size.x - 10, y + height - size.y - 8)
    draw_list = imgui.get_background_draw_list()
    shadow, color = imgui.get_color_u32((0, 0, 0, 0.5)), imgui.get_color_u32((1, 1, 1, 0.85))
    draw_list.add_text((place[0] + 1, place[1] + 1), shadow, text)
    draw_list.add_text(place, color, text)


def _draw_legend(state: AppState) -> None:
    """Say what the colours of a scalar view stand for, in a corner of the view."""
    x, y, width, _ = state.view_rect
    shows_mesh = any(
        actor.visible and actor.figure.mesh is not None and state.options.show != "skeleton"
        for actor in state.scene.actors
    )
    if state.options.shading != "scalar" or width < 200 or not shows_mesh:
        return
    factor, unit = length_unit(state.actor.figure)
    view = SCALARS[state.options.scalar]
    missing = missing_part(state.options.scalar, state.actor.figure)
    if missing:
        if _overlay("##legend", x + 10, y + 10, (0.0, 0.0)):
            imgui.text_unformatted(f"{view.title}: this figure has not {missing}")
        imgui.end()
        return
    low, high = view.shown(*state.stats.scalar_range)
    if _overlay("##legend", x + 10, y + 10, (0.0, 0.0)):
        imgui.text_unformatted(f"{view.title}, {unit}")
        place, bar = imgui.get_cursor_screen_pos(), (min(180.0, width - 60), 12.0)
        draw_list, steps = imgui.get_window_draw_list(), 64
        for step in range(steps):
            # Whole pixels: edges between them would be blended with the background.
            left = round(place.x + bar[0] * step / steps)
            right = round(place.x + bar[0] * (step + 1) / steps)
            color = imgui.get_color_u32((*color_at((step + 0.5) / steps), 1.0))
            draw_list.add_rect_filled((left, place.y), (right, place.y + bar[1]), color)
        imgui.dummy(bar)
        is_flat = state.stats.scalar_range[1] <= 0.0
        imgui.text_unformatted("0 everywhere" if is_flat else number_text(factor * low))
        text = "" if is_flat else number_text(factor * high)
        imgui.same_line(bar[0] - imgui.calc_text_size(text).x + imgui.get_style().window_padding.x)
        imgui.text_unformatted(text)
    imgui.end()


def _draw_notes(state: AppState) -> None:
    state.drop_old_notes()
    x, y, width, height = state.view_rect
    if state.notes and width > 40:
        imgui.set_next_window_size_constraints((0.0, 0.0), (max(width - 20, 60.0), 1e6))
        if _overlay("##notes", x + 10, y + height - 10, (0.0, 1.0)):
            imgui.push_text_wrap_pos(max(width - 40, 50.0))
            for note in state.notes[-8:]:
                imgui.text_unformatted(printable(note.text, 400))
            imgui.pop_text_wrap_pos()
        imgui.end()


def _draw_keys(state: AppState) -> None:
    if not state.keys_visible:
        return
    lines = [*((key.label, key.text) for key in KEYS), *MOUSE]
    viewport = imgui.get_main_viewport()
    fits = (len(lines) + 3) * imgui.get_text_line_height_with_spacing() <= viewport.size.y
    style = imgui.get_style()
    # In a low window the lines move together and get smaller rather than go out of it.
    room = (viewport.size.y - 3 * style.window_padding.y) / len(lines)
    share = 1.0 if fits else max(min(room / imgui.get_text_line_height(), 1.0), 0.5)
    gap = (style.item_spacing.x, style.item_spacing.y if fits else 0.0)
    imgui.push_style_var(imgui.StyleVar_.item_spacing, gap)
    imgui.push_font(None, share * style.font_size_base)
    center = viewport.get_center()
    if _overlay("##keys", center.x, center.y, (0.5, 0.5)):
        for label, text in lines:
            imgui.text_colored((1.0, 0.78, 0.45, 1.0), label)
            imgui.same_line(11 * imgui.get_font_size())
            imgui.text_unformatted(text)
    imgui.end()
    imgui.pop_font()
    imgui.pop_style_var()


def _draw_progress(state: AppState) -> None:
    loader, stream = state.loader, state.stream
    x, y, width, height = state.view_rect
    if loader is not None and loader.seconds >= _SHOW_PROGRESS_AFTER:
        # Negative fractions make ImGui draw a bar of unknown length that moves.
        share, text = -loader.seconds, f"{loader.seconds:.0f} s"
        title, place = (
            f"Opening {printable(loader.paths[-1].name, 60)}",
            (x + width / 2, y + height / 2),
        )
        label, pivot = "Cancel opening", (0.5, 0.5)
    elif stream is not None:
        read, total = stream.progress
        share, text = read / max(total, 1), f"{read:,} of {total:,} frames"
        names = ", ".join(builder.capture.name for builder in stream.builders)
        title, label = f"Reading {printable(names, 60)}", "Cancel reading"
        place, pivot = (x + width - 10, y + 10), (1.0, 0.0)
    elif state.job is not None:
        done, total = state.job.progress
        title, label = state.job.title, "Cancel" if state.job.can_cancel else ""
        # Negative fractions make ImGui draw a bar of unknown length that moves.
        share, text = (done / total, f"{done:,} of {total:,}") if total else (-imgui.get_time(), "")
        place, pivot = (x + width / 2, y + height / 2), (0.5, 0.5)
    else:
        return
    imgui.set_next_window_pos(place, imgui.Cond_.always, pivot)
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing
    if imgui.begin("##progress", None, flags)[0]:
        imgui.text_unformatted(title)
        imgui.progress_bar(share, (260.0, 0.0), text)
        if label and button(state, label):
            cancel(state)
    imgui.end()


def _draw_error(state: AppState) -> None:
    if not state.error:
        return
    imgui.open_popup(_ERROR_TITLE)
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.always, (0.5, 0.5))
    width = min(560.0, 0.92 * imgui.get_main_viewport().size.x)
    imgui.set_next_window_size((width, 0.0))
    opened, stays = imgui.begin_popup_modal(_ERROR_TITLE, True, imgui.WindowFlags_.no_resize)
    if opened:
        imgui.text_wrapped(printable(state.error, 1000))
        if button(state, "OK"):
            stays = False
        imgui.same_line()
        if button(state, "Copy"):
            imgui.set_clipboard_text(state.error)
        if not stays:
            state.error = ""
            imgui.close_current_popup()
        imgui.end_popup()
