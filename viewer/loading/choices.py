"""Options that select among the contents of a file, in the form that readers expect."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.loading.settings import MotionSettings

__all__ = ["reader_options"]


def reader_options(settings: MotionSettings) -> dict[str, str]:
    """Return the options that readers consider; see ``Source.options``."""
    rate = settings.frame_rate
    return {"rig": settings.rig, "lod": settings.lod, "fps": "" if rate is None else f"{rate!r}"}
