"""Choices among the contents of files, as readers expect them."""

from __future__ import annotations

from viewer.loading.settings import MotionSettings

__all__ = ["reader_options"]


def reader_options(settings: MotionSettings) -> dict[str, str]:
    """Return the choices among the contents of files, see ``Source.options``."""
    return {"rig": settings.rig, "lod": settings.lod}
