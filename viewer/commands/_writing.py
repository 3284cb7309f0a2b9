"""What ``convert`` writes: actors, poses, keys or frames, the exporter, and its options."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from viewer.commands._frames import Frames, numbering_of, parse_range
from viewer.commands._scene import SceneOptions
from viewer.commands._settings import add_settings, number, settings_of
from viewer.diagnostics import Diagnostic, wording
from viewer.errors import FormatError, RigError, UnsupportedFormatError, ViewerError
from viewer.export import (
    EXPORTERS,
    ExportOptions,
    Part,
    Selection,
    VrmMeta,
    exporters_at,
    exporters_of,
    sampled,
    suited_exporter,
)
from viewer.export._motion_paths import PERSON, is_together
from viewer.phrases import Remedy, agree, all_of, counted, printable
from viewer.rig.motion.animation_choice import has_own_animations, keeps_keys, own_animations
from viewer.rig.motion.sampled_animation import upright_single_frame
from viewer.rig.motion.spring_motion import has_springs, with_baked_springs
from viewer.rig.motion.timing import frame_at
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of motion export."""
    group = parser.add_argument_group("writing motions")
    usual = ", ".join(key for key, kind in EXPORTERS.items() if kind.stores_motion)
    add_settings(group, ExportOptions, "kind", choices=[*EXPORTERS], usual=usual)
    names = "unit", "up", "rotation_order", "quaternions", "rest_frame", "optimizes"
    add_settings(group, ExportOptions, *names)
    group.add_argument(
        "--bake-springs",
        dest="springs",
        action="store_const",
        const="on",
        default="off",
        help="write the simulated rotations of spring joints, such as hair in VRM files",
    )
    add_settings(group, ExportOptions, "safe_names")
    add_settings(group, ExportOptions, "digits", type=number)


