"""Conversion of figures, poses and motions to other formats."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._one_pose import check_frame_options
from viewer.commands._output import inputs_of
from viewer.commands._pose import (
    add_pose_arguments,
    add_skinning_arguments,
    skinning_of,
    use_file_method,
)
from viewer.commands._progress import shown_progress
from viewer.commands._scene import (
    add_capture_arguments,
    add_file_arguments,
    open_scene,
)
from viewer.commands._sequence.frame_numbers import add_frame_arguments
from viewer.commands._writing.baked_springs import bake_springs
from viewer.commands._writing.motion_export import (
    add_motion_arguments,
    check_frame_field,
    check_kind,
    check_numbered,
    is_motion,
    write_motions,
    writes_keys,
)
from viewer.commands._writing.saved_joint_map import add_joint_map_argument, saving_joint_map
from viewer.commands._writing.streamed_bvh import convert_streamed
from viewer.commands._writing.vrm_meta import add_vrm_arguments, vrm_meta
from viewer.commands._writing.written_actors import (
    able_actors,
    left_out_notes,
    pose_or_point_actors,
)
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, RigError, UnsupportedFormatError, ViewerError
from viewer.export import (
    EXPORTERS,
    export,
    export_clips,
    export_figures,
    exporter_for,
    files_written,
)
from viewer.export._motion_paths import PERSON, motion_paths
from viewer.formats import all_or_none, check_folder_target, check_targets
from viewer.interrupts import raising
from viewer.phrases import printable
from viewer.rig.motion.own_animations import has_own_animations, own_animations
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.motion.upright import upright_actor, upright_placement
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.streams import is_stdout, require_stdout, summary_stream

__all__ = ["add_arguments", "run"]

_OPTIMIZED = (".glb", ".gltf", ".vrm")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [FILES ...] -o FILE [options]"
    add_file_arguments(parser)
    group = parser.add_argument_group("output")
    group.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help=f"one of {_known_suffixes()}; walk_{{frame:05}}.obj for numbered meshes, "
        "walk_{person}.glb for a file per person",
    )
    group.add_argument("--force", action="store_true", help="replace existing files")
    add_joint_map_argument(group)
    add_motion_arguments(parser)
    add_vrm_arguments(parser, upgrades=True)
    add_frame_arguments(parser, "A:B")
    add_capture_arguments(parser, gaps="write")
    add_cleanup_arguments(parser)
    add_pose_arguments(parser)
    add_skinning_arguments(parser)


def _known_suffixes() -> str:
    suffixes = dict.fromkeys(suffix for kind in EXPORTERS.values() for suffix in kind.suffixes)
    return ", ".join("a folder for EasyMocap" if each == "/" else each for each in suffixes)


def run(arguments: argparse.Namespace) -> int:
    """Write poses or motions; print messages about written files and losses."""
    output = Path(arguments.output)
    _check_suffix(arguments, output)
    skinning = skinning_of(arguments)
    notes = convert_streamed(arguments, output, skinning)
    if notes is None:
        notes = _converted(arguments, output, skinning)
    for note in notes:
        note_found(note)
    print("\n".join(map(str, notes)), file=summary_stream(output))
    return 0


def _converted(arguments: argparse.Namespace, output: Path, skinning: Skinning) -> list[Diagnostic]:
    """Open all files, and write what is requested; return the notes."""
    scene = open_scene(arguments)
    use_file_method(arguments, scene, skinning)
    baked = bake_springs(arguments, scene, output)
    write = _write_motions if is_motion(arguments, output, scene) else _write_poses
    if writes_keys(arguments, output, scene):
        write = _write_clips
    with saving_joint_map(arguments, scene), shown_progress("converting"):
        return [*write(arguments, scene, output, skinning), *baked]


def _check_suffix(arguments: argparse.Namespace, output: Path) -> None:
    """Check the output before anything is read."""
    check_frame_options(arguments)
    require_stdout(output)
    if is_stdout(output) and not output.suffix:
        name = printable(output, 300)
        raise UnsupportedFormatError(
            f"{name}: expected a suffix, which selects the format; use a link to {name} that has "
            f"one"
        )
    suffix = output.suffix.lower() or "/"
    kinds = [kind for kind in EXPORTERS.values() if suffix in kind.suffixes]
    if not kinds:
        raise UnsupportedFormatError(f'no exporter for "{suffix}"; supported: {_known_suffixes()}')
    if arguments.optimize and suffix not in _OPTIMIZED:
        raise ViewerError(f"--optimize: expected .glb, .gltf or .vrm, found {printable(suffix)}")
    vrm_meta(arguments, output)
    check_kind(arguments, output)
    check_numbered(arguments, output)
    if suffix == "/" or "{frame" in output.name:
        return  # the files are unknown until the motion has been read
    is_pose = all(kind.writes_pose for kind in kinds)
    files = files_written(output) if is_pose else [output]
    check_targets(files, inputs_of(arguments), arguments.force)


def _write_poses(
    arguments: argparse.Namespace, scene: Scene, output: Path, skinning: Skinning
) -> list[Diagnostic]:
    """Write the current poses."""
    return _write_actors(arguments, scene, output, skinning, lambda _: None)


def _write_clips(
    arguments: argparse.Namespace, scene: Scene, output: Path, skinning: Skinning
) -> list[Diagnostic]:
    """Write figures at rest with their animations, or only with the requested one."""
    is_chosen, refused = bool(arguments.animation), list[FormatError]()

    def clips_of(actor: Actor) -> Sequence[TransformClip] | None:
        own = own_animations(actor, is_chosen, refused) if has_own_animations(actor) else ()
        return own or None

    notes = _write_actors(arguments, scene, output, skinning, clips_of)
    # Figures of one file share its animations.
    problems = dict.fromkeys(map(str, refused))
    return notes + [
        Diagnostic("X003.invalid-animation", values={"problem": each}) for each in problems
    ]


def _write_actors(
    arguments: argparse.Namespace,
    scene: Scene,
    output: Path,
    skinning: Skinning,
    clips_of: Callable[[Actor], Sequence[TransformClip] | None],
) -> list[Diagnostic]:
    """Write the actors that are present, to one file each unless the format holds several."""
    all_shown = pose_or_point_actors(scene)
    shown, lacking = able_actors(all_shown, exporter_for(output))
    actors = [actor for actor in shown if actor.is_present]
    if not actors:
        raise RigError("no person is present at that time: there is nothing to write")
    if EXPORTERS[exporter_for(output)].writes_several and PERSON not in output.name:
        notes = _write_together(arguments, scene, output, skinning, actors, clips_of)
    else:
        places = dict(zip(shown, motion_paths(output, shown), strict=True))
        found = {each: places[each] for each in actors}
        notes = _write_apart(arguments, scene, skinning, found, clips_of)
    away = [actor.name for actor in shown if not actor.is_present]
    notes += [Diagnostic("X003.absent-now", values={"figure": name}) for name in away]
    return notes + lacking + left_out_notes(scene, all_shown)


def _write_together(
    arguments: argparse.Namespace,
    scene: Scene,
    output: Path,
    skinning: Skinning,
    actors: Sequence[Actor],
    clips_of: Callable[[Actor], Sequence[TransformClip] | None],
) -> list[Diagnostic]:
    """Write all actors and cameras to one file."""
    check_targets(files_written(output), inputs_of(arguments, scene), arguments.force)
    upright = []
    for actor in actors:
        placement = upright_placement(scene, actor)
        upright.append(replace(upright_actor(scene, actor), placement=placement))
    with raising():
        clips = [clips_of(actor) for actor in upright]
        optimizes = bool(arguments.optimize)
        return export_figures(upright, output, skinning, clips, scene, optimizes)


def _write_apart(
    arguments: argparse.Namespace,
    scene: Scene,
    skinning: Skinning,
    places: Mapping[Actor, Path],
    clips_of: Callable[[Actor], Sequence[TransformClip] | None],
) -> list[Diagnostic]:
    """Write each actor to a separate file."""
    optimizes, meta = bool(arguments.optimize), vrm_meta(arguments, next(iter(places.values())))
    files = [file for path in places.values() for file in files_written(path)]
    check_targets(files, inputs_of(arguments, scene), arguments.force)
    notes: list[Diagnostic] = []
    with all_or_none(files):
        for actor, path in places.items():
            with raising():
                upright = upright_actor(scene, actor)
                clips = clips_of(upright)
                if clips is None:
                    notes += export(upright, path, skinning, optimizes, meta)
                else:
                    notes += export_clips(upright, path, skinning, clips, optimizes)
    return notes


def _write_motions(
    arguments: argparse.Namespace, scene: Scene, output: Path, skinning: Skinning
) -> list[Diagnostic]:
    inputs, force = inputs_of(arguments, scene), arguments.force
    if "{frame" in output.name or (arguments.frames and output.suffix.lower() == ".obj"):
        check_frame_field(output)
    elif not output.suffix:
        check_folder_target(output / "smpl", inputs, force)
    return write_motions(
        arguments, scene, output, skinning, lambda files: check_targets(files, inputs, force)
    )
