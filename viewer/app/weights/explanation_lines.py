"""Drawing of the pinned vertex, with lines to its images under each joint alone."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.weights.actions import explained, unpin
from viewer.app.weights.state import Weights
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rendering.colors import joint_palette
from viewer.rendering.overlay.annotation import LABEL_COLOR, Annotation, Labels
from viewer.rendering.overlay.segments import Segments, SegmentStyle, dots, joined
from viewer.rendering.projection import picture_scale, project
from viewer.rendering.view import view_of
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.inspection.explanation import Explanation
from viewer.rig.memo import Memo
from viewer.rig.scene import Actor
from viewer.rig.skeleton import Skeleton

__all__ = ["draw_hovered", "influence_colors", "pinned_annotations", "vertex_annotation"]

# Pixels in an image of standard height.
_THINNEST, _THICKEST = 1.0, 5.0  # line widths for the smallest and largest weight
_DOT, _RIM, _BORDER = 8.0, 3.0, 2.0  # diameter of a dot; dark borders of dots and lines
_FAINTEST = 0.35
_LONGEST = 24  # maximum length of a name in characters
_DARK, _LIGHT = (0.05, 0.06, 0.08, 0.8), (1.0, 1.0, 1.0, 1.0)
_palettes: Memo[Skeleton, Bytes] = Memo()


def influence_colors(explanation: Explanation, skeleton: Skeleton) -> Floats:
    """Return the colours of the influences, as for dominant joints: (K, 3), sRGB.

    Parameters
    ----------
    explanation : Explanation
        Explanation of a vertex.
    skeleton : Skeleton
        Skeleton of its figure.
    """
    colors = _palettes.get(skeleton, (), lambda: joint_palette(skeleton.parents))
    return colors[explanation.joints, :3] / 255.0


def pinned_annotations(state: AppState, size: tuple[int, int]) -> tuple[Annotation, ...]:
    """Return the annotation of the pinned vertex; the same object as long as nothing changes.

    Parameters
    ----------
    state : AppState
        State with the posed scene; a vertex that cannot be explained is unpinned.
    size : (int, int)
        Width and height of the image, pixels.
    """
    view = state.of(Weights)
    pinned = view.pinned
    if pinned is None or state.options.show == "binding":
        return ()
    try:
        explanation = explained(state)
    except ViewerError as problem:
        state.error = str(problem)
        unpin(state)
        return ()
    if explanation is None or not state.scene.actors[pinned.actor].is_drawn:
        return ()
    actor = state.scene.actors[pinned.actor]
    key = (explanation, actor.placement.tobytes(), view.draws_lines, size)
    if key != view.annotation_key or not view.annotations:
        view.annotations = (vertex_annotation(explanation, actor, view.draws_lines, size),)
        view.annotation_key = key
    return view.annotations


def vertex_annotation(
    explanation: Explanation, actor: Actor, draws_lines: bool, size: tuple[int, int]
) -> Annotation:
    """Return a dot at a vertex, and lines from it to its rigid images M_i p with their weights.

    Parameters
    ----------
    explanation : Explanation
        Explanation of the vertex in the actor's pose.
    actor : Actor
        Actor with a skeleton.
    draws_lines : bool
        Whether lines are drawn in addition to the dot.
    size : (int, int)
        Width and height of the image, pixels.
    """
    scale = picture_scale(size)
    vertex = apply_transform(actor.placement, explanation.position)
    rim = dots(vertex[None], np.array(_DARK), scale * (_DOT + _RIM + 1.0))
    parts = [rim, dots(vertex[None], np.array(_LIGHT), scale * _DOT)]
    if not draws_lines or not len(explanation.joints):
        return Annotation(joined(parts), SegmentStyle(on_top=True))
    skeleton = actor.figure.skeleton
    assert skeleton is not None  # influences imply a skeleton
    images = apply_transform(actor.placement @ explanation.placement, explanation.images)
    colors = influence_colors(explanation, skeleton)
    lines = _image_lines(vertex, images, colors, explanation.weights, scale)
    texts = tuple(
        f"{printable(name, _LONGEST)}  {weight:.3f}"
        for name, weight in zip(explanation.names, explanation.weights.tolist(), strict=True)
    )
    white = np.broadcast_to(LABEL_COLOR, (len(texts), 3))
    # Priorities after the name of the selected joint, before those of all other joints.
    labels = Labels(texts, images, np.arange(1, len(texts) + 1, dtype=np.int32), white)
    return Annotation(joined([lines, *parts]), SegmentStyle(on_top=True), labels)


def _image_lines(
    vertex: Floats, images: Floats, colors: Floats, weights: Floats, scale: float
) -> Segments:
    """Return a line and a dot for each influence, both with a dark rim; the strongest is on top."""
    strengths = np.clip(np.abs(weights), 0.0, 1.0)
    opacities = _FAINTEST + (1.0 - _FAINTEST) * strengths
    widths = _THINNEST + (_THICKEST - _THINNEST) * strengths
    count = len(images)
    dark, one = np.tile(_DARK, (count, 1)), np.ones((count, 1))
    starts = np.stack([np.broadcast_to(vertex, images.shape)] * 2 + [images] * 2, axis=1)
    ends = np.repeat(images[:, None], 4, axis=1)
    faint, solid = np.hstack([colors, opacities[:, None]]), np.hstack([colors, one])
    shades = np.stack([dark, faint, dark, solid], axis=1)
    dot = np.full(count, _DOT)
    thick = scale * np.stack([widths + _BORDER, widths, dot + _RIM, dot], axis=1)
    # The weakest influence is drawn first; explanations list it last.
    order = np.arange(count)[::-1]
    return Segments(
        starts[order].reshape(-1, 3),
        ends[order].reshape(-1, 3),
        shades[order].reshape(-1, 4),
        thick[order].ravel(),
    )


def draw_hovered(state: AppState) -> None:
    """Mark the vertex that the hover text describes, only in the window, not in screenshots."""
    hover = state.of(Weights).hover
    if not hover.lines:
        return
    x, y, width, height = state.view_rect
    size = (max(round(width), 1), max(round(height), 1))
    found = project(view_of(state.camera, size, state.box), size, hover.point[None])
    if not found.seen[0]:
        return
    draw_list = imgui.get_background_draw_list()
    draw_list.push_clip_rect((x, y), (x + width, y + height), True)
    across, down = (found.pixels[0] + [x, y]).tolist()
    for radius, color in ((0.5 * (_DOT + _RIM), _DARK), (0.5 * _DOT, _LIGHT)):
        draw_list.add_circle((across, down), radius, imgui.get_color_u32(color), 0, 2.0)
    draw_list.pop_clip_rect()
