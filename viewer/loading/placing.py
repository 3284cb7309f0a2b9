"""Placement of the actors of a scene: upright, in one unit of length, and side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.loading.scaling import known_unit, scale_to_unit, scaling
from viewer.loading.scene_draft import SceneDraft
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import up_rotation
from viewer.rigs.geometry.transform import affine_matrices, translation_matrix
from viewer.rigs.scene import Actor, Scene, scene_box, scene_unit
from viewer.rigs.units import METRES

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rigs.captures.cameras import CameraView
    from viewer.rigs.figure import FigureGroup

_GAP = 0.25  # gap between actors side by side, relative to the width of the wider one
# Distances of the lowest point from height 0, relative to a figure's height: it stands there up to
# the first, and from the second on, its origin is inside it, as in body models (the pelvis).
_STANDS, _INSIDE = 0.05, 0.25


def stand_up(draft: SceneDraft, world_up: str) -> None:
    """Rotate actors whose up axis differs from the scene's."""
    for actor, up in zip(draft.actors, draft.ups, strict=True):
        _turn(actor, up, world_up)
    for builder in draft.builders:  # for people who appear later
        _turn(builder, builder.up, world_up)


def _turn(turned: Actor | Builder, up: str, world_up: str) -> None:
    turned.placement = affine_matrices(up_rotation(up, world_up), np.zeros(3)) @ turned.placement


def placed_like(scene: Scene, actor: Actor) -> list[Diagnostic]:
    """Rotate and scale an actor to a scene's up axis and unit; a note states a change of unit."""
    unit = scene_unit(scene)
    _turn(actor, actor.figure.up, scene.up)
    return scale_to_unit(actor, unit)


def scale_to_one_unit(draft: SceneDraft) -> None:
    """Scale actors whose unit differs from that of the scene; a note names each of them."""
    # The unit of the scene is that of the first actor whose motion determines its position, or else
    # of the first actor with a known unit. Actors with an unknown unit are not scaled.
    order = sorted(range(len(draft.actors)), key=lambda index: not draft.placed[index])
    unit = next((found for index in order if (found := known_unit(draft.actors[index]))), "")
    for actor in draft.actors:
        draft.diagnostics += scale_to_unit(actor, unit)
    for builder in draft.builders:
        builder.unit = unit


def place_side_by_side(draft: SceneDraft, world_up: str) -> None:
    """Move actors without their own position to the right of the actors before them, by groups.

    Those whose origin is inside them are lifted to height 0 if others stand there.
    """
    loose = _by_group(draft)
    placed = [a for a, placed in zip(draft.actors, draft.placed, strict=True) if placed]
    if not loose or len(loose) + len(placed) < 2:
        return
    # Bounds of the drawn scene exclude stray vertices, which would displace the next actor.
    boxes = [scene_box(Scene(group)) for group in loose]
    if not placed:
        _lift(loose, boxes, 2 if world_up == "z" else 1)
    spans = [box[:, 0] for box in boxes]
    if placed:
        before = scene_box(Scene(placed))[:, 0]
    else:
        before, loose, spans = spans[0], loose[1:], spans[1:]
    edge = before[1]
    for group, span in zip(loose, spans, strict=True):
        low, high = span
        gap = _GAP * max(high - low, before[1] - before[0])
        shift = translation_matrix(np.array([edge + gap - low, 0.0, 0.0]))
        for actor in group:
            actor.placement = shift @ actor.placement
        edge += gap + high - low
        before = span


def _lift(groups: list[list[Actor]], boxes: list[Floats], up: int) -> None:
    """Lift groups whose origin is inside them to height 0 if others stand there."""
    lows = np.array([box[0, up] for box in boxes])
    heights = np.array([box[1, up] for box in boxes]) - lows
    if not (np.abs(lows) <= _STANDS * heights).any():
        return
    for group, low, height in zip(groups, lows, heights, strict=True):
        if -height < low < -_INSIDE * height:
            shift = np.zeros(3)
            shift[up] = -low
            for actor in group:
                actor.placement = translation_matrix(shift) @ actor.placement


def _by_group(draft: SceneDraft) -> list[list[Actor]]:
    """Return the actors without their own position, grouped by figure group."""
    groups: dict[FigureGroup | int, list[Actor]] = {}
    for index, (actor, group) in enumerate(zip(draft.actors, draft.groups, strict=True)):
        if not draft.placed[index]:
            groups.setdefault(index if group is None else group, []).append(actor)
    return list(groups.values())


def placed_views(draft: SceneDraft) -> list[CameraView]:
    """Return the cameras of captures and figure groups, moved and scaled with their figures."""
    placed = [
        # Captures are in metres.
        (builder.views, scaling(1.0 / METRES[builder.unit or "m"]) @ builder.placement)
        for builder in draft.builders
    ]
    placements = {
        group: actor.placement
        for actor, group in zip(draft.actors, draft.groups, strict=True)
        if group is not None
    }
    placed += [(group.views, placement) for group, placement in placements.items()]
    if not any(views for views, _ in placed):
        return []
    from viewer.rigs.captures.cameras import placed_view

    return [placed_view(view, placement) for views, placement in placed for view in views]
