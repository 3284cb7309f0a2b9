"""Helpers for readers of plain meshes: vertex normals, up axis and unit."""

from __future__ import annotations

import re
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from viewer.formats._source import Source
from viewer.phrases import counted
from viewer.rig.arrays import Floats, Ints
from viewer.rig.mesh import vertex_normals
from viewer.rig.units import UNIT_NAMES

__all__ = ["filled_normals", "polygon_text", "stated_unit", "stated_up"]

_SHORTEST = 1e-15  # minimum length of a normal; the square of a shorter length is 0 in float32
_SIZES = {3: "triangle", 4: "quad"}


def filled_normals(
    source: Source, normals: Floats | None, positions: Floats, triangles: Ints
) -> Floats:
    """Return a normal for every vertex, from the file or computed.

    Parameters
    ----------
    source : Source
        The file, which records warnings about zero-length normals.
    normals : (V, 3) or None
        Normals of the file; NaN if there is none.
    positions, triangles : (V, 3), (T, 3)
        The mesh.
    """
    if normals is None:
        return vertex_normals(positions, triangles)
    absent = np.isnan(normals[:, 0])
    # Columns are reduced one by one, because numpy is slow at reducing rows of three.
    x, y, z = (np.abs(column) for column in normals.T)
    zero = np.maximum(np.maximum(x, y), z) < _SHORTEST
    if zero.any():
        places = np.flatnonzero(zero)
        source.warn(
            "M007.computed", part="positions", places=places, n=len(places), vertex=int(places[0])
        )
    missing = absent | zero
    if not missing.any():
        return normals
    return np.where(missing[:, None], vertex_normals(positions, triangles), normals)


def polygon_text(counts: NDArray[np.integer], n_triangles: int) -> str:
    """Return polygon counts by size: ``"2 quads, 1 with 5 or more corners"``."""
    sizes = [counted(int((counts == size).sum()), name) for size, name in _SIZES.items()]
    large = int((counts > 4).sum())
    parts = [text for text in sizes if not text.startswith("0 ")]
    parts += [f"{large} with 5 or more corners"] * (large > 0)
    return f"{', '.join(parts)}: {counted(n_triangles, 'triangle')} in all"


def stated_up(comment: str) -> Literal["y", "z"]:
    """Return the up axis stated by a comment that this program wrote; y by default."""
    return "z" if re.search(r"\bz up\b", comment) else "y"


def stated_unit(comment: str) -> str:
    """Return the unit that a comment written by this program states; empty without one."""
    stated = re.search(r"\b[yz] up, (\w+)", comment)
    names = {name: unit for unit, name in UNIT_NAMES.items()}
    return "" if stated is None else names.get(stated[1], "")
