"""Tools of video motion capture whose results are read, in the order in which they are tried."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

from viewer.formats._archive.values import Archive

__all__ = ["TOOLS", "Tool", "module_of", "tool_of"]


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool, and what its results contain.

    Attributes
    ----------
    title : str
        Name of the tool.
    files : str
        Its files, for the manual.
    """

    title: str
    files: str


TOOLS = {
    "gvhmr": Tool("GVHMR", "hmr4d_results.pt"),
    "wham": Tool("WHAM", "wham_output.pkl"),
}
"""Modules in this folder; each has ``recognises(archive)`` and ``read(source, archive)``."""


def module_of(tool: str) -> ModuleType:
    """Return the module of a tool."""
    return import_module(f"{__package__}.{tool}")


def tool_of(archive: Archive) -> str | None:
    """Return the key in ``TOOLS`` of an archive's tool, None if it is none of them."""
    return next((tool for tool in TOOLS if module_of(tool).recognises(archive)), None)
