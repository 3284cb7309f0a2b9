"""Exporter for Wavefront ``.obj`` files, with a ``.mtl`` and image if the mesh is textured.

Vertices keep their numbering: along seams faces refer to several ``vt`` for one ``v``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.export import MotionOptions
from viewer.export._exporter import require_mesh
from viewer.export._gaps import kept_gaps
from viewer.export._left_out import not_held_note, surface_parts
from viewer.export._motion_paths import numbered_paths
from viewer.export._obj_materials import PLAIN, library_losses, material_library
from viewer.formats import all_or_none, save_bytes, save_parts
from viewer.formats._text.decimals import integers, significant
from viewer.formats._text.number_text import row_texts
from viewer.phrases import printable
from viewer.rig.arrays import Floats, Ints
from viewer.rig.mesh import Mesh
from viewer.rig.motion.evaluation import pose_of
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning, deform
from viewer.rig.srgb import encode_srgb
from viewer.rig.units import UNIT_NAMES

__all__ = ["export", "export_animation"]


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write ``v``, ``vt``, ``vn`` and triangles; see ``viewer.export.export``."""
    require_mesh(actor, ".obj")
    mesh = actor.figure.require_mesh()
    positions, normals = deform(actor.figure, actor.pose, skinning)
    name = "_".join(printable(actor.figure.name, 100).split()) or "figure"
    beside = material_library(mesh, path)
    unit = f", {UNIT_NAMES[actor.figure.unit]}" if actor.figure.unit in UNIT_NAMES else ""
    head = f"# {name}: {actor.figure.up} up{unit}\n"
    head += f"mtllib {list(beside)[-1].name}\n" if beside else ""
    head += f"o {name}\n"
    parts = chain(
        [head.encode("utf-8", "surrogateescape")],
        _rows("v", _colored(positions, mesh.colors)),
        () if mesh.uvs is None else _rows("vt", mesh.uvs),
        _rows("vn", normals),
        _faces(mesh, bool(beside)),
    )
    n_uvs = 0 if mesh.uvs is None else len(mesh.uvs)
    # Files that are not missing already have the same content.
    missing = [file for file in beside if not os.path.lexists(file)]
    with all_or_none(missing):
        for file in missing:
            save_bytes(file, beside[file])
        save_parts(path, parts, 2 * mesh.n_vertices + n_uvs + mesh.n_triangles)
    counts = {"vertices": mesh.n_vertices, "triangles": mesh.n_triangles}
    textures = [Diagnostic("X001.texture", file) for file in beside if file.suffix == ".png"]
    lost = library_losses(mesh)
    lost += [part for part in surface_parts(mesh, has_colors=True) if part not in lost]
    notes = not_held_note(".obj and .mtl", lost)
    return [Diagnostic("X001.mesh", path, values=counts), *textures, *notes]


def export_animation(
    animation: SampledAnimation, path: Path, options: MotionOptions
) -> list[Diagnostic]:
    """Write one numbered file per frame; see ``viewer.export.export_animation``.

    ``{frame}`` in the name is replaced by the frame number, as in ``walk_{frame:05}.obj``. Missing
    frames have no file unless ``options.gaps`` requests holding or interpolation.
    """
    poses, filling = kept_gaps(animation.frames, options.gaps, animation.first_frame)
    frames = np.flatnonzero(poses.present)
    files = numbered_paths(path, animation.first_frame + frames)
    with all_or_none(files):
        for frame, file in zip(frames, files, strict=True):
            pose = pose_of(animation.figure, poses, int(frame))
            export(Actor(animation.figure, pose), file, options.skinning)
    if not files:
        return [Diagnostic("X001.no-meshes", path)]
    values = {
        "n": len(files),
        "first": files[0].name,
        "last": files[-1].name,
        "missing": poses.n_frames - len(files),
    }
    key = "X001.meshes" if len(files) > 1 else "X001.one-mesh"
    return [Diagnostic(key, path, values=values), *filling]


def _colored(positions: Floats, colors: Floats | None) -> Floats:
    """Return positions followed by colours in sRGB, with opacity if there is any."""
    if colors is None:
        return positions
    opacity = colors[:, 3:] if (colors[:, 3] != 1.0).any() else colors[:, :0]
    return np.hstack([positions, encode_srgb(colors[:, :3]), np.clip(opacity, 0.0, 1.0)])


def _rows(keyword: str, rows: Floats) -> Iterator[bytes]:
    # Adding 0 makes -0 positive.
    start = f"{keyword} ".encode()
    return row_texts(rows + 0.0, lambda numbers: significant(numbers, 9), start=start)


def _faces(mesh: Mesh, with_materials: bool) -> Iterator[bytes]:
    """Yield the lines of triangles, with ``usemtl`` before each run of a material."""
    corners = [mesh.triangles + 1]
    if mesh.uvs is not None:
        uv = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
        corners.append(uv + 1)
    corners.append(mesh.triangles + 1)
    within = [b"/" if mesh.uvs is not None else b"//"] * (len(corners) - 1)
    between = [*within, b" ", *within, b" ", *within]
    table: Ints = np.stack(corners, axis=2).reshape(mesh.n_triangles, 3 * len(corners))
    edges = np.flatnonzero(np.diff(mesh.material_indices)) + 1
    for first, last in zip([0, *edges], [*edges, mesh.n_triangles], strict=True):
        index = int(mesh.material_indices[first]) if mesh.n_triangles else -1
        if with_materials:
            yield f"usemtl {f'material{index}' if index >= 0 else PLAIN}\n".encode()
        yield from row_texts(table[first:last], integers, between, start=b"f ")
