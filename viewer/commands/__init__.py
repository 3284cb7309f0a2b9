"""Subcommands of ``viewer``: one module each, imported when it is called."""

from __future__ import annotations

__all__ = ["COMMANDS"]

COMMANDS = {
    "view": "open files in a window (the default)",
    "render": "draw files into a picture, without a window",
    "convert": "write poses and motions: .obj, .ply, .npz, .bvh, .anim, .skel + .skin",
    "rig": "give an unrigged mesh (.obj, .ply) the rig of a figure",
    "info": "say what is in files",
    "diff": "hold figures or motions against a reference, and say how far they are apart",
    "lint": "check rigs and motions: what is wrong, where, and what to do about it",
    "doctor": "say what this machine offers, and the cure for what it lacks",
    "help": "show a page of the manual",
}
"""Modules in this folder, each with ``add_arguments(parser)`` and ``run(arguments)``."""
