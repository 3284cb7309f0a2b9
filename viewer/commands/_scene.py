"""Options that say what is opened and how it is posed; shared by the commands that open files."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._frame_numbers import add_frame_arguments
from viewer.commands._pose import add_pose_arguments, apply_pose
from viewer.commands._progress import Progress
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, ViewerError, printable
from viewer.formats import SUFFIXES
from viewer.loading import MotionSettings, begin, bundled_body, bundled_files, read_files
from viewer.models import known_models, load_model_folder, resolve, save_model_folder
from viewer.near_names import did_you_mean
from viewer.rig.scene import Scene
from viewer.rig.units import METRES

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder

LAYOUTS = ("body19", "panoptic", "coco", "h36m")
"""Keypoint layouts that share their number of points with another."""

_DEFAULT = "the bundled figure"
_MOST_MODELS = 12  # names in a message
_SLOW_BYTES = 60e6  # about a second of reading
_UNITS = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}


def add_scene_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES and the options that pose what they hold; see ``add_file_arguments``."""
    add_file_arguments(parser, default)
    add_capture_arguments(parser)
    add_frame_arguments(parser)
    add_pose_arguments(parser)


def add_file_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES and the options that say where they are.

    ``parser``: of a command.
    ``default``: what is opened without files, for the help; empty if that is refused.
    """
    group = parser.add_argument_group("files")
    group.add_argument(
        "files",
        nargs="*",
        metavar="FILES",
        help=f"files ({', '.join(SUFFIXES)}), folders of PIG or EasyMocap, names of body models in "
        "the model folder, as smplx:neutral, a texture picture; see viewer help formats"
        f"{f' (default: {default})' if default else ''}",
    )
    group.add_argument("--body", action="store_true", help="open the bundled human body too")
    group.add_argument(
        "--model-path", metavar="FOLDER", help="where body models are; remembered from then on"
    )
    group.add_argument(
        "--max-size",
        default="2G",
        metavar="SIZE",
        help="refuse larger files, with k, M or G (default: 2G)",
    )


def add_capture_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how captures and BVH are taken."""
    group = parser.add_argument_group("captures and BVH")
    group.add_argument(
        "--model",
        metavar="FIGURE",
        help="draw captured bodies with this model, and let BVH drive it (default: one among "
        "FILES, for captured bodies else the bundled one)",
    )
    group.add_argument(
        "--up", choices=("y", "z", "-y", "-z"), help="the axis that points up in captures and BVH"
    )
    group.add_argument("--unit", choices=METRES, help="unit of lengths in BVH (default: judged)")
    group.add_argument(
        "--layout",
        choices=LAYOUTS,
        help="what captured keypoints are where their number leaves a choice",
    )
    group.add_argument(
        "--legacy-expression",
        action="store_true",
        help="expressions drive SMPL-X columns 10 to 19, as EasyMocap has it",
    )
    group.add_argument(
        "--beside", action="store_true", help="a BVH stands beside figures instead of driving one"
    )
    group.add_argument(
        "--fill-gaps", action="store_true", help="show captures in their gaps too, in between"
    )


def motion_settings(arguments: argparse.Namespace) -> MotionSettings:
    """Return how motions are asked to be taken."""
    model = None if arguments.model is None else resolve(arguments.model)
    return MotionSettings(
        model=None if model is None else Path(model),
        frame_rate=arguments.fps,
        up=arguments.up or "",
        unit=arguments.unit or "",
        flat_hands=None if arguments.hands is None else arguments.hands == "flat",
        layout=arguments.layout or "",
        legacy_expression=arguments.legacy_expression,
        drives=not arguments.beside,
    )


def size_limit(arguments: argparse.Namespace) -> int:
    """Return the size, in bytes, above which files are refused."""
    return _parse_bytes(arguments.max_size)


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
    """Load the files whole, print what their readers noticed, and pose them as asked."""
    scene, builders = begin_scene(arguments)
    for builder in builders:
        finish(builder, scene)
    print_warnings(apply_pose(scene, arguments))
    return scene


def finish(builder: Builder, scene: Scene) -> None:
    """Read a capture to its end, with progress at a terminal, and print what was noticed."""
    notes: list[Diagnostic] = []
    with Progress(f"reading {builder.capture.name}", builder.capture.n_frames) as progress:
        while not builder.is_done:
            new, said = builder.read_some()
            scene.actors += new
            notes += said
            progress.show(builder.n_read)
    scene.diagnostics = (*scene.diagnostics, *notes)  # the window and its pictures show them too
    print_warnings(notes)


def begin_scene(arguments: argparse.Namespace) -> tuple[Scene, list[Builder]]:
    """Load what is needed for a first picture, and print what was noticed; not posed yet."""
    if arguments.model_path is not None:
        save_model_folder(arguments.model_path)
    files = scene_files(arguments)
    _announce(files)
    settings = motion_settings(arguments)
    try:
        contents = read_files(files or bundled_files(), _parse_bytes(arguments.max_size), settings)
        scene, builders = begin(contents, settings)
    except FormatError as problem:
        named = [*arguments.files, *filter(None, [arguments.model])]
        raise _with_models(problem, named) from None
    print_warnings(scene.diagnostics)
    return scene, builders


def _with_models(problem: FormatError, files: Sequence[str]) -> ViewerError:
    """Name the models that can be opened by name, if it was a name that was not found."""
    folder = load_model_folder()
    missing = [file for file in files if Path(file) == problem.path and not problem.path.exists()]
    if not missing or folder is None or len(problem.path.parts) != 1:
        return problem
    models = [*known_models(folder)]
    near = did_you_mean(str(problem.path), models) if len(models) > _MOST_MODELS else ""
    values = {"folder": folder, "near": near, "names": models[:_MOST_MODELS]}
    key = "F001.no-model-near" if near else "F001.no-model"
    return FormatError(Diagnostic(key, problem.path, values=values))


def _announce(files: Sequence[str | Path]) -> None:
    """Tell a person at a terminal about reading that takes longer than a second."""
    if not sys.stderr.isatty():
        return
    for file in files:
        with contextlib.suppress(OSError, ValueError):  # the reader will say what is wrong
            size = Path(file).stat().st_size
            if size > _SLOW_BYTES:
                print(f"reading {printable(file)} ({size / 1e6:.0f} MB) …", file=sys.stderr)


def print_warnings(warnings: Iterable[str | Diagnostic]) -> None:
    """Print one line each to the error stream."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
