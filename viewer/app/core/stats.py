"""Statistics of the last frame: duration, renderer and the range of its colours."""

from __future__ import annotations

from viewer.data_classes import dataclass
from viewer.rendering.overlay.legend import Legend

__all__ = ["Stats"]


@dataclass(slots=True)
class Stats:
    """Duration and renderer of the last frame."""

    frame_ms: float = 0.0
    renderer: str = ""
    version: str = ""
    samples: int = 0
    scalar_range: tuple[float, float] = (0.0, 0.0)
    scalar_ends: tuple[float, float] = (0.0, 0.0)
    legend: Legend | None = None
