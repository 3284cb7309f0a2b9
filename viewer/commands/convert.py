"""Conversion of figures, poses and motions to other formats.

The files are opened as one scene, which is cleaned up and posed as requested, and written: a pose,
a motion, or figures with their animations, in one file, or in one for each actor if the name has
``{person}``. All files are written or none. A long BVH file that is written as BVH again is
converted part by part (``convert_streamed``), if no option needs the whole motion in memory.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._frames import Frames, add_frame_arguments, numbering_of, parse_range
from viewer.commands._pose import (
    PoseOptions,
    add_pose_arguments,
    add_skinning_arguments,
    apply_pose,
    use_file_method,
)
from viewer.commands._progress import shown_progress
from viewer.commands._scene import (
    SceneOptions,
    add_capture_arguments,
    add_file_arguments,
    inputs_of,
    open_scene,
    print_warnings,
    scene_options,
)
from viewer.commands._settings import add_settings, number, settings_of, stated
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, OutputError, RigError, UnsupportedFormatError, ViewerError
from viewer.exporters import (
    EXPORTERS,
    FOLDER,
    ExportOptions,
    PageOptions,
    Part,
    SampledParts,
    Selection,
    VrmMeta,
    export,
    exporters_at,
    exporters_of,
    files_written,
    known_suffixes,
    no_exporter,
    output_files,
    sampled,
    suited_exporter,
)
from viewer.exporters._motion_paths import PERSON, is_together, motion_paths, numbered_paths
from viewer.formats import Source, all_or_none, check_folder_target, check_targets, detect
from viewer.interrupts import hold, raising
from viewer.loading import Contents, MotionSettings, begin
from viewer.near_names import name_hint
from viewer.phrases import Remedy, agree, all_of, counted, printable
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.motion.animation_choice import has_own_animations, keeps_keys, own_animations
from viewer.rigs.motion.sampled_animation import SampledAnimation, frame_range, upright_single_frame
from viewer.rigs.motion.timing import frame_at
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning
from viewer.rigs.springs.simulation import has_springs, with_baked_springs
from viewer.streams import is_stdout, require_stdout, summary_stream

if TYPE_CHECKING:
    from viewer.formats.bvh import LongMotion


# Streamed conversion.
_PEEK = 1 << 16  # bytes that identify the format
_LARGE = 8_000_000  # bytes; smaller files are read as a whole


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
        help=f"one of {known_suffixes()}; walk_{{frame:05}}.obj for numbered meshes, "
        "walk_{person}.glb for a file per person",
    )
    group.add_argument("--force", action="store_true", help="replace existing files")
    group.add_argument(
        "--save-joint-map",
        metavar="FILE",
        help="also write which joint of the motion drives each joint of the figure, as a text file "
        "for --joint-map (in a batch, a template such as maps/{stem}.txt)",
    )
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
    add_vrm_arguments(parser)
    group = parser.add_argument_group("writing HTML pages")
    add_settings(group, PageOptions, "caption", "wipes")
    add_frame_arguments(parser, "A:B")
    add_capture_arguments(parser, gaps="write")
    add_cleanup_arguments(parser)
    parser.add_argument_group("faults that viewer lint finds").add_argument(
        "--fix",
        nargs="?",
        const="",
        metavar="CODE,…",
        help="fix them before writing: all errors and warnings that have a fix, or these codes, "
        "such as W011,C020; changes and what remains are printed",
    )
    add_pose_arguments(parser)
    add_skinning_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write poses or motions; print messages about written files and losses."""
    output, asked = Path(arguments.output), scene_options(arguments)
    skinning = settings_of(Skinning, arguments)
    if arguments.digits != int(arguments.digits):
        raise ViewerError(f"--digits: expected 1 to 15, found {arguments.digits:g}")
    options = settings_of(
        ExportOptions,
        arguments,
        gaps="interpolate" if asked.frames.interpolates else asked.frames.gaps,
        skinning=skinning,
        meta=settings_of(VrmMeta, arguments),
        page=settings_of(PageOptions, arguments),
    )
    _check_suffix(asked, options, output, arguments.force)
    joint_map = None if arguments.save_joint_map is None else Path(arguments.save_joint_map)
    fixes_nothing = arguments.fix is None
    is_plain = joint_map is None and fixes_nothing
    notes = convert_streamed(asked, options, output) if is_plain else None
    if notes is None:
        scene = open_scene(asked)
        print_warnings(use_file_method(scene, skinning, stated(Skinning, arguments)))
        fixed = [] if fixes_nothing else _fixed(scene, arguments.fix)
        baked = _bake_springs(asked.motion.springs, asked.frames.fps, scene, output)
        saving = _saving_joint_map(joint_map, asked, scene, output, arguments.force)
        with saving, shown_progress("converting"):
            selection, options, chosen = selected(asked, options, scene, output)
            files = output_files(selection, output, options)
            check_outputs(files, output, inputs_of(asked, scene), arguments.force)
            notes = [*export(selection, output, options=options), *chosen, *baked, *fixed]
    for written in notes:
        note_found(written)
    print("\n".join(map(str, notes)), file=summary_stream(output))
    return 0


