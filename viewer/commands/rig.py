"""Rig transfer from a figure to an unrigged mesh, and rigs from the motion of a mesh.

``--landmarks`` names a text file with pairs of corresponding points, one pair per line: three
numbers of the posed template and three of the target, or the name of a joint of the template and
three numbers of the target; ``#`` begins a comment::

    0.0 1.62 0.1      0.0 162.0 9.5
    left_wrist        71.2 140.0 -3.0

Motions of the template (``--clip``) are transferred too, and written next to the result. All output
files are checked before the transfer, which takes long, and written together or not at all.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.autorig.alignment.orientation_search import AXES, axis_direction, nearest_axis
from viewer.autorig.alignment.surface_alignment import AlignmentSettings, stated_up
from viewer.autorig.checks import FARTHEST
from viewer.autorig.correspondence import MatchSettings
from viewer.autorig.decomposition import DecompositionSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.rigged import Rigged, clip_for, start_of_clips
from viewer.autorig.settings import BINDING, SkeletonSettings, TransferSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.commands._frames import Frames, add_frame_arguments, frames_of
from viewer.commands._keywords import arguments_of, paths_of, without_dashes
from viewer.commands._pose import PoseOptions, add_pose_arguments, apply_pose
from viewer.commands._progress import shown_progress
from viewer.commands._scene import print_warnings
from viewer.commands._settings import add_settings, changed, settings_of
from viewer.commands.convert import add_vrm_arguments, check_meta
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, RigError, UnsupportedFormatError, ViewerError
from viewer.exporters import (
    EXPORTERS,
    ExportOptions,
    Selection,
    VrmMeta,
    check_figure,
    export,
    exporter_for,
    files_written,
    sampled,
)
from viewer.formats import MESHES, Source, all_or_none, check_targets
from viewer.formats._text.numbers import to_number
from viewer.loading import MotionSettings, bundled_body, bundled_files, load
from viewer.loading.mesh_sequence import ARCHIVES, SEQUENCES, read_mesh_sequence, stores_frames
from viewer.models import named_files, resolve
from viewer.near_names import name_hint
from viewer.phrases import counted, listed, printable, rounded
from viewer.progress import part_of_work
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import bounding_box
from viewer.rigs.motion.clip import Clip, is_course_rig
from viewer.rigs.motion.moving_mesh import (
    MovingMesh,
    frame_errors,
    moving_mesh,
    posed_rows,
)
from viewer.rigs.motion.sampled_animation import baked
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Scene, scene_of
from viewer.rigs.skinning import joint_matrices, posed_mesh
from viewer.streams import is_stdout, require_stdout, summary_stream

# Landmarks.
_FAR = 0.1  # distance from the mesh's box, relative to its longest side, that is a warning
_LARGEST_SCALE = 1e9  # largest ratio of the extents of both meshes, or of its inverse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s TARGET [-o FILE] [options]"
    parser.add_argument(
        "files",
        nargs="+",
        metavar="TARGET",
        help=f"the mesh: {', '.join(MESHES)}; and its texture image; or the frames of a mesh that "
        f"moves: several {' or '.join(SEQUENCES)} files, a folder of them, or an "
        f"{' or '.join(ARCHIVES)} file of all vertices, with the faces in it or in a mesh file",
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
        "--skeleton",
        action="append",
        default=[],
        metavar="FILE",
        help="bind the mesh to the skeleton of this file or model instead, where it is; repeat it "
        "for other files of the skeleton or its motion",
    )
    parser.add_argument(
        "--auto",
        action="store_true",
        help="bind the mesh to a skeleton found in its shape instead: for what is no person and no "
        "quadruped, such as a spider, an octopus, a hand or a robot arm",
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
    parser.add_argument(
        "--clip",
        dest="clips",
        action="append",
        default=[],
        metavar="FILE",
        help="a motion of the template: it is transferred to the target, with its path scaled to "
        "the figure, and written next to the result as NAME-FILE.anim (.skel-style rigs) or "
        ".bvh; may be repeated",
    )
    parser.add_argument("--view", action="store_true", help="open the result in a window")
    group = parser.add_argument_group("method")
    usual = f"; default: robust, or {BINDING[0]} with --skeleton and --auto"
    add_settings(group, TransferSettings, "method", given=None, usual=usual)
    add_settings(group, MatchSettings)
    add_settings(group, WeightSettings)
    add_settings(group, TransferSettings, "joints", "fits", "correctives", "insists")
    add_settings(group, SkeletonSettings)
    group = parser.add_argument_group("rig from motion")
    add_settings(group, DecompositionSettings)
    group.add_argument(
        "--bind-frame",
        type=int,
        metavar="N",
        help="the frame in which the mesh is bound (default: the first)",
    )
    add_settings(group, MotionSettings, "animation")
    group = parser.add_argument_group("alignment")
    add_settings(group, AlignmentSettings, "up", "facing", choices=AXES)
    add_settings(group, AlignmentSettings, "scale")
    group.add_argument(
        "--landmarks",
        metavar="FILE",
        help="file with pairs of points, one per line: a joint or position of the posed template, "
        "and a position on the target; the fit keeps them together",
    )
    add_settings(group, AlignmentSettings, "refines")
    add_vrm_arguments(parser)
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


def run(arguments: argparse.Namespace) -> int:
    """Rig the mesh, print a report, write it, and show it if requested."""
    from viewer.exporters._rigged_files import files_of, write_rigged

    frames_of_mesh = _sequence(arguments.files)
    if arguments.bones is not None or frames_of_mesh:
        return _rig_moving(arguments, frames_of_mesh)
    output = None if arguments.output is None else Path(arguments.output)
    meta = settings_of(VrmMeta, arguments)
    check_meta(meta, output)
    pose, frames = settings_of(PoseOptions, arguments), frames_of(arguments)
    named = [
        *(*arguments.files, *arguments.template, *arguments.skeleton),
        *(*pose.files, *arguments.clips),
        *([arguments.landmarks] if arguments.landmarks else []),
    ]
    inputs = [Path(file) for file in (*map(resolve, named), bundled_body(), *bundled_files())]
    if output is not None:
        require_stdout(output)
        check_targets(files_of(output), inputs, arguments.force)
    target = _target(arguments.files, inputs)
    if output is not None and output.suffix.lower() == ".vrm":
        from viewer.exporters.vrm import checked_meta

        checked_meta(meta, target.name)  # checked early, as the rig transfer takes long
    _name_template_frame(arguments, frames)
    template_files, template, found = _asked_template(arguments, target, pose, frames, inputs)
    if output is not None and output.suffix.lower() != ".npz":
        # The rigged mesh gets the template's joints, and the rig transfer takes long.
        check_figure(exporter_for(output), template.figure)
    settings = _settings(arguments, template, output, target)
    clips = _read_clips(arguments.clips, output, template_files, template.figure, frames.fps)
    files = [] if output is None else [*files_of(output), *(clip.path for clip in clips)]
    check_targets(files, inputs, arguments.force)
    rigged = _transferred(target, template, settings, found)
    stream = sys.stdout if output is None else summary_stream(output)
    print_warnings(line for line in rigged.lines if line.severity == "warning")
    notes = [str(line) for line in rigged.lines if line.severity == "note"]
    print("\n".join(notes), file=stream)
    if output is not None:
        with all_or_none(files):
            written = [*write_rigged(rigged, output, meta), *_write_clips(rigged, clips)]
        for note in written:
            note_found(note)
        print("\n".join(map(str, written)), file=stream)
    if arguments.view:
        from viewer.app.window import show

        result = Actor(rigged.figure, rigged.pose.copy(), placement=np.array(rigged.placement))
        show(Scene([result, Actor(target, visible=False)], world_up=_world_up(rigged)))
    return 0


def check_format(output: Path) -> None:
    """Raise for a suffix that stores no rigged mesh."""
    from viewer.exporters._rigged_files import files_of

    files_of(output)


def rig(
    target: Scene | Actor | str | Path | Sequence[str | Path],
    template: str | Path | Sequence[str | Path] | None = None,
    *,
    skeleton: str | Path | Sequence[str | Path] | None = None,
    **options: object,
) -> Scene:
    """Rig a mesh from a template or for a skeleton, as ``viewer rig`` does.

    Parameters
    ----------
    target : path, sequence of paths, Actor or Scene
        The mesh, with its texture image; a rig that it has is ignored.
    template : path, name, or sequence of them, optional
        The rigged figure, ``"body"`` if omitted, and other files of it.
    skeleton : path, name, or sequence of them, optional
        Binds the mesh to the skeleton of this file instead, where it is.
    **options
        Options of the command with underscores: ``auto``, ``method``, ``max_distance``,
        ``max_angle`` (degrees), ``smooth``, ``max_influences``, ``joints``, ``fit``,
        ``correctives``, ``up``, ``facing``, ``scale``, ``landmarks``, ``refine``,
        ``template_pose`` and others.

    Returns
    -------
    Scene
        The rigged figure, posed as the mesh was; the ``diagnostics`` say what was matched. If the
        mesh has another up axis than the template, the figure is upright along the template's.

    Raises
    ------
    ViewerError
        If there is no such option or value, a file cannot be read, or there is not one mesh.
    RigError
        If the template has no rig, or does not match the mesh.
    """
    from viewer.diagnostics.record import recorded

    given = {"template": template, "skeleton": skeleton}
    words = {
        name: paths_of(name, what, "paths or names")
        for name, what in given.items()
        if what is not None
    }
    own = "output", "force", "clip", "view", "from", "skeleton"
    of_motion = "bones", "tolerance", "bind_frame", "animation"
    without = (*own, *of_motion, "vrm_name", "vrm_author", "vrm_licence")
    arguments = arguments_of("rig", add_arguments, options, without, ["a"])
    arguments.template, arguments.skeleton = words.get("template", []), words.get("skeleton", [])
    inputs: list[Path] = []
    with without_dashes(**{"from": "template"}), recorded() as said:
        figure = (
            _one_mesh(scene_of(target, "rig"))
            if isinstance(target, Scene | Actor)
            else _target(paths_of("rig", target), inputs)
        )
        pose, frames = settings_of(PoseOptions, arguments), frames_of(arguments)
        _name_template_frame(arguments, frames)
        _, actor, found = _asked_template(arguments, figure, pose, frames, inputs)
        settings = _settings(arguments, actor, None, figure)
        rigged = _transferred(figure, actor, settings, found)
    result = Actor(rigged.figure, rigged.pose.copy(), placement=np.array(rigged.placement))
    if _world_up(rigged) != rigged.figure.up:
        result.placement = np.eye(4)
    return Scene([result], (*said.found, *rigged.lines), world_up=rigged.figure.up, files=inputs)


def _world_up(rigged: Rigged) -> Up:
    """Return the up axis of the target's space, in which the figure is placed upright."""
    up = nearest_axis(rigged.placement[:3, :3] @ axis_direction(rigged.figure.up))
    return "z" if up == "z" else "y"


