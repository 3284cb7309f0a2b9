"""Pictures of scenes in Jupyter and IPython."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.rigs.scene import Scene

SIZE = (480, 360)
"""Size of the pictures, pixels."""


def show_pictures() -> None:
    """Let IPython show a picture of a scene that is the last expression of a cell."""
    shell = sys.modules["IPython"].get_ipython()
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        pictures.for_type_by_name("viewer.rigs.scene", "Scene", picture)


def picture(scene: Scene) -> bytes:
    """Return a picture of a scene as a PNG file."""
    from viewer.media.png import encode_png
    from viewer.rendering.offscreen import render

    return bytes(encode_png(render(scene, SIZE)))
