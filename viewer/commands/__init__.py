"""Subcommands of ``viewer``: one module each, imported when the command runs."""

from __future__ import annotations

COMMANDS = {
    "view": "open files in a window (the default)",
    "serve": "open files in a window that other programs on this machine move",
    "render": "render files to an image or video, without a window",
    "convert": "write figures, poses and motions in other formats",
    "batch": "run convert, render, rig, info, diff or lint for many files, in parallel",
    "rig": "transfer the rig of a figure to an unrigged mesh, or bind it to a skeleton",
    "info": "describe the contents of files",
    "diff": "compare figures or motions with a reference: how much they differ, where, and in "
    "which pose",
    "lint": "check rigs and motions: what is wrong, where, and how to fix it",
    "models": "list body models: found, missing, where they are published, and their licences",
    "new-plugin": "write a package with a plug-in to start from",
    "doctor": "check this machine: packages, OpenGL, display, and how to install missing parts",
    "help": "show a page of the manual, or an example script",
    "completion": "print a script that completes commands and options in bash, zsh, tcsh or fish",
}
"""Modules in this folder, each with ``add_arguments(parser)`` and ``run(arguments)``. Names of
modules have underscores for dashes."""
