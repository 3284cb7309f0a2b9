"""Which triangles are drawn: all of them, a coarser set, or without hidden body parts."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from viewer.rendering.upload import buffer
from viewer.rig.arrays import Bools, Ints
from viewer.rig.figure import Figure

__all__ = ["IndexSet", "MeshRun", "index_set", "kept_triangles"]


@dataclass(frozen=True, slots=True)
class MeshRun:
    """Consecutive triangles with one material: first index, number of indices, its texture."""

    first: int
    count: int
    texture: moderngl.Texture | None


@dataclass(frozen=True, slots=True)
class IndexSet:
    """An index buffer and its runs; whoever made it releases the buffer."""

    indices: moderngl.Buffer
    runs: tuple[MeshRun, ...]


def index_set(
    context: moderngl.Context,
    triangles: Ints,
    materials: Ints,
    textures: list[moderngl.Texture | None],
) -> IndexSet:
    """Upload triangles; runs follow their materials.

    Parameters
    ----------
    context : moderngl.Context
        Gives the buffer.
    triangles : (T, 3)
        Indices of split vertices.
    materials : (T,)
        Index into ``textures`` of each triangle, -1 for none.
    textures : list
        Of the materials.
    """
    edges = np.flatnonzero(np.diff(materials)) + 1
    runs = []
    for first, last in zip([0, *edges], [*edges, len(materials)], strict=True):
        index = int(materials[first]) if len(materials) else -1
        texture = None if index < 0 else textures[index]
        runs.append(MeshRun(3 * int(first), 3 * int(last - first), texture))
    return IndexSet(buffer(context, triangles, "u4"), tuple(runs))


def kept_triangles(figure: Figure, hidden: tuple[int, ...], triangles: Ints) -> Bools:
    """Return which triangles have a corner outside the hidden body parts: (T,) bool.

    Parameters
    ----------
    figure : Figure
        With or without body parts.
    hidden : tuple of int
        Parts that are not drawn.
    triangles : (T, 3)
        Indices of the figure's vertices.
    """
    if figure.body_parts is None or not hidden:
        return np.ones(len(triangles), dtype=bool)
    is_shown: Bools = ~np.isin(figure.body_parts.of_vertex, hidden)
    return np.any(is_shown[triangles], axis=1)