def _asked_template(
    arguments: argparse.Namespace,
    target: Figure,
    pose: PoseOptions,
    frames: Frames,
    inputs: list[Path],
) -> tuple[list[Path], Actor, tuple[Diagnostic, ...]]:
    """Return the files of the requested template or skeleton, its figure, and messages about it."""
    _check_options(arguments)
    if arguments.auto:
        from viewer.autorig.curve_skeleton import find_skeleton

        how = settings_of(SkeletonSettings, arguments)
        sides = AlignmentSettings(up=arguments.up, facing=arguments.facing)
        title = f"rigging {printable(target.name, 40)}"
        with shown_progress(title), part_of_work(title):
            found = find_skeleton(target, target.require_mesh(), how, sides)
        return [], Actor(found.figure, figure_pose(found.figure)), found.lines
    option = "--skeleton" if arguments.skeleton else "--from"
    files = [
        file
        for name in arguments.skeleton or arguments.template or ["body"]
        for file in named_files(name)
    ]
    return files, _template(files, option, arguments.rig or "", pose, frames, inputs), ()


def _name_template_frame(arguments: argparse.Namespace, frames: Frames) -> None:
    """Let ``--template-frame`` choose the frame, in place."""
    if arguments.template_frame is None:
        return
    if frames.frame is not None:
        raise ViewerError("--frame and --template-frame: expected one of them, found both")
    frames.frame, frames.option = arguments.template_frame, "--template-frame"


