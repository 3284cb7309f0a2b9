"""The option for gaps in captures: frames in which a person is absent."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import Any

from viewer.phrases import printable

__all__ = ["add_gap_arguments"]

_ONE_SECOND = 1.0
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


def add_gap_arguments(group: argparse._ArgumentGroup, use: str) -> None:
    """Add ``--gaps``, and deprecated options for its values, which are hidden in the help.

    ``group``: options of a command.
    ``use``: ``"view"``; ``"check"`` for commands that do not clean up; ``"write"``.
    Parsing sets ``gaps``: ``"hold"``, ``"split"`` or None; ``interpolate_gaps``: whether all gaps
      are interpolated; ``fill_gaps``: the longest gap that clean-up interpolates, frames as an
      integer or seconds as a float, or None.
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
        values: str | Sequence[Any] | None,
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
            f"expected a number of frames, or no value and the files before the option, found "
            f"{printable(text, 60)}"
        )
    return int(text)