def _is_motion(key: str, frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether the whole motion is requested, rather than one pose."""
    kinds = [EXPORTERS[key]] if key else exporters_at(output)
    if not any(kind.stores_motion for kind in kinds):
        return False
    if frames.frames is not None or "{frame" in output.name:
        return True
    if not any("pose" in kind.stores for kind in kinds):
        return True
    moves = any(actor.joint_motion for actor in scene.actors)
    if any("points" in kind.stores for kind in kinds) and scene.actors:
        moves = moves or all(actor.moves_points for actor in scene.actors)
    # Many files are written on request only.
    return (
        moves and not frames.is_one and not any(kind.is_numbered for kind in exporters_at(output))
    )


def _keeps_keys(key: str, frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether animations are written with their own keys instead of as frames."""
    # This is the case for formats with keys, unless frames, a rate or a single pose is requested,
    # or a figure has another motion.
    kinds = [EXPORTERS[key]] if key else exporters_at(output)
    if not any("clips" in kind.stores for kind in kinds) or frames.gaps:
        return False
    options = frames.frames, frames.frame, frames.time, frames.fps
    if any(option is not None for option in options):
        return False
    moving = [actor for actor in scene.actors if actor.clip is not None]
    return bool(moving) and all(keeps_keys(scene, actor) for actor in moving)


def export_options(
    arguments: argparse.Namespace, frames: Frames, skinning: Skinning
) -> ExportOptions:
    """Return the requested options of export."""
    if arguments.digits != int(arguments.digits):
        raise ViewerError(f"--digits: expected 1 to 15, found {arguments.digits:g}")
    return settings_of(
        ExportOptions,
        arguments,
        gaps="interpolate" if frames.interpolates else frames.gaps,
        skinning=skinning,
        meta=settings_of(VrmMeta, arguments),
    )


def selected(
    asked: SceneOptions, options: ExportOptions, scene: Scene, output: Path
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Return what is written of a scene, how, and notes about what was chosen."""
    # Animations keep their own keys where the format holds them; other motions are sampled. Without
    # a motion, or if one pose is requested, the current poses are written: as a motion of one frame
    # if the format holds nothing else.
    frames = asked.frames
    if _keeps_keys(options.kind, frames, output, scene):
        is_chosen = bool(asked.motion.animation)
        return _clips(is_chosen, scene, replace(options, gaps="", meta=VrmMeta()))
    if _is_motion(options.kind, frames, output, scene):
        return _motions(frames, scene, output, replace(options, meta=VrmMeta()))
    actors = _pose_or_point_actors(scene)
    options = replace(options, gaps="")
    chosen = Selection([Part(actor) for actor in actors], scene)
    return chosen, options, _left_out_notes(scene, actors)


def _clips(
    is_chosen: bool, scene: Scene, options: ExportOptions
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Select figures at rest with their animations, or only with the requested one."""
    refused, parts, actors = list[FormatError](), list[Part](), _pose_or_point_actors(scene)
    for actor in actors:
        own = own_animations(actor, is_chosen, refused) if has_own_animations(actor) else ()
        parts.append(Part(actor, own or None))
    # Figures of one file share its animations.
    problems = dict.fromkeys(map(str, refused))
    notes = _left_out_notes(scene, actors) + [
        Diagnostic(
            "X003.invalid-animation: {problem}; this animation is not written",
            values={"problem": each},
        )
        for each in problems
    ]
    return Selection(parts, scene), options, notes


def _motions(
    frames: Frames, scene: Scene, output: Path, options: ExportOptions
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Select every actor's motion; a file that holds several also gets the figures at rest."""
    # If one pose is requested, or nothing moves, a motion of one frame is written.
    options.kind = key = _exporter(options.kind, frames, output, scene)
    actors = _written_actors(frames, output, scene)
    is_pose = _asks_one_pose(frames, output, scene)
    if is_pose:
        parts = [_part_of_pose(frames, key, options, scene, actor) for actor in actors]
    else:
        parts = [_whole_motion(frames, key, options, scene, actor) for actor in actors]
    if "pose" in EXPORTERS[key].stores and is_together(EXPORTERS[key], output, options):
        others = [each for each in scene.actors if each not in actors]
        parts += [Part(each) for each in others if each.clip is None]
    notes = [_pose_note(frames, scene)] * is_pose
    notes += _left_out_notes(scene, [part.actor for part in parts])
    return Selection(parts, scene), options, notes


def _whole_motion(
    frames: Frames, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return the requested frames of an actor."""
    fills = frames.interpolates
    if actor.moves_points:
        if options.gaps not in ("", "interpolate"):
            raise ViewerError(f"--gaps: expected interpolate for keypoints, found {options.gaps}")
        fills = options.gaps == "interpolate"
    span = requested_frames(frames, actor)
    return sampled(key, options, scene, actor, frames.fps, span, fills)


def _exporter(kind: str, frames: Frames, output: Path, scene: Scene) -> str:
    """Return the requested exporter, or the first one for the suffix and the figures."""
    exporters_of(output, "frames")
    first = _written_actors(frames, output, scene)[0]
    if first.moves_points:
        (key,) = exporters_of(output, "points")
        if kind not in ("", key):
            exporters_of("", "points")
        return key
    if kind:
        check_kind(kind, output)
        return kind
    return suited_exporter(output, first.figure)


def requested_frames(frames: Frames, actor: Actor) -> tuple[int, int | None] | None:
    """Return the requested range, counted from 0: its first frame and one past its last."""
    if frames.frames is None:
        return None
    found = parse_range(frames.frames)
    if found.step != 1:
        raise ViewerError(f"--frames: expected A:B, found {printable(frames.frames, 40)}")
    return numbering_of([actor], frames.fps).span(found)


def check_kind(kind: str, output: Path) -> None:
    """Raise for a file name whose suffix the requested exporter does not write."""
    if not kind:
        return
    known, suffix = EXPORTERS[kind].suffixes, output.suffix.lower() or "/"
    if suffix not in known:
        raise UnsupportedFormatError(
            f"--as {kind}: expected a name with {', '.join(known)}, found {printable(output, 300)}"
        )


def check_numbered(has_frames: bool, output: Path) -> None:
    """Refuse a name pattern if one file contains the whole motion, or all names are the same."""
    is_numbered = any(kind.is_numbered for kind in exporters_at(output))
    if "{frame" not in output.name and not (has_frames and is_numbered):
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


def check_frame_options(frames: Frames) -> None:
    """Check that a range of frames and a single one are not both given."""
    for option in ("frame", "time"):
        if frames.frames is not None and getattr(frames, option) is not None:
            raise ViewerError(f"--frames and --{option}: expected one of them, found both")


def _asks_one_pose(frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether a single pose is written: at a frame or time, or if there is no motion."""
    if frames.frames is not None or all(actor.pose is None for actor in scene.actors):
        return False
    is_still = not _moving(scene) and "{frame" not in output.name
    return is_still or frames.is_one


def _posed_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose pose is written: those with a motion, else all with a skeleton."""
    return _moving(scene) or [actor for actor in scene.actors if actor.pose is not None]


def _part_of_pose(
    frames: Frames, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return an actor's pose as a motion of one frame, with the number that ``--frame`` uses."""
    # Between two frames, it is that of the displayed frame.
    numbering = numbering_of(scene.actors, frames.fps)
    time = numbering.start if scene.time is None else scene.time
    number = numbering.first + frame_at(time - numbering.start, numbering.rate)
    keeps_world = EXPORTERS[key].keeps_world and not options.up
    return Part(
        actor, None, *upright_single_frame(scene, actor, numbering.rate, number, time, keeps_world)
    )


def _pose_note(frames: Frames, scene: Scene) -> Diagnostic:
    """Return the note that explains why there is only one frame."""
    if not _moving(scene):
        return Diagnostic(wording.CURRENT_POSE)
    if frames.frame is not None:
        return Diagnostic(
            "X001.pose-at-frame: one frame: the pose at frame {frame}",
            values={"frame": frames.frame},
        )
    if frames.time is not None:
        return Diagnostic(
            "X001.pose-at-time: one frame: the pose at {time:zg} s", values={"time": frames.time}
        )
    return Diagnostic(wording.CURRENT_POSE)


def _moving(scene: Scene) -> list[Actor]:
    return [actor for actor in scene.actors if actor.joint_motion]


def _left_out_notes(scene: Scene, written: list[Actor]) -> list[Diagnostic]:
    """Return notes about omitted data: still figures, and keypoints of people with bodies."""
    left = [actor for actor in scene.actors if actor not in written]
    still = [actor.name for actor in left if actor.clip is None]
    points = [actor.name for actor in left if actor.moves_points]
    moves = any(actor.clip is not None for actor in written)
    key = (
        "X003.no-motion: {figure}: no motion, not written"
        if moves
        else "X003.no-joints: {figure}: no joints, not written"
    )
    notes = [Diagnostic(key, values={"figure": name}) for name in still]
    if points:
        notes.append(
            Diagnostic(
                "X003.keypoints: keypoints next to bodies are not written ({names}): to write "
                "them, open only the keypoints3d folder",
                values={"names": all_of(points)},
            )
        )
    return notes


def _pose_or_point_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose current pose is written: captured points only if there is no body."""
    figures = [actor for actor in scene.actors if not actor.moves_points]
    return figures or list(scene.actors)


def _written_actors(frames: Frames, output: Path, scene: Scene) -> list[Actor]:
    """Return the actors whose motion is written, or whose pose is written as a one-frame motion."""
    if _asks_one_pose(frames, output, scene):
        return _posed_actors(scene)
    return _moving_actors(scene)


def _moving_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose motions are written: bodies, or captured points if there are none."""
    moving = [actor for actor in scene.actors if actor.clip is not None]
    bodies = [actor for actor in moving if not actor.moves_points]
    if not moving:
        raise RigError("no file has a motion: a motion cannot be written")
    return bodies or moving


def bake_springs(bakes: bool, fps: float | None, scene: Scene, output: Path) -> list[Diagnostic]:
    """Replace motions of figures with spring joints by frames, if requested; return notes."""
    holds_motion = not any(kind.joints == "human" for kind in exporters_at(output))
    actors = [actor for actor in scene.actors if actor.joint_motion and has_springs(actor)]
    actors = actors if holds_motion else []
    if bakes and not holds_motion:
        raise ViewerError(
            f"--bake-springs: {printable(output.suffix)} cannot store motions of spring joints"
        )
    if bakes and not actors:
        raise ViewerError("--bake-springs: no figure with a motion has spring joints")
    notes = []
    for actor in actors:
        springs = actor.figure.require_skeleton().springs
        count = 0 if springs is None else springs.n_joints
        if bakes:
            actor.clip = with_baked_springs(actor, fps)
            actor.springs, actor.animation = None, -1
        key = (
            "X005.springs-baked: {figure}: simulated rotations of {n} are written"
            if bakes
            else wording.SPRINGS
        )
        notes.append(
            Diagnostic(
                key,
                values={
                    "figure": actor.name,
                    "n": counted(count, "spring joint"),
                    "have": agree(count, "has", "have"),
                    "remedy": Remedy("can write", "--bake-springs writes"),
                },
            )
        )
    return notes


def add_vrm_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that name a character, its authors and its licence."""
    group = parser.add_argument_group("writing VRM characters")
    add_settings(group, VrmMeta, "name", "authors", "licence")


def check_meta(meta: VrmMeta, output: Path | None) -> None:
    """Raise ViewerError if there are meta data, but the output is not a VRM file."""
    given = {
        "--vrm-name": meta.name,
        "--vrm-author": meta.authors,
        "--vrm-licence": meta.licence,
    }
    named = next((option for option, value in given.items() if value), "")
    kinds = [] if output is None else exporters_at(output)
    if named and not any("meta" in kind.options for kind in kinds):
        suffix = printable(output.suffix) if output is not None and output.suffix else "no suffix"
        raise ViewerError(f"{named}: expected an output with .vrm, found {suffix}")
