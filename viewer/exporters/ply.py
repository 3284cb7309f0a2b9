"""Exporter for binary ``.ply`` files with texture coordinates per corner, and vertex colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.exporters._exporter import Selection, require_mesh
from viewer.exporters._left_out import animation_parts, not_held_note, rig_parts, surface_parts
from viewer.exporters._losses.pose_errors import mesh_losses
from viewer.exporters._options import ExportOptions
from viewer.formats import Source, save_bytes
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.skinning import deform
from viewer.rigs.srgb import encode_srgb
from viewer.rigs.units import UNIT_NAMES

_PRECISE = 1e-6  # largest rounding of positions, as a fraction of the figure's size
_TYPES = {"float": "<f4", "double": "<f8"}
_COLORS = ("red", "green", "blue", "alpha")


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write positions, normals and triangles, in double precision only where single would show."""
    actor, skinning = selection.part.actor, options.skinning
    require_mesh(actor, ".ply")
    mesh = actor.figure.require_mesh()
    positions, normals = deform(actor.figure, actor.own_pose, skinning)
    size = box_size(bounding_box(positions)) if mesh.n_vertices else 0.0
    kind = _number_kind(positions, size)
    uv_kind = "float" if mesh.uvs is None else _number_kind(mesh.uvs, 1.0)
    vertices = _vertices(positions, normals, mesh.colors, kind)
    faces = _faces(mesh, uv_kind)
    unit = f", {UNIT_NAMES[actor.figure.unit]}" if actor.figure.unit in UNIT_NAMES else ""
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {printable(actor.figure.name, 60)}, {actor.figure.up} up{unit}",
        f"element vertex {mesh.n_vertices}",
        *(f"property {kind} {name}" for name in ("x", "y", "z")),
        *(f"property float {name}" for name in ("nx", "ny", "nz")),
        *(f"property uchar {name}" for name in _COLORS if mesh.colors is not None),
        f"element face {mesh.n_triangles}",
        "property list uchar int vertex_indices",
        *([f"property list uchar {uv_kind} texcoord"] if mesh.uvs is not None else []),
        "end_header\n",
    ]
    text = "\n".join(header).encode("ascii", "backslashreplace")
    data = text + vertices.tobytes() + faces.tobytes()
    errors = mesh_losses(actor, skinning, Source(path, data))
    save_bytes(path, data)
    counts = {
        "vertices": counted(mesh.n_vertices, "vertex"),
        "triangles": counted(mesh.n_triangles, "triangle"),
    }
    lost = rig_parts(actor.figure) + animation_parts(actor.figure)
    lost += [Phrase("materials and textures")] if mesh.materials else []
    lost += surface_parts(mesh, has_colors=True)
    notes = [note(wording.MESH, path, **counts), *errors]
    if kind == "double":
        notes.append(
            note(
                "X005.double-positions: positions are written in double precision: single "
                "precision would move vertices by more than a millionth of the size",
                path,
            )
        )
    return notes + not_held_note(".ply", lost)


def _number_kind(numbers: Floats, size: float) -> str:
    """Return the PLY type that keeps numbers to within a millionth of a size."""
    with np.errstate(over="ignore"):
        single = numbers.astype(np.float32)
    return "float" if np.abs(numbers - single).max(initial=0.0) <= _PRECISE * size else "double"


def _vertices(positions: Floats, normals: Floats, colors: Floats | None, kind: str) -> np.ndarray:
    """Return the rows of vertices; colours become sRGB bytes."""
    fields = [("position", _TYPES[kind], 3), ("normal", "<f4", 3)]
    if colors is not None:
        fields.append(("color", "u1", 4))
    rows = np.zeros(len(positions), dtype=fields)
    rows["position"], rows["normal"] = positions, normals
    if colors is not None:
        encoded = np.column_stack([encode_srgb(colors[:, :3]), np.clip(colors[:, 3], 0.0, 1.0)])
        rows["color"] = np.rint(255.0 * encoded)
    return rows


def _faces(mesh: Mesh, uv_kind: str) -> np.ndarray:
    fields: list[tuple[str, str] | tuple[str, str, int]] = [("n", "u1"), ("corners", "<i4", 3)]
    if mesh.uvs is not None:
        fields += [("n_uv", "u1"), ("uv", _TYPES[uv_kind], 6)]
    faces = np.zeros(mesh.n_triangles, dtype=fields)
    faces["n"], faces["corners"] = 3, mesh.triangles
    if mesh.uvs is not None:
        corners = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
        faces["n_uv"], faces["uv"] = 6, mesh.uvs[corners].reshape(-1, 6)
    return faces
