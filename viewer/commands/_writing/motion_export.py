"""Choice of what ``convert`` writes: actors, poses, keys or frames, the exporter, and options."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from viewer.commands._frames import numbering_of, parse_range
from viewer.commands._one_pose import asks_one_pose, part_of_pose, pose_note
from viewer.commands._settings import number
from viewer.commands._writing.baked_springs import add_spring_argument
from viewer.commands._writing.vrm_meta import vrm_meta
from viewer.commands._writing.written_actors import (
    left_out_notes,
    pose_or_point_actors,
    written_actors,
)
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, UnsupportedFormatError, ViewerError
from viewer.export import (
    EXPORTERS,
    ExportOptions,
    Part,
    Selection,
    exporters_at,
    exporters_of,
    sampled,
    suited_exporter,
)
from viewer.export._motion_paths import PERSON, is_together
from viewer.export._options import QUATERNIONS, ROTATION_ORDERS, SAFE_NAMES
from viewer.phrases import printable
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.animation_choice import has_own_animations, keeps_keys, own_animations
from viewer.rig.motion.evaluation import JointMotion
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.rig.units import METRES

_MOST_DIGITS = 15


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of motion export."""
    group = parser.add_argument_group("writing motions")
    kinds = [key for key, kind in EXPORTERS.items() if kind.stores_motion]
    group.add_argument(
        "--as",
        dest="kind",
        choices=[*EXPORTERS],
        help=f"the format, if the suffix is ambiguous; motions: {', '.join(kinds)}",
    )
    group.add_argument("--to-unit", choices=METRES, help="unit of the file (default: cm in BVH)")
    group.add_argument(
        "--to-up", choices=("y", "z"), help="up axis of the file (default: y in BVH, z in SMPL-X)"
    )
    group.add_argument(
        "--rotation-order", choices=ROTATION_ORDERS, default="zyx", help="BVH (default: zyx)"
    )
    group.add_argument(
        "--quaternions",
        choices=QUATERNIONS,
        default="xyzw",
        help="arrays (.npz): order of the components (default: xyzw)",
    )
    group.add_argument(
        "--rest-frame", action="store_true", help="BVH: begin with a rest pose frame"
    )
    group.add_argument(
        "--optimize",
        action="store_true",
        help="glTF: quantise positions, normals, texture coordinates and weights to 16 bits "
        "(KHR_mesh_quantization); the errors are printed",
    )
    add_spring_argument(group)
    group.add_argument(
        "--safe-names",
        action="store_true",
        help=f"BVH: {SAFE_NAMES}",
    )
    group.add_argument(
        "--digits", type=number, default=6, metavar="N", help="BVH: decimals, 1 to 15 (default: 6)"
    )


def _is_motion(arguments: argparse.Namespace, output: Path, scene: Scene) -> bool:
    """Return whether the whole motion is requested, rather than one pose."""
    kinds = exporters_at(output) if arguments.kind is None else [EXPORTERS[arguments.kind]]
    if not any(kind.stores_motion for kind in kinds):
        return False
    if arguments.frames is not None or "{frame" in output.name:
        return True
    if not any("pose" in kind.stores for kind in kinds):
        return True
    moves = any(isinstance(actor.clip, JointMotion) for actor in scene.actors)
    if any("points" in kind.stores for kind in kinds) and scene.actors:
        moves = moves or all(isinstance(actor.clip, PointClip) for actor in scene.actors)
    wants_one = arguments.time is not None or arguments.frame is not None
    # Many files are written on request only.
    return moves and not wants_one and not any(kind.is_numbered for kind in exporters_at(output))


def _keeps_keys(arguments: argparse.Namespace, output: Path, scene: Scene) -> bool:
    """Return whether animations are written with their own keys instead of as frames.

    This is the case for formats with keys, unless frames, a rate or a single pose is requested, or
    a figure has another motion.
    """
    kinds = exporters_at(output) if arguments.kind is None else [EXPORTERS[arguments.kind]]
    if not any("clips" in kind.stores for kind in kinds) or arguments.gaps is not None:
        return False
    options = arguments.frames, arguments.frame, arguments.time, arguments.fps
    if any(option is not None for option in options):
        return False
    moving = [actor for actor in scene.actors if actor.clip is not None]
    return bool(moving) and all(keeps_keys(scene, actor) for actor in moving)


def motion_options(arguments: argparse.Namespace, skinning: Skinning) -> ExportOptions:
    """Return the requested options of motion export."""
    digits = int(arguments.digits)
    if not 1 <= digits <= _MOST_DIGITS or digits != arguments.digits:
        raise ViewerError(f"--digits: expected 1 to {_MOST_DIGITS}, found {arguments.digits:g}")
    return ExportOptions(
        unit=arguments.to_unit or "",
        up=arguments.to_up or "",
        rotation_order=arguments.rotation_order,
        quaternions=arguments.quaternions,
        gaps="interpolate" if arguments.interpolate_gaps else arguments.gaps or "",
        rest_frame=arguments.rest_frame,
        digits=digits,
        safe_names=arguments.safe_names,
        skinning=skinning,
        optimizes=arguments.optimize,
    )


