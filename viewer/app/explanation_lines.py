"""The pinned vertex in the view: where each joint alone would carry it, and where it is."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.state import AppState
from viewer.app.weights_actions import explained, unpin
from viewer.errors import ViewerError, printable
from viewer.rendering.palettes import joint_palette
from viewer.rendering.projection import project_segments
from viewer.rendering.view import view_of
from viewer.rig.arrays import Bools, Bytes, Floats
from viewer.rig.explanation import Explanation
from viewer.rig.memo import Memo
from viewer.rig.skeleton import Skeleton
from viewer.rig.transform import apply_transform

__all__ = ["draw_hovered", "draw_pinned", "influence_colors"]

_THINNEST, _THICKEST = 1.0, 5.0  # points: lines of the smallest and largest weight
_FAINTEST = 0.35
_DOT = 4.0  # points, radius
_LONGEST = 24  # letters of a name
_DARK, _LIGHT = (0.05, 0.06, 0.08, 0.8), (1.0, 1.0, 1.0, 1.0)
_palettes: Memo[Skeleton, Bytes] = Memo()


def influence_colors(explanation: Explanation, skeleton: Skeleton) -> Floats:
    """Return the colours of the influences, as the view of dominant joints has them: (K, 3), sRGB.

    Parameters
    ----------
    explanation : Explanation
        Of a vertex.
    skeleton : Skeleton
        Of its figure.
    """
    colors = _palettes.get(skeleton, (), lambda: joint_palette(skeleton.parents))
    return colors[explanation.joints, :3] / 255.0


def draw_pinned(state: AppState) -> None:
    """Draw the pinned vertex over the scene, with lines to its rigid images M_i p."""
    draw_hovered(state)
    pinned = state.weights.pinned
    if pinned is None or state.options.show == "binding":
        return
    try:
        explanation = explained(state)
    except ViewerError as problem:
        state.error = str(problem)
        unpin(state)
        return
    if explanation is None or pinned.figure.skeleton is None:
        return
    placement = state.scene.actors[pinned.actor].placement
    vertex = apply_transform(placement, explanation.position)
    images = apply_transform(placement @ explanation.placement, explanation.images)
    draw_list = _begin(state)
    if state.weights.draws_lines:
        colors = influence_colors(explanation, pinned.figure.skeleton)
        _draw_images(state, draw_list, explanation, colors, vertex, images)
    places, seen = _places(state, vertex[None], vertex[None])
    if seen[0]:
        x, y = places[0, 0].tolist()
        draw_list.add_circle_filled((x, y), _DOT + 2.0, imgui.get_color_u32(_DARK))
        draw_list.add_circle_filled((x, y), _DOT, imgui.get_color_u32(_LIGHT))
    draw_list.pop_clip_rect()


def draw_hovered(state: AppState) -> None:
    """Mark the vertex that is described, if one is."""
    hover = state.weights.hover
    if not hover.lines:
        return
    places, seen = _places(state, hover.point[None], hover.point[None])
    if not seen[0]:
        return
    draw_list = _begin(state)
    x, y = places[0, 0].tolist()
    for radius, color in ((_DOT + 1.5, _DARK), (_DOT, _LIGHT)):
        draw_list.add_circle((x, y), radius, imgui.get_color_u32(color), 0, 2.0)
    draw_list.pop_clip_rect()


def _begin(state: AppState) -> imgui.ImDrawList:
    """Return what draws over the scene and behind the panels, within the view."""
    x, y, width, height = state.view_rect
    draw_list = imgui.get_background_draw_list()
    draw_list.push_clip_rect((x, y), (x + width, y + height), True)
    return draw_list


def _places(state: AppState, starts: Floats, ends: Floats) -> tuple[Floats, Bools]:
    """Return where segments are in the window, (N, 2, 2), and whether they are seen, (N,)."""
    x, y, width, height = state.view_rect
    size = (max(round(width), 1), max(round(height), 1))
    places, seen = project_segments(view_of(state.camera, size, state.box), size, starts, ends)
    return places + np.array([x, y]), seen


def _draw_images(
    state: AppState,
    draw_list: imgui.ImDrawList,
    explanation: Explanation,
    colors: Floats,
    vertex: Floats,
    images: Floats,
) -> None:
    """Draw a line, a dot and a name for each influence, those of small weight first."""
    places, seen = _places(state, np.broadcast_to(vertex, images.shape), images)
    shares = np.clip(np.abs(explanation.weights), 0.0, 1.0)
    for index in reversed(range(len(images))):
        if not seen[index]:
            continue
        share = float(shares[index])
        start, end = (tuple(place) for place in places[index].tolist())
        r, g, b = colors[index].tolist()
        color = imgui.get_color_u32((r, g, b, _FAINTEST + (1.0 - _FAINTEST) * share))
        width = _THINNEST + (_THICKEST - _THINNEST) * share
        draw_list.add_line(start, end, imgui.get_color_u32(_DARK), width + 2.0)
        draw_list.add_line(start, end, color, width)
        solid = imgui.get_color_u32((r, g, b, 1.0))
        draw_list.add_circle_filled(end, _DOT + 1.5, imgui.get_color_u32(_DARK))
        draw_list.add_circle_filled(end, _DOT, solid)
    _draw_names(draw_list, explanation, places[seen, 1], np.flatnonzero(seen).tolist())


def _draw_names(
    draw_list: imgui.ImDrawList, explanation: Explanation, ends: Floats, indices: list[int]
) -> None:
    """Write joints and weights beside the images; what would cover a stronger one's is left out."""
    line = imgui.get_text_line_height()
    taken: list[tuple[float, float, float]] = []
    for (x, y), index in zip(ends.tolist(), indices, strict=True):
        name = printable(explanation.names[index], _LONGEST)
        text = f"{name}  {explanation.weights[index]:.3f}"
        left, top = x + 2.0 * _DOT, y - 0.5 * line
        right = left + imgui.calc_text_size(text).x
        covers = any(
            abs(top - other) < line and left < end and start < right for start, end, other in taken
        )
        if not covers:
            taken.append((left, right, top))
            shadow = imgui.get_color_u32((0.0, 0.0, 0.0, 0.9))
            draw_list.add_text((left + 1.0, top + 1.0), shadow, text)
            draw_list.add_text((left, top), imgui.get_color_u32(_LIGHT), text)
