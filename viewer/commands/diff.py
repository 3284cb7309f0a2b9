"""Comparison of figures or motions with a reference."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from viewer.commands._diff.inputs import input_files
from viewer.commands._diff.pairs import Pairing, pair_actors
from viewer.commands._diff.picture import Heat, heat_of, save_heat
from viewer.commands._diff.report import Compared, json_data, lines_of, table_of
from viewer.commands._output import PICTURES
from viewer.commands._pose import add_skinning_arguments, skinning_of
from viewer.commands._progress import Progress
from viewer.commands._scene import add_animation_argument, print_warnings
from viewer.commands._sequence.frame_numbers import parse_range
from viewer.diagnostics import Diagnostic, Phrase
from viewer.diagnostics.record import is_recorded, note_values
from viewer.errors import UnsupportedFormatError, ViewerError
from viewer.formats import check_targets
from viewer.loading import MotionSettings, load
from viewer.phrases import printable
from viewer.rig.comparison import Difference, compare
from viewer.rig.comparison.steps import FrameRange
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning
from viewer.rig.units import METRES
from viewer.streams import require_stdout, summary_stream

__all__ = ["add_arguments", "run"]

_DIFFERS = 1  # exit code if there are differences
_UNREADABLE = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s REFERENCE OTHER ... [options]"
    files = parser.add_argument_group("files")
    files.add_argument(
        "reference",
        metavar="REFERENCE",
        help="a file, several joined by + (arm.skel+arm.skin), or a folder that contains a rig",
    )
    files.add_argument(
        "files", nargs="+", metavar="OTHER", help="a file or folder to compare with it"
    )
    files.add_argument(
        "--with",
        dest="common",
        action="append",
        default=[],
        metavar="FILE",
        help="also open this file with every input, such as the .skel of .anim files",
    )
    files.add_argument(
        "--up", choices=("y", "z", "-y", "-z"), help="up axis of captures and BVH files"
    )
    files.add_argument("--unit", choices=METRES, help="length unit of BVH files")
    add_animation_argument(files)
    _add_poses(parser)
    _add_results(parser)
    add_skinning_arguments(parser)


def _add_poses(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("poses")
    group.add_argument(
        "--poses",
        type=int,
        default=8,
        metavar="N",
        help="compare in N poses within the joint limits if there is no motion (default: 8)",
    )
    group.add_argument(
        "--frames",
        metavar="A:B",
        help="frames A to B - 1 of motions, numbered as in the reference (default: all)",
    )


def _add_results(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("results")
    group.add_argument(
        "--tolerance",
        type=float,
        metavar="X",
        help="exit with 1 if anything differs by more than X: lengths as a fraction of the "
        "reference's size, angles in radians, weights as stored",
    )
    group.add_argument("--json", action="store_true", help="print everything as JSON")
    group.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="image of the reference, coloured by distance, in the worst pose; several comparisons "
        "produce a sheet with a common scale",
    )
    group.add_argument("--force", action="store_true", help="replace an existing image")


def run(arguments: argparse.Namespace) -> int:
    """Compare, print the differences, and return 1 if any exceeds the tolerance."""
    tolerance = arguments.tolerance
    if tolerance is not None and not (tolerance >= 0.0 and math.isfinite(tolerance)):
        raise ViewerError(f"--tolerance: expected 0 or more, found {tolerance:g}")
    if not 0 <= arguments.poses <= 10_000:
        raise ViewerError(f"--poses: expected 0 to 10000, found {arguments.poses}")
    frames = _frames(arguments.frames)
    output = _checked_output(arguments)
    open_one = _opener(arguments)
    reference = open_one(arguments.reference)
    print_warnings(reference.diagnostics)
    skinning = skinning_of(arguments)
    rows: list[Compared] = []
    heats: list[Heat] = []
    inputs = [*_inputs(arguments), *reference.files]
    for name in arguments.files:
        try:
            other = open_one(name)
            inputs += other.files
            row, heat = _compared(name, reference, other, skinning, arguments.poses, frames)
        except ViewerError as problem:
            row, heat = Compared(name, error=printable(problem, 500)), None
        rows.append(row)
        heats += [] if heat is None else [heat]
    stream = sys.stdout if output is None else summary_stream(output)
    if output is not None:
        check_targets([output], inputs, arguments.force)
    _print(arguments, rows, stream)
    if output is not None:
        summary = save_heat(heats, output, skinning)
        print(summary, file=sys.stderr if arguments.json else stream)
    if any(row.error for row in rows):
        return _UNREADABLE
    exceeds = tolerance is not None and any(row.exceeds(tolerance) for row in rows)
    return _DIFFERS if exceeds else 0


def _checked_output(arguments: argparse.Namespace) -> Path | None:
    """Check the output image before anything is compared."""
    if arguments.output is None:
        return None
    output = Path(arguments.output)
    require_stdout(output)
    if output.suffix.lower() not in PICTURES:
        raise UnsupportedFormatError(
            f"{printable(output, 300)}: expected an image ({', '.join(PICTURES)}), "
            f'found "{output.suffix}"'
        )
    check_targets([output], _inputs(arguments), arguments.force)
    return output


def _inputs(arguments: argparse.Namespace) -> list[Path]:
    """Return the named files; missing ones are reported when they are opened."""
    found = [Path(file) for file in arguments.common]
    for text in (arguments.reference, *arguments.files):
        with contextlib.suppress(ViewerError):
            found += input_files(text)
    return found


def _frames(text: str | None) -> FrameRange | None:
    if text is None:
        return None
    found = parse_range(text)
    if found.step != 1:
        raise ViewerError(f"--frames: expected A:B without a step, found {text}")
    return found.first, found.stop


def _opener(arguments: argparse.Namespace) -> Callable[[str], Scene]:
    settings = MotionSettings(
        up=arguments.up or "", unit=arguments.unit or "", animation=arguments.animation or ""
    )

    def open_one(text: str) -> Scene:
        return load(*arguments.common, *input_files(text), motion=settings)

    return open_one


def _compared(
    name: str,
    reference: Scene,
    other: Scene,
    skinning: Skinning,
    n_poses: int,
    frames: FrameRange | None,
) -> tuple[Compared, Heat | None]:
    pairing = pair_actors(reference.actors, other.actors)
    is_choice = len(reference.actors) > 1 or len(other.actors) > 1
    found: list[tuple[Actor, Difference]] = []
    for first, second in pairing.pairs:
        # Comparing poses the reference, which must start in the same pose for each input.
        with Progress(f"comparing {Path(name).name}", 1) as progress:

            def report(done: int, count: int, progress: Progress = progress) -> None:
                progress.total = count
                progress.show(done)

            posed = first.copy()
            difference = compare(posed, second, skinning, n_poses, frames, report)
        if is_choice and first.figure.name != second.figure.name:
            note = Diagnostic("D002.partner", values={"name": second.name})
            difference = replace(difference, notes=(note, *difference.notes))
        found.append((posed, difference))
    differences = tuple((actor.name, difference) for actor, difference in found)
    row = Compared(name, differences, _lone(name, pairing), diagnostics=other.diagnostics)
    return row, heat_of(name, found)


def _lone(name: str, pairing: Pairing) -> tuple[Diagnostic, ...]:
    """Return messages about actors and motions that are present in only one of the scenes."""
    sides = ((Phrase("the-reference"), pairing.first), (name, pairing.second))
    return tuple(
        Diagnostic("D001.actor", values={"side": side, "actor": one})
        for side, lone in sides
        for one in lone
    )


def _print(arguments: argparse.Namespace, rows: Sequence[Compared], stream: TextIO) -> None:
    tolerance = arguments.tolerance
    if arguments.json or is_recorded():
        found = json_data(arguments.reference, rows, tolerance)
        note_values(found)
    if arguments.json:
        print(json.dumps(found, indent=2, ensure_ascii=False), file=stream)
    elif len(rows) > 1:
        print("\n".join(table_of(rows, tolerance)), file=stream)
    else:
        print_warnings(rows[0].diagnostics)
        print("\n".join(lines_of(rows[0], tolerance)), file=stream)
