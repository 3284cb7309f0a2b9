"""Materials in glTF form: metallic-roughness surfaces, textures and samplers."""

from __future__ import annotations

import math

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.exporters.gltf.document import Document, named
from viewer.media.png import encode_png
from viewer.phrases import brief
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.file_record import Json
from viewer.rigs.material import MINIFICATIONS, Texture
from viewer.rigs.mesh import Mesh

Color = tuple[float, float, float]
_PLAIN = (0.62, 0.60, 0.57)  # linear; the viewer's colour for untextured surfaces
_MATTE = {"metallicFactor": 0.0, "roughnessFactor": 0.8}  # glTF surfaces are metallic by default
_WRAPS = {"clamp": 33071, "repeat": 10497, "mirror": 33648}

# Filters for magnification, and for minification with mipmaps.
_SMOOTH, _SHARP = (9729, 9987), (9728, 9986)
_MINIFIED = dict(zip(MINIFICATIONS, (9728, 9729, 9984, 9985, 9986, 9987), strict=True))
_SHEAR = 1e-6  # larger shears of texture transforms are reported, because glTF cannot store them


class Materials:
    """Writer of a mesh's materials; ``color`` is for surfaces that have none."""

    def __init__(
        self, document: Document, mesh: Mesh, color: Color | None, is_own: bool = False
    ) -> None:
        self._is_own = is_own
        # Vertex colours replace the figure's colour.
        own = color or _PLAIN if mesh.colors is None else (1.0, 1.0, 1.0)
        self._document, self.mesh, self._color = document, mesh, own
        self._images: dict[tuple[int, int], tuple[int, Bytes]] = {}
        self._added: dict[int, int] = {}
        self._textures: dict[tuple[int, int], int] = {}
        self._samplers: dict[tuple[object, ...], int] = {}

    @property
    def written(self) -> dict[int, int]:
        """Index in the document of each material of the mesh that has been added."""
        return {index: added for index, added in self._added.items() if index >= 0}

    def plain(self, name: str = "plain") -> int:
        """Add a material without textures; return its index."""
        return self._add(name, {"baseColorFactor": [*self._color, 1.0], **_MATTE})

    def add(self, index: int) -> int:
        """Add a material of the mesh if it is missing; return its index in the document."""
        if index not in self._added:
            self._added[index] = self.plain() if index < 0 else self._surface(index)
        return self._added[index]

    def _surface(self, index: int) -> int:
        material = self.mesh.materials[index]
        name = material.name or material.texture or f"material{index}"
        has_uvs = self.mesh.uvs is not None and len(self.mesh.uvs) > 0
        shown = {
            kind: texture
            for kind, texture in (material.textures if has_uvs else {}).items()
            if texture.image is not None
        }
        surface: Json = {}
        if material.base_color is not None:
            surface["baseColorFactor"] = list(material.base_color)
        elif "base_texture" not in shown:
            surface["baseColorFactor"] = [*self._color, 1.0]
        if "base_texture" in shown:
            surface["baseColorTexture"] = self._reference(shown["base_texture"], name)
        if material.is_physical:
            factors = material.metallic, material.roughness
            surface |= dict(zip(("metallicFactor", "roughnessFactor"), factors, strict=True))
        else:
            surface |= _MATTE
        if "metallic_texture" in shown or "roughness_texture" in shown:
            packed = _packed(shown.get("metallic_texture"), shown.get("roughness_texture"))
            surface["metallicRoughnessTexture"] = self._reference(packed, name)
        title = material.name if self._is_own else name
        rest: Json = {"doubleSided": material.double_sided}
        rest |= {} if material.extras is None else {"extras": material.extras}
        extensions: Json = {}
        if "normal_texture" in shown:
            normal = self._reference(shown["normal_texture"], name)
            rest["normalTexture"] = {**normal, "scale": material.normal_scale}
        if "occlusion_texture" in shown:
            occlusion = self._reference(_red(shown["occlusion_texture"]), name)
            rest["occlusionTexture"] = {**occlusion, "strength": material.occlusion_strength}
        strength = max(1.0, *material.emissive)
        if any(material.emissive):
            rest["emissiveFactor"] = [channel / strength for channel in material.emissive]
        if strength > 1.0:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        if "emissive_texture" in shown:
            rest["emissiveTexture"] = self._reference(shown["emissive_texture"], name)
        if material.alpha_mode != "opaque":
            rest["alphaMode"] = material.alpha_mode.upper()
        if material.alpha_mode == "mask":
            rest["alphaCutoff"] = material.alpha_cutoff
        if material.unlit:
            extensions["KHR_materials_unlit"] = {}
        if extensions:
            rest["extensions"] = extensions
            self._document.declare(*extensions)
        return self._add(title, surface, rest)

    def _add(self, name: str, surface: Json, rest: Json | None = None) -> int:
        # Triangles may be wound either way unless the file states that they are single-sided.
        rest = {"doubleSided": True} if rest is None else rest
        return self._document.add(
            "materials", {**named(name), "pbrMetallicRoughness": surface, **rest}
        )

    def _reference(self, texture: Texture, name: str) -> Json:
        """Return a texture's index with its transform; each image is written once."""
        assert texture.image is not None  # checked by the caller
        image = texture.image
        key = id(image), image.size
        if key not in self._images:
            data = texture.encoded or encode_png(image)
            added = self._document.picture(data, texture.name or name)
            # A reference keeps the pixels alive, so that no other array gets their id.
            self._images[key] = added, image
        source, sampler = self._images[key][0], self._sampler(texture)
        pair = source, sampler
        if pair not in self._textures:
            self._textures[pair] = self._document.add(
                "textures", {"sampler": sampler, "source": source}
            )
        reference: Json = {"index": self._textures[pair]}
        if texture.uv_set:
            reference["texCoord"] = texture.uv_set
        if not texture.is_placed_plainly:
            reference["extensions"] = {"KHR_texture_transform": _placement(texture.matrix)[0]}
            self._document.declare("KHR_texture_transform")
        return reference

    def _sampler(self, texture: Texture) -> int:
        key = (*texture.wrap, texture.is_smooth, texture.minification)
        if key not in self._samplers:
            magnified, minified = _SMOOTH if texture.is_smooth else _SHARP
            minified = _MINIFIED.get(texture.minification, minified)
            filters = {"magFilter": magnified, "minFilter": minified}
            wraps = {"wrapS": _WRAPS[texture.wrap[0]], "wrapT": _WRAPS[texture.wrap[1]]}
            self._samplers[key] = self._document.add("samplers", {**filters, **wraps})
        return self._samplers[key]


