"""View through a moving calibrated camera."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rendering.camera import follow_view

__all__ = ["follow_calibrated"]


def follow_calibrated(state: AppState) -> None:
    """Move the camera with the moving calibrated camera that it looks through, if any."""
    _, _, width, height = state.view_rect
    size = max(round(width), 1), max(round(height), 1)
    follow_view(state.camera, size, state.clock.time, state.box)
