"""Conversion of figures, poses and motions to other formats.

The files are opened as one scene, which is cleaned up and posed as requested, and written: a pose,
a motion, or figures with their animations, in one file, or in one for each actor if the name has
``{person}``. All files are written or none. A long BVH file that is written as BVH again is
converted part by part (``convert_streamed``), if no option needs the whole motion in memory.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._frames import add_frame_arguments
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
from viewer.commands._settings import settings_of, stated
from viewer.commands._writing import (
    add_motion_arguments,
    add_vrm_arguments,
    bake_springs,
    check_frame_options,
    check_kind,
    check_meta,
    check_numbered,
    export_options,
    requested_frames,
    selected,
)
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.record import note_found
from viewer.errors import FormatError, OutputError, RigError, UnsupportedFormatError, ViewerError
from viewer.export import (
    EXPORTERS,
    FOLDER,
    ExportOptions,
    Part,
    SampledParts,
    Selection,
    export,
    exporters_at,
    files_written,
    output_files,
    sampled,
)
from viewer.export._motion_paths import PERSON, motion_paths
from viewer.formats import Source, all_or_none, check_folder_target, check_targets, detect
from viewer.interrupts import hold, raising
from viewer.loading import Contents, MotionSettings, begin
from viewer.loading.skeleton_motions import as_asked
from viewer.phrases import printable
from viewer.rig.motion.sampled_animation import SampledAnimation, frame_range
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
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
        help=f"one of {_known_suffixes()}; walk_{{frame:05}}.obj for numbered meshes, "
        "walk_{person}.glb for a file per person",
    )
    group.add_argument("--force", action="store_true", help="replace existing files")
    group.add_argument(
        "--save-joint-map",
        metavar="FILE",
        help="also write which joint of the motion drives each joint of the figure, as a text file "
        "for --joint-map (in a batch, a template such as maps/{stem}.txt)",
    )
    add_motion_arguments(parser)
    add_vrm_arguments(parser)
    add_frame_arguments(parser, "A:B")
    add_capture_arguments(parser, gaps="write")
    add_cleanup_arguments(parser)
    add_pose_arguments(parser)
    add_skinning_arguments(parser)


def _known_suffixes() -> str:
    suffixes = dict.fromkeys(suffix for kind in EXPORTERS.values() for suffix in kind.suffixes)
    return ", ".join("a folder for EasyMocap" if each == FOLDER else each for each in suffixes)


def run(arguments: argparse.Namespace) -> int:
    """Write poses or motions; print messages about written files and losses."""
    output, asked = Path(arguments.output), scene_options(arguments)
    skinning = settings_of(Skinning, arguments)
    options = export_options(arguments, asked.frames, skinning)
    _check_suffix(asked, options, output, arguments.force)
    joint_map = None if arguments.save_joint_map is None else Path(arguments.save_joint_map)
    notes = convert_streamed(asked, options, output) if joint_map is None else None
    if notes is None:
        scene = open_scene(asked)
        use_file_method(scene, skinning, stated(Skinning, arguments))
        baked = bake_springs(asked.motion.springs, asked.frames.fps, scene, output)
        saving = _saving_joint_map(joint_map, asked, scene, output, arguments.force)
        with saving, shown_progress("converting"):
            notes = [*_written(asked, options, scene, output, arguments.force), *baked]
    for note in notes:
        note_found(note)
    print("\n".join(map(str, notes)), file=summary_stream(output))
    return 0


def _written(
    asked: SceneOptions, options: ExportOptions, scene: Scene, output: Path, force: bool
) -> list[Diagnostic]:
    """Write what is requested of a scene; return the notes."""
    selection, options, chosen = selected(asked, options, scene, output)
    files, inputs = output_files(selection, output, options), inputs_of(asked, scene)
    if output.suffix:
        check_targets(files, inputs, force)
    else:
        check_folder_target(files[0], inputs, force)
    return [*export(selection, output, options=options), *chosen]


def _check_suffix(asked: SceneOptions, options: ExportOptions, output: Path, force: bool) -> None:
    """Check the output before anything is read."""
    check_frame_options(asked.frames)
    require_stdout(output)
    if is_stdout(output) and not output.suffix:
        name = printable(output, 300)
        raise UnsupportedFormatError(
            f"{name}: expected a suffix, which selects the format; use a link to {name} that has "
            f"one"
        )
    suffix, kinds = output.suffix.lower() or FOLDER, exporters_at(output)
    if not kinds:
        raise UnsupportedFormatError(f'no exporter for "{suffix}"; supported: {_known_suffixes()}')
    if options.optimizes and not any("optimizes" in kind.options for kind in kinds):
        raise ViewerError(f"--optimize: expected .glb, .gltf or .vrm, found {printable(suffix)}")
    check_meta(options.meta, output)
    check_kind(options.kind, output)
    check_numbered(bool(asked.frames.frames), output)
    if not output.suffix or "{frame" in output.name:
        return  # the files are unknown until the motion has been read
    is_pose = all("pose" in kind.stores for kind in kinds)
    files = files_written(output) if is_pose else [output]
    check_targets(files, inputs_of(asked), force)


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
    from viewer.rig.retargeting.driven_clip import full_map

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
    # None if the files or options need the whole motion in memory; the output is then unchanged.
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
    up: str

    @property
    def actor(self) -> Actor:
        return self.scene.actors[0]

    def parts(self, options: ExportOptions) -> Iterator[SampledAnimation]:
        """Yield the requested frames."""
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
    span = frame_range(clip, clip.frame_rate, requested_frames(asked.frames, actor))
    up = sampled("bvh", options, scene, actor, frames=(0, 1)).up
    return _Request(stream, settings, scene, warnings, span, up)
