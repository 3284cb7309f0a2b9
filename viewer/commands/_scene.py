"""Options that choose the files to open and their pose, shared by several commands.

Files, captures, driven characters, clean-up and ``--gaps``; then the scene that these options
describe, opened with a progress bar, and the warnings about it.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from viewer.commands._cleanup import clean_up_of
from viewer.commands._pose import add_pose_arguments, apply_pose
from viewer.commands._progress import shown_progress
from viewer.commands._sequence.frame_numbers import add_frame_arguments
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, ViewerError
from viewer.formats import SUFFIXES, Source
from viewer.loading import MotionSettings, begin, bundled_body, bundled_files, read_files
from viewer.loading.settings import CleanUp
from viewer.models import named_files, resolve
from viewer.phrases import printable
from viewer.progress import report
from viewer.rig.bodies.smpl_family import GENDERS
from viewer.rig.scene import Scene
from viewer.rig.units import METRES
from viewer.streams import summary_stream

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rig.retargeting.joint_map import JointMap

_LAYOUTS = ("body19", "panoptic", "coco", "h36m")
"""Keypoint layouts with the same number of points as another one."""
_DEFAULT = "the bundled figure"
_MOST_MODELS = 12  # maximum number of names in a message
_UNITS = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}  # suffixes of sizes, bytes
# Values of --gaps, by the use of the command: pattern, help and metavariable.
_ONE_SECOND = 1.0  # the longest gap if the deprecated --fill-gaps has no value
_LIMIT = r"interpolate(?::(?P<limit>[1-9][0-9]{0,8}|[0-9]{1,6}(?:\.[0-9]{1,6})?s)%s)?"
_PATTERNS = {
    "view": _LIMIT % "",
    "check": "interpolate",
    "write": rf"(?P<alone>hold|split)|{_LIMIT % '(?:,(?P<rest>hold|split))?'}",
}
_WHAT = {
    "view": "gaps in captures: interpolate all, or those of up to N frames or N seconds (2s)",
    "check": "gaps in captures: interpolate all",
    "write": "gaps in captures: hold the pose before the gap (at the start, the first pose), split "
    "the file, or interpolate all or those of up to N frames or N seconds (2s), as in "
    "interpolate:10,split (default: missing frames are omitted from EasyMocap, .obj and arrays; "
    "other formats hold poses)",
}
_METAVAR = {
    "view": "interpolate[:N|:Ns]",
    "check": "interpolate",
    "write": "hold|split|interpolate[:N|:Ns]",
}


def add_scene_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES and the options that pose them; see ``add_file_arguments``."""
    add_file_arguments(parser, default)
    add_capture_arguments(parser)
    add_frame_arguments(parser)
    add_pose_arguments(parser)


def add_file_arguments(parser: argparse.ArgumentParser, default: str = _DEFAULT) -> None:
    """Add FILES and the options that locate them.

    ``parser``: parser of a command.
    ``default``: default if no files are given, for the help; empty if files are required.
    """
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
    add_animation_argument(group)
    parser.set_defaults(springs="off")
    group.add_argument(
        "--rig", metavar="NAME", help="rig of Anny: default, mixamo, game_engine, cmu_mb"
    )
    group.add_argument("--lod", metavar="N", help="level of detail of MHR, 0 (fine) to 6 (coarse)")
    group.add_argument(
        "--body",
        action="store_true",
        help="the bundled human body: next to FILES, or moved by a motion among them",
    )
    group.add_argument(
        "--model-path", metavar="FOLDER", help="folder of body models; the viewer remembers it"
    )
    group.add_argument(
        "--max-size",
        default="2G",
        metavar="SIZE",
        help="maximum size of a file, with suffix k, M or G (default: 2G)",
    )
    group.add_argument(
        "--no-cache",
        action="store_true",
        help="parse all files again instead of using cached arrays (see viewer doctor)",
    )