def _transferred(
    target: Figure, template: Actor, settings: TransferSettings, found: tuple[Diagnostic, ...]
) -> Rigged:
    """Return the target with the template's rig; ``found``: messages about the template."""
    title = f"rigging {printable(target.name, 40)}"
    with shown_progress(title), part_of_work(title):
        rigged = transfer(
            template.figure,
            template.pose,
            target.require_mesh(),
            settings,
            target.name,
        )
    return replace(rigged, lines=(*found, *rigged.lines))


def _sequence(files: Sequence[str]) -> list[Path]:
    """Return the frames of a mesh if the arguments are such files, or one folder of them."""
    paths = [Path(file) for file in files]
    if len(paths) == 1 and paths[0].is_dir():
        folder, inside = paths[0], [*paths[0].iterdir()]
        paths = [path for path in inside if path.suffix.lower() in SEQUENCES]
        if len(paths) == len(inside) == 1:
            raise ViewerError(
                f"{printable(folder, 300)}: expected at least 2 frames of a mesh, found 1; to rig "
                f"it at rest, name the file {printable(paths[0].name, 60)}"
            )
    if len(paths) > 1 and all(path.suffix.lower() in SEQUENCES for path in paths):
        return paths
    return paths if stores_frames(paths) else []


def _rig_moving(arguments: argparse.Namespace, sequence: list[Path]) -> int:
    """Find the bones of a mesh that moves, write them, and print the errors of all frames."""
    from viewer.autorig.bones_from_motion import (
        error_lines,
        frame_lines,
        read_back_errors,
        rig_motion,
    )

    _check_only_motion(arguments)
    output = None if arguments.output is None else Path(arguments.output)
    inputs = sequence or [Path(resolve(file)) for file in arguments.files]
    if output is not None:
        require_stdout(output)
        if not {"clips", "frames"} <= EXPORTERS[exporter_for(output)].stores:
            suffixes = " or ".join(EXPORTERS["gltf"].suffixes)
            raise UnsupportedFormatError(
                f"{printable(output, 300)}: expected {suffixes} for a mesh with bones and their "
                f"motion, found {output.suffix.lower()}"
            )
        check_targets(files_written(output), inputs, arguments.force)
    most = settings_of(WeightSettings, arguments).max_influences
    how = settings_of(DecompositionSettings, arguments)
    how = how if most is None else replace(how, max_influences=most)
    frames = frames_of(arguments)
    with shown_progress("finding bones"):
        if sequence:
            moving, notes = read_mesh_sequence(sequence, frames.fps, arguments.bind_frame)
            print_warnings(notes)
        else:
            moving = _moving_figure(arguments, frames)
        made = rig_motion(moving, how)
        scene, written = Scene([made.actor], world_up=made.actor.figure.up), list[Diagnostic]()
        if output is not None:
            options = ExportOptions(kind="gltf")
            part = sampled(options.kind, options, scene, made.actor)
            written = export(Selection([part], scene), output, options=options)
        if output is not None and not is_stdout(output):
            (again,) = load(output).actors
            errors, missing = read_back_errors(moving, made.times, again)
        else:
            errors = frame_errors(moving, posed_rows(made.actor.figure, made.clip, made.times))
            missing = np.zeros(0, dtype=np.int32)
    stream = sys.stdout if output is None else summary_stream(output)
    lines = *frame_lines(moving, errors), *error_lines(moving, errors, missing, how)
    for each in (*made.lines, *written, *lines):
        note_found(each)
        print(each, file=stream)
    if arguments.view:
        from viewer.app.window import show

        show(scene)
    return 0


