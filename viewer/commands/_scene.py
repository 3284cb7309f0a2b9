"""Options that say what is opened and how it is posed; shared by the commands that open files."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from viewer.commands._pose import add_pose_arguments, apply_pose
from viewer.errors import FormatError, ViewerError, printable
from viewer.loading import bundled_body, load
from viewer.models import known_models, load_model_folder, resolve, save_model_folder
from viewer.rig.scene import Scene

__all__ = ["add_scene_arguments", "open_scene", "print_warnings", "scene_files"]

_SLOW_BYTES = 60e6  # about a second of reading
_UNITS = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}


def add_scene_arguments(parser: argparse.ArgumentParser) -> None:
    """Add FILES and the options that pose what they hold."""
    parser.add_argument(
        "files",
        nargs="*",
        metavar="FILES",
        help=".skel, .skin, .anim files; body models (.npz, .pkl) or their names in the model "
        "folder, as smplx:neutral; PIG folders; poses; a texture picture",
    )
    parser.add_argument("--body", action="store_true", help="open the bundled human body too")
    parser.add_argument(
        "--model-path", metavar="FOLDER", help="where body models are; remembered from then on"
    )
    parser.add_argument(
        "--max-size", default="2G", metavar="SIZE", help="refuse larger files (default 2G)"
    )
    add_pose_arguments(parser)


def _parse_bytes(text: str) -> int:
    found = re.fullmatch(r"(\d{1,15})([kKmMgG]?)", text)
    if not found:
        raise ViewerError(f'--max-size: expected a number with k, M or G, found "{text}"')
    return int(found[1]) * _UNITS.get(found[2].lower(), 1)


def scene_files(arguments: argparse.Namespace) -> list[str | Path]:
    """Return what is opened: the files as given or found by name, and the bundled body."""
    files: list[str | Path] = [resolve(file) for file in arguments.files]
    if arguments.body:
        files.append(bundled_body())
    return files


def open_scene(arguments: argparse.Namespace) -> Scene:
    """Load the files, print what their readers noticed, and pose them as asked."""
    if arguments.model_path is not None:
        save_model_folder(arguments.model_path)
    files = scene_files(arguments)
    _announce(files)
    try:
        scene = load(*files, max_size=_parse_bytes(arguments.max_size))
    except FormatError as problem:
        raise _with_models(problem, arguments.files) from None
    print_warnings(scene.warnings)
    print_warnings(apply_pose(scene, arguments))
    return scene


def _with_models(problem: FormatError, files: Sequence[str]) -> ViewerError:
    """Name the models that can be opened by name, if it was a name that was not found."""
    folder = load_model_folder()
    missing = [file for file in files if Path(file) == problem.path and not problem.path.exists()]
    if not missing or folder is None or len(problem.path.parts) != 1:
        return problem
    names = ", ".join(list(known_models(folder))[:12]) or "none"
    return FormatError(
        problem.path,
        f"no such file, and no such model in {printable(folder, 200)}; models there: {names}",
    )


def _announce(files: Sequence[str | Path]) -> None:
    """Tell a person at a terminal about reading that takes longer than a second."""
    if not sys.stderr.isatty():
        return
    for file in files:
        with contextlib.suppress(OSError, ValueError):  # the reader will say what is wrong
            size = Path(file).stat().st_size
            if size > _SLOW_BYTES:
                print(f"reading {printable(file)} ({size / 1e6:.0f} MB) …", file=sys.stderr)


def print_warnings(warnings: Sequence[str]) -> None:
    """Print one line each to the error stream."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
