"""Paths of the bundled figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viewer.resources import resource


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the bundled figure."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def bundled_body() -> Path:
    """Return the bundled neutral human body, in SMPL's layout."""
    return resource("assets", "samples", "body.npz")


BUNDLED: dict[str, Callable[[], tuple[Path, ...]]] = {
    "body": lambda: (bundled_body(),),
    "fox": bundled_files,
}
"""Functions that return the files of each bundled figure, by name."""