def _fixed(scene: Scene, text: str) -> list[Diagnostic]:
    """Fix what lint finds in a scene; return notes about changes, and about what remains."""
    from viewer.diagnostics.codes import codes_in
    from viewer.linting.fixes import FIXES, fix_scene

    codes = codes_in(text)
    unknown = [code for code in codes if code not in FIXES]
    if unknown:
        raise ViewerError(
            f"--fix: expected codes that can be fixed ({', '.join(sorted(FIXES))}), found "
            f"{printable(unknown[0], 40)}; without codes, --fix fixes all it can"
        )
    with shown_progress("fixing"):
        found = fix_scene(scene, codes)
    # Readers correct some faults themselves: no check can see these.
    seen = found.codes | {one.code for one in found.left}
    read = [
        note("X007.read: {code} fixed on reading: {problem}", code=one.code, problem=one)
        for one in scene.diagnostics
        if one.code in (codes or FIXES) and one.code not in seen
    ]
    if not found.notes and not found.left and not read:
        return [note("X007.none: nothing to fix")]
    left = [
        Diagnostic(
            "X008.left: {figure}: {code} remains: {message}",
            values={"figure": one.name, "code": one.code, "message": one.message},
        )
        for one in found.left
    ]
    return [*found.notes, *read, *left]


def check_format(output: Path) -> None:
    """Raise for a suffix that nothing writes."""
    if not exporters_at(output):
        raise no_exporter(output)


def _check_suffix(asked: SceneOptions, options: ExportOptions, output: Path, force: bool) -> None:
    """Check the output before anything is read."""
    asked.frames.check()
    require_stdout(output)
    if is_stdout(output) and not output.suffix:
        name = printable(output, 300)
        raise UnsupportedFormatError(
            f"{name}: expected a suffix, which selects the format; use a link to {name} that has "
            f"one"
        )
    check_format(output)
    suffix, kinds = output.suffix.lower() or FOLDER, exporters_at(output)
    if options.optimizes and not any("optimizes" in kind.options for kind in kinds):
        raise ViewerError(f"--optimize: expected .glb, .gltf or .vrm, found {printable(suffix)}")
    if options.page != PageOptions() and not any("page" in kind.options for kind in kinds):
        name = "--caption" if options.page.caption else "--wipe"
        raise ViewerError(f"{name}: expected an output with .html, found {printable(suffix)}")
    check_meta(options.meta, output)
    _check_kind(options.kind, output)
    _check_numbered(bool(asked.frames.frames), output)
    if not output.suffix or "{frame" in output.name:
        return  # the files are unknown until the motion has been read
    is_pose = all("pose" in kind.stores for kind in kinds)
    files = files_written(output) if is_pose else [output]
    check_targets(files, inputs_of(asked), force)


def check_outputs(files: list[Path], output: Path, inputs: Sequence[Path], force: bool) -> None:
    """Refuse to write files or, if ``output`` has no suffix, a folder; see ``check_targets``."""
    if output.suffix:
        check_targets(files, inputs, force)
    else:
        check_folder_target(files[0], inputs, force)


@contextmanager
def _saving_joint_map(
    path: Path | None, asked: SceneOptions, scene: Scene, output: Path, force: bool
) -> Iterator[None]:
    """Write the requested joint map before the block; remove it if the block fails."""
    if path is None:
        yield
        return
    from viewer.formats._joint_map import joint_map_text
    from viewer.media.saving import save_text
    from viewer.rigs.retargeting.driven_clip import full_map

    texts: dict[str, Actor] = {}
    for actor in scene.actors:
        if actor.drive is not None:
            titles = actor.drive.motion.figure.name, actor.figure.name
            texts.setdefault(joint_map_text(full_map(actor.drive, actor.figure), titles), actor)
    if not texts:
        raise RigError(
            "--save-joint-map: expected a motion that drives a figure with different joints, found "
            "none"
        )
    files = motion_paths(path, [*texts.values()])
    check_targets(files, inputs_of(asked, scene), force)
    if output.suffix and "{frame" not in output.name:
        check_targets([*files, output], (), force=True)  # the files must be different
    with all_or_none(files):
        for file, text in zip(files, texts, strict=True):
            save_text(file, text)
        yield