def _check_only_motion(arguments: argparse.Namespace) -> None:
    """Check that there is no option for a template or a skeleton."""
    given = {
        "--from": arguments.template,
        "--skeleton": arguments.skeleton,
        "--auto": arguments.auto,
        "--clip": arguments.clips,
        "--landmarks": arguments.landmarks,
        "--method": arguments.method,
        "--smooth": arguments.smooth,
        "--template-pose": arguments.pose,
        "--rig": arguments.rig is not None,
        "--frame": arguments.frame is not None,
        "--time": arguments.time is not None,
        "--template-frame": arguments.template_frame is not None,
    }
    kinds = (TransferSettings, MatchSettings, SkeletonSettings, AlignmentSettings, PoseOptions)
    unused = [option for option, is_given in given.items() if is_given]
    unused += [option for kind in kinds for option in changed(kind, arguments)]
    if unused:
        found = "--bones" if arguments.bones is not None else "several meshes"
        raise ViewerError(f"{unused[0]}: expected one mesh without a motion, found {found}")


def _moving_figure(arguments: argparse.Namespace, frames: Frames) -> MovingMesh:
    """Return the vertices of the figure that moves in a scene."""
    motion = settings_of(MotionSettings, arguments, frame_rate=frames.fps)
    scene = load(*arguments.files, motion=motion)
    print_warnings(scene.diagnostics)
    meshes = [actor for actor in scene.actors if actor.figure.mesh is not None]
    moving = [actor for actor in meshes if actor.joint_motion is not None]
    if len(moving) != 1:
        raise ViewerError(
            f"--bones: expected one mesh that moves, found {len(moving)} among "
            f"{counted(len(meshes), 'mesh')}; its motion is an animation of its file, another "
            "file, or a mesh file for each frame"
        )
    return moving_mesh(moving[0], frames.fps, arguments.bind_frame)


