"""Export of a scene's motions: choice of exporter and frames, one file per actor."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from viewer.commands._frames import numbering_of, parse_range
from viewer.commands._one_pose import animation_of_pose, asks_one_pose, pose_note
from viewer.commands._settings import number
from viewer.commands._writing.baked_springs import add_spring_argument
from viewer.commands._writing.written_actors import able_actors, left_out_notes, written_actors
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, frame_range
from viewer.errors import RigError, UnsupportedFormatError, ViewerError
from viewer.export import (
    EXPORTERS,
    MotionOptions,
    animation_for,
    check_figure,
    export_animation,
    files_written,
    motion_exporters,
    suited_exporter,
)
from viewer.export._motion_paths import PERSON, animation_files, is_together, motion_paths
from viewer.export._options import QUATERNIONS, ROTATION_ORDERS, SAFE_NAMES
from viewer.formats import all_or_none
from viewer.interrupts import raising
from viewer.phrases import printable
from viewer.rig.arrays import Bools
from viewer.rig.captures.person import is_tracked, person_label
from viewer.rig.captures.points import PointClip
from viewer.rig.captures.sampled_points import SampledPoints, sample_upright_points
from viewer.rig.motion.animation_choice import keeps_keys
from viewer.rig.motion.evaluation import JointMotion
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.rig.units import METRES

_MOST_DIGITS = 15
_OF_POINTS = "npz"  # exporter for captured points
# These write one file per frame, so motions are written only on request.
_ONE_A_FRAME = (".obj",)


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of motion export."""
    group = parser.add_argument_group("writing motions")
    kinds = [key for key, kind in EXPORTERS.items() if kind.writes_motion]
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


def is_motion(arguments: argparse.Namespace, output: Path, scene: Scene) -> bool:
    """Return whether the whole motion is requested, rather than one pose."""
    suffix = output.suffix.lower() or "/"
    if arguments.kind is not None:
        kinds = [EXPORTERS[arguments.kind]]
    else:
        kinds = [kind for kind in EXPORTERS.values() if suffix in kind.suffixes]
    if not any(kind.writes_motion for kind in kinds):
        return False
    if arguments.frames is not None or "{frame" in output.name:
        return True
    if not any(kind.writes_pose for kind in kinds):
        return True
    moves = any(isinstance(actor.clip, JointMotion) for actor in scene.actors)
    if EXPORTERS[_OF_POINTS] in kinds and scene.actors:
        moves = moves or all(isinstance(actor.clip, PointClip) for actor in scene.actors)
    wants_one = arguments.time is not None or arguments.frame is not None
    return moves and not wants_one and suffix not in _ONE_A_FRAME


def writes_keys(arguments: argparse.Namespace, output: Path, scene: Scene) -> bool:
    """Return whether animations are written with their own keys instead of as frames.

    This is the case for formats with keys, unless frames, a rate or a single pose is requested, or
    a figure has another motion.
    """
    suffix = output.suffix.lower()
    kinds = [key for key, kind in EXPORTERS.items() if kind.writes_keys and suffix in kind.suffixes]
    if not kinds or arguments.kind not in (None, *kinds) or arguments.gaps is not None:
        return False
    options = arguments.frames, arguments.frame, arguments.time, arguments.fps
    if any(option is not None for option in options):
        return False
    moving = [actor for actor in scene.actors if actor.clip is not None]
    return bool(moving) and all(keeps_keys(scene, actor) for actor in moving)


