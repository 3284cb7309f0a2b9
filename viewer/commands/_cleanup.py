"""Options that clean up captured motions."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from viewer.commands._frames import parse_range, rate
from viewer.commands._settings import add_settings, settings_of
from viewer.loading.settings import CleanUp
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay

_LONGEST_WINDOW = 9999
_KEYS = {"one-euro": ("cutoff", "beta", "speed-cutoff"), "savgol": ("window", "order")}


def add_cleanup_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that clean up captured motions."""
    group = parser.add_argument_group(
        "clean-up of captures, applied in this order; changes are printed"
    )
    add_settings(group, CleanUp, "merged", type=_people)
    add_settings(group, CleanUp, "smoothing", nargs="?", type=_filter, const="savgol")
    add_settings(group, CleanUp, "locks_feet", "grounds", "frames")
    add_settings(group, CleanUp, "rate", type=rate)


def clean_up_of(arguments: argparse.Namespace) -> CleanUp:
    """Return the requested clean-up, which is empty for a command without these options."""
    if "resample" not in arguments:
        return CleanUp()
    frames = None
    if arguments.trim is not None:
        span = parse_range(arguments.trim, "--trim", steps=False)
        frames = span.first, span.stop
    gap = {} if arguments.fill_gaps is None else {"longest_gap": arguments.fill_gaps}
    return settings_of(CleanUp, arguments, frames=frames, interpolates=bool(gap), **gap)


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
    from viewer.rigs.cleanup.smoothing import OneEuro

    found = OneEuro(**values)
    if min(found.cutoff, found.speed_cutoff) <= 0.0:
        raise argparse.ArgumentTypeError("one-euro: expected cutoffs above 0 Hz, found 0")
    return found


def _savgol(values: dict[str, float]) -> SavitzkyGolay:
    from viewer.rigs.cleanup.smoothing import SavitzkyGolay

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
