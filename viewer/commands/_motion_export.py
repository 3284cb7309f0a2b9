"""Write the motions of a scene: which exporter, which frames, one file for each actor."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._numbers import number
from viewer.commands._shots import parse_range
from viewer.errors import OutputError, RigError, UnsupportedFormatError, ViewerError, printable
from viewer.export import (
    EXPORTERS,
    MotionOptions,
    export_take,
    motion_exporters,
    suited_exporter,
)
from viewer.export._options import GAPS, ROTATION_ORDERS, UNITS
from viewer.rig.clip import Clip
from viewer.rig.points import PointClip
from viewer.rig.sampled_clip import SampledClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.rig.take import upright_take

__all__ = [
    "add_motion_arguments",
    "check_frame_field",
    "is_motion",
    "motion_paths",
    "write_motions",
]

_MOST_DIGITS = 15
_ONE_A_FRAME = (".obj",)  # their motions are many files, which nobody wants by accident


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how motions are written."""
    group = parser.add_argument_group("writing motions")
    kinds = [key for key, kind in EXPORTERS.items() if kind.writes_motion]
    group.add_argument(
        "--as",
        dest="kind",
        choices=[*EXPORTERS],
        help=f"what to write, where a suffix leaves a choice; motions: {', '.join(kinds)}",
    )
    group.add_argument("--frames", metavar="A:B", help="frames A to B - 1 of the motion, from 0")
    group.add_argument("--gaps", choices=GAPS, default="hold", help="missing frames: default hold")
    group.add_argument("--to-unit", choices=UNITS, help="unit of the file (BVH: default cm)")
    group.add_argument("--to-up", choices=("y", "z"), help="up axis of the file (BVH: default y)")
    group.add_argument(
        "--rotation-order", choices=ROTATION_ORDERS, default="zyx", help="of BVH: default zyx"
    )
    group.add_argument("--rest-frame", action="store_true", help="BVH: first a frame at rest")
    group.add_argument("--digits", type=number, default=6, metavar="N", help="decimals: default 6")


def is_motion(arguments: argparse.Namespace, output: Path, scene: Scene) -> bool:
    """Return whether the whole motion is asked for, rather than one pose."""
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
    moves = any(isinstance(actor.clip, Clip | SampledClip) for actor in scene.actors)
    wants_one = arguments.time is not None or arguments.frame is not None
    return moves and not wants_one and suffix not in _ONE_A_FRAME


def motion_options(arguments: argparse.Namespace, skinning: Skinning) -> MotionOptions:
    """Return how motions are asked to be written."""
    digits = int(arguments.digits)
    if not 0 <= digits <= _MOST_DIGITS or digits != arguments.digits:
        raise ViewerError(f"--digits: expected 0 to {_MOST_DIGITS}, found {arguments.digits:g}")
    return MotionOptions(
        unit=arguments.to_unit or "",
        up=arguments.to_up or "",
        rotation_order=arguments.rotation_order,
        gaps="interpolate" if arguments.fill_gaps else arguments.gaps,
        rest_frame=arguments.rest_frame,
        digits=digits,
        skinning=skinning,
    )


def write_motions(
    arguments: argparse.Namespace, scene: Scene, output: Path, skinning: Skinning
) -> list[str]:
    """Write every actor's motion; return lines that say what was written and what was lost.

    Raises
    ------
    ViewerError
        If no actor has a motion that the format can hold.
    """
    options = motion_options(arguments, skinning)
    key = _exporter(arguments, output, scene)
    actors = _moving(scene)
    takes = []
    for actor in actors:
        take, options.world_up = upright_take(
            scene, actor, arguments.fps, _frames(arguments.frames), arguments.fill_gaps
        )
        takes.append(take)
    if key == "easymocap":
        from viewer.export.easymocap import export_takes

        persons = [index if a.person is None else a.person for index, a in enumerate(actors)]
        return export_takes(takes, output, options, persons)
    lines: list[str] = []
    for take, path in zip(takes, motion_paths(output, actors), strict=True):
        lines += export_take(take, path, key, options)
    return lines


def motion_paths(output: Path, actors: list[Actor]) -> list[Path]:
    """Return the file of each actor: persons by their number, others counted from 2 on."""
    if len(actors) == 1:
        return [output]
    persons = [actor.person for actor in actors]
    by_person = None not in persons and len(set(persons)) == len(persons)
    names = [
        f"-{person}" if by_person else (f"-{number}" if number > 1 else "")
        for number, person in enumerate(persons, 1)
    ]
    return [output.with_name(f"{output.stem}{name}{output.suffix}") for name in names]


def _moving(scene: Scene) -> list[Actor]:
    moving = [actor for actor in scene.actors if actor.clip is not None]
    bodies = [actor for actor in moving if not isinstance(actor.clip, PointClip)]
    if not moving:
        raise RigError("no file moves anything: a motion cannot be written")
    if not bodies:
        raise RigError("there are only keypoints: a motion of joints cannot be written")
    return bodies


def _exporter(arguments: argparse.Namespace, output: Path, scene: Scene) -> str:
    """Return the exporter asked for, or the first that suits the suffix and the figures."""
    found = motion_exporters(output)
    if arguments.kind is not None:
        if arguments.kind not in found:
            known = ", ".join(EXPORTERS[arguments.kind].suffixes)
            raise UnsupportedFormatError(f"--as {arguments.kind}: expected a name with {known}")
        return str(arguments.kind)
    return suited_exporter(output, _moving(scene)[0].figure)


def _frames(text: str | None) -> tuple[int, int | None] | None:
    """Return the range of ``A:B``: the first frame and the one behind the last."""
    if text is None:
        return None
    found = parse_range(text)
    if found.step != 1:
        raise ViewerError(f"--frames: expected A:B (--fps thins out), found {printable(text, 40)}")
    return found.first, found.stop


def check_frame_field(output: Path) -> None:
    """Refuse names of numbered files that would all be the same, or that cannot be formed."""
    try:
        first, second = (output.name.format(frame=frame) for frame in (0, 1))
    except (ValueError, KeyError, IndexError, AttributeError):
        first = second = ""
    if first == second:
        raise OutputError(
            f"{printable(output, 300)}: expected a name with {{frame}}, as in walk_{{frame:05}}"
            f"{output.suffix}, for one file a frame"
        )
