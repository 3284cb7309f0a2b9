"""Projection between the scene and the window, in both directions."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import unit

Place = tuple[float, float]
"""A position in the window, in window coordinates."""

_NEAREST = 1e-9  # smallest w in clip space: points with a smaller w are at or behind the eye


@dataclass(frozen=True, slots=True, eq=False)
class ViewFrame:
    """The camera's projection and the part of the window that it fills."""

    matrix: Floats
    """Scene to clip space, projection @ view: (4, 4)."""
    rect: tuple[float, float, float, float]
    """Window coordinates: (x, y, width, height)."""
    scale: float = 1.0
    """Window coordinates per point, the unit of handles: the scale of the interface."""

    def project(self, points: Floats) -> Floats:
        """Return the projections of points: (..., 3) to (..., 2), NaN for those behind the eye."""
        clip = points @ self.matrix[:, :3].T + self.matrix[:, 3]
        w = clip[..., 3:]
        ratio = clip[..., :2] / np.where(w > _NEAREST, w, np.nan)
        x, y, width, height = self.rect
        return np.array([x + 0.5 * width, y + 0.5 * height]) + ratio * (
            0.5 * np.array([width, -height])
        )

    def place(self, point: Floats) -> Place | None:
        """Return the projection of a point, or None if it is behind the eye."""
        seen = self.project(point)
        return (float(seen[0]), float(seen[1])) if np.isfinite(seen).all() else None

    def at_depth_of(self, point: Floats, place: Place) -> Floats:
        """Return the scene point (3,) at a window position, at the depth of another point (3,)."""
        # Points of a plane parallel to the image have the same depth and w in clip space.
        clip = self.matrix @ np.append(point, 1.0)
        found = np.linalg.solve(self.matrix, self._clip(place, clip[2], clip[3]))
        return np.asarray(found[:3] / found[3])

    def ray(self, place: Place) -> tuple[Floats, Floats]:
        """Return the viewing ray at a window position: a point on it, and its unit direction."""
        ends = np.stack([self._clip(place, depth, 1.0) for depth in (-1.0, 1.0)], axis=1)
        near, far = np.linalg.solve(self.matrix, ends).T
        near, far = near[:3] / near[3], far[:3] / far[3]
        return near, unit(far - near)

    def unit_length(self, point: Floats) -> float:
        """Return the length of one point of handles at a scene point's depth, in scene units."""
        seen = self.place(point)
        if seen is None:
            return 0.0
        beside = self.at_depth_of(point, (seen[0] + self.scale, seen[1]))
        return float(np.linalg.norm(beside - point))

    def _clip(self, place: Place, depth: float, w: float) -> Floats:
        x, y, width, height = self.rect
        across = 2.0 * (place[0] - x) / width - 1.0
        upward = 1.0 - 2.0 * (place[1] - y) / height
        return np.array([across * w, upward * w, depth, w])


def view_frame(state: AppState) -> ViewFrame:
    """Return the current projection of the scene in the view."""
    x, y, width, height = state.view_rect
    rect = (x, y, max(width, 1.0), max(height, 1.0))
    projection = state.camera.projection_matrix(state.aspect, state.box)
    scale = imgui.get_style().font_scale_dpi
    return ViewFrame(projection @ state.camera.view_matrix(), rect, scale)
