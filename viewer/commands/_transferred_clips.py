"""Motions of a template, transferred to the mesh that was rigged with it."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.autorig.rigged import Rigged, clip_for
from viewer.commands._scene import print_warnings
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError, ViewerError
from viewer.export import MotionOptions, animation_for, export_animation
from viewer.loading import MotionSettings, load
from viewer.models import resolve
from viewer.phrases import printable
from viewer.rig.figure import Figure
from viewer.rig.motion.baking import baked
from viewer.rig.motion.clip import Clip, is_course_rig
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scene import Actor, Scene, figure_pose


@dataclass(frozen=True, slots=True, eq=False)
class TransferredClip:
    """A motion of the template, and the file its transferred copy is written to.

    Attributes
    ----------
    clip : Clip or SampledClip
        The template's motion.
    path : Path
        ``.anim`` for .skel-style rigs, ``.bvh`` for other figures.
    """

    clip: Clip | SampledClip
    path: Path


def add_clip_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--clip``."""
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


def read_clips(
    arguments: argparse.Namespace, template: list[Path], figure: Figure
) -> list[TransferredClip]:
    """Return the motions named by ``--clip``, before any work is done.

    ``arguments``: arguments of ``viewer rig``.
    ``template``: the template's files.
    ``figure``: the template.
    Raises ViewerError if there is no output to write next to, a file contains no motion of the
    template, or two output files would have the same name.
    """
    if not arguments.clips:
        return []
    if arguments.output is None:
        raise ViewerError("--clip: expected -o FILE to write the motion next to, found none")
    output = Path(arguments.output)
    found: list[TransferredClip] = []
    suffix = ".anim" if is_course_rig(figure.require_skeleton()) else ".bvh"
    for name in arguments.clips:
        path = output.with_name(f"{output.stem}-{Path(name).stem}{suffix}")
        if any(each.path == path for each in found):
            raise ViewerError(f"--clip: expected different file names, found {path.stem} twice")
        found.append(TransferredClip(_clip_of(name, template, arguments.fps), path))
    return found


def _clip_of(name: str, template: list[Path], fps: float | None) -> Clip | SampledClip:
    scene = load(*template, resolve(name), motion=MotionSettings(frame_rate=fps))
    print_warnings(scene.diagnostics)
    for actor in scene.actors:
        if actor.figure.is_attached and isinstance(actor.clip, TransformClip):
            return baked(actor.figure, actor.clip, fps)
        if actor.figure.is_attached and isinstance(actor.clip, Clip | SampledClip):
            return actor.clip
    raise RigError(f"--clip: expected a motion of the template, found none in {printable(name)}")


def write_clips(rigged: Rigged, clips: list[TransferredClip]) -> list[Diagnostic]:
    """Write the template's motions for the rigged figure; return notes about the files.

    ``rigged``: the result of the rig transfer.
    ``clips``: from ``read_clips``.
    Raises RigError if a clip is for a different skeleton.
    Raises OutputError if a file cannot be written.
    """
    notes: list[Diagnostic] = []
    for each in clips:
        actor = Actor(rigged.figure, figure_pose(rigged.figure), clip_for(rigged, each.clip))
        key, options = each.path.suffix[1:], MotionOptions()
        animation, _ = animation_for(key, options, Scene([actor]), actor)
        notes += export_animation(animation, each.path, key, options)
    return notes
