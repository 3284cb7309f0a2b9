"""Statistics of the last frame: what it took, who drew it, and the range of its colours."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rendering.overlay.legend import Legend

__all__ = ["Stats"]


@dataclass(slots=True)
class Stats:
    """What the last frame took and who drew it."""

    frame_ms: float = 0.0
    renderer: str = ""
    version: str = ""
    samples: int = 0
    skin_updates: int = 0
    scalar_range: tuple[float, float] = (0.0, 0.0)
    scalar_ends: tuple[float, float] = (0.0, 0.0)
    legend: Legend | None = None
