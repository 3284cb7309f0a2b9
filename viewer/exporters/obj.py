"""Exporter for Wavefront ``.obj`` files, with a ``.mtl`` and image if the mesh is textured.

Vertices keep their numbering: along seams faces refer to several ``vt`` for one ``v``.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.exporters._exporter import Selection, require_mesh
from viewer.exporters._gaps import kept_gaps
from viewer.exporters._left_out import animation_parts, not_held_note, rig_parts, surface_parts
from viewer.exporters._losses.pose_errors import PoseLosses, look_at_mesh
from viewer.exporters._motion_paths import numbered_paths
from viewer.exporters._options import ExportOptions
from viewer.formats import Source, all_or_none, free_path, save_bytes, save_parts
from viewer.formats._text.number_text import row_texts
from viewer.media.png import encode_png
from viewer.phrases import Shown, agree, counted, listed, printable
from viewer.rigs.arrays import Bytes, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.motion.evaluation import pose_of
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning, deform
from viewer.rigs.srgb import encode_srgb
from viewer.rigs.units import UNIT_NAMES

_DIGITS = 9  # significant digits of a number, as most programs read and write
_PRECISE = 1e-6  # largest rounding of positions, as a fraction of the figure's size
_NO_PART = "other"  # object of triangles without a part
_MAPS = {
    "base_texture": ("map_Kd", ""),
    "metallic_texture": ("map_Pm", "_metallic"),
    "roughness_texture": ("map_Pr", "_roughness"),
    "normal_texture": ("norm", "_normal"),
    "emissive_texture": ("map_Ke", "_emissive"),
}
"""MTL statement of each texture, and suffix of its image's name."""
_ONE_NUMBER = ("metallic_texture", "roughness_texture")


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write ``v``, ``vt``, ``vn`` and triangles; see ``viewer.exporters.export``."""
    if selection.part.frames is not None:
        return _export_frames(selection.part.animation, path, options)
    actor, skinning = selection.part.actor, options.skinning
    losses = PoseLosses(actor.figure, skinning)
    odd, textures = _write(actor, path, skinning, losses)
    figure, mesh = actor.figure, actor.figure.require_mesh()
    notes = [
        note(
            wording.MESH,
            path,
            vertices=counted(mesh.n_vertices, "vertex"),
            triangles=counted(mesh.n_triangles, "triangle"),
        ),
        *textures,
        *odd,
        *losses.notes(path),
    ]
    return notes + _changed(figure, animation_parts(figure))


def _export_frames(
    animation: SampledAnimation, path: Path, options: ExportOptions
) -> list[Diagnostic]:
    """Write one numbered file per frame, as in ``walk_{frame:05}.obj``, none for missing frames."""
    figure = animation.figure
    poses, filling = kept_gaps(animation.frames, options.gaps, animation.first_frame)
    frames = np.flatnonzero(poses.present)
    files = numbered_paths(path, animation.first_frame + frames)
    losses, odd = PoseLosses(figure, options.skinning), list[Diagnostic]()
    with all_or_none(files):
        for frame, file in zip(frames.tolist(), files, strict=True):
            actor = Actor(figure, pose_of(figure, poses, frame))
            odd += _write(actor, file, options.skinning, losses, frame)[0]
    if not files:
        return [
            note("X001.no-meshes: no person is present in these frames: nothing was written", path)
        ]
    values = {
        "n": len(files),
        "first": files[0].name,
        "last": files[-1].name,
        "missing": _missing(poses.n_frames - len(files)),
    }
    key = (
        "X001.meshes: {n} files, {first} to {last}{missing}"
        if len(files) > 1
        else "X001.one-mesh: 1 file, {first}{missing}"
    )
    errors = losses.notes(path, animation.first_frame)
    written = note(key, path, **values)
    return [written, *filling, *odd[:1], *errors, *_changed(figure)]


def _missing(n: int) -> Shown:
    """Return the end of a sentence about frames without a file."""
    frames, have = counted(n, "frame", "is", "are"), agree(n, "has", "have")
    return Shown(f"; {frames} missing in the motion and {have} no file" if n else "", n)


def _write(
    actor: Actor, path: Path, skinning: Skinning, losses: PoseLosses, frame: int = 0
) -> tuple[list[Diagnostic], list[Diagnostic]]:
    """Write one pose and compare the file with it; return notes about triangles and textures."""
    require_mesh(actor, ".obj")
    mesh = actor.figure.require_mesh()
    positions, normals = deform(actor.figure, actor.own_pose, skinning)
    name = "_".join(printable(actor.figure.name, 100).split()) or "figure"
    names = _material_names(mesh)
    beside = _material_library(mesh, path, names)
    unit = f", {UNIT_NAMES[actor.figure.unit]}" if actor.figure.unit in UNIT_NAMES else ""
    head = f"# {name}: {actor.figure.up} up{unit}\n"
    library = f"mtllib {list(beside)[-1].name}\n" if beside else ""
    parts = [
        f"o {dict(actor.figure.facts).get('object', name)}\n".encode("utf-8", "surrogateescape"),
        *_rows("v", _colored(positions, mesh.colors), _keeps_places(positions)),
        *(() if mesh.uvs is None else _rows("vt", mesh.uvs)),
        *_rows("vn", normals),
        *_faces(mesh, names if beside or _names_only(mesh) else (), bool(beside)),
    ]
    first, text = head.encode("utf-8", "surrogateescape"), b"".join(parts)
    # Without the library: its images would be decoded again.
    odd = look_at_mesh(losses, actor, Source(path, first + text), frame)
    n_uvs = 0 if mesh.uvs is None else len(mesh.uvs)
    # Files that are not missing already have the same content.
    missing = [file for file in beside if not os.path.lexists(file)]
    with all_or_none(missing):
        for file in missing:
            save_bytes(file, beside[file])
        n_lines = 2 * mesh.n_vertices + n_uvs + mesh.n_triangles
        save_parts(path, [first, library.encode(), text], n_lines)
    return odd, [
        note("X001.texture: its texture", file) for file in beside if file.suffix == ".png"
    ]


def _changed(figure: Figure, others: Sequence[Phrase] = ()) -> list[Diagnostic]:
    """Return notes about data that is written in another form, or, as ``others``, not at all."""
    mesh, notes = figure.require_mesh(), list[Diagnostic]()
    polygons = dict(figure.facts).get("polygons")
    if polygons is not None:
        notes.append(
            note(
                "X005.polygons: polygons of the original file are written as triangles "
                "({polygons})",
                polygons=polygons,
            )
        )
    renamed = [
        material.name
        for material, name in zip(mesh.materials, _material_names(mesh), strict=True)
        if material.name and material.name != name
    ]
    if renamed:
        notes.append(
            note(
                "X005.material-names: {n} another name in the file, because names must be unique: "
                "{names}",
                n=counted(len(renamed), "material", "has", "have"),
                names=listed(renamed, 8),
            )
        )
    lost = [*rig_parts(figure), *others, *_library_losses(mesh)]
    extra = surface_parts(mesh, has_colors=True, has_parts=True)
    lost += [part for part in extra if part not in lost]
    return notes + not_held_note(".obj and .mtl", lost)


def _names_only(mesh: Mesh) -> bool:
    """Return whether materials without a look have names, other than those of the parts."""
    names = {material.name for material in mesh.materials if material.name}
    return bool(names) and not names <= set(mesh.parts)


def _keeps_places(positions: Floats) -> bool:
    """Return whether nine digits move a vertex by less than a millionth of the size."""
    if len(positions) == 0:
        return True
    farthest, size = float(np.abs(positions).max()), box_size(bounding_box(positions))
    return 0.5 * 10.0 ** (1 - _DIGITS) * farthest <= _PRECISE * size


def _colored(positions: Floats, colors: Floats | None) -> Floats:
    """Return positions followed by colours in sRGB, with opacity if there is any."""
    if colors is None:
        return positions
    opacity = colors[:, 3:] if (colors[:, 3] != 1.0).any() else colors[:, :0]
    return np.hstack([positions, encode_srgb(colors[:, :3]), np.clip(opacity, 0.0, 1.0)])


def _rows(keyword: str, rows: Floats, is_short: bool = True) -> Iterator[bytes]:
    """Yield lines of numbers, with nine digits or with all."""
    # Adding 0 makes -0 positive.
    return row_texts(rows + 0.0, _DIGITS if is_short else None, start=f"{keyword} ".encode())


def _faces(mesh: Mesh, materials: Sequence[str], has_library: bool) -> Iterator[bytes]:
    """Yield the lines of triangles; ``o`` and ``usemtl`` precede each run of a part or material."""
    corners = [mesh.triangles + 1]
    if mesh.uvs is not None:
        uv = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
        corners.append(uv + 1)
    corners.append(mesh.triangles + 1)
    within = b"/" if mesh.uvs is not None else b"//"
    table: Ints = np.stack(corners, axis=2)
    of_material = mesh.material_indices if materials else np.full(mesh.n_triangles, -1)
    kinds = np.stack([mesh.part_indices, of_material], axis=1)
    edges = np.flatnonzero((kinds[1:] != kinds[:-1]).any(axis=1)) + 1
    names = [_part_name(part) for part in mesh.parts]
    now = [-1, -2 if has_library else -1]
    for first, last in zip([0, *edges], [*edges, mesh.n_triangles], strict=True):
        part, material = kinds[first].tolist() if mesh.n_triangles else now
        if part != now[0]:
            name = names[part] if part >= 0 else _NO_PART
            yield f"o {name}\n".encode("utf-8", "surrogateescape")
        if material != now[1]:
            name = materials[material] if material >= 0 else _plain_name(materials)
            yield f"usemtl {name}\n".encode("utf-8", "surrogateescape")
        now = [part, material]
        yield from row_texts(table[first:last], within=within, start=b"f ")


def _part_name(name: str) -> str:
    """Return a name as a reader of ``.obj`` returns it: white space is only kept inside."""
    return " ".join(printable(name, 200).split(" ")).strip() or "unnamed"


def _material_names(mesh: Mesh) -> list[str]:
    """Return a name for each material: its own, if it has one that no other material has."""
    names = [_part_name(material.name) if material.name else "" for material in mesh.materials]
    known = Counter(names)
    return [
        name if name and known[name] == 1 else f"material{index}"
        for index, name in enumerate(names)
    ]


def _plain_name(names: Sequence[str]) -> str:
    """Return the name of the material of triangles without a material."""
    name = "plain"
    while name in names:
        name += "_"
    return name


def _material_library(mesh: Mesh, path: Path, names: Sequence[str]) -> dict[Path, bytes]:
    """Return the images, followed by the ``.mtl`` that refers to them; empty for plain meshes."""
    uvs = mesh.uvs if mesh.uvs is not None else np.zeros((0, 2))
    materials = mesh.materials if any(map(_has_look, mesh.materials)) else ()
    files: dict[Path, bytes] = {}
    parts = [f"newmtl {_plain_name(names)}\nKd 1 1 1\n"]
    stem = path.stem[:80]  # leaves room for the number, which must not be truncated
    # Some programs do not support options before the name, so only necessary ones are written.
    clamps = bool(((uvs < 0.0) | (uvs > 1.0)).any())
    for index, material in enumerate(materials):
        parts.append(f"newmtl {names[index]}\n{_numbers(material)}")
        pictures = _pictures(material) if len(uvs) else {}
        for statement, (texture, image, ending) in pictures.items():
            data = encode_png(image)
            picture = free_path(path.parent, f"{stem}_{index}{ending}", ".png", data)
            files[picture] = data
            options = _options(texture, clamps)
            if statement == "norm" and material.normal_scale != 1.0:
                options += f"-bm {material.normal_scale:.9g} "
            parts.append(f"{statement} {options}{picture.name}\n")
    if files or materials:
        library = "".join(parts).encode("utf-8", "surrogateescape")
        files[free_path(path.parent, stem, ".mtl", library)] = library
    return files


def _has_look(material: Material) -> bool:
    """Return whether a material differs from a plain one."""
    return (
        material.image is not None
        or material.base_color is not None
        or material.is_physical
        or any(material.emissive)
        or any(texture.image is not None for texture in material.textures.values())
    )


def _numbers(material: Material) -> str:
    red, green, blue, alpha = material.base_color or (1.0, 1.0, 1.0, 1.0)
    lines = [f"Kd {red:.9g} {green:.9g} {blue:.9g}\n"]
    if alpha < 1.0 and material.alpha_mode != "opaque":
        lines.append(f"d {alpha:.9g}\n")
    if material.is_physical:
        lines.append(f"Pr {material.roughness:.9g}\nPm {material.metallic:.9g}\n")
    if any(material.emissive):
        lines.append("Ke {:.9g} {:.9g} {:.9g}\n".format(*material.emissive))
    return "".join(lines)


def _pictures(material: Material) -> dict[str, tuple[Texture, Bytes, str]]:
    """Return the texture, pixels and name ending for each statement."""
    found = {}
    for name, (statement, ending) in _MAPS.items():
        texture = getattr(material, name)
        if texture is None or texture.image is None:
            continue
        image = _grey(texture.image, texture.channel) if name in _ONE_NUMBER else texture.image
        found[statement] = texture, image, ending
    base = material.base_texture
    if material.alpha_mode != "opaque" and base is not None and base.image is not None:
        opacity = _grey(base.image, 3)
        found["map_d"] = base, opacity, "_opacity"
    return found


def _grey(image: Bytes, channel: int) -> Bytes:
    """Return an image of one channel."""
    grey = np.repeat(image[..., channel : channel + 1], 4, axis=2)
    grey[..., 3] = 255
    return grey


def _options(texture: Texture, clamps: bool) -> str:
    matrix = texture.matrix
    options = ""
    scale, offset = (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2])
    if scale != (1.0, 1.0):
        options += f"-s {scale[0]:.9g} {scale[1]:.9g} 1 "
    if offset != (0.0, 0.0):
        options += f"-o {offset[0]:.9g} {offset[1]:.9g} 0 "
    return options + "-clamp on " * (clamps and "clamp" in texture.wrap)


def _library_losses(mesh: Mesh) -> list[Phrase]:
    """Return the material properties of a mesh that a material library cannot store."""
    materials = mesh.materials
    placed = [texture for material in materials for texture in material.textures.values()]
    lost = {
        "occlusion maps": any(material.occlusion_texture is not None for material in materials),
        "alpha cutoffs": any(material.alpha_mode == "mask" for material in materials),
        "unlit surfaces": any(material.unlit for material in materials),
        "single-sided surfaces": any(not material.double_sided for material in materials),
        "second texture coordinates": any(texture.uv_set for texture in placed),
        "rotated or mirrored textures": any(
            "mirror" in texture.wrap or texture.matrix[0, 1] or texture.matrix[1, 0]
            for texture in placed
        ),
        "unfiltered textures": any(not texture.is_smooth for texture in placed),
    }
    return [Phrase(key) for key, is_lost in lost.items() if is_lost]
