"""Meshes of rigged figures as arrays of an ``.npz``.

::

    positions (V, 3)   triangles (T, 3)   uvs (U, 2)   uv_triangles (T, 3)            at rest
    second_uvs (U, 2)   uvs_2 (U, 2) …                           other texture coordinates
    colors (V, 4)   part_names (P,)   triangle_parts (T,)
    triangle_materials (T,)   and the materials, see ``materials.py``
"""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part
from viewer.formats._archive.checking import corners_of, finite
from viewer.formats._archive.values import Archive
from viewer.formats._neutral import neutral_positions
from viewer.formats._rigged.materials import material_arrays, read_materials, texts
from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh, vertex_normals

__all__ = ["mesh_arrays", "read_mesh"]


def mesh_arrays(mesh: Mesh) -> dict[str, NDArray[Any]]:
    """Return the arrays of a mesh with its materials; normals are not stored."""
    arrays: dict[str, NDArray[Any] | None] = {
        "positions": mesh.positions,
        "triangles": mesh.triangles,
        "uvs": mesh.uvs,
        "uv_triangles": mesh.uv_triangles,
        "colors": mesh.colors,
    }
    arrays |= dict(zip(_more_uvs(len(mesh.other_uvs)), mesh.other_uvs, strict=True))
    found = {key: array for key, array in arrays.items() if array is not None}
    if mesh.parts:
        found |= {"part_names": np.array(mesh.parts), "triangle_parts": mesh.part_indices}
    return found | material_arrays(mesh)


def read_mesh(archive: Archive) -> Mesh:
    """Return the mesh of an archive.

    Raises
    ------
    FormatError
        If an array is missing or invalid.
    RigError
        If arrays do not match each other.
    """
    positions = _finite(archive, "positions", (None, 3), "positions")
    listed = archive.array("triangles", (None, 3)).values()
    triangles = corners_of(archive, "triangles", listed, len(positions))
    positions = neutral_positions(positions, triangles)
    materials = read_materials(archive)
    return Mesh(
        positions=positions,
        normals=vertex_normals(positions, triangles),
        triangles=triangles,
        uvs=_finite(archive, "uvs", (None, 2)) if archive.has("uvs") else None,
        uv_triangles=_optional(archive, "uv_triangles", (None, 3)),
        other_uvs=tuple(_finite(archive, key, (None, 2)) for key in _present_uvs(archive)),
        colors=_finite(archive, "colors", (None, 4)) if archive.has("colors") else None,
        parts=texts(archive, "part_names") if archive.has("part_names") else (),
        triangle_parts=_optional(archive, "triangle_parts", (None,)),
        materials=materials,
        triangle_materials=_optional(archive, "triangle_materials", (None,)) if materials else None,
    )


def _more_uvs(number: int) -> list[str]:
    """Return the keys of the sets of texture coordinates after the first."""
    return ["second_uvs", *(f"uvs_{index}" for index in range(2, number + 1))][:number]


def _present_uvs(archive: Archive) -> list[str]:
    """Return the keys of the sets of texture coordinates after the first that an archive has."""
    return next(
        _more_uvs(number) for number in count() if not archive.has(_more_uvs(number + 1)[-1])
    )


def _finite(archive: Archive, key: str, shape: tuple[int | None, ...], part: Part = "") -> Floats:
    return finite(archive, key, archive.array(key, shape).values(), part)


def _optional(archive: Archive, key: str, shape: tuple[int | None, ...]) -> NDArray[Any] | None:
    """Return an array; None if the archive does not have it."""
    return archive.array(key, shape).values() if archive.has(key) else None