def convert_streamed(
    asked: SceneOptions, options: ExportOptions, output: Path
) -> list[Diagnostic] | None:
    """Convert a long, regular file part by part; print warnings and return the notes."""
    # The result is None if files or options need the whole motion in memory; the output is then
    # unchanged.
    if not _is_streamable(asked, options.kind, output):
        return None
    from viewer.formats.bvh.motion import Irregular

    try:
        options = replace(options)
        request = _opened(asked, options)
    except ViewerError:
        return None  # reading the whole file finds and reports what is wrong
    if request is None:
        return None
    first, stop = request.span
    options.kind, moves = "bvh", request.stream.may_move_inner_joints
    motion = SampledParts(lambda: request.parts(options), stop - first, moves)
    part = Part(request.actor, None, motion, request.up)
    try:
        with shown_progress("converting"), raising():
            notes = export(Selection([part]), output, options=options)
    except (Irregular, FormatError, RigError):
        return None
    except OutputError:
        print_warnings(request.warnings)
        raise
    hold()  # as after the writing of a whole motion
    print_warnings(request.warnings)
    return notes


def _is_streamable(asked: SceneOptions, kind: str, output: Path) -> bool:
    """Return whether the options can be applied to parts, and the output is a ``.bvh`` file."""
    # Options that involve other files, or pose the figure, need the whole motion.
    motion = asked.motion
    files = asked.body, motion.model, motion.motions, asked.joint_map, motion.video, motion.images
    if any(files) or asked.model_path is not None or asked.pose != PoseOptions():
        return False
    if asked.frames.is_one or motion.springs or not asked.changes.is_empty:
        return False
    if kind not in ("", "bvh") or len(asked.files) != 1:
        return False
    is_file = not is_stdout(output) and (output.is_file() or not output.exists())
    is_pattern = "{frame" in output.name or PERSON in output.name
    return is_file and output.suffix.lower() == ".bvh" and not is_pattern


@dataclass(frozen=True, slots=True, eq=False)
class _Request:
    """A file that can be streamed, and a scene with its figure."""

    stream: LongMotion
    settings: MotionSettings
    scene: Scene
    warnings: list[str | Diagnostic]
    span: tuple[int, int]
    up: SignedUp

    @property
    def actor(self) -> Actor:
        return self.scene.actors[0]

    def parts(self, options: ExportOptions) -> Iterator[SampledAnimation]:
        """Yield the requested frames."""
        from viewer.loading.skeleton_motions import as_asked

        first, stop = self.span
        for clip in self.stream.clips(first, stop):
            motion = as_asked(replace(self.stream.motion, clip=clip), self.settings)
            actor = replace(self.actor, clip=motion.clip)
            part = sampled("bvh", options, self.scene, actor).animation
            yield replace(part, first_frame=first)


def _opened(asked: SceneOptions, options: ExportOptions) -> _Request | None:
    """Return the request, or None if the file must be read as a whole."""
    from viewer.formats.bvh import open_long

    source = Source.open(asked.paths[0], asked.size_limit)
    path = source.path
    if source.is_folder or path.suffix.lower() != ".bvh" or path.stat().st_size < _LARGE:
        return None
    settings = asked.motion
    head = Source(path, source.peek(_PEEK))
    if detect(head) != "bvh" or len(head.diagnostics):
        return None
    stream = open_long(source)
    if stream is None:
        return None
    contents = Contents(
        skeleton_motions=[(path, stream.motion)],
        diagnostics=tuple(source.diagnostics.warnings),
        files=(path,),
        used_options=set(),
    )
    scene, _ = begin(contents, settings)
    warnings = [*scene.diagnostics, *apply_pose(scene, asked.pose, asked.frames)]
    actor = scene.actors[0]
    clip = actor.require_clip()
    span = frame_range(clip, clip.frame_rate, _requested_frames(asked.frames, actor))
    up = sampled("bvh", options, scene, actor, frames=(0, 1)).up
    return _Request(stream, settings, scene, warnings, span, up)


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


