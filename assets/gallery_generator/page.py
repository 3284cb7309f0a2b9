"""The manual's page about the gallery."""

from __future__ import annotations

import re
import textwrap

from gallery_generator.pictures import COMMON, PICTURES

__all__ = ["file_name", "page"]

_HEAD = """<!-- Written by assets/make_gallery.py: make gallery -->

# Gallery

Pictures of bundled data only, and the commands that drew them, with the options
`{common}`. `make gallery` draws them again, and
fails if more than 0.1 % of the pixels of a picture are overexposed or black. `walk` and `capture`
are synthetic recordings in EasyMocap's layout, `scan.obj` is a person without a rig, and `body.npz`
is the bundled body. `assets/gallery_generator/` makes them.
"""
_WIDTH = 96


def file_name(name: str) -> str:
    """Return the file name of a picture; the README also uses the picture of the window."""
    return "window.png" if name == "window" else f"gallery_{name}.png"


def page() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD.format(common=COMMON)]
    for name, picture in PICTURES.items():
        text = textwrap.fill(picture.text, _WIDTH)
        parts.append(f"\n## {picture.title}\n\n{text}\n")
        parts.append(f"\n![{picture.title}](../../assets/pictures/{file_name(name)})\n")
        if picture.commands:
            commands = [*picture.commands[:-1], f"{picture.commands[-1]} -o {name}.png"]
            lines = "\n".join(map(_wrapped, commands))
            parts.append(f"\n```sh\n{lines}\n```\n")
        else:
            parts.append("\nDrawn with Python: `assets/gallery_generator/pictures.py`.\n")
    return "".join(parts)


def _wrapped(command: str) -> str:
    """Return a command broken at options into lines that end with a backslash, except the last."""
    lines = [""]
    for part in re.split(r" (?=-)", command):
        longer = f"{lines[-1]} {part}".lstrip()
        if len(longer) <= _WIDTH - 2:
            lines[-1] = longer
        else:
            lines.append(part)
    return " \\\n  ".join(lines)
