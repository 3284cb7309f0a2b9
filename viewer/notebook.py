"""Scenes in Jupyter and IPython: a picture, and the page of an export in a frame over it."""

from __future__ import annotations

import base64
import html
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.rigs.scene import Scene
    from viewer.rigs.skinning import Skinning

SIZE = (480, 360)
"""Size of the pictures, pixels."""

LARGEST = 6_000_000
"""Largest page in a notebook, characters; larger scenes show a picture."""

_USUAL_RATE = 30.0  # frames per second, to guess the number of frames
_MOST_POSED = 4_000_000  # vertices in all frames; of longer motions, the current pose is shown


def show_scenes() -> None:
    """Let IPython show a scene that is the last expression of a cell."""
    shell = sys.modules["IPython"].get_ipython()
    if shell is not None:
        formatters = shell.display_formatter.formatters
        formatters["image/png"].for_type_by_name("viewer.rigs.scene", "Scene", picture)
        formatters["text/html"].for_type_by_name("viewer.rigs.scene", "Scene", framed_page)


def picture(scene: Scene) -> bytes:
    """Return a picture of a scene as a PNG file."""
    from viewer.media.png import encode_png
    from viewer.rendering.offscreen import render

    return bytes(encode_png(render(scene, SIZE)))


def page_of(scene: Scene, skinning: Skinning | None = None) -> str:
    """Return the text of a page that shows a scene: short motions, or the current poses."""
    from viewer.commands._exports import export
    from viewer.exporters import ExportOptions, Part, Selection
    from viewer.exporters import export as export_selection
    from viewer.rigs.skinning import Skinning

    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.html"
        if _is_short(scene):
            export(scene, path, skinning)
        else:
            parts = [Part(actor) for actor in scene.actors if actor.is_present]
            options = ExportOptions(skinning=skinning or Skinning())
            export_selection(Selection(parts, scene), path, options=options)
        return path.read_text("utf-8")


def framed_page(scene: Scene) -> str | None:
    """Return a picture with the page in a frame over it; None for scenes with a large page."""
    from viewer.errors import ViewerError

    try:
        page = page_of(scene)
    except ViewerError as problem:
        # The picture is shown in its place.
        sys.stderr.write(f"no interactive view: {problem}\n")
        return None
    if len(page) > LARGEST:
        return None
    data = base64.b64encode(picture(scene)).decode("ascii")
    # Where frames are removed, as on GitHub, the picture is left.
    box = "position:absolute;inset:0;width:100%;height:100%;border:0"
    return (
        '<div style="position:relative;max-width:800px;aspect-ratio:4/3">'
        f'<img alt="3D view" src="data:image/png;base64,{data}" style="{box}">'
        f'<iframe title="3D view" sandbox="allow-scripts" style="{box}" '
        f'srcdoc="{html.escape(page)}"></iframe></div>'
    )


def _is_short(scene: Scene) -> bool:
    """Return whether the motions are short enough for a notebook."""
    total = 0.0
    for actor in scene.actors:
        mesh, clip = actor.figure.mesh, actor.clip
        if mesh is not None and clip is not None:
            total += mesh.n_vertices * _USUAL_RATE * (clip.end - clip.start)
    return total <= _MOST_POSED
