"""Rig transfer from a figure to an unrigged mesh."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TextIO

import numpy as np

from viewer.autorig.alignment.orientation_search import AXES
from viewer.autorig.alignment.surface_alignment import SCALES, AlignmentSettings
from viewer.autorig.correspondence.matching import MatchSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import JOINTS, METHODS, TransferSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.commands._landmarks import read_landmarks
from viewer.commands._numbers import number
from viewer.commands._pose import add_pose_arguments, apply_pose, pose_files
from viewer.commands._progress import Progress
from viewer.commands._scene import print_warnings
from viewer.commands._sequence.frame_numbers import add_frame_arguments
from viewer.commands._transferred_clips import add_clip_argument, read_clips, write_clips
from viewer.commands._writing.vrm_meta import add_vrm_arguments, vrm_meta
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, RigError, ViewerError
from viewer.export import check_figure, exporter_for
from viewer.export._rigged_files import files_of, write_rigged
from viewer.export.vrm.meta import checked_meta
from viewer.formats import MESHES, Source, all_or_none, check_targets
from viewer.loading import MotionSettings, bundled_body, bundled_files, load
from viewer.models import named_files, resolve
from viewer.models.bundled import BUNDLED
from viewer.near_names import did_you_mean
from viewer.phrases import printable
from viewer.rig.figure import Figure
from viewer.rig.posing.posed_mesh import posed_mesh
from viewer.rig.scene import Actor, Scene
from viewer.streams import require_stdout, summary_stream

__all__ = ["add_arguments", "run"]

_SMOOTHING = 10  # number of iterations if --smooth has no value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s TARGET [-o FILE] [options]"
    parser.add_argument(
        "files",
        nargs="+",
        metavar="TARGET",
        help=f"the mesh: {', '.join(MESHES)}; and its texture image",
    )
    parser.add_argument(
        "--from",
        dest="template",
        action="append",
        default=[],
        metavar="FIGURE",
        help="the rigged figure: any file, a model's name, body (default) or fox; repeat it for "
        "other files of the figure or its motion",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=".skel (with .skin, .obj, .json), .npz, .glb, .gltf or .vrm",
    )
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument(
        "--rig", metavar="NAME", help="rig of the template, for Anny (default: default)"
    )
    add_clip_argument(parser)
    parser.add_argument("--view", action="store_true", help="open the result in a window")
    _add_method_arguments(parser)
    _add_alignment_arguments(parser)
    add_vrm_arguments(parser)
    _add_template_pose_arguments(parser)


def _add_template_pose_arguments(parser: argparse.ArgumentParser) -> None:
    add_frame_arguments(parser)
    add_pose_arguments(parser)
    parser.add_argument(
        "--template-pose",
        dest="pose",
        metavar="FILE|A,B,…",
        help="the template's pose, similar to the target's pose, given as for --pose",
    )
    parser.add_argument(
        "--template-frame",
        type=int,
        metavar="N",
        help="a frame of the template's motion, numbered as for --frame",
    )
    parser.set_defaults(interpolate_gaps=False)


def _add_method_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("method")
    texts = "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    group.add_argument("--method", choices=METHODS, default="robust", help=texts)
    group.add_argument(
        "--max-distance",
        type=number,
        default=0.05,
        metavar="X",
        help="maximum distance of matching points, relative to the target's size (default: 0.05)",
    )
    group.add_argument(
        "--max-angle",
        type=number,
        default=30.0,
        metavar="DEG",
        help="maximum angle between the normals of matching points (default: 30)",
    )
    group.add_argument(
        "--smooth",
        type=int,
        nargs="?",
        const=_SMOOTHING,
        default=0,
        metavar="N",
        help=f"smooth inpainted weights, N iterations ({_SMOOTHING} without a number)",
    )
    group.add_argument(
        "--max-influences", type=int, metavar="N", help="keep each vertex's N strongest influences"
    )
    group.add_argument(
        "--joints",
        choices=JOINTS,
        default="surface",
        help="place joints by the surface around them, or only by the alignment (default: surface)",
    )
    group.add_argument(
        "--no-fit",
        action="store_true",
        help="keep the template's pose and proportions, even if rotating its joints and scaling "
        "its limbs would align it with the mesh much better",
    )
    group.add_argument(
        "--no-correctives", action="store_true", help="omit the template's pose correctives"
    )


def _add_alignment_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("alignment")
    group.add_argument("--up", choices=AXES, help="up axis of the target (default: estimated)")
    group.add_argument("--facing", choices=AXES, help="front of the target (default: estimated)")
    group.add_argument(
        "--scale",
        choices=SCALES,
        default="uniform",
        help="scale of the template: one factor, one factor per axis, or none (default: uniform)",
    )
    group.add_argument(
        "--landmarks",
        metavar="FILE",
        help="file with three or more pairs of points, one per line: a joint or position of the "
        "posed template, and a position on the target",
    )
    group.add_argument(
        "--no-refine", action="store_true", help="skip the refinement of the alignment"
    )


def run(arguments: argparse.Namespace) -> int:
    """Rig the mesh, print a report, write it, and show it if requested."""
    output = None if arguments.output is None else Path(arguments.output)
    meta = vrm_meta(arguments, output)
    inputs = _inputs(arguments)
    if output is not None:
        require_stdout(output)
        check_targets(files_of(output), inputs, arguments.force)
    target = _target(arguments, inputs)
    if output is not None and output.suffix.lower() == ".vrm":
        checked_meta(meta, target.name)  # checked early, as the rig transfer takes long
    template = _template(arguments, inputs)
    if output is not None and output.suffix.lower() != ".npz":
        # The rigged mesh gets the template's joints, and the rig transfer takes long.
        check_figure(exporter_for(output), template.figure)
    settings = _settings(arguments, template, output)
    clips = read_clips(arguments, _files(arguments), template.figure)
    files = [] if output is None else [*files_of(output), *(clip.path for clip in clips)]
    check_targets(files, inputs, arguments.force)
    title = f"rigging {printable(target.name, 40)}"
    with Progress(title, 100) as progress:
        rigged = transfer(
            template.figure,
            template.require_pose(),
            target.require_mesh(),
            settings,
            lambda fraction, what: progress.show(round(100.0 * fraction)),
            name=target.name,
        )
    stream = sys.stdout if output is None else summary_stream(output)
    _print_report(rigged, stream)
    if output is not None:
        with all_or_none(files):
            written = [*write_rigged(rigged, output, meta), *write_clips(rigged, clips)]
        for note in written:
            note_found(note)
        print("\n".join(map(str, written)), file=stream)
    if arguments.view:
        _show(rigged, target)
    return 0


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    named = [*arguments.files, *arguments.template, *pose_files(arguments)]
    named += arguments.clips
    named += [arguments.landmarks] if arguments.landmarks else []
    return [Path(file) for file in (*map(resolve, named), bundled_body(), *bundled_files())]


def _target(arguments: argparse.Namespace, inputs: list[Path]) -> Figure:
    """Return the mesh to rig; a mesh that has a rig is used in its current pose."""
    scene = load(*map(resolve, arguments.files))
    inputs += scene.files
    print_warnings(scene.diagnostics)
    meshes = [actor for actor in scene.actors if actor.figure.mesh is not None]
    if len(meshes) != 1:
        raise ViewerError(f"expected one mesh to rig, found {len(meshes)}")
    actor = meshes[0]
    figure = actor.figure
    if not figure.is_attached:
        return figure
    if figure.is_rigged:
        print_warnings([f"{printable(figure.name, 60)} already has a rig, which is ignored"])
    return Figure(figure.name, posed_mesh(figure, actor.pose))


def _template(arguments: argparse.Namespace, inputs: list[Path]) -> Actor:
    """Return the figure whose rig is transferred, posed and shaped as requested."""
    scene = load(*_files(arguments), motion=_template_settings(arguments))
    inputs += scene.files
    _check_frame(scene, arguments)
    print_warnings([*scene.diagnostics, *apply_pose(scene, arguments)])
    attached = [actor for actor in scene.actors if actor.figure.is_attached]
    if not attached:
        raise RigError("--from: expected a figure with mesh, skeleton and skin, found none")
    if len(attached) > 1:
        name = printable(attached[0].name, 60)
        print_warnings([f"--from: {len(attached)} figures; the first one, {name}, is the template"])
    if not attached[0].is_present:
        raise RigError("--from: expected a frame of the template, found a gap")
    return attached[0]


def _template_settings(arguments: argparse.Namespace) -> MotionSettings:
    return MotionSettings(frame_rate=arguments.fps, rig=arguments.rig or "")


def _check_frame(scene: Scene, arguments: argparse.Namespace) -> None:
    """Apply --template-frame, and check that the template of a frame or time has a motion.

    Raises ViewerError if the template has no motion, or two frames are given.
    """
    if arguments.template_frame is not None:
        if arguments.frame is not None:
            raise ViewerError("--frame and --template-frame: expected one of them, found both")
        arguments.frame, arguments.frame_option = arguments.template_frame, "--template-frame"
    if arguments.frame is None and arguments.time is None:
        return
    if all(actor.clip is None for actor in scene.actors):
        option = "--time" if arguments.frame is None else arguments.frame_option
        raise ViewerError(
            f"{option}: expected a template with a motion, found none; add the motion's file with "
            "another --from, as in --from body --from walk.npz"
        )


def _files(arguments: argparse.Namespace) -> list[Path]:
    return [file for name in arguments.template or ["body"] for file in _template_files(name)]


def _template_files(name: str) -> list[Path]:
    path, *others = named_files(name)
    near = "" if path.exists() or len(path.parts) != 1 else did_you_mean(name, [*BUNDLED])
    if near:
        raise FormatError(Diagnostic("F001.no-template", path, values={"near": near}))
    return [path, *others]


def _check_numbers(arguments: argparse.Namespace) -> None:
    if not 0.0 <= arguments.max_angle <= 180.0:
        raise ViewerError(f"--max-angle: expected 0 to 180, found {arguments.max_angle:g}")
    if not arguments.max_distance >= 0.0:
        raise ViewerError(f"--max-distance: expected 0 or more, found {arguments.max_distance:g}")
    if arguments.smooth < 0:
        raise ViewerError(f"--smooth: expected 0 or more iterations, found {arguments.smooth}")
    if arguments.max_influences is not None and arguments.max_influences < 1:
        raise ViewerError(f"--max-influences: expected 1 or more, found {arguments.max_influences}")


def _settings(
    arguments: argparse.Namespace, template: Actor, output: Path | None
) -> TransferSettings:
    """Return the requested settings; the .skel format cannot store correctives."""
    landmarks = None
    if arguments.landmarks is not None:
        source = Source.open(arguments.landmarks)
        landmarks = read_landmarks(source, template.figure, template.require_pose())
    _check_numbers(arguments)
    as_rig = output is not None and output.suffix.lower() != ".npz"
    angle = math.radians(arguments.max_angle)
    usual = MatchSettings()
    return TransferSettings(
        method=arguments.method,
        alignment=AlignmentSettings(
            up=arguments.up,
            facing=arguments.facing,
            scale=arguments.scale,
            landmarks=landmarks,
            refines=not arguments.no_refine,
        ),
        weights=WeightSettings(
            match=MatchSettings(
                max_distance=arguments.max_distance,
                max_angle=angle,
                near_angle=max(angle, usual.near_angle),
            ),
            smoothing_rounds=arguments.smooth,
            max_influences=arguments.max_influences,
        ),
        joints=arguments.joints,
        fits=not arguments.no_fit,
        correctives=not (arguments.no_correctives or as_rig),
    )


def _print_report(rigged: Rigged, stream: TextIO) -> None:
    """Print the report, and warnings to the error stream."""
    print_warnings(line for line in rigged.lines if line.severity == "warning")
    notes = [str(line) for line in rigged.lines if line.severity == "note"]
    print("\n".join(notes), file=stream)


def _show(rigged: Rigged, target: Figure) -> None:
    """Open the result in a window, with the hidden target at the same position."""
    from viewer.app.window import show

    result = Actor(rigged.figure, rigged.pose.copy(), placement=np.array(rigged.placement))
    show(Scene([result, Actor(target, visible=False)], world_up=rigged.figure.up))
