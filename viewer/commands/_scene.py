"""Options that choose the files to open and their pose, shared by several commands.

Files, captures, driven characters, clean-up and ``--gaps``; then the scene that these options
describe, opened with a progress bar, and the warnings about it.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import GapUse, add_gap_arguments, clean_up_of
from viewer.commands._frames import Frames, add_frame_arguments, frames_of
from viewer.commands._pose import PoseOptions, add_pose_arguments, apply_pose
from viewer.commands._progress import shown_progress
from viewer.commands._settings import add_settings, settings_of
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, ViewerError
from viewer.formats import SUFFIXES, Source
from viewer.loading import MotionSettings, begin, bundled_body, bundled_files, read_files
from viewer.loading.settings import CleanUp
from viewer.models import named_files, resolve
from viewer.progress import report
from viewer.rigs.scene import Scene
from viewer.streams import summary_stream

if TYPE_CHECKING:
    from viewer.diagnostics.codes import Severity
    from viewer.loading.capturing import Builder
    from viewer.rigs.retargeting.joint_map import JointMap

_DEFAULT = "the bundled figure"
_UNITS = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}  # suffixes of sizes, bytes


@dataclass(slots=True)
class SceneOptions:
    """The files to open, and how they are read, cleaned up and posed."""

    files: list[str]
    """As given: files, folders, and names of models."""
    body: bool = setting(
        False, "the bundled human body: next to FILES, or moved by a motion among them"
    )
    model_path: str | None = setting(
        None, "folder of body models; the viewer remembers it", metavar="FOLDER"
    )
    max_size: str = setting(
        "2G", "maximum size of a file, with suffix k, M or G (default: {default})", metavar="SIZE"
    )
    no_cache: bool = setting(
        False, "parse all files again instead of using cached arrays (see viewer doctor)"
    )
    motion_files: list[str] = setting(
        [],
        "a file whose motion or animation drives a figure, such as a glTF or FBX file that "
        "contains another figure; may be repeated",
        flag="--motion",
        metavar="FILE",
    )
    joint_map: str | None = setting(
        None,
        "joints of the driven figure and the joints that drive them, one pair per line, as in "
        "LeftUpLeg = lThigh; others are matched by name (convert --save-joint-map writes such a "
        "file)",
        metavar="FILE",
    )
    motion: MotionSettings = MotionSettings()
    changes: CleanUp = CleanUp()
    frames: Frames = field(default_factory=Frames)
    pose: PoseOptions = field(default_factory=PoseOptions)
    output: str | None = None
    """The file that the command writes, if it has one."""

    @property
    def size_limit(self) -> int:
        """File size limit in bytes."""
        return parse_bytes(self.max_size)

    @property
    def paths(self) -> list[str | Path]:
        """The files to open: as given or found by name, and the bundled body."""
        files: list[str | Path] = [path for file in self.files for path in named_files(file)]
        return [*files, bundled_body()] if self.body else files


def add_scene_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES and the options that pose them; see ``add_file_arguments``."""
    add_file_arguments(parser, default)
    add_capture_arguments(parser)
    add_frame_arguments(parser)
    add_pose_arguments(parser)


def add_file_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES, which are required if ``default`` is empty, and the options that locate them."""
    group = parser.add_argument_group("files")
    group.add_argument(
        "files",
        nargs="*",
        metavar="FILES",
        help=f"files ({', '.join(SUFFIXES)}), folders (PIG, EasyMocap and others), names of body "
        "models in the model folder, such as smplx:neutral, a texture image; see viewer help "
        "formats"
        f"{f' (default: {default})' if default else ''}",
    )
    add_settings(group, MotionSettings, "animation", "rig", "lod")
    parser.set_defaults(springs="off")
    add_settings(group, SceneOptions, "body", "model_path", "max_size", "no_cache")


def add_capture_arguments(parser: argparse.ArgumentParser, gaps: GapUse = "check") -> None:
    """Add the options that control how captures and BVH are read."""
    group = parser.add_argument_group("captures and BVH")
    add_settings(group, MotionSettings, "model", "gender")
    add_settings(group, SceneOptions, "motion_files")
    add_driving_arguments(group)
    add_settings(group, SceneOptions, "joint_map")
    names = "up", "unit", "images", "video", "space", "average_shape", "layout"
    add_settings(group, MotionSettings, *names, "legacy_expression", "drives")
    add_gap_arguments(group, gaps)


def add_driving_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options that control how motions drive figures."""
    add_settings(group, MotionSettings, "source_rest", type=_source_rest)
    add_settings(group, MotionSettings, "feet", "hand_contact")


def _source_rest(text: str) -> int | str:
    if text in ("zero", "auto"):
        return text
    if re.fullmatch(r"-?\d{1,9}", text):
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a frame number, zero or auto, found {text}")