def selected(
    arguments: argparse.Namespace, scene: Scene, output: Path, skinning: Skinning
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Return what is written of a scene, how, and notes about what was chosen.

    Animations keep their own keys where the format holds them; other motions are sampled. Without
    a motion, or if one pose is requested, the current poses are written: as a motion of one frame
    if the format holds nothing else. Raises ``ViewerError`` if there is nothing to write.
    """
    options = motion_options(arguments, skinning)
    if _keeps_keys(arguments, output, scene):
        return _clips(arguments, scene, replace(options, gaps=""))
    if _is_motion(arguments, output, scene):
        return _motions(arguments, scene, output, options)
    actors = pose_or_point_actors(scene)
    options = replace(options, gaps="", meta=vrm_meta(arguments, output))
    chosen = Selection([Part(actor) for actor in actors], scene)
    return chosen, options, left_out_notes(scene, actors)


def _clips(
    arguments: argparse.Namespace, scene: Scene, options: ExportOptions
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Select figures at rest with their animations, or only with the requested one."""
    is_chosen, refused = bool(arguments.animation), list[FormatError]()
    parts, actors = list[Part](), pose_or_point_actors(scene)
    for actor in actors:
        own = own_animations(actor, is_chosen, refused) if has_own_animations(actor) else ()
        parts.append(Part(actor, own or None))
    # Figures of one file share its animations.
    problems = dict.fromkeys(map(str, refused))
    notes = left_out_notes(scene, actors) + [
        Diagnostic("X003.invalid-animation", values={"problem": each}) for each in problems
    ]
    return Selection(parts, scene), options, notes


def _motions(
    arguments: argparse.Namespace, scene: Scene, output: Path, options: ExportOptions
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Select every actor's motion; a file that holds several also gets the figures at rest.

    If one pose is requested, or nothing moves, a motion of one frame is written.
    """
    options.kind = key = _exporter(arguments, output, scene)
    actors = written_actors(arguments, output, scene)
    is_pose = asks_one_pose(arguments, output, scene)
    if is_pose:
        parts = [part_of_pose(arguments, key, options, scene, actor) for actor in actors]
    else:
        parts = [_whole_motion(arguments, key, options, scene, actor) for actor in actors]
    if "pose" in EXPORTERS[key].stores and is_together(EXPORTERS[key], output, options):
        others = [each for each in scene.actors if each not in actors]
        parts += [Part(each) for each in others if each.clip is None]
    notes = [pose_note(arguments, scene)] * is_pose
    notes += left_out_notes(scene, [part.actor for part in parts])
    return Selection(parts, scene), options, notes


def _whole_motion(
    arguments: argparse.Namespace, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return the requested frames of an actor."""
    frames, fills = requested_frames(arguments, actor), bool(arguments.interpolate_gaps)
    if isinstance(actor.clip, PointClip):
        if options.gaps not in ("", "interpolate"):
            raise ViewerError(f"--gaps: expected interpolate for keypoints, found {options.gaps}")
        fills = options.gaps == "interpolate"
    return sampled(key, options, scene, actor, arguments.fps, frames, fills)


def _exporter(arguments: argparse.Namespace, output: Path, scene: Scene) -> str:
    """Return the requested exporter, or the first one for the suffix and the figures."""
    exporters_of(output, "frames")
    first = written_actors(arguments, output, scene)[0]
    if isinstance(first.clip, PointClip):
        (key,) = exporters_of(output, "points")
        if arguments.kind not in (None, key):
            exporters_of("", "points")
        return key
    if arguments.kind is not None:
        check_kind(arguments, output)
        return str(arguments.kind)
    return suited_exporter(output, first.figure)


def requested_frames(arguments: argparse.Namespace, actor: Actor) -> tuple[int, int | None] | None:
    """Return the requested range, counted from 0: its first frame and one past its last."""
    if arguments.frames is None:
        return None
    found = parse_range(arguments.frames)
    if found.step != 1:
        raise ViewerError(f"--frames: expected A:B, found {printable(arguments.frames, 40)}")
    return numbering_of([actor], arguments.fps).span(found)


def check_kind(arguments: argparse.Namespace, output: Path) -> None:
    """Raise for a file name whose suffix the requested exporter does not write."""
    if arguments.kind is None:
        return
    known, suffix = EXPORTERS[arguments.kind].suffixes, output.suffix.lower() or "/"
    if suffix not in known:
        raise UnsupportedFormatError(
            f"--as {arguments.kind}: expected a name with {', '.join(known)}, "
            f"found {printable(output, 300)}"
        )


def check_numbered(arguments: argparse.Namespace, output: Path) -> None:
    """Check the name pattern of numbered files.

    Raises ViewerError if one file contains the whole motion, or all names would be the same.
    """
    is_numbered = any(kind.is_numbered for kind in exporters_at(output))
    if "{frame" not in output.name and not (arguments.frames and is_numbered):
        return
    if not is_numbered:
        suffixes = [kind.suffixes[0] for kind in EXPORTERS.values() if kind.is_numbered]
        raise UnsupportedFormatError(
            f"{printable(output, 300)}: expected {', '.join(suffixes)} for one file per frame, "
            f"found {output.suffix.lower() or 'a folder'}"
        )
    try:
        name = output.name.replace(PERSON, "")
        first, second = (name.format(frame=frame) for frame in (0, 1))
    except (ValueError, KeyError, IndexError, AttributeError):
        first = second = ""
    if first == second:
        raise ViewerError(
            f"{printable(output, 300)}: expected a name with {{frame}}, such as walk_{{frame:05}}"
            f"{output.suffix}, for one file per frame"
        )
