"""Options that clean up captured motions, and ``viewer.clean``, which does the same."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from viewer.commands._frames import parse_range, rate
from viewer.commands._keywords import arguments_of, without_dashes
from viewer.commands._settings import add_settings, settings_of
from viewer.commands._usage import FILES_BEFORE
from viewer.errors import ViewerError
from viewer.loading.settings import CleanUp
from viewer.phrases import printable
from viewer.rigs.scene import Actor, Scene, scene_of

if TYPE_CHECKING:
    from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay

_LONGEST_WINDOW = 9999
_KEYS = {"one-euro": ("cutoff", "beta", "speed-cutoff"), "savgol": ("window", "order")}

# Values of --gaps, by the use of the command: pattern, help and metavariable.
_ONE_SECOND = 1.0  # the longest gap if the deprecated --fill-gaps has no value
_LIMIT = r"interpolate(?::(?P<limit>[1-9][0-9]{0,8}|[0-9]{1,6}(?:\.[0-9]{1,6})?s)%s)?"
_PATTERNS = {
    "view": _LIMIT % "",
    "check": "interpolate",
    "write": rf"(?P<alone>hold|split)|{_LIMIT % '(?:,(?P<rest>hold|split))?'}",
}
_WHAT = {
    "view": "gaps in captures: interpolate all, or those of up to N frames or N seconds (2s)",
    "check": "gaps in captures: interpolate all",
    "write": "gaps in captures: hold the pose before the gap (at the start, the first pose), split "
    "the file, or interpolate all or those of up to N frames or N seconds (2s), as in "
    "interpolate:10,split (default: missing frames are omitted from EasyMocap, .obj and arrays; "
    "other formats hold poses)",
}
_METAVAR = {
    "view": "interpolate[:N|:Ns]",
    "check": "interpolate",
    "write": "hold|split|interpolate[:N|:Ns]",
}

GapUse: TypeAlias = Literal["view", "check", "write"]


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


def clean(what: Scene | Actor, **options: object) -> Scene:
    """Clean up captured motions, or those of your own arrays, as ``viewer convert`` does.

    Parameters
    ----------
    what
        Unchanged; the result has copies of its actors.
    **options
        Options of the command with underscores, applied in this order: ``merge_ids`` (``[1, 4]``),
        ``gaps`` (``"interpolate"``, or ``"interpolate:10"`` frames), ``smooth`` (True,
        ``"savgol:window=7"``, ``"one-euro"``), ``lock_feet``, ``ground``, ``trim`` (a range of
        frames) and ``resample`` (frames per second).

    Returns
    -------
    Scene
        With the new motions; its ``diagnostics`` end with what was changed, and how far.

    Raises
    ------
    ViewerError
        If there is no such option or value, or nothing is requested.
    RigError
        If no motion has frames.
    """
    from viewer.loading.cleaning import clean_up

    scene = scene_of(what, "clean")
    arguments = arguments_of("clean", _add_clean_arguments, options)
    with without_dashes():
        wanted = clean_up_of(arguments)
    if arguments.interpolate_gaps:  # however long they are
        wanted = replace(wanted, interpolates=True, longest_gap=sys.maxsize)
    if wanted.is_empty:
        raise ViewerError("clean: expected an option such as smooth or lock_feet, found none")
    scene = replace(scene, actors=[actor.copy() for actor in scene.actors])
    notes = clean_up(scene, wanted)
    return replace(scene, diagnostics=(*scene.diagnostics, *notes))


def _add_clean_arguments(parser: argparse.ArgumentParser) -> None:
    add_cleanup_arguments(parser)
    add_gap_arguments(parser.add_argument_group("gaps"), "view")


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
            f"expected one-euro or savgol{FILES_BEFORE}, found {printable(text, 60)}"
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


def add_gap_arguments(group: argparse._ArgumentGroup, use: GapUse) -> None:
    """Add ``--gaps``, and deprecated options for its values, which are hidden in the help.

    ``use``: ``"view"``; ``"check"`` for commands that do not clean up; ``"write"``. Parsing sets
    ``gaps``: ``"hold"``, ``"split"`` or None; ``interpolate_gaps``: whether all gaps are
    interpolated; ``fill_gaps``: the longest gap that clean-up interpolates, frames as an integer or
    seconds as a float, or None.
    """
    group.add_argument("--gaps", action=_Gaps, metavar=_METAVAR[use], help=_WHAT[use], const=use)
    hidden = argparse.SUPPRESS
    group.add_argument("--interpolate-gaps", action="store_true", help=hidden)
    if use == "check":
        return
    group.add_argument("--fill-gaps", nargs="?", type=_longest, const=_ONE_SECOND, help=hidden)


class _Gaps(argparse.Action):
    """Parses the value of ``--gaps`` into the results of all three options."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        """Store the results, or raise ArgumentError."""
        text, use = str(values), str(self.const)
        found = re.fullmatch(_PATTERNS[use], text)
        if found is None:
            raise argparse.ArgumentError(
                self, f"expected {_METAVAR[use]}, found {printable(text, 60)}"
            )
        parts = found.groupdict()
        namespace.gaps = parts.get("alone") or parts.get("rest")
        limit = parts.get("limit")
        namespace.interpolate_gaps = limit is None and parts.get("alone") is None
        if use != "check":
            is_time = limit is not None and limit.endswith("s")
            longest = float(limit[:-1]) if limit is not None and is_time else int(limit or 0)
            namespace.fill_gaps = None if limit is None else longest


def _longest(text: str) -> int:
    """Return the length of the longest gap in frames."""
    if not re.fullmatch(r"[1-9]\d{0,8}", text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f"expected a number of frames{FILES_BEFORE}, found {printable(text, 60)}"
        )
    return int(text)