def _target(files: Sequence[str], inputs: list[Path]) -> Figure:
    """Return the mesh to rig."""
    scene = load(*files)
    inputs += scene.files
    print_warnings(scene.diagnostics)
    return _one_mesh(scene)


def _one_mesh(scene: Scene) -> Figure:
    """Return the mesh of a scene; a mesh that has a rig is used in its current pose."""
    meshes = [actor for actor in scene.actors if actor.figure.mesh is not None]
    if len(meshes) != 1:
        raise ViewerError(f"expected one mesh to rig, found {len(meshes)}")
    actor = meshes[0]
    figure = actor.figure
    if not figure.is_attached:
        return figure
    if figure.is_rigged:
        print_warnings([f"{printable(figure.name, 60)} already has a rig, which is ignored"])
    mesh = posed_mesh(figure, actor.own_pose)
    return Figure(figure.name, mesh, up=figure.up, unit=figure.unit)


def _check_options(arguments: argparse.Namespace) -> None:
    """Check that options are not given together with others that do not use them."""
    sources = {
        "--from": bool(arguments.template),
        "--skeleton": bool(arguments.skeleton),
        "--auto": arguments.auto,
    }
    found = [option for option, is_given in sources.items() if is_given]
    if len(found) > 1:
        all_found = "both" if len(found) == 2 else "all"
        raise ViewerError(f"{' and '.join(found)}: expected one of them, found {all_found}")
    of_motion = changed(DecompositionSettings, arguments)
    of_motion += ["--bind-frame"] if arguments.bind_frame is not None else []
    of_motion += ["--animation"] if arguments.animation else []
    if of_motion:
        raise ViewerError(f"{of_motion[0]}: expected --bones or several mesh files, found neither")
    if changed(SkeletonSettings, arguments) and not arguments.auto:
        raise ViewerError("--symmetry and --joint-spacing: expected --auto, found none")
    if not arguments.skeleton and not arguments.auto:
        return
    (source,) = found
    if arguments.method not in (None, *BINDING):
        names = " or ".join(BINDING)
        raise ViewerError(f"--method: expected {names} with {source}, found {arguments.method}")
    own, usual = settings_of(TransferSettings, arguments), TransferSettings()
    only_for_templates = {
        **dict.fromkeys(changed(MatchSettings, arguments), True),
        "--joints": own.joints != usual.joints,
        "--no-fit": own.fits != usual.fits,
        "--no-refine": not settings_of(AlignmentSettings, arguments).refines,
        "--keep-doubtful": own.insists,
    }
    if arguments.auto:
        alignment = settings_of(AlignmentSettings, arguments)
        only_for_templates |= {
            "--scale": alignment.scale != AlignmentSettings().scale,
            "--landmarks": arguments.landmarks is not None,
            "--template-pose": arguments.pose is not None,
            "--template-frame": arguments.template_frame is not None,
            "--clip": bool(arguments.clips),
            "--rig": arguments.rig is not None,
        }
    for option, is_given in only_for_templates.items():
        if is_given:
            raise ViewerError(f"{option}: expected a template (--from) to match, found {source}")


