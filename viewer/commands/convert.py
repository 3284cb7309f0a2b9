"""Write a posed figure into a file for other programs: mesh, arrays, or a course rig."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._output import check_output
from viewer.commands._pose import add_skinning_arguments, pose_files, skinning_of
from viewer.commands._scene import add_scene_arguments, open_scene, scene_files
from viewer.errors import OutputError, printable
from viewer.export import EXPORTERS, export, exporter_for, files_written
from viewer.formats import all_or_none

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_scene_arguments(parser)
    kinds = ", ".join(suffix for kind in EXPORTERS.values() for suffix in kind.suffixes)
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=kinds)
    parser.add_argument("--force", action="store_true", help="replace existing files")
    add_skinning_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write one file for each actor, and say what was written and what was lost."""
    output = Path(arguments.output)
    exporter_for(output)
    for path in _written(output):
        check_output(path, _inputs(arguments), arguments.force)
    skinning = skinning_of(arguments)
    scene = open_scene(arguments)
    inputs = _inputs(arguments)  # --model-path counts from now on
    paths = [output] + [
        output.with_name(f"{output.stem}-{number}{output.suffix}")
        for number in range(2, len(scene.actors) + 1)
    ]
    files = [file for path in paths for file in _written(path)]
    for file in files:
        check_output(file, inputs, arguments.force)
    lines = []
    with all_or_none(files):
        for actor, path in zip(scene.actors, paths, strict=True):
            lines += export(actor, path, skinning)
    print("\n".join(lines))
    return 0


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    return [Path(file) for file in (*scene_files(arguments), *pose_files(arguments))]


def _written(path: Path) -> list[Path]:
    """Return all that is written for one output, in a folder that exists."""
    if not path.parent.is_dir():
        raise OutputError(f"{printable(path, 300)}: the folder does not exist")
    return files_written(path)
