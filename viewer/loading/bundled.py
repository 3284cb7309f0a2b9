"""The figures that ship with the viewer."""

from __future__ import annotations

from pathlib import Path

from viewer.resources import resource

__all__ = ["bundled_body", "bundled_files"]


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the figure that ships with the viewer."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def bundled_body() -> Path:
    """Return the neutral human body that ships with the viewer, in SMPL's layout."""
    return resource("assets", "samples", "body.npz")
