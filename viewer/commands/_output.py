"""Output files: their suffixes, and the input files that must never be replaced."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._pose import pose_files
from viewer.commands._scene import scene_files
from viewer.models import named_files, resolve
from viewer.rig.scene import Scene

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".ppm", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of writable image formats."""


def inputs_of(arguments: argparse.Namespace, scene: Scene | None = None) -> list[Path]:
    """Return all files that are read: the named files, and those they refer to.

    ``arguments``: arguments of a command that opens a scene.
    ``scene``: the opened scene; if omitted, only the named files are returned.
    """
    model = [] if arguments.model is None else named_files(arguments.model, arguments.gender or "")
    more = [*model, *map(resolve, arguments.motion)]
    more += [] if arguments.joint_map is None else [arguments.joint_map]
    named = [Path(file) for file in (*scene_files(arguments), *pose_files(arguments), *more)]
    return named if scene is None else [*named, *scene.files]
