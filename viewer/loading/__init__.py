"""Open files together: figures, what moves them, and what they wear, become a scene."""

from __future__ import annotations

from pathlib import Path

from viewer.formats import MAX_SIZE
from viewer.loading.additions import add_to_actor
from viewer.loading.assembly import assemble, begin
from viewer.loading.bundled import bundled_body, bundled_files
from viewer.loading.contents import Contents, read_files, read_source
from viewer.loading.settings import MotionSettings
from viewer.rig.scene import Scene

__all__ = [
    "Contents",
    "MotionSettings",
    "add_to_actor",
    "assemble",
    "begin",
    "bundled_body",
    "bundled_files",
    "load",
    "read_files",
    "read_source",
]


def load(
    *paths: str | Path, max_size: int = MAX_SIZE, motion: MotionSettings | None = None
) -> Scene:
    """Open files as one scene; without files, the bundled figure.

    Files are recognised by content. A skeleton takes the first skin that has its number of
    joints, one of the same name if there is one. A figure without a partner opens alone; several
    actors stand side by side. A clip goes to the first actor without one that has its number of
    channels. A BVH drives the model if one is asked for, else the first figure whose joints it
    names, or stands as a skeleton: in metres beside others, else with the numbers of its file.
    Captured bodies are drawn with the first body model among the files, or the bundled body. All
    actors are posed as at the start of their motions. A pose goes to the first actor that it
    fits, a picture to the first with texture coordinates and no texture.

    Parameters
    ----------
    *paths : str or Path
        ``.skel``, ``.skin``, ``.anim``, ``.bvh``, body models, PIG folders, AMASS files,
        EasyMocap folders, poses and pictures, in any order.
    max_size : int
        Larger files, in bytes, are refused before they are read.
    motion : MotionSettings, optional
        How motions are taken: model, frame rate, up axis, unit.

    Returns
    -------
    Scene
        One actor per figure; its ``warnings`` hold what the readers noticed.

    Raises
    ------
    FormatError
        If a file cannot be read; with the line if there is one.
    RigError
        If a skin, clip or pose does not fit; the message names files and numbers.

    >>> scene = load()
    >>> scene.actors[0].figure.name
    'fox'
    """
    return assemble(read_files(paths or bundled_files(), max_size, motion), motion)
