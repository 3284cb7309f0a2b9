"""Subcommands of ``viewer``: one module each, imported when it is called."""

from __future__ import annotations

__all__ = ["COMMANDS"]

COMMANDS = {
    "view": "open files in a window (the default)",
    "render": "draw files into a picture, without a window",
    "convert": "write figures, poses and motions in other formats",
    "rig": "give a mesh without a rig that of a figure",
    "info": "describe the contents of files",
    "diff": "compare figures or motions with a reference: how far apart, where, in which pose",
    "lint": "check rigs and motions: what is wrong, where, and what to do about it",
    "doctor": "check what this machine offers, and how to get what is missing",
    "help": "show a page of the manual",
    "completion": "print a script that completes commands and options in bash, zsh or tcsh",
}
"""Modules in this folder, each with ``add_arguments(parser)`` and ``run(arguments)``."""
