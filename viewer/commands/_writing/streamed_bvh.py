"""Conversion of a long ``.bvh`` file to another one, part by part, in constant memory."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import clean_up_of
from viewer.commands._pose import apply_pose
from viewer.commands._progress import shown_progress
from viewer.commands._scene import motion_settings, print_warnings, scene_files, size_limit
from viewer.commands._writing.motion_export import motion_options, requested_frames
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, OutputError, RigError, ViewerError
from viewer.export import MotionOptions, animation_for
from viewer.export._motion_paths import PERSON
from viewer.formats import Source, detect
from viewer.interrupts import raising
from viewer.loading import Contents, MotionSettings, begin
from viewer.loading.skeleton_motions import as_asked
from viewer.rig.motion.sampled_animation import SampledAnimation, frame_range
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.streams import is_stdout

if TYPE_CHECKING:
    from viewer.formats._bvh.streaming import BvhStream

__all__ = ["convert_streamed"]

_PEEK = 1 << 16  # bytes that identify the format
_LARGE = 8_000_000  # bytes; smaller files are read as a whole
# Options that involve other files, or pose the figure.
_OTHERS = (
    "body",
    "model",
    "motion",
    "joint_map",
    "save_joint_map",
    "video",
    "images",
    "hands",
    "pose",
    "shape",
    "expression",
    "dof",
    "mirror",
)


def convert_streamed(
    arguments: argparse.Namespace, output: Path, skinning: Skinning
) -> list[Diagnostic] | None:
    """Convert a long, regular file part by part; print warnings and return the notes.

    ``arguments``: arguments of ``convert``.
    ``output``: the requested file, which may be replaced.
    ``skinning``: the requested method.
    Returns None, and leaves the file unchanged, if the files or options need the whole motion in
    memory.
    """
    if not _is_streamable(arguments, output):
        return None
    from viewer.export.bvh.streaming import Parts, export_parts
    from viewer.formats._bvh.streaming import Irregular

    try:
        options = motion_options(arguments, skinning)
        request = _opened(arguments, options)
    except ViewerError:
        return None  # reading the whole file finds and reports what is wrong
    if request is None:
        return None
    first, stop = request.span
    options.world_up = request.up
    moves = request.stream.may_move_inner_joints
    animation = Parts(lambda: request.parts(options), stop - first, moves)
    try:
        with shown_progress("converting"), raising():
            notes = export_parts(animation, output, options)
    except (Irregular, FormatError, RigError):
        return None
    except OutputError:
        print_warnings(request.warnings)
        raise
    print_warnings(request.warnings)
    return notes


def _is_streamable(arguments: argparse.Namespace, output: Path) -> bool:
    """Return whether the options can be applied to parts, and the output is a ``.bvh`` file."""
    given = [name for name in _OTHERS if getattr(arguments, name)]
    # Frame 0 and time 0 are values, too.
    given += [
        name for name in ("frame", "time", "model_path") if getattr(arguments, name) is not None
    ]
    if given or arguments.springs == "on" or not clean_up_of(arguments).is_empty:
        return False
    if arguments.kind not in (None, "bvh") or len(arguments.files) != 1:
        return False
    is_file = not is_stdout(output) and (output.is_file() or not output.exists())
    is_pattern = "{frame" in output.name or PERSON in output.name
    return is_file and output.suffix.lower() == ".bvh" and not is_pattern


@dataclass(frozen=True, slots=True, eq=False)
class _Request:
    """A file that can be streamed, and a scene with its figure."""

    stream: BvhStream
    settings: MotionSettings
    scene: Scene
    warnings: list[str | Diagnostic]
    span: tuple[int, int]
    up: str

    @property
    def actor(self) -> Actor:
        return self.scene.actors[0]

    def parts(self, options: MotionOptions) -> Iterator[SampledAnimation]:
        """Yield the requested frames."""
        first, stop = self.span
        for clip in self.stream.clips(first, stop):
            motion = as_asked(replace(self.stream.motion, clip=clip), self.settings)
            actor = replace(self.actor, clip=motion.clip)
            part = animation_for("bvh", options, self.scene, actor)[0]
            yield replace(part, first_frame=first)


def _opened(arguments: argparse.Namespace, options: MotionOptions) -> _Request | None:
    """Return the request, or None if the file must be read as a whole."""
    from viewer.formats._bvh.streaming import open_stream

    source = Source.open(scene_files(arguments)[0], size_limit(arguments))
    path = source.path
    if source.is_folder or path.suffix.lower() != ".bvh" or path.stat().st_size < _LARGE:
        return None
    settings = motion_settings(arguments)
    head = Source(path, source.peek(_PEEK))
    if detect(head) != "bvh" or len(head.diagnostics):
        return None
    stream = open_stream(source)
    if stream is None:
        return None
    contents = Contents(
        skeleton_motions=[(path, stream.motion)],
        diagnostics=tuple(source.diagnostics.warnings),
        files=(path,),
        used_options=set(),
    )
    scene, _ = begin(contents, settings)
    warnings = [*scene.diagnostics, *apply_pose(scene, arguments)]
    actor = scene.actors[0]
    assert isinstance(actor.clip, SampledClip)  # that of the stream
    span = frame_range(actor.clip, actor.clip.timing.frame_rate, requested_frames(arguments, actor))
    up = animation_for("bvh", options, scene, actor, frames=(0, 1))[1]
    return _Request(stream, settings, scene, warnings, span, up)