def add_capture_arguments(parser: argparse.ArgumentParser, gaps: str = "check") -> None:
    """Add the options that control how captures and BVH are read.

    ``parser``: parser of a command.
    ``gaps``: how the command handles gaps, see ``add_gap_arguments``.
    """
    group = parser.add_argument_group("captures and BVH")
    _add_driving_arguments(group)
    group.add_argument(
        "--up", choices=("y", "z", "-y", "-z"), help="up axis of captures and BVH files"
    )
    group.add_argument(
        "--unit", choices=METRES, help="length unit of BVH files (default: estimated)"
    )
    _add_video_arguments(group)
    group.add_argument(
        "--layout",
        choices=_LAYOUTS,
        help="layout of captured keypoints, if their number is ambiguous",
    )
    group.add_argument(
        "--legacy-expression",
        action="store_true",
        help="apply expressions to SMPL-X columns 10 to 19, as EasyMocap does",
    )
    group.add_argument(
        "--beside",
        action="store_true",
        help="show a BVH next to the figures instead of driving one",
    )
    add_gap_arguments(group, gaps)


def _add_driving_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options for motions that drive figures."""
    group.add_argument(
        "--model",
        metavar="FIGURE",
        help="body model for captured bodies, or figure that a BVH file drives: a file, or a name "
        "such as smplx, smplx:female, body or fox (default: one of FILES; for captured bodies, "
        "otherwise their model in the model folder, or the bundled body)",
    )
    group.add_argument(
        "--gender",
        choices=GENDERS,
        help="gender of the body model for captured bodies (default: as stated by their files)",
    )
    group.add_argument(
        "--motion",
        action="append",
        default=[],
        metavar="FILE",
        help="a file whose motion or animation drives a figure, such as a glTF or FBX file that "
        "contains another figure; may be repeated",
    )
    group.add_argument(
        "--source-rest",
        type=_source_rest,
        default="auto",
        metavar="N|zero|auto",
        help="rest pose of a skeleton that drives a figure: frame N, the file's zero pose, or "
        "auto: the zero pose if it is a standing pose, otherwise a T-pose if the joint axes "
        "are parallel to the body's in it, otherwise a frame in a T- or A-pose, otherwise "
        "estimated from the motion (default: auto)",
    )
    group.add_argument(
        "--feet",
        choices=("on", "off"),
        default="on",
        help="plant the feet of driven figures while the feet of the motion are on the ground "
        "(default: on)",
    )
    group.add_argument(
        "--joint-map",
        metavar="FILE",
        help="joints of the driven figure and the joints that drive them, one pair per line, as in "
        "LeftUpLeg = lThigh; others are matched by name (convert --save-joint-map writes such a "
        "file)",
    )


def _add_video_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options of video motion capture, and of cameras' images."""
    group.add_argument(
        "--images",
        metavar="FOLDER",
        help="folder of the cameras' images, as in FOLDER/01/000000.jpg (default: images, next to "
        "the capture); for a single camera also a folder of its numbered images",
    )
    group.add_argument(
        "--video",
        metavar="FILE",
        help="video of a capture's camera, drawn behind the scene when it is seen through that "
        "camera, as it is by default; also sets the frame rate of captures that have none (needs "
        "PyAV)",
    )
    group.add_argument(
        "--space",
        choices=("world", "camera"),
        help="space of video motion capture (default: the world, if the file has it)",
    )
    group.add_argument(
        "--average-shape",
        action="store_true",
        help="average each person's shape over time if the files have one per frame",
    )


def _source_rest(text: str) -> int | str:
    if text in ("zero", "auto"):
        return text
    if re.fullmatch(r"-?\d{1,9}", text):
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a frame number, zero or auto, found {text}")


