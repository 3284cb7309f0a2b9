"""Options for the meta data of written VRM characters."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.errors import ViewerError
from viewer.export import VrmMeta, exporters_at
from viewer.phrases import printable


def add_vrm_arguments(parser: argparse.ArgumentParser, upgrades: bool = False) -> None:
    """Add the options that name a character, its authors and its licence.

    ``upgrades``: whether the command can convert VRM 0.x to 1.0.
    """
    group = parser.add_argument_group("writing VRM characters")
    group.add_argument("--vrm-name", metavar="NAME", help="name of the character")
    group.add_argument(
        "--vrm-author",
        action="append",
        default=[],
        metavar="NAME",
        help="an author; may be repeated; required for figures from other formats",
    )
    group.add_argument(
        "--vrm-licence",
        metavar="URL",
        help="address of the licence; required for figures from other formats",
    )
    if upgrades:
        group.add_argument(
            "--vrm-version",
            choices=("1.0", "1"),
            help="write characters from VRM 0.x files as VRM 1.0 (default: the file's version)",
        )


def vrm_meta(arguments: argparse.Namespace, output: Path | None) -> VrmMeta:
    """Return the requested meta data.

    Raises ViewerError if there are any, but the output is not a VRM file.
    """
    given = {
        "--vrm-name": arguments.vrm_name,
        "--vrm-author": arguments.vrm_author,
        "--vrm-licence": arguments.vrm_licence,
    }
    version = getattr(arguments, "vrm_version", None)
    given["--vrm-version"] = version
    named = next((option for option, value in given.items() if value), "")
    kinds = [] if output is None else exporters_at(output)
    if named and not any("meta" in kind.options for kind in kinds):
        suffix = printable(output.suffix) if output is not None and output.suffix else "no suffix"
        raise ViewerError(f"{named}: expected an output with .vrm, found {suffix}")
    return VrmMeta(
        arguments.vrm_name or "",
        tuple(arguments.vrm_author),
        arguments.vrm_licence or "",
        upgrades=version is not None,
    )
