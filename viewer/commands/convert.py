"""Write a posed figure into a file for other programs: mesh, arrays, or a course rig."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._output import check_output
from viewer.commands._pose import add_skinning_arguments, skinning_of
from viewer.commands._scene import add_scene_arguments, open_scene, scene_files
from viewer.errors import OutputError, printable
from viewer.export import EXPORTERS, export, exporter_for

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
    inputs = [Path(file) for file in scene_files(arguments)]
    for path in _written(output):
        check_output(path, inputs, arguments.force)
    skinning = skinning_of(arguments)
    scene = open_scene(arguments)
    paths = [output] + [
        output.with_name(f"{output.stem}-{number}{output.suffix}")
        for number in range(2, len(scene.actors) + 1)
    ]
    for path in paths[1:]:
        for beside in _written(path):
            check_output(beside, inputs, arguments.force)
    for actor, path in zip(scene.actors, paths, strict=True):
        for line in export(actor, path, skinning):
            print(line)
    return 0


def _written(path: Path) -> list[Path]:
    """Return all that is written for one output: a rig is two files."""
    if not path.parent.is_dir():
        raise OutputError(f"{printable(path, 300)}: the folder does not exist")
    suffixes = EXPORTERS[exporter_for(path)].suffixes
    if suffixes == (".skel", ".skin"):
        return [path.with_suffix(suffix) for suffix in suffixes]
    return [path]
