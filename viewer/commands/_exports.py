"""``viewer.export``: files of a scene or an actor, with the choices of the command ``convert``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING

from viewer.arguments import check_type
from viewer.commands._scene import SceneOptions
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.rigs.scene import Actor, Scene, scene_of
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.exporters import ExportOptions, VrmMeta


def export(
    scene: Scene | Actor,
    path: str | Path,
    skinning: Skinning | None = None,
    *,
    frames: range | None = None,
    fps: float | None = None,
    time: float | None = None,
    optimizes: bool = False,
    meta: VrmMeta | None = None,
    options: ExportOptions | None = None,
) -> list[Diagnostic]:
    """Write a scene or one actor as ``viewer convert`` does; existing files are replaced.

    Motions are written where the format stores them, with their own keys if it can; else the
    current poses.

    Parameters
    ----------
    scene
        What is written; of a single actor, its placement in the scene is omitted.
    path
        The suffix selects the format. ``{person}`` in the name selects a file for each actor,
        ``{frame:05}`` one for each frame.
    skinning
        Skinning method and options.
    frames
        Numbers of the frames, without a step; the whole motion if omitted.
    fps
        Frames per second; those of the motion if omitted.
    time
        Seconds of the motions: writes the poses at that time.
    optimizes
        Quantise vertices, which glTF and VRM support.
    meta
        Name, authors and licence of a VRM character; those of its file if omitted.
    options
        All options, including those above.

    Returns
    -------
    list of Diagnostic
        Notes: the written files, then the data that the format cannot store, with errors. ``str``
        gives the text of each.

    Raises
    ------
    UnsupportedFormatError
        If no exporter writes this suffix, or it cannot quantise.
    RigError
        If the figure lacks the data that the format needs, or nobody is present.
    ViewerError
        If there are no such frames.
    OutputError
        If a file cannot be written, or is one of those that were opened.
    """
    from viewer.commands._keywords import without_dashes
    from viewer.commands._pictures import scene_at
    from viewer.commands.convert import check_outputs, selected
    from viewer.exporters import ExportOptions, VrmMeta, export, output_files

    check_type("path", path, str, Path)
    check_type("frames", frames, range, NoneType)
    check_type("fps", fps, float, NoneType)
    check_type("skinning", skinning, Skinning, NoneType)
    check_type("meta", meta, VrmMeta, NoneType)
    check_type("options", options, ExportOptions, NoneType)
    chosen = replace(options) if options is not None else ExportOptions()
    chosen.skinning = chosen.skinning if skinning is None else skinning
    chosen.meta, chosen.optimizes = meta or chosen.meta, optimizes or chosen.optimizes
    asked, scene = SceneOptions([]), scene_of(scene, "export")
    asked.frames.fps, asked.frames.time = fps, time
    if frames is not None:
        if frames.step != 1:
            raise ViewerError(f"frames: expected a step of 1, found {frames.step}")
        asked.frames.frames = f"{frames.start}:{frames.stop}"
    with without_dashes():
        asked.frames.check()
        if time is not None:
            scene = scene_at(scene, time)
        selection, chosen, notes = selected(asked, chosen, scene, Path(path))
        # Files of the scene may still be read.
        files = output_files(selection, Path(path), chosen)
        check_outputs(files, Path(path), scene.files, force=True)
        return [*export(selection, path, options=chosen), *notes]
