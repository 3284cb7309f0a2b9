"""Materials on the GPU: textures, each uploaded once, and the uniforms of each material."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import field, replace
from typing import Any

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import set_uniforms
from viewer.rendering.gpu.upload import picture_texture
from viewer.rigs.arrays import Bytes
from viewer.rigs.material import ALPHA_MODES, TEXTURES, Material, Outline, Rim, Texture
from viewer.rigs.mesh import Mesh

SAMPLERS = {
    "u_texture": 5,
    "u_metallic_map": 8,
    "u_roughness_map": 9,
    "u_normal_map": 10,
    "u_occlusion_map": 11,
    "u_emissive_map": 12,
    "u_shade_map": 16,
}
"""Texture unit of each entry of ``TEXTURES``; skinning and effects use the other units."""

_MOST_SETS = 3  # maximum number of texture coordinate sets that one figure's textures may use
_COLORS = ("base_texture", "emissive_texture", "shade_texture")  # sRGB
# Toon materials have no metalness and roughness: their other textures use the units of these.
_MATCAP, _RIM, _WIDTH = "metallic_texture", "roughness_texture", "occlusion_texture"
_UNTEXTURED: dict[str, object] = {
    "u_textured": False,
    "u_has_metallic_map": False,
    "u_has_roughness_map": False,
    "u_normal_scale": 0.0,
    "u_occlusion_map_strength": 0.0,
    "u_has_emissive_map": False,
    "u_has_shade_map": False,
}


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Drawing properties of the triangles of one material."""

    uniforms: dict[str, Any] = field(default_factory=lambda: surface_uniforms(Material(), (), ()))
    """Uniforms of ``include/surface.glsl`` and ``shade/pbr.glsl``."""
    untextured: dict[str, object] = field(default_factory=dict)
    """Uniforms that differ while textures are off."""
    textures: tuple[tuple[int, moderngl.Texture], ...] = ()
    """tuple of (unit, texture). Textures to bind before the triangles are drawn."""
    is_physical: bool = False
    """Whether the material has its own metallic and roughness values."""
    is_blended: bool = False
    """Whether the triangles are drawn after all opaque ones."""
    double_sided: bool = True
    """Whether back faces are drawn."""
    outline: Outline | None = None
    """Line around the triangles."""

    def use(self, program: moderngl.Program, textured: bool) -> None:
        """Set uniforms and bind textures."""
        set_uniforms(program, self.uniforms)
        if not textured:
            set_uniforms(program, self.untextured)
            return
        for unit, texture in self.textures:
            texture.use(unit)

    def changed(self, material: Material) -> Surface:
        """Return the surface with the colours and placements of a changed material."""
        uniforms = {**self.uniforms, **changing_uniforms(material)}
        return replace(self, uniforms=uniforms, outline=material.outline)


def needs_materials(mesh: Mesh) -> bool:
    """Return whether a mesh has more than plain base colour textures, see ``MATERIALS``."""
    return mesh.colors is not None or any(
        not material.is_plain
        or (material.base_texture is not None and "mirror" in material.base_texture.wrap)
        for material in mesh.materials
    )


def drawn_sets(mesh: Mesh, notes: list[str]) -> tuple[int, ...]:
    """Return the sets of texture coordinates that textures use and that can be drawn, in order."""
    used = {
        texture.uv_set
        for material in mesh.materials
        for texture in drawn_textures(material).values()
        if texture.image is not None and 0 < texture.uv_set <= len(mesh.other_uvs)
    }
    sets = (0, *sorted(used))
    if len(sets) > _MOST_SETS:
        notes.append(
            f"textures use {len(sets)} sets of texture coordinates; those that use set "
            f"{sets[_MOST_SETS]} or a higher one are not drawn"
        )
    return sets[:_MOST_SETS]


def upload_surfaces(
    context: moderngl.Context,
    materials: Sequence[Material],
    sets: Sequence[int],
    notes: list[str],
    owner: Owner,
) -> list[Surface]:
    """Upload the textures of materials whose sets of texture coordinates are drawn."""
    made: dict[tuple[object, ...], moderngl.Texture] = {}
    units = dict(zip(TEXTURES, SAMPLERS.values(), strict=True))
    surfaces = []
    for material in materials:
        found: dict[str, moderngl.Texture] = {}
        for name, texture in drawn_textures(material).items():
            if texture.image is None or texture.uv_set not in sets:
                continue
            is_linear = has_linear_texels(material, name)
            filters = texture.is_smooth, texture.minification
            key = id(texture.image), is_linear, texture.wrap, filters
            if key not in made:
                pixels = joined_image(texture.image, texture.wrap)
                new = owner.keep(picture_texture(context, pixels, notes, is_linear))
                new.repeat_x, new.repeat_y = (side != "clamp" for side in texture.wrap)
                usual = "linear_mipmap_linear" if texture.is_smooth else "nearest_mipmap_linear"
                minified = getattr(moderngl, (texture.minification or usual).upper())
                new.filter = minified, moderngl.LINEAR if texture.is_smooth else moderngl.NEAREST
                made[key] = new
            found[name] = made[key]
        untextured = dict(_UNTEXTURED)
        if material.base_texture is not None:
            untextured["u_has_base_factor"] = False
        surfaces.append(
            Surface(
                uniforms=surface_uniforms(material, found, sets),
                untextured=untextured,
                textures=tuple((units[name], texture) for name, texture in found.items()),
                is_physical=material.is_physical,
                is_blended=material.alpha_mode == "blend",
                double_sided=material.double_sided,
                outline=material.outline,
            )
        )
    return surfaces


