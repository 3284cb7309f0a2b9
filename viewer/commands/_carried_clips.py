"""Motions of a template, written for the mesh that got its rig."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from viewer.autorig.rigged import Rigged, clip_for
from viewer.commands._scene import print_warnings
from viewer.errors import RigError, ViewerError, printable
from viewer.export import MotionOptions, animation_for, export_animation
from viewer.loading import MotionSettings, load
from viewer.models import resolve
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Clip, is_course_rig
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Actor, Scene, figure_pose

__all__ = ["CarriedClip", "add_clip_argument", "read_clips", "write_clips"]


@dataclass(frozen=True, slots=True, eq=False)
class CarriedClip:
    """A motion of the template, and the file that the target's will be.

    Attributes
    ----------
    clip : Clip or SampledClip
        As it moves the template.
    path : Path
        ``.anim`` for course rigs, ``.bvh`` for other figures.
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
        help="a motion of the template; the target's is written beside the result as "
        "NAME-FILE.anim (course rigs) or .bvh, its path scaled with the figure; repeat for more",
    )


def read_clips(
    arguments: argparse.Namespace, template: list[Path], figure: Figure
) -> list[CarriedClip]:
    """Return the motions that ``--clip`` asks for, before any work is done.

    Parameters
    ----------
    arguments : argparse.Namespace
        Of ``viewer rig``.
    template : list of Path
        The template's files.
    figure : Figure
        The template.

    Raises
    ------
    ViewerError
        If there is no output to write beside, a file holds no motion of the template, or two
        would have one name.
    """
    if not arguments.clips:
        return []
    if arguments.output is None:
        raise ViewerError("--clip: expected -o FILE to write the motion beside, found none")
    output = Path(arguments.output)
    found: list[CarriedClip] = []
    assert figure.skeleton is not None  # a template has one
    suffix = ".anim" if is_course_rig(figure.skeleton) else ".bvh"
    for name in arguments.clips:
        path = output.with_name(f"{output.stem}-{Path(name).stem}{suffix}")
        if any(each.path == path for each in found):
            raise ViewerError(f"--clip: expected names that differ, found {path.stem} twice")
        found.append(CarriedClip(_clip_of(name, template, arguments.fps), path))
    return found


def _clip_of(name: str, template: list[Path], fps: float | None) -> Clip | SampledClip:
    scene = load(*template, resolve(name), motion=MotionSettings(frame_rate=fps))
    print_warnings(scene.warnings)
    for actor in scene.actors:
        if actor.figure.is_attached and isinstance(actor.clip, Clip | SampledClip):
            return actor.clip
    raise RigError(f"--clip: expected a motion of the template, found none in {printable(name)}")


def write_clips(rigged: Rigged, clips: list[CarriedClip]) -> list[str]:
    """Write the template's motions for the rigged figure; return what was written.

    Parameters
    ----------
    rigged : Rigged
        The result.
    clips : list of CarriedClip
        From ``read_clips``.

    Raises
    ------
    RigError
        If a clip is of another skeleton.
    OutputError
        If a file cannot be written.
    """
    lines = []
    for each in clips:
        actor = Actor(rigged.figure, figure_pose(rigged.figure), clip_for(rigged, each.clip))
        key, options = each.path.suffix[1:], MotionOptions()
        animation, _ = animation_for(key, options, Scene([actor]), actor)
        lines += export_animation(animation, each.path, key, options)
    return lines
