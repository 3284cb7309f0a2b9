"""Material libraries with the PBR extension, and the image files that they refer to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats import free_path
from viewer.media.image import encode_png
from viewer.phrases import printable
from viewer.rig.arrays import Bytes
from viewer.rig.material import Material, Texture
from viewer.rig.mesh import Mesh

__all__ = [
    "library_losses",
    "material_library",
    "material_names",
    "part_name",
    "plain_name",
]

_MAPS = {
    "base_texture": ("map_Kd", ""),
    "metallic_texture": ("map_Pm", "_metallic"),
    "roughness_texture": ("map_Pr", "_roughness"),
    "normal_texture": ("norm", "_normal"),
    "emissive_texture": ("map_Ke", "_emissive"),
}
"""MTL statement of each texture, and suffix of its image's name."""

_ONE_NUMBER = ("metallic_texture", "roughness_texture")


def part_name(name: str) -> str:
    """Return a name as a reader of ``.obj`` returns it: white space is only kept inside."""
    return " ".join(printable(name, 200).split(" ")).strip() or "unnamed"


def material_names(mesh: Mesh) -> list[str]:
    """Return a name for each material: its own, if it has one that no other material has."""
    names = [part_name(material.name) if material.name else "" for material in mesh.materials]
    known = Counter(names)
    return [
        name if name and known[name] == 1 else f"material{index}"
        for index, name in enumerate(names)
    ]


def plain_name(names: Sequence[str]) -> str:
    """Return the name of the material of triangles without a material."""
    name = "plain"
    while name in names:
        name += "_"
    return name


def material_library(mesh: Mesh, path: Path, names: Sequence[str]) -> dict[Path, bytes]:
    """Return the images, followed by the ``.mtl`` that refers to them; empty for plain meshes.

    ``names``: the name of each material.
    """
    uvs = mesh.uvs if mesh.uvs is not None else np.zeros((0, 2))
    materials = mesh.materials if any(map(_has_look, mesh.materials)) else ()
    files: dict[Path, bytes] = {}
    parts = [f"newmtl {plain_name(names)}\nKd 1 1 1\n"]
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


def library_losses(mesh: Mesh) -> list[Phrase]:
    """Return the material properties of a mesh that a material library cannot store."""
    materials = mesh.materials
    placed = [texture for material in materials for texture in material.textures.values()]
    lost = {
        "part-occlusion": any(material.occlusion_texture is not None for material in materials),
        "part-alpha-cutoff": any(material.alpha_mode == "mask" for material in materials),
        "part-unlit": any(material.unlit for material in materials),
        "part-single-sided": any(not material.double_sided for material in materials),
        "part-second-uvs": any(texture.uv_set for texture in placed),
        "part-texture-rotation": any(
            "mirror" in texture.wrap or texture.matrix[0, 1] or texture.matrix[1, 0]
            for texture in placed
        ),
        "part-unfiltered": any(not texture.is_smooth for texture in placed),
    }
    return [Phrase(key) for key, is_lost in lost.items() if is_lost]
