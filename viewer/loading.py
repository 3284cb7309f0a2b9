"""Open files together: a skeleton and the skin that fits it become one actor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, RigError, printable
from viewer.formats import MAX_SIZE, Source, read
from viewer.resources import resource
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene, actor_points
from viewer.rig.transform import translation_matrix

__all__ = ["bundled_files", "load"]

_GAP = 0.25  # between actors side by side, in widths of the wider one


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the figure that ships with the viewer."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def load(*paths: str | Path, max_size: int = MAX_SIZE) -> Scene:
    """Open files as one scene; without files, the bundled figure.

    Files are recognised by content. Skeletons and skins are paired in the order given: a
    ``.skel`` with the ``.skin`` that follows or precedes it. One without a partner opens alone.
    Several actors stand side by side.

    Parameters
    ----------
    *paths : str or Path
        ``.skel`` and ``.skin`` files in any order.
    max_size : int
        Larger files, in bytes, are refused before they are read.

    Returns
    -------
    Scene
        One actor per pair; its ``warnings`` hold what the readers noticed.

    Raises
    ------
    FormatError
        If a file cannot be read; with the line if there is one.
    RigError
        If a skin does not fit its skeleton; the message names both files and both numbers.

    >>> scene = load()
    >>> scene.actors[0].figure.name
    'fox'
    """
    sources = [Source.open(path, max_size) for path in paths or bundled_files()]
    figures = [read(source) for source in sources]
    pairs = _pairs([figure.skeleton is not None for figure in figures])
    actors = [
        Actor(_join([sources[i].path for i in pair], [figures[i] for i in pair])) for pair in pairs
    ]
    _place_side_by_side(actors)
    return Scene(actors, tuple(text for source in sources for text in source.warnings))


def _pairs(is_skeleton: Sequence[bool]) -> list[tuple[int, ...]]:
    """Match each skeleton with the nearest free skin, neighbours first, in file order.

    >>> _pairs([True, False, True, False])
    [(0, 1), (2, 3)]
    >>> _pairs([False, True, True])
    [(1, 0), (2,)]
    """
    free_skins = [index for index, skeleton in enumerate(is_skeleton) if not skeleton]
    pairs: list[tuple[int, ...]] = []
    skeletons = [index for index, skeleton in enumerate(is_skeleton) if skeleton]
    for index in skeletons:
        if free_skins:
            pairs.append((index, free_skins.pop(0)))
        else:
            pairs.append((index,))
    pairs += [(index,) for index in free_skins]
    return sorted(pairs, key=min)


def _join(paths: list[Path], figures: list[Figure]) -> Figure:
    """Attach a skin to its skeleton, or return the figure that stands alone."""
    if len(figures) == 1:
        return figures[0]
    skeleton, skin = figures[0].skeleton, figures[1].skin
    skel_path, skin_path = (printable(path, 300) for path in paths)
    assert skeleton is not None  # the pairs put it first
    if skin is None:
        raise FormatError(
            paths[1],
            f"expected weights and bindings to follow the {skeleton.n_joints} joints of "
            f"{skel_path}, found none",
        )
    if skin.n_joints != skeleton.n_joints:
        raise RigError(
            f"{skin_path} has {skin.n_joints} binding matrices, "
            f"{skel_path} has {skeleton.n_joints} joints"
        )
    return Figure(paths[1].stem, figures[1].mesh, skeleton, skin)


def _place_side_by_side(actors: list[Actor]) -> None:
    """Move the second and later actors to the right of those before them."""
    edge = 0.0
    for number, actor in enumerate(actors):
        xs = actor_points(actor)[:, 0] if len(actors) > 1 else None
        if xs is None:
            return
        low, width = float(xs.min()), float(xs.max() - xs.min())
        if number:
            gap = _GAP * width
            actor.placement = translation_matrix(np.array([edge + gap - low, 0.0, 0.0]))
            edge += gap + width
        else:
            edge = low + width