def material_losses(mesh: Mesh) -> list[Diagnostic]:
    """Return notes about material properties of a mesh that glTF cannot store."""
    lost = []
    for material in mesh.materials:
        values = {"material": brief(material.name or "unnamed")}
        metallic, roughness = material.metallic_texture, material.roughness_texture
        if metallic and roughness and not _same_place(metallic, roughness):
            lost.append(
                note(
                    "X005.metallic-placement: material {material}: its metallic map uses the "
                    "placement "
                    "of its roughness map",
                    **values,
                )
            )
        if any(_placement(one.matrix)[1] > _SHEAR for one in material.textures.values()):
            lost.append(
                note(
                    "X003.texture-shear: material {material}: the shear of its textures is omitted",
                    **values,
                )
            )
    return lost


def _same_place(one: Texture, other: Texture) -> bool:
    same = np.array_equal(one.matrix, other.matrix) and one.uv_set == other.uv_set
    return same and (one.wrap, one.is_smooth) == (other.wrap, other.is_smooth)


def _placement(matrix: Floats) -> tuple[Json, float]:
    """Return the members of KHR_texture_transform for a transform (2, 3), and the omitted shear."""
    # In glTF, v = 0 at the first image row, so v is flipped before and after the extension's
    # T(offset) R(-rotation) S(scale).
    (a, b, u), (c, d, v) = matrix.tolist()
    scale_u = math.hypot(a, c)
    angle = math.atan2(c, a)
    cos, sin = math.cos(angle), math.sin(angle)
    # The second column is (-b, d); its component along the first column is shear.
    scale_v = d * cos - b * sin
    shear = abs(b * cos + d * sin)
    placed = {"offset": [u + b, 1.0 - d - v], "rotation": angle, "scale": [scale_u, scale_v]}
    return placed, shear


def _packed(metallic: Texture | None, roughness: Texture | None) -> Texture:
    """Return one texture with roughness in green and metallic in blue."""
    first = roughness or metallic
    assert first is not None and first.image is not None  # checked by the caller
    if metallic is None or roughness is None or metallic.image is roughness.image:
        channels = {1: roughness, 2: metallic}
        if all(one is None or one.channel == column for column, one in channels.items()):
            return first
    shapes = [one.image.shape[:2] for one in (metallic, roughness) if one and one.image is not None]
    height, width = np.max(shapes, axis=0).tolist()
    pixels = np.full((height, width, 4), 255, np.uint8)
    for column, one in ((1, roughness), (2, metallic)):
        if one is not None and one.image is not None:
            rows = np.arange(height) * one.image.shape[0] // height
            columns = np.arange(width) * one.image.shape[1] // width
            pixels[..., column] = one.image[..., one.channel][np.ix_(rows, columns)]
    return Texture("", pixels, 1, first.uv_set, first.matrix, first.wrap, first.is_smooth)


def _red(texture: Texture) -> Texture:
    """Return an occlusion texture, which glTF reads from red."""
    if texture.channel == 0 or texture.image is None:
        return texture
    pixels = texture.image.copy()
    pixels[..., 0] = texture.image[..., texture.channel]
    placing = texture.uv_set, texture.matrix, texture.wrap, texture.is_smooth
    return Texture(texture.name, pixels, 0, *placing)