def add_animation_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--animation``."""
    group.add_argument(
        "--animation",
        metavar="NAME",
        help="animation of a file to play: a name, a number from 1, or none; viewer "
        "info lists them (default: the first)",
    )


def motion_settings(arguments: argparse.Namespace) -> MotionSettings:
    """Return the requested settings for reading motions.

    Raises ViewerError if there are both a video and a folder of images.
    """
    if arguments.video is not None and arguments.images is not None:
        raise ViewerError("--video and --images: expected one of them, found both")
    return MotionSettings(
        model=arguments.model,
        gender=arguments.gender or "",
        rig=arguments.rig or "",
        lod=arguments.lod or "",
        frame_rate=arguments.fps,
        space=arguments.space or "",
        is_overlay=getattr(arguments, "overlay", None) is not None,
        average_shape=arguments.average_shape,
        source_rest=arguments.source_rest,
        feet=arguments.feet == "on",
        joint_map=_joint_map(arguments),
        up=arguments.up or "",
        unit=arguments.unit or "",
        flat_hands=None if arguments.hands is None else arguments.hands == "flat",
        layout=arguments.layout or "",
        legacy_expression=arguments.legacy_expression,
        drives=not arguments.beside,
        images=None if arguments.images is None else Path(arguments.images),
        video=None if arguments.video is None else Path(arguments.video),
        animation=arguments.animation or "",
        motions=tuple(resolve(file) for file in arguments.motion),
        springs=arguments.springs == "on",
    )


def _joint_map(arguments: argparse.Namespace) -> JointMap | None:
    """Return the requested match of joints; raises FormatError if its file cannot be read."""
    if arguments.joint_map is None:
        return None
    from viewer.formats._joint_map import read_joint_map

    return read_joint_map(Source.open(arguments.joint_map, size_limit(arguments)))


def size_limit(arguments: argparse.Namespace) -> int:
    """Return the file size limit in bytes."""
    return parse_bytes(arguments.max_size)


def parse_bytes(text: str, option: str = "--max-size") -> int:
    """Return the number of bytes that an option specifies, such as ``2G``.

    Raises ViewerError if the text is not such a number.
    """
    found = re.fullmatch(r"(\d{1,15})([kKmMgG]?)", text)
    if not found:
        raise ViewerError(f'{option}: expected a number with k, M or G, found "{text}"')
    return int(found[1]) * _UNITS.get(found[2].lower(), 1)


def scene_files(arguments: argparse.Namespace) -> list[str | Path]:
    """Return the files to open: as given or found by name, and the bundled body."""
    files: list[str | Path] = [path for file in arguments.files for path in named_files(file)]
    if arguments.body:
        files.append(bundled_body())
    return files


def open_scene(arguments: argparse.Namespace) -> Scene:
    """Load the files completely, print their readers' warnings, and pose them as requested."""
    changes = clean_up_of(arguments)
    scene, builders = begin_scene(arguments)
    for builder in builders:
        finish(builder, scene)
    if not changes.is_empty:
        clean(scene, changes, getattr(arguments, "output", None))
        arguments.fps = changes.rate or arguments.fps  # frames have this rate from now on
    print_warnings(apply_pose(scene, arguments))
    return scene


def clean(scene: Scene, changes: CleanUp, output: str | None = None) -> None:
    """Clean up captured motions in place, and print the changes unless they are the output."""
    from viewer.loading.cleaning import clean_up

    stream = sys.stdout if output is None else summary_stream(output)
    for note in clean_up(scene, changes):
        print(note, file=stream)


def finish(builder: Builder, scene: Scene) -> None:
    """Read a capture to its end, with a progress bar in a terminal, and print warnings."""
    from viewer.commands._progress import Progress

    notes: list[Diagnostic] = []
    with Progress(f"reading {builder.capture.name}", builder.capture.n_frames) as progress:
        while not builder.is_done:
            new, said = builder.read_some()
            scene.actors += new
            notes += said
            progress.show(builder.n_read)
            report(builder.n_read, builder.capture.n_frames, "frames")
    scene.diagnostics = (*scene.diagnostics, *notes)  # the window shows them too
    print_warnings(notes)


def use_models(arguments: argparse.Namespace) -> None:
    """Use the folder of body models of ``--model-path``, before any name is looked up in it."""
    if arguments.model_path is not None:
        from viewer.models import use_model_folder

        print_warnings(filter(None, [use_model_folder(arguments.model_path)]))