def _template(
    files: Sequence[Path],
    option: str,
    rig: str,
    pose: PoseOptions,
    frames: Frames,
    inputs: list[Path],
) -> Actor:
    """Return the figure whose rig or skeleton is used, posed and shaped as requested."""
    scene = load(*files, motion=MotionSettings(frame_rate=frames.fps, rig=rig))
    inputs += scene.files
    if frames.is_one and all(actor.clip is None for actor in scene.actors):
        asked = "--time" if frames.frame is None else frames.option
        raise ViewerError(
            f"{asked}: expected a template with a motion, found none; add the motion's file with "
            f"another {option}, as in {option} body {option} walk.npz"
        )
    only_skeleton = option == "--skeleton"
    if not frames.is_one:
        for actor in scene.actors:
            _put_at_rest(actor)
    print_warnings([*scene.diagnostics, *apply_pose(scene, pose, frames)])
    found = [
        actor
        for actor in scene.actors
        if actor.figure.is_attached or (only_skeleton and actor.figure.skeleton is not None)
    ]
    if not found:
        wanted = "skeleton" if only_skeleton else "figure with mesh, skeleton and skin"
        hint = "" if only_skeleton or not _has_skeleton(scene) else "; bind to it by --skeleton"
        raise RigError(f"{option}: expected a {wanted}, found none{hint}")
    if len(found) > 1:
        name = printable(found[0].name, 60)
        print_warnings([f"{option}: {len(found)} figures; the first one, {name}, is the template"])
    if not found[0].is_present:
        raise RigError(f"{option}: expected a frame of the template, found a gap")
    return found[0]


def _has_skeleton(scene: Scene) -> bool:
    return any(actor.figure.skeleton is not None for actor in scene.actors)


def _put_at_rest(actor: Actor) -> None:
    """Replace the first pose of a motion, which rarely resembles an unposed mesh, by rest."""
    if actor.clip is None or actor.own_pose is None or actor.figure.skeleton is None:
        return
    shape = actor.own_pose.shape_weights
    actor.pose = figure_pose(actor.figure)
    actor.own_pose.shape_weights = shape
    actor.is_present = True


def _settings(
    arguments: argparse.Namespace, template: Actor, output: Path | None, target: Figure
) -> TransferSettings:
    """Return the requested settings; the .skel format cannot store correctives."""
    landmarks = None
    if arguments.landmarks is not None:
        source = Source.open(arguments.landmarks)
        landmarks = read_landmarks(source, template.figure, template.pose)
        print_warnings(_far_landmarks(source, landmarks[:, 1], target))
    if arguments.smooth < 0:
        raise ViewerError(f"--smooth: expected 0 or more iterations, found {arguments.smooth}")
    # A skeleton found in the mesh is where it should be.
    alignment = AlignmentSettings(matrix=np.eye(4))
    if not arguments.auto:
        up = arguments.up or stated_up(target.up)
        alignment = settings_of(AlignmentSettings, arguments, landmarks=landmarks, up=up)
    settings = settings_of(
        TransferSettings,
        arguments,
        alignment=alignment,
        weights=settings_of(WeightSettings, arguments, match=settings_of(MatchSettings, arguments)),
    )
    if (arguments.skeleton or arguments.auto) and arguments.method is None:
        settings = replace(settings, method=BINDING[0])
    as_rig = output is not None and output.suffix.lower() != ".npz"
    return replace(settings, correctives=False) if as_rig else settings


def read_landmarks(source: Source, template: Figure, pose: Pose) -> Floats:
    """Read pairs of points: on the posed template and on the target, (N, 2, 3)."""
    skeleton = template.require_skeleton()
    joints = joint_matrices(template, pose)[:, :3, 3]
    pairs = []
    for line_number, data in enumerate(source.data.splitlines(), start=1):
        line = data.decode("utf-8", "replace")
        words = line.partition("#")[0].split()
        if not words:
            continue
        values = _floats(words if len(words) == 6 else words[-3:])
        if values is None or len(words) < 4 or (len(words) != 6 and _floats(words) is not None):
            raise FormatError.fault(
                "F002.landmark: expected six numbers, or a joint and three numbers, found "
                '"{found}"',
                source.path,
                line_number,
                found=printable(line.strip(), 60),
            )
        if len(values) == 6:
            pairs.append([values[:3], values[3:]])
            continue
        name = " ".join(words[:-3])
        if name not in skeleton.names:
            raise _unknown_joint(source, line_number, name, template)
        pairs.append([joints[skeleton.names.index(name)].tolist(), values])
    last = max(len(source.data.splitlines()), 1)
    if not pairs:
        raise FormatError.fault(
            "F002.landmarks: expected pairs of points, found none", source.path, last
        )
    points = np.array(pairs, dtype=np.float64)
    if len(points) == 1:
        return points
    own, other = np.ptp(points, axis=0).max(axis=1).tolist()
    if not (own < _LARGEST_SCALE * other and other < _LARGEST_SCALE * own):
        raise FormatError.fault(
            "F002.landmark-extents: expected points that differ in scale by less than 1e9, "
            "found extents of {own} in the template and {other} in the target",
            source.path,
            last,
            own=rounded(own),
            other=rounded(other),
        )
    return points