def selected(
    asked: SceneOptions, options: ExportOptions, scene: Scene, output: Path
) -> tuple[Selection, ExportOptions, list[Diagnostic]]:
    """Return what is written of a scene, how, and notes about what was chosen."""
    # Animations keep their own keys where the format holds them; other motions are sampled. Without
    # a motion, or if one pose is requested, the current poses are written: as a motion of one frame
    # if the format holds nothing else.
    _check_kind(options.kind, output)  # of Python; the command's is checked before files are read
    frames = asked.frames
    if _keeps_keys(options.kind, frames, output, scene):
        options = replace(options, gaps="", meta=VrmMeta())
        refused, parts, actors = list[FormatError](), list[Part](), _pose_or_point_actors(scene)
        for actor in actors:
            is_chosen = bool(asked.motion.animation)
            own = own_animations(actor, is_chosen, refused) if has_own_animations(actor) else ()
            parts.append(Part(actor, own or None))
        # Figures of one file share its animations.
        problems = dict.fromkeys(map(str, refused))
        key = "X003.invalid-animation: {problem}; this animation is not written"
        notes = [note(key, problem=each) for each in problems]
        return Selection(parts, scene), options, _left_out_notes(scene, actors) + notes
    if _is_motion(options.kind, frames, output, scene):
        kind = _exporter(options.kind, frames, output, scene)
        options = replace(options, kind=kind, meta=VrmMeta())
        actors = _written_actors(frames, output, scene)
        is_pose = _asks_one_pose(frames, output, scene)
        part_of = _part_of_pose if is_pose else _whole_motion
        parts = [part_of(frames, kind, options, scene, actor) for actor in actors]
        # A file that holds several motions also gets the figures at rest.
        if "pose" in EXPORTERS[kind].stores and is_together(EXPORTERS[kind], output, options):
            others = [each for each in scene.actors if each not in actors]
            parts += [Part(each) for each in others if each.clip is None]
        notes = [_pose_note(frames, scene)] * is_pose
        notes += _left_out_notes(scene, [part.actor for part in parts])
        return Selection(parts, scene), options, notes
    actors = _pose_or_point_actors(scene)
    chosen = Selection([Part(actor) for actor in actors], scene)
    return chosen, replace(options, gaps=""), _left_out_notes(scene, actors)


def _whole_motion(
    frames: Frames, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return the requested frames of an actor."""
    fills = frames.interpolates
    if actor.moves_points:
        if options.gaps not in ("", "interpolate"):
            raise ViewerError(f"--gaps: expected interpolate for keypoints, found {options.gaps}")
        fills = options.gaps == "interpolate"
    span = _requested_frames(frames, actor)
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
    return kind or suited_exporter(output, first.figure)


def _requested_frames(frames: Frames, actor: Actor) -> tuple[int, int | None] | None:
    """Return the requested range, counted from 0: its first frame and one past its last."""
    if frames.frames is None:
        return None
    found = parse_range(frames.frames)
    if found.step != 1:
        raise ViewerError(f"--frames: expected A:B, found {printable(frames.frames, 40)}")
    return numbering_of([actor], frames.fps).span(found)


def _check_kind(kind: str, output: Path) -> None:
    """Raise for an unknown exporter, or a file name whose suffix it does not write."""
    if not kind:
        return
    if kind not in EXPORTERS:
        hint = name_hint(kind, EXPORTERS)
        raise UnsupportedFormatError(f'no exporter is called "{printable(kind, 60)}"; {hint}')
    known, suffix = EXPORTERS[kind].suffixes, output.suffix.lower() or "/"
    if suffix not in known:
        raise UnsupportedFormatError(
            f"--as {kind}: expected a name with {', '.join(known)}, found {printable(output, 300)}"
        )


def _check_numbered(has_frames: bool, output: Path) -> None:
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
    numbered_paths(output.with_name(output.name.replace(PERSON, "")), (0, 1))  # checks the name


def _asks_one_pose(frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether a single pose is written: at a frame or time, or if there is no motion."""
    if frames.frames is not None or all(actor.own_pose is None for actor in scene.actors):
        return False
    is_still = not _moving(scene) and "{frame" not in output.name
    return is_still or frames.is_one


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
        key = "X001.pose-at-frame: one frame: the pose at frame {frame}"
        return note(key, frame=frames.frame)
    if frames.time is not None:
        return note("X001.pose-at-time: one frame: the pose at {time:zg} s", time=frames.time)
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
    notes = [note(key, figure=name) for name in still]
    if points:
        key = (
            "X003.keypoints: keypoints next to bodies are not written ({names}): to write them, "
            "open only the keypoints3d folder"
        )
        notes.append(note(key, names=all_of(points)))
    return notes


def _pose_or_point_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose current pose is written: captured points only if there is no body."""
    figures = [actor for actor in scene.actors if not actor.moves_points]
    return figures or list(scene.actors)


def _written_actors(frames: Frames, output: Path, scene: Scene) -> list[Actor]:
    """Return the actors whose motion is written, or whose pose is written as a one-frame motion."""
    if _asks_one_pose(frames, output, scene):
        return _moving(scene) or [actor for actor in scene.actors if actor.own_pose is not None]
    moving = [actor for actor in scene.actors if actor.clip is not None]
    bodies = [actor for actor in moving if not actor.moves_points]
    if not moving:
        raise RigError("no file has a motion: a motion cannot be written")
    return bodies or moving


def _bake_springs(bakes: bool, fps: float | None, scene: Scene, output: Path) -> list[Diagnostic]:
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
            note(
                key,
                figure=actor.name,
                n=counted(count, "spring joint"),
                have=agree(count, "has", "have"),
                remedy=Remedy("can write", "--bake-springs writes"),
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
