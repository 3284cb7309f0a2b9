"""Where results go: suffixes, and what must never be replaced."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._pose import pose_files
from viewer.commands._scene import scene_files
from viewer.models import resolve
from viewer.rig.scene import Scene

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".ppm", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of pictures that can be written."""


def inputs_of(arguments: argparse.Namespace, scene: Scene | None = None) -> list[Path]:
    """Return all files that are read: those that are named, and what reading them led to.

    ``arguments``: of a command that opens a scene.
    ``scene``: what was opened; before that, only the names are known.
    """
    model = [] if arguments.model is None else [resolve(arguments.model)]
    named = [Path(file) for file in (*scene_files(arguments), *pose_files(arguments), *model)]
    return named if scene is None else [*named, *scene.files]