def _far_landmarks(source: Source, places: Floats, target: Figure) -> list[Diagnostic]:
    """Return a warning if positions (N, 3) are outside the mesh's box: they may have other axes."""
    box = bounding_box(target.require_mesh().positions)
    away = np.maximum(box[0] - places, places - box[1]).max(axis=1)
    far = np.flatnonzero(away > _FAR * (box[1] - box[0]).max())
    if not len(far):
        return []
    values = {
        "n": counted(len(far), "landmark"),
        "all": len(places),
        "low": _point_text(box[0]),
        "high": _point_text(box[1]),
        "found": _point_text(places[far[0]]),
    }
    return [
        Diagnostic(
            "R009.landmarks: {n} of {all} outside the box of the mesh, {low} to {high}, the first "
            "at {found}; coordinates are those of viewer info, after the rotations of the file's "
            "nodes",
            source.path,
            values=values,
        )
    ]


def _point_text(point: Floats) -> str:
    return f"({listed([rounded(value) for value in point.tolist()])})"


def _unknown_joint(source: Source, line: int, name: str, template: Figure) -> FormatError:
    names = () if template.skeleton is None else template.skeleton.names
    return FormatError.fault(
        'F002.landmark-joint: expected a joint of {figure}, found "{found}"; {near}',
        source.path,
        line,
        figure=printable(template.name, 60),
        found=name,
        near=name_hint(name, names),
    )


def _floats(words: list[str]) -> list[float] | None:
    found = [to_number(word.encode()) for word in words]
    values = [value for value in found if value is not None and abs(value) < FARTHEST]
    return values if len(values) == len(found) else None


@dataclass(frozen=True, slots=True, eq=False)
class _TransferredClip:
    """A motion of the template, and the file its transferred copy is written to."""

    clip: Clip | SampledClip
    """The template's motion."""
    path: Path
    """``.anim`` for .skel-style rigs, ``.bvh`` for other figures."""


def _read_clips(
    clips: Sequence[str],
    output: Path | None,
    template: list[Path],
    figure: Figure,
    fps: float | None,
) -> list[_TransferredClip]:
    """Return the template's motions named by ``--clip``, before any work is done."""
    if not clips:
        return []
    if output is None:
        raise ViewerError("--clip: expected -o FILE to write the motion next to, found none")
    found: list[_TransferredClip] = []
    suffix = ".anim" if is_course_rig(figure.require_skeleton()) else ".bvh"
    for name in clips:
        path = output.with_name(f"{output.stem}-{Path(name).stem}{suffix}")
        if any(each.path == path for each in found):
            raise ViewerError(f"--clip: expected different file names, found {path.stem} twice")
        found.append(_TransferredClip(_clip_of(name, template, fps), path))
    return found


def _clip_of(name: str, template: list[Path], fps: float | None) -> Clip | SampledClip:
    scene = load(*template, resolve(name), motion=MotionSettings(frame_rate=fps))
    print_warnings(scene.diagnostics)
    for actor in scene.actors:
        clip = actor.joint_motion
        if actor.figure.skeleton is not None and clip is not None:
            return baked(actor.figure, clip, fps) if clip.kind == "transforms" else clip
    raise RigError(f"--clip: expected a motion of the template, found none in {printable(name)}")


def _write_clips(rigged: Rigged, clips: list[_TransferredClip]) -> list[Diagnostic]:
    """Write the template's motions for the rigged figure; return notes about the files."""
    notes: list[Diagnostic] = []
    for each in clips:
        actor = Actor(rigged.figure, start_of_clips(rigged), clip_for(rigged, each.clip))
        options = ExportOptions(kind=each.path.suffix[1:])
        part = sampled(options.kind, options, Scene([actor]), actor)
        notes += export(Selection([part]), each.path, options=options)
    return notes