def scene_options(arguments: argparse.Namespace) -> SceneOptions:
    """Return the requested files, and how they are opened and posed."""
    if arguments.video is not None and arguments.images is not None:
        raise ViewerError("--video and --images: expected one of them, found both")
    options = settings_of(SceneOptions, arguments, files=arguments.files)
    use_models(options.model_path)
    joint_map: JointMap | None = None
    if options.joint_map is not None:
        from viewer.formats._joint_map import read_joint_map

        joint_map = read_joint_map(Source.open(options.joint_map, options.size_limit))
    options.motion = settings_of(
        MotionSettings,
        arguments,
        frame_rate=arguments.fps,
        is_overlay=getattr(arguments, "overlay", None) is not None,
        joint_map=joint_map,
        flat_hands=None if arguments.hands is None else arguments.hands == "flat",
        motions=tuple(resolve(file) for file in options.motion_files),
    )
    options.changes, options.frames = clean_up_of(arguments), frames_of(arguments)
    options.pose = settings_of(PoseOptions, arguments)
    options.output = getattr(arguments, "output", None)
    return options


def parse_bytes(text: str, option: str = "--max-size") -> int:
    """Return the number of bytes that an option specifies, such as ``2G``."""
    found = re.fullmatch(r"(\d{1,15})([kKmMgG]?)", text)
    if not found:
        raise ViewerError(f'{option}: expected a number with k, M or G, found "{text}"')
    return int(found[1]) * _UNITS.get(found[2].lower(), 1)


def inputs_of(options: SceneOptions, scene: Scene | None = None) -> list[Path]:
    """Return the named files and, if the scene is given, those they refer to."""
    motion = options.motion
    model = [] if motion.model is None else named_files(motion.model, motion.gender)
    more: list[str | Path] = [*options.pose.files, *model, *motion.motions]
    more += [] if options.joint_map is None else [options.joint_map]
    named = [Path(file) for file in (*options.paths, *more)]
    return named if scene is None else [*named, *scene.files]


def open_scene(options: SceneOptions) -> Scene:
    """Load the files completely, print their readers' warnings, and pose them as requested."""
    changes = options.changes
    scene, builders = begin_scene(options)
    for builder in builders:
        finish(builder, scene, changes)
    if not changes.is_empty:
        clean(scene, changes, options.output)
        # Frames have this rate from now on.
        options.frames.fps = changes.rate or options.frames.fps
    print_warnings(apply_pose(scene, options.pose, options.frames))
    return scene


def clean(scene: Scene, changes: CleanUp, output: str | None = None) -> None:
    """Clean up captured motions in place, and print the changes unless they are the output."""
    from viewer.loading.cleaning import clean_up

    stream = sys.stdout if output is None else summary_stream(output)
    for note in clean_up(scene, changes):
        print(note, file=stream)


def finish(builder: Builder, scene: Scene, changes: CleanUp) -> None:
    """Read a capture to its end, with a progress bar in a terminal, and print warnings.

    ``changes``: what ``clean`` will do.
    """
    notes: list[Diagnostic] = []
    with shown_progress(f"reading {builder.capture.name}"):
        while not builder.is_done:
            new, said = builder.read_some()
            scene.actors += new
            notes += said
            report(builder.n_read, builder.capture.n_frames, "frames")
    notes = _unsolved(notes, changes)
    scene.diagnostics = (*scene.diagnostics, *notes)  # the window shows them too
    print_warnings(notes)


def _unsolved(notes: Iterable[Diagnostic], changes: CleanUp) -> list[Diagnostic]:
    """Return the notes whose remedy was not requested."""
    solved = ("F007.feet-far", "F007.feet-far-lowest") if changes.grounds else ()
    return [each for each in notes if each.key not in solved]


def use_models(folder: str | None) -> None:
    """Use the folder of body models of ``--model-path``, before any name is looked up in it."""
    if folder is not None:
        from viewer.models import use_model_folder

        print_warnings(filter(None, [use_model_folder(folder)]))


def begin_scene(options: SceneOptions) -> tuple[Scene, list[Builder]]:
    """Load enough for a first image, without posing the scene, and print warnings."""
    files = options.paths
    try:
        with shown_progress("reading"):
            contents = read_files(files or bundled_files(), options.size_limit, options.motion)
            scene, builders = begin(contents, options.motion)
    except FormatError as problem:
        from viewer.models.download import with_models

        model = options.motion.model
        named = [*options.files, *([] if model is None else [model])]
        raise with_models(problem, named) from None
    scene.diagnostics = tuple(_unsolved(scene.diagnostics, options.changes))
    print_warnings(scene.diagnostics)
    return scene, builders


def print_warnings(warnings: Iterable[str | Diagnostic], plain: Severity = "warning") -> None:
    """Print a line per warning or note, ``plain`` for strings, unless the run is recorded.

    Notes do not repeat the file of the line above.
    """
    named = ""
    for warning in warnings:
        if note_found(warning, plain):
            continue
        found = warning if isinstance(warning, Diagnostic) else None
        place = "" if found is None else found.place
        if (plain if found is None else found.severity) != "note":
            # Errors in a file that was opened nevertheless are warnings.
            print(f"warning: {warning}", file=sys.stderr)
        elif found is not None and place == named != "":
            print(f"note:   {found.message}", file=sys.stderr)
        else:
            print(f"note: {warning}", file=sys.stderr)
        named = place
