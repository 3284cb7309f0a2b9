"""Options that say what is opened and how it is posed; shared by the commands that open files."""

from __future__ import annotations

import argparse
import contextlib
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from viewer.errors import RigError, ViewerError, printable
from viewer.loading import load
from viewer.rig.clip import sample
from viewer.rig.scene import Actor, Scene
from viewer.rig.skeleton import clamp_dofs, dof_label, find_dof

__all__ = ["add_scene_arguments", "apply_dofs", "number", "open_scene", "print_warnings"]

_SLOW_BYTES = 60e6  # about a second of reading
_UNITS = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}


def add_scene_arguments(parser: argparse.ArgumentParser) -> None:
    """Add FILES and the options that pose what they hold."""
    parser.add_argument("files", nargs="*", metavar="FILES", help=".skel, .skin, .anim files")
    parser.add_argument(
        "--time", type=number, metavar="S", help="pose by the clip at S seconds (default its start)"
    )
    parser.add_argument(
        "--dof",
        action="append",
        default=[],
        metavar="NAME.X=VALUE",
        help="set a DOF: joint (or #index) and x, y, z for a rotation (radians as in the file, or "
        "30deg) or tx, ty, tz for the root's translation; may be repeated",
    )
    parser.add_argument(
        "--max-size", default="2G", metavar="SIZE", help="refuse larger files (default 2G)"
    )


def number(text: str) -> float:
    """Return a finite number; argparse words the refusal."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, found {text}")
    return value


def _parse_bytes(text: str) -> int:
    found = re.fullmatch(r"(\d{1,15})([kKmMgG]?)", text)
    if not found:
        raise ViewerError(f'--max-size: expected a number with k, M or G, found "{text}"')
    return int(found[1]) * _UNITS.get(found[2].lower(), 1)


def open_scene(arguments: argparse.Namespace) -> Scene:
    """Load the files, print what their readers noticed, and pose them as asked."""
    _announce(arguments.files)
    scene = load(*arguments.files, max_size=_parse_bytes(arguments.max_size))
    print_warnings(scene.warnings)
    apply_time(scene, arguments.time)
    apply_dofs(scene, arguments.dof)
    return scene


def _announce(files: Sequence[str]) -> None:
    """Tell a person at a terminal about reading that takes longer than a second."""
    if not sys.stderr.isatty():
        return
    for file in files:
        with contextlib.suppress(OSError, ValueError):  # the reader will say what is wrong
            size = Path(file).stat().st_size
            if size > _SLOW_BYTES:
                print(f"reading {printable(file)} ({size / 1e6:.0f} MB) …", file=sys.stderr)


def apply_time(scene: Scene, time: float | None) -> None:
    """Pose every actor that has a clip as it is at a time in seconds.

    Raises
    ------
    ViewerError
        If a time is given and no actor has a clip.
    """
    if time is None:
        return
    moving = [actor for actor in scene.actors if actor.clip is not None]
    if not moving:
        raise ViewerError("--time: no file is a clip")
    for actor in moving:
        if actor.clip and actor.figure.skeleton and actor.pose:
            sample(actor.clip, actor.figure.skeleton, time, out=actor.pose)


def print_warnings(warnings: Sequence[str]) -> None:
    """Print one line each to the error stream."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)


def apply_dofs(scene: Scene, settings: Sequence[str]) -> None:
    """Set DOFs given as ``NAME.X=VALUE``, on the first actor that has such a joint.

    Values beyond a limit are clamped, with a warning.

    Raises
    ------
    ViewerError
        If the text, the joint or the value is wrong.
    """
    for setting in settings:
        label, equals, text = setting.partition("=")
        if not equals:
            raise ViewerError(f'--dof: expected NAME.X=VALUE, found "{setting}"')
        actor, dof = _find(scene, label)
        skeleton = actor.figure.skeleton
        assert skeleton is not None and actor.pose is not None  # _find looked
        is_rotation = skeleton.dof_kinds[dof] >= 3
        wanted = actor.pose.dofs.copy()
        wanted[dof] = _dof_value(setting, text, is_rotation)
        clamped = clamp_dofs(skeleton, wanted)
        if clamped[dof] != wanted[dof]:
            low, high = skeleton.dof_limits[dof]
            name, unit = dof_label(skeleton, dof), " rad" if is_rotation else ""
            limits = f"{low:g} to {high:g}{unit}"
            how = f"locked at {low:g}{unit}" if low == high else f"clamped to its limits {limits}"
            print_warnings([f"{name}={text} is {how}"])
        actor.pose.dofs[:] = clamped


def _find(scene: Scene, label: str) -> tuple[Actor, int]:
    problem: RigError | None = None
    found: list[tuple[Actor, int]] = []
    for actor in scene.actors:
        if actor.figure.skeleton is not None:
            try:
                found.append((actor, find_dof(actor.figure.skeleton, label)))
            except RigError as error:
                problem = problem or error
    if not found:
        raise ViewerError(f"--dof: {problem or 'no file has a skeleton'}")
    if len(found) > 1:
        first = printable(found[0][0].figure.name)
        print_warnings([f"{len(found)} figures have {label}; the first, {first}, is posed"])
    return found[0]


def _dof_value(setting: str, text: str, is_rotation: bool) -> float:
    found = re.fullmatch(r"(.*?)(rad|deg)?", text.strip())
    assert found is not None  # the pattern matches everything
    try:
        value = number(found[1])
    except (ValueError, argparse.ArgumentTypeError):
        raise ViewerError(f'--dof: expected a number after "=", found "{setting}"') from None
    return math.radians(value) if found[2] == "deg" and is_rotation else value
