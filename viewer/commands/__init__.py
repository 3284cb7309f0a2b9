"""Subcommands of ``viewer``: one module each, imported when it is called."""

from __future__ import annotations

__all__ = ["COMMANDS"]

COMMANDS = {
    "view": "open files in a window (the default)",
    "render": "draw files into a picture, without a window",
    "convert": "write poses and motions: .obj, .ply, .npz, .bvh, .anim, .skel + .skin",
    "info": "say what is in files",
    "doctor": "say what this machine offers, and the cure for what it lacks",
}
"""Modules in this folder, each with ``add_arguments(parser)`` and ``run(arguments)``."""
