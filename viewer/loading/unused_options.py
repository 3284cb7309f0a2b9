"""Messages about options for reading files that had no effect."""

from __future__ import annotations

from collections.abc import Iterator

from viewer.diagnostics import Diagnostic
from viewer.loading.settings import MotionSettings

__all__ = ["unused_options"]


def unused_options(settings: MotionSettings, used: set[str]) -> Iterator[Diagnostic]:
    """Yield a message for each option that was given but had no effect.

    Parameters
    ----------
    settings : MotionSettings
        The requested settings.
    used : set of str
        Names of the options that had an effect.
    """
    given = {
        "rig": settings.rig,
        "lod": settings.lod,
        "space": settings.space,
        "average-shape": settings.average_shape,
        "video": settings.video,
        "images": settings.images,
        "model": settings.model,
        "gender": settings.gender,
    }
    for name, value in given.items():
        if value and name not in used:
            yield Diagnostic(f"F007.unused-{name}", values={"value": value})
    joint_map = settings.joint_map
    if joint_map is not None and "joint-map" not in used:
        yield Diagnostic("F007.unused-joint-map", joint_map.path)
