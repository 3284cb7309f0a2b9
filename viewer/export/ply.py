"""Exporter for binary ``.ply`` files with texture coordinates per corner, and vertex colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._exporter import require_mesh
from viewer.export._left_out import not_held_note, surface_parts
from viewer.formats import save_bytes
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning, deform
from viewer.rig.srgb import encode_srgb

__all__ = ["export"]

_COLORS = ("red", "green", "blue", "alpha")


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write positions and normals as float32, and triangles; see ``viewer.export.export``."""
    require_mesh(actor, ".ply")
    mesh = actor.figure.require_mesh()
    positions, normals = deform(actor.figure, actor.pose, skinning)
    vertices = _vertices(np.concatenate([positions, normals], axis=1), mesh.colors)
    faces = _faces(mesh)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {printable(actor.figure.name, 60)}, {actor.figure.up} up",
        f"element vertex {mesh.n_vertices}",
        *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
        *(f"property uchar {name}" for name in _COLORS if mesh.colors is not None),
        f"element face {mesh.n_triangles}",
        "property list uchar int vertex_indices",
        *(["property list uchar float texcoord"] if mesh.uvs is not None else []),
        "end_header\n",
    ]
    text = "\n".join(header).encode("ascii", "backslashreplace")
    save_bytes(path, text + vertices.tobytes() + faces.tobytes())
    counts = {"vertices": mesh.n_vertices, "triangles": mesh.n_triangles}
    lost = [Phrase("part-all-materials")] if mesh.materials else []
    lost += surface_parts(mesh, has_colors=True)
    return [Diagnostic("X001.mesh", path, values=counts), *not_held_note(".ply", lost)]


def _vertices(numbers: Floats, colors: Floats | None) -> np.ndarray:
    """Return the rows of vertices; colours become sRGB bytes."""
    fields: list[tuple[str, str, int]] = [("numbers", "<f4", 6)]
    if colors is not None:
        fields.append(("color", "u1", 4))
    rows = np.zeros(len(numbers), dtype=fields)
    rows["numbers"] = numbers
    if colors is not None:
        encoded = np.column_stack([encode_srgb(colors[:, :3]), np.clip(colors[:, 3], 0.0, 1.0)])
        rows["color"] = np.rint(255.0 * encoded)
    return rows


def _faces(mesh: Mesh) -> np.ndarray:
    fields: list[tuple[str, str] | tuple[str, str, int]] = [("n", "u1"), ("corners", "<i4", 3)]
    if mesh.uvs is not None:
        fields += [("n_uv", "u1"), ("uv", "<f4", 6)]
    faces = np.zeros(mesh.n_triangles, dtype=fields)
    faces["n"], faces["corners"] = 3, mesh.triangles
    if mesh.uvs is not None:
        corners = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
        faces["n_uv"], faces["uv"] = 6, mesh.uvs[corners].reshape(-1, 6)
    return faces