def motion_options(arguments: argparse.Namespace, skinning: Skinning) -> MotionOptions:
    """Return the requested options of motion export."""
    digits = int(arguments.digits)
    if not 1 <= digits <= _MOST_DIGITS or digits != arguments.digits:
        raise ViewerError(f"--digits: expected 1 to {_MOST_DIGITS}, found {arguments.digits:g}")
    return MotionOptions(
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


def write_motions(
    arguments: argparse.Namespace,
    scene: Scene,
    output: Path,
    skinning: Skinning,
    check: Callable[[list[Path]], None],
) -> list[Diagnostic]:
    """Write every actor's motion; return notes about what was written and what was lost.

    Formats that hold several figures get one file, which includes the figures that do not move. If
    one pose is requested, or nothing moves, a motion of one frame is written. People absent
    from all frames are omitted, and the others keep their file names. ``check`` is called with
    all files before the first is written, and raises if one of them must not be replaced.

    Raises ViewerError if no actor has a motion that the format can store, or no person is present
    in the frames; in that case, nothing is written.
    """
    options = motion_options(arguments, skinning)
    key = _exporter(arguments, output, scene)
    all_written = written_actors(arguments, output, scene)
    actors, lacking = able_actors(all_written, key)
    for actor in actors:
        check_figure(key, actor.figure)
    is_pose = asks_one_pose(arguments, output, scene)
    is_one = EXPORTERS[key].writes_several and is_together(output, options)
    paths = [output] * len(actors) if is_one else motion_paths(output, actors)
    parts = []
    for actor, path in zip(actors, paths, strict=True):
        if is_pose:
            animation: SampledAnimation | SampledPoints
            animation, up = animation_of_pose(arguments, key, options, scene, actor)
        else:
            animation, up = _whole_animation(arguments, key, options, scene, actor)
        parts.append(_Part(actor, animation, up, path))
    there = [part for part in parts if part.present.any()]
    if not there:
        raise RigError(f"no person is present in {parts[0].span}: there is nothing to write")
    others = [each for each in scene.actors if each not in all_written]
    still = [each for each in others if is_one and each.clip is None]
    # The cameras of a scene are written together with the joints that carry them.
    if is_one and (len(there) + len(still) > 1 or scene.views):
        notes = _write_together(there, scene, output, options, still, check)
    else:
        notes = _write(there, output, key, options, check)
    notes += _untracked_notes(there, key, is_one and len(there) > 1)
    for part in parts:
        if not part.present.any():
            values = {"figure": part.animation.name, "frames": part.span}
            notes.append(Diagnostic("X003.absent", values=values))
    left = left_out_notes(scene, all_written + still)
    return [*notes, *[pose_note(arguments, scene)] * is_pose, *lacking, *left]


def _whole_animation(
    arguments: argparse.Namespace, key: str, options: MotionOptions, scene: Scene, actor: Actor
) -> tuple[SampledAnimation | SampledPoints, str]:
    """Return the requested frames of an actor, and their up axis."""
    frames, fills = requested_frames(arguments, actor), bool(arguments.interpolate_gaps)
    if not isinstance(actor.clip, PointClip):
        return animation_for(key, options, scene, actor, arguments.fps, frames, fills)
    if options.gaps not in ("", "interpolate"):
        raise ViewerError(f"--gaps: expected interpolate for keypoints, found {options.gaps}")
    fills = options.gaps == "interpolate"
    return sample_upright_points(scene, actor, arguments.fps, frames, fills)


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Frames of one actor, their up axis, and the file they are written to."""

    actor: Actor
    animation: SampledAnimation | SampledPoints
    up: str
    path: Path

    @property
    def present(self) -> Bools:
        animation = self.animation
        return (
            animation.frames.present
            if isinstance(animation, SampledAnimation)
            else animation.present
        )

    @property
    def span(self) -> Phrase:
        first = self.animation.first_frame
        return frame_range(first, first + len(self.present) - 1)


def _write(
    parts: list[_Part],
    output: Path,
    key: str,
    options: MotionOptions,
    check: Callable[[list[Path]], None],
) -> list[Diagnostic]:
    """Write the motions of the people present; return the exporters' notes."""
    if key == "easymocap":
        return _write_capture(parts, output, options)
    files = [
        file for part in parts for file in animation_files(part.animation, part.path, key, options)
    ]
    check(files)
    notes: list[Diagnostic] = []
    with all_or_none(files):
        for part in parts:
            options.world_up = part.up
            with raising():
                notes += _write_one(part, key, options)
    return notes


def _write_one(part: _Part, key: str, options: MotionOptions) -> list[Diagnostic]:
    if isinstance(part.animation, SampledAnimation):
        return export_animation(part.animation, part.path, key, options)
    from viewer.export.npz import export_points

    return export_points(part.animation, part.path, options)


def _write_together(
    parts: list[_Part],
    scene: Scene,
    output: Path,
    options: MotionOptions,
    still: list[Actor],
    check: Callable[[list[Path]], None],
) -> list[Diagnostic]:
    """Write the people present and the figures that do not move into one file."""
    from viewer.export.gltf import export_animations

    files = files_written(output)
    check(files)
    motions = [
        (part.actor, part.animation, part.up)
        for part in parts
        if isinstance(part.animation, SampledAnimation)
    ]
    with raising(), all_or_none(files):
        return export_animations(motions, output, options, scene, still)


def _write_capture(parts: list[_Part], output: Path, options: MotionOptions) -> list[Diagnostic]:
    """Write all people into one folder."""
    from viewer.export.easymocap import export_animations

    ups = sorted({part.up for part in parts})
    if len(ups) > 1:
        raise RigError(f"expected one up axis for all people, found {' and '.join(ups)}")
    options.world_up = parts[0].up
    animations = [part.animation for part in parts if isinstance(part.animation, SampledAnimation)]
    actors = [part.actor for part in parts]
    people = [index if a.person is None else a.person for index, a in enumerate(actors)]
    return export_animations(animations, output, options, people)


def _untracked_notes(parts: list[_Part], key: str, is_together: bool) -> list[Diagnostic]:
    """Return a note about files of untracked people, or about these people in one file."""
    names = []
    for part in parts:
        person = part.actor.person
        if person is None or is_tracked(person):
            continue
        if key == "easymocap":
            names.append(person_label(person))
        else:
            names.append(printable(part.animation.name if is_together else part.path.name))
    if not names:
        return []
    return [Diagnostic("X005.untracked", values={"names": names})]


def _exporter(arguments: argparse.Namespace, output: Path, scene: Scene) -> str:
    """Return the requested exporter, or the first one for the suffix and the figures."""
    found, actors = motion_exporters(output), written_actors(arguments, output, scene)
    if isinstance(actors[0].clip, PointClip):
        if _OF_POINTS not in found or arguments.kind not in (None, _OF_POINTS):
            raise RigError(
                "there are only keypoints: a motion of joints cannot be written (.npz stores "
                "points)"
            )
        return _OF_POINTS
    if arguments.kind is not None:
        check_kind(arguments, output)
        return str(arguments.kind)
    return suited_exporter(output, actors[0].figure)


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
    suffix = output.suffix.lower()
    if "{frame" not in output.name and not (arguments.frames and suffix in _ONE_A_FRAME):
        return
    if suffix not in _ONE_A_FRAME:
        raise UnsupportedFormatError(
            f"{printable(output, 300)}: expected {', '.join(_ONE_A_FRAME)} for one file per frame, "
            f"found {suffix or 'a folder'}"
        )
    check_frame_field(output)


def check_frame_field(output: Path) -> None:
    """Raise for a name of numbered files without a valid frame field."""
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
