"""Options that clean up captured motions."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from viewer.commands._sequence.frame_numbers import parse_range, rate
from viewer.loading.settings import CleanUp
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.rig.cleanup.smoothing import OneEuro, SavitzkyGolay

_LONGEST_WINDOW = 9999
_KEYS = {"one-euro": ("cutoff", "beta", "speed-cutoff"), "savgol": ("window", "order")}


def add_cleanup_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that clean up captured motions."""
    group = parser.add_argument_group(
        "clean-up of captures, applied in this order; changes are printed"
    )
    group.add_argument(
        "--merge-ids",
        type=_people,
        action="append",
        default=[],
        metavar="A,B,…",
        help="IDs of tracks that belong to one person, who keeps ID A; may be repeated",
    )
    group.add_argument(
        "--smooth",
        nargs="?",
        type=_filter,
        const="savgol",
        metavar="FILTER",
        help="smooth rotations and translations: savgol (default), savgol:window=7,order=2 (an odd "
        "number of frames, the degree), one-euro or one-euro:cutoff=3,beta=2 (Hz; Hz per rad/s and "
        "per m/s)",
    )
    _add_feet(group)
    group.add_argument(
        "--trim", metavar="A:B", help="keep frames A to B - 1; A or B may be omitted"
    )
    group.add_argument(
        "--resample",
        type=rate,
        metavar="R",
        help="interpolate at R frames per second (--fps instead changes the speed)",
    )


def _add_feet(group: argparse._ArgumentGroup) -> None:
    """Add the options that put feet on the ground."""
    group.add_argument(
        "--lock-feet",
        action="store_true",
        help="hold feet in place while they touch the ground; legs follow, and so does the body if "
        "they are too short",
    )
    group.add_argument(
        "--ground",
        action="store_true",
        help="move people up or down until their feet rest at height 0, z = 0 or y = 0",
    )


def clean_up_of(arguments: argparse.Namespace) -> CleanUp:
    """Return the requested clean-up, which is empty for a command without these options.

    Raises ViewerError if the frames are not a range.
    """
    if "resample" not in arguments:
        return CleanUp()
    frames = None
    if arguments.trim is not None:
        span = parse_range(arguments.trim, "--trim", steps=False)
        frames = span.first, span.stop
    return CleanUp(
        merged=tuple(arguments.merge_ids),
        interpolates=arguments.fill_gaps is not None,
        longest_gap=1.0 if arguments.fill_gaps is None else arguments.fill_gaps,
        smoothing=arguments.smooth,
        locks_feet=arguments.lock_feet,
        grounds=arguments.ground,
        frames=frames,
        rate=arguments.resample,
    )


def _people(text: str) -> tuple[int, ...]:
    """Return the numbers of people to merge."""
    is_list = re.fullmatch(r"\s*\d{1,9}(\s*,\s*\d{1,9})+\s*", text, re.ASCII)
    people = tuple(dict.fromkeys(map(int, text.split(",")))) if is_list else ()
    if len(people) < 2:
        raise argparse.ArgumentTypeError(
            f"expected at least two numbers of people, as in 3,7, found {printable(text, 40)}"
        )
    return people


def _filter(text: str) -> OneEuro | SavitzkyGolay:
    """Return a filter by name, with parameters after a colon."""
    name, _, rest = text.partition(":")
    if name not in _KEYS:
        raise argparse.ArgumentTypeError(
            f"expected one-euro or savgol, or no value and the files before the option, found "
            f"{printable(text, 60)}"
        )
    values = {}
    for part in filter(None, rest.split(",")):
        key, _, number = part.partition("=")
        if key not in _KEYS[name] or not re.fullmatch(r"\d{1,6}(\.\d{1,9})?", number, re.ASCII):
            known = ", ".join(f"{each}=NUMBER" for each in _KEYS[name])
            raise argparse.ArgumentTypeError(
                f"{name}: expected {known}, found {printable(part, 40)}"
            )
        values[key.replace("-", "_")] = float(number)
    return _one_euro(values) if name == "one-euro" else _savgol(values)


def _one_euro(values: dict[str, float]) -> OneEuro:
    from viewer.rig.cleanup.smoothing import OneEuro

    found = OneEuro(**values)
    if min(found.cutoff, found.speed_cutoff) <= 0.0:
        raise argparse.ArgumentTypeError("one-euro: expected cutoffs above 0 Hz, found 0")
    return found


def _savgol(values: dict[str, float]) -> SavitzkyGolay:
    from viewer.rig.cleanup.smoothing import SavitzkyGolay

    window, order = values.get("window", 0.0), values.get("order", 2.0)
    is_odd = window % 2 == 1 and 3 <= window <= _LONGEST_WINDOW
    if "window" in values and not is_odd:
        raise argparse.ArgumentTypeError(
            f"savgol: expected an odd window of at least 3 frames, found {window:g}"
        )
    if order != int(order) or order > 9 or ("window" in values and order >= window):
        raise argparse.ArgumentTypeError(
            f"savgol: expected an integer order from 0 to 9, less than the window, found {order:g}"
        )
    return SavitzkyGolay(int(window), int(order))
