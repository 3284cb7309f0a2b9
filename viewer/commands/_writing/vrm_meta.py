"""Options for the meta data of written VRM characters."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.commands._settings import add_settings
from viewer.errors import ViewerError
from viewer.export import VrmMeta, exporters_at
from viewer.phrases import printable


def add_vrm_arguments(parser: argparse.ArgumentParser, upgrades: bool = False) -> None:
    """Add the options that name a character, its authors and its licence.

    ``upgrades``: whether the command can convert VRM 0.x to 1.0.
    """
    group = parser.add_argument_group("writing VRM characters")
    names = "name", "authors", "licence", "upgrades"
    add_settings(group, VrmMeta, *(names if upgrades else names[:-1]))


def check_meta(meta: VrmMeta, output: Path | None) -> None:
    """Raise ViewerError if there are meta data, but the output is not a VRM file."""
    given = {
        "--vrm-name": meta.name,
        "--vrm-author": meta.authors,
        "--vrm-licence": meta.licence,
        "--vrm-version": meta.upgrades,
    }
    named = next((option for option, value in given.items() if value), "")
    kinds = [] if output is None else exporters_at(output)
    if named and not any("meta" in kind.options for kind in kinds):
        suffix = printable(output.suffix) if output is not None and output.suffix else "no suffix"
        raise ViewerError(f"{named}: expected an output with .vrm, found {suffix}")
