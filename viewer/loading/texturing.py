"""Application of images as textures of figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.rig.arrays import Bytes
from viewer.rig.figure import Figure
from viewer.rig.material import Material, Texture

__all__ = ["with_texture"]


def with_texture(figure: Figure, path: Path, pixels: Bytes) -> Figure:
    """Return a figure textured with one image.

    Raises
    ------
    RigError
        If it has no texture coordinates.
    """
    mesh = figure.mesh
    if mesh is None or mesh.uvs is None:
        values = {"figures": [figure.name]}
        raise RigError(Diagnostic("F004.picture", path, values=values))
    covered = replace(
        mesh,
        materials=(Material(path.stem, Texture(path.name, pixels)),),
        triangle_materials=np.zeros(mesh.n_triangles, dtype=np.int32),
    )
    return replace(figure, mesh=covered)