def begin_scene(arguments: argparse.Namespace) -> tuple[Scene, list[Builder]]:
    """Load enough for a first image, without posing the scene, and print warnings."""
    use_models(arguments)
    files = scene_files(arguments)
    settings = motion_settings(arguments)
    try:
        with shown_progress("reading"):
            limit = parse_bytes(arguments.max_size)
            contents = read_files(files or bundled_files(), limit, settings)
            scene, builders = begin(contents, settings)
    except FormatError as problem:
        named = [*arguments.files, *filter(None, [arguments.model])]
        raise _with_models(problem, named) from None
    print_warnings(scene.diagnostics)
    return scene, builders


def _with_models(problem: FormatError, files: Sequence[str]) -> ViewerError:
    """Add the names of available models to an error about an unknown name."""
    from viewer.models import known_models, load_model_folder
    from viewer.near_names import did_you_mean

    folder = load_model_folder()
    missing = [file for file in files if Path(file) == problem.path and not problem.path.exists()]
    if not missing or folder is None or len(problem.path.parts) != 1:
        return problem
    models = [*known_models(folder)]
    near = did_you_mean(str(problem.path), models) if len(models) > _MOST_MODELS else ""
    values = {"folder": folder, "near": near, "names": models[:_MOST_MODELS]}
    key = "F001.no-model-near" if near else "F001.no-model"
    return FormatError(Diagnostic(key, problem.path, values=values))


def print_warnings(warnings: Iterable[str | Diagnostic], plain: str = "warning") -> None:
    """Print one line per warning or note to the error stream, unless the run is recorded.

    Plain strings have the severity ``plain``; errors in a file that was opened nevertheless are
    warnings.
    """
    for warning in warnings:
        if not note_found(warning, plain):
            severity = warning.severity if isinstance(warning, Diagnostic) else plain
            print(f"{'note' if severity == 'note' else 'warning'}: {warning}", file=sys.stderr)


def add_gap_arguments(group: argparse._ArgumentGroup, use: str) -> None:
    """Add ``--gaps``, and deprecated options for its values, which are hidden in the help.

    ``group``: options of a command.
    ``use``: ``"view"``; ``"check"`` for commands that do not clean up; ``"write"``.
    Parsing sets ``gaps``: ``"hold"``, ``"split"`` or None; ``interpolate_gaps``: whether all gaps
      are interpolated; ``fill_gaps``: the longest gap that clean-up interpolates, frames as an
      integer or seconds as a float, or None.
    """
    group.add_argument("--gaps", action=_Gaps, metavar=_METAVAR[use], help=_WHAT[use], const=use)
    hidden = argparse.SUPPRESS
    group.add_argument("--interpolate-gaps", action="store_true", help=hidden)
    if use == "check":
        return
    group.add_argument("--fill-gaps", nargs="?", type=_longest, const=_ONE_SECOND, help=hidden)


class _Gaps(argparse.Action):
    """Parses the value of ``--gaps`` into the results of all three options."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Store the results, or raise ArgumentError."""
        text, use = str(values), str(self.const)
        found = re.fullmatch(_PATTERNS[use], text)
        if found is None:
            raise argparse.ArgumentError(
                self, f"expected {_METAVAR[use]}, found {printable(text, 60)}"
            )
        parts = found.groupdict()
        namespace.gaps = parts.get("alone") or parts.get("rest")
        limit = parts.get("limit")
        namespace.interpolate_gaps = limit is None and parts.get("alone") is None
        if use != "check":
            is_time = limit is not None and limit.endswith("s")
            longest = float(limit[:-1]) if limit is not None and is_time else int(limit or 0)
            namespace.fill_gaps = None if limit is None else longest


def _longest(text: str) -> int:
    """Return the length of the longest gap in frames."""
    if not re.fullmatch(r"[1-9]\d{0,8}", text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f"expected a number of frames, or no value and the files before the option, found "
            f"{printable(text, 60)}"
        )
    return int(text)
