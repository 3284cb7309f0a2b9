"""Placement of the actors of a scene: upright, and side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.loading.cast import Cast
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.geometry.transform import rotation_transform, translation_matrix
from viewer.rig.scene import Actor, Scene, scene_box

__all__ = ["place_side_by_side", "placed_views", "stand_up"]

_GAP = 0.25  # between actors side by side, in widths of the wider one


def stand_up(cast: Cast, world_up: str) -> None:
    """Rotate actors whose files have a different up axis from the scene."""
    for actor, up in zip(cast.actors, cast.ups, strict=True):
        if up != world_up:
            quarter = np.pi / 2 if world_up == "z" else -np.pi / 2
            actor.placement = rotation_transform(0, quarter) @ actor.placement


def place_side_by_side(cast: Cast) -> None:
    """Move actors without a position from their files to the right of those before them.

    Actors of one file are moved together.
    """
    loose = _by_file(cast)
    placed = [a for a, placed in zip(cast.actors, cast.placed, strict=True) if placed]
    if not loose or len(loose) + len(placed) < 2:
        return
    # Bounds of the drawn scene exclude stray vertices, which would displace the next actor.
    spans = [scene_box(Scene(group))[:, 0] for group in loose]
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


def _by_file(cast: Cast) -> list[list[Actor]]:
    """Return the actors without a position of their own, those of one file together."""
    groups: dict[Path | int, list[Actor]] = {}
    for index, actor in enumerate(cast.actors):
        if not cast.placed[index]:
            origin = cast.origins[index]
            groups.setdefault(index if origin is None else origin, []).append(actor)
    return list(groups.values())


def placed_views(cast: Cast, views: Iterable[tuple[Path, CameraView]]) -> list[CameraView]:
    """Return the cameras of files with figures, moved with the figures of their file."""
    placements = {
        origin: actor.placement
        for actor, origin in zip(cast.actors, cast.origins, strict=True)
        if origin is not None
    }
    found = []
    for path, view in views:
        placement = placements[path]
        rotation = view.rotation @ placement[:3, :3].T
        moved = view.translation - rotation @ placement[:3, 3]
        found.append(replace(view, rotation=rotation, translation=moved))
    return found
