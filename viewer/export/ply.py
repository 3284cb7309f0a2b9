"""Exporter of binary ``.ply`` files, with texture coordinates per triangle corner."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.export import require_mesh
from viewer.export._left_out import not_held_note
from viewer.formats import save_bytes
from viewer.phrases import printable
from viewer.rig.mesh import Mesh
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning, deform

__all__ = ["export"]


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write positions and normals as float32, and triangles; see ``viewer.export.export``."""
    require_mesh(actor, ".ply")
    mesh = actor.figure.require_mesh()
    positions, normals = deform(actor.figure, actor.pose, skinning)
    vertices = np.concatenate([positions, normals], axis=1).astype("<f4")
    faces = _faces(mesh)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {printable(actor.figure.name, 60)}, {actor.figure.up} up",
        f"element vertex {mesh.n_vertices}",
        *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
        f"element face {mesh.n_triangles}",
        "property list uchar int vertex_indices",
        *(["property list uchar float texcoord"] if mesh.uvs is not None else []),
        "end_header\n",
    ]
    text = "\n".join(header).encode("ascii", "backslashreplace")
    save_bytes(path, text + vertices.tobytes() + faces.tobytes())
    counts = {"vertices": mesh.n_vertices, "triangles": mesh.n_triangles}
    lost = [Phrase("part-all-materials")] if mesh.materials else []
    if mesh.second_uvs is not None:
        lost.append(Phrase("part-second-uvs"))
    return [Diagnostic("X001.mesh", path, values=counts), *not_held_note(".ply", lost)]


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
