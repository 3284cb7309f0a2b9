"""Choice of what ``convert`` writes: actors, poses, keys or frames, the exporter, and options."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from viewer.commands._frames import Frames, numbering_of, parse_range
from viewer.commands._one_pose import asks_one_pose, part_of_pose, pose_note
from viewer.commands._scene import SceneOptions
from viewer.commands._settings import add_settings, number, settings_of
from viewer.commands._writing.baked_springs import add_spring_argument
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
    VrmMeta,
    exporters_at,
    exporters_of,
    sampled,
    suited_exporter,
)
from viewer.export._motion_paths import PERSON, is_together
from viewer.phrases import printable
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.animation_choice import has_own_animations, keeps_keys, own_animations
from viewer.rig.motion.evaluation import JointMotion
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of motion export."""
    group = parser.add_argument_group("writing motions")
    usual = ", ".join(key for key, kind in EXPORTERS.items() if kind.stores_motion)
    add_settings(group, ExportOptions, "kind", choices=[*EXPORTERS], usual=usual)
    names = "unit", "up", "rotation_order", "quaternions", "rest_frame", "optimizes"
    add_settings(group, ExportOptions, *names)
    add_spring_argument(group)
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
    moves = any(isinstance(actor.clip, JointMotion) for actor in scene.actors)
    if any("points" in kind.stores for kind in kinds) and scene.actors:
        moves = moves or all(isinstance(actor.clip, PointClip) for actor in scene.actors)
    # Many files are written on request only.
    return (
        moves and not frames.is_one and not any(kind.is_numbered for kind in exporters_at(output))
    )


def _keeps_keys(key: str, frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether animations are written with their own keys instead of as frames.

    This is the case for formats with keys, unless frames, a rate or a single pose is requested, or
    a figure has another motion.
    """
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
    """Return what is written of a scene, how, and notes about what was chosen.

    Animations keep their own keys where the format holds them; other motions are sampled. Without
    a motion, or if one pose is requested, the current poses are written: as a motion of one frame
    if the format holds nothing else. Raises ``ViewerError`` if there is nothing to write.
    """
    frames = asked.frames
    if _keeps_keys(options.kind, frames, output, scene):
        is_chosen = bool(asked.motion.animation)
        return _clips(is_chosen, scene, replace(options, gaps="", meta=VrmMeta()))
    if _is_motion(options.kind, frames, output, scene):
        return _motions(frames, scene, output, replace(options, meta=VrmMeta()))
    actors = pose_or_point_actors(scene)
    options = replace(options, gaps="")
    chosen = Selection([Part(actor) for actor in actors], scene)
    return chosen, options, left_out_notes(scene, actors)


def _clips(
    is_chosen: bool, scene: Scene, options: ExportOptions
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Select figures at rest with their animations, or only with the requested one."""
    refused, parts, actors = list[FormatError](), list[Part](), pose_or_point_actors(scene)
    for actor in actors:
        own = own_animations(actor, is_chosen, refused) if has_own_animations(actor) else ()
        parts.append(Part(actor, own or None))
    # Figures of one file share its animations.
    problems = dict.fromkeys(map(str, refused))
    notes = left_out_notes(scene, actors) + [
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
    """Select every actor's motion; a file that holds several also gets the figures at rest.

    If one pose is requested, or nothing moves, a motion of one frame is written.
    """
    options.kind = key = _exporter(options.kind, frames, output, scene)
    actors = written_actors(frames, output, scene)
    is_pose = asks_one_pose(frames, output, scene)
    if is_pose:
        parts = [part_of_pose(frames, key, options, scene, actor) for actor in actors]
    else:
        parts = [_whole_motion(frames, key, options, scene, actor) for actor in actors]
    if "pose" in EXPORTERS[key].stores and is_together(EXPORTERS[key], output, options):
        others = [each for each in scene.actors if each not in actors]
        parts += [Part(each) for each in others if each.clip is None]
    notes = [pose_note(frames, scene)] * is_pose
    notes += left_out_notes(scene, [part.actor for part in parts])
    return Selection(parts, scene), options, notes


def _whole_motion(
    frames: Frames, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return the requested frames of an actor."""
    fills = frames.interpolates
    if isinstance(actor.clip, PointClip):
        if options.gaps not in ("", "interpolate"):
            raise ViewerError(f"--gaps: expected interpolate for keypoints, found {options.gaps}")
        fills = options.gaps == "interpolate"
    span = requested_frames(frames, actor)
    return sampled(key, options, scene, actor, frames.fps, span, fills)


def _exporter(kind: str, frames: Frames, output: Path, scene: Scene) -> str:
    """Return the requested exporter, or the first one for the suffix and the figures."""
    exporters_of(output, "frames")
    first = written_actors(frames, output, scene)[0]
    if isinstance(first.clip, PointClip):
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
    """Check the name pattern of numbered files.

    Raises ViewerError if one file contains the whole motion, or all names would be the same.
    """
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