def joined_image(image: Bytes, wrap: tuple[str, str]) -> Bytes:
    """Return an image joined with its mirror image: moderngl lacks the mirrored repeat mode."""
    if wrap[0] == "mirror":
        image = np.concatenate([image, image[:, ::-1]], axis=1)
    if wrap[1] == "mirror":
        # v = 0 is at the last row, at which the unmirrored image begins.
        image = np.concatenate([image[::-1], image], axis=0)
    return image


def has_linear_texels(material: Material, name: str) -> bool:
    """Return whether the texture of a slot has numbers instead of sRGB colours."""
    is_toon = material.shade_color is not None
    return name not in (*_COLORS, *((_MATCAP, _RIM) if is_toon else ()))


def drawn_textures(material: Material) -> dict[str, Texture]:
    """Return the drawn textures, by the field of the material whose texture unit they use."""
    if material.shade_color is None:
        return material.textures
    rim, outline = material.rim, material.outline
    others = {
        _MATCAP: None if rim is None else rim.matcap,
        _RIM: None if rim is None else rim.texture,
        _WIDTH: None if outline is None else outline.texture,
    }
    kept = {name: one for name, one in material.textures.items() if name not in others}
    return kept | {name: one for name, one in others.items() if one is not None}


def surface_uniforms(
    material: Material, textures: Collection[str], sets: Sequence[int]
) -> dict[str, object]:
    """Return all uniforms of a material, of which some textures are drawn, by name of the slot."""
    # All of them, since programs keep the values of the previous material.
    placed = _placed(material)
    channels = np.eye(4, dtype="f4")[[texture.channel for texture in placed]]
    slots = [sets.index(one.uv_set) if one.uv_set in sets else 0 for one in placed]
    values: dict[str, object] = {
        "u_textured": "base_texture" in textures,
        "u_has_base_factor": material.base_color is not None,
        "u_alpha_mode": ALPHA_MODES.index(material.alpha_mode),
        "u_alpha_cutoff": material.alpha_cutoff,
        "u_uv_sets": np.array(slots, dtype="i4").tobytes(),
        "u_channels": channels.tobytes(),
        "u_has_metallic_map": "metallic_texture" in textures,
        "u_has_roughness_map": "roughness_texture" in textures,
        "u_normal_scale": material.normal_scale if "normal_texture" in textures else 0.0,
        "u_occlusion_map_strength": (
            material.occlusion_strength if "occlusion_texture" in textures else 0.0
        ),
        "u_has_emissive_map": "emissive_texture" in textures,
        "u_unlit": material.unlit,
        "u_toon": material.shade_color is not None,
        "u_shade_range": material.shade_range,
        "u_has_shade_map": "shade_texture" in textures,
        **changing_uniforms(material),
    }
    if material.rim is not None:
        rim = material.rim
        values |= {"u_rim_power": rim.power, "u_rim_lift": rim.lift, "u_rim_mix": rim.mix}
    if material.is_physical:
        values |= {"u_metallic": material.metallic, "u_roughness": material.roughness}
    return values


def changing_uniforms(material: Material) -> dict[str, object]:
    """Return the uniforms that expressions may change: colours, and placements of textures."""
    rim = material.rim or Rim()
    return {
        "u_base_factor": material.base_color or (1.0, 1.0, 1.0, 1.0),
        "u_emissive": material.emissive,
        "u_shade_color": material.shade_color or (1.0, 1.0, 1.0),
        "u_has_rim": rim.has_effect,
        "u_rim_color": rim.color,
        "u_matcap_factor": rim.matcap_factor,
        "u_places": np.stack([_place(texture) for texture in _placed(material)]).tobytes(),
    }


def outline_uniforms(outline: Outline, uniforms: dict[str, Any], has_map: bool) -> dict[str, Any]:
    """Return the uniforms of an outline, but its width; ``uniforms``: those of its surface."""
    places = np.frombuffer(uniforms["u_places"], "f4").reshape(-1, 9)
    slot = TEXTURES.index(_WIDTH)
    return {
        "u_outline_color": outline.color,
        "u_outline_mix": outline.mix,
        "u_hull_on_screen": outline.mode == "screen",
        "u_has_width_map": has_map,
        "u_width_map": list(SAMPLERS.values())[slot],
        "u_width_place": places[slot].tobytes(),
        "u_width_set": int(np.frombuffer(uniforms["u_uv_sets"], "i4")[slot]),
    }


def _placed(material: Material) -> list[Texture]:
    """Return the texture of each unit; one without pixels for unused units."""
    slots = drawn_textures(material)
    return [slots.get(name) or Texture("") for name in TEXTURES]


def _place(texture: Texture) -> np.ndarray:
    """Return a texture's transform as GLSL stores it: columns of a 3 x 3 matrix."""
    matrix = np.eye(3)
    matrix[:2] = texture.matrix
    for row, side in enumerate(texture.wrap):
        if side == "mirror":
            matrix[row] *= 0.5
    return matrix.T.astype("f4")


PLAIN = Surface()
"""Surface of triangles without a material."""
