"""Drawing of the two skeletons of a match, side by side, with the joints under the mouse."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.ink import WARNING, faint, ink
from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item
from viewer.app.retargeting.state import JointMatch, Shown, Side
from viewer.phrases import printable
from viewer.rig.arrays import Floats

__all__ = ["draw_preview", "hover_pair"]

_MATCHED = (0.45, 0.78, 1.0, 1.0)
_HOVERED = (1.0, 0.86, 0.35, 1.0)
_NEAR = 0.7  # distance in font sizes within which a joint is hovered
_DOT = 0.16  # radius of a joint, font sizes
_DRAG = 0.01  # radians per pixel

Box = tuple[float, float, float, float]


def draw_preview(state: AppState, shown: Shown, size: tuple[float, float]) -> None:
    """Draw both skeletons at rest; a click selects a joint of the figure, a drag orbits.

    Parameters
    ----------
    state : AppState
        State that contains the panel's state.
    shown : Shown
        The match.
    size : (float, float)
        Width and height in window coordinates.
    """
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


def hover_pair(state: AppState, shown: Shown, joint: int) -> None:
    """Highlight a joint of the figure and the joint that drives it."""
    partner = int(shown.partners[joint])
    state.of(JointMatch).hovered = {joint}, {partner} if partner >= 0 else set()


def _hover(state: AppState, shown: Shown, placed: list[Floats]) -> None:
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
        hover_pair(state, shown, joint)
    elif number == 1:
        view.hovered = set(shown.driven.get(joint, ())), {joint}
    chosen = sorted(view.hovered[0]) if number >= 0 else []
    if chosen and imgui.is_mouse_released(imgui.MouseButton_.left) and not _was_dragged():
        state.selected_joint = view.scrolls_to = chosen[0]


def _was_dragged() -> bool:
    delta = imgui.get_mouse_drag_delta(imgui.MouseButton_.left)
    return bool(abs(delta.x) + abs(delta.y) > imgui.get_io().mouse_drag_threshold)


def _placed(side: Side, yaw: float, box: Box) -> Floats:
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


def _draw_side(side: Side, placed: Floats, used: set[int], hovered: set[int]) -> None:
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
