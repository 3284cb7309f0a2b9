"""Materials in exported files: every field of glTF and of the PBR extension of .mtl."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from gltf_files import write
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from seamed import PICTURE, UVS, seamed_actor, seamed_mesh

from viewer.exporters import export
from viewer.formats import Source, obj
from viewer.rigs.material import Material, Texture
from viewer.rigs.scene import Actor

ORM = np.arange(3 * 4 * 4, dtype=np.uint8).reshape(3, 4, 4)[::-1]


def textured(material: Material) -> Actor:
    """Return the roof with one material on all triangles, and a second set of coordinates."""
    actor = seamed_actor(unit="m")
    mesh = replace(
        seamed_mesh(),
        materials=(material,),
        triangle_materials=np.zeros(3, np.int32),
        other_uvs=(UVS[::-1],),
    )
    actor.figure = replace(actor.figure, mesh=mesh)
    return actor


def everything() -> Material:
    paint = Texture("paint.png", PICTURE)
    rough = Texture("orm.png", ORM, channel=1, wrap=("repeat", "mirror"), is_smooth=False)
    return Material(
        "glazed",
        paint,
        base_color=(1.0, 0.5, 0.25, 0.125),
        metallic=0.75,
        roughness=0.1,
        metallic_texture=replace(rough, channel=2),
        roughness_texture=rough,
        normal_texture=replace(paint, uv_set=1),
        normal_scale=-0.5,
        occlusion_texture=replace(rough, channel=0),
        occlusion_strength=0.5,
        emissive=(0.0, 3.0, 1.5),
        emissive_texture=paint,
        alpha_mode="mask",
        alpha_cutoff=0.75,
        double_sided=False,
        unlit=True,
        is_physical=True,
    )


def test_gltf_keeps_every_field(tmp_path):
    gltf, _ = write(tmp_path, textured(everything()))
    (material,) = gltf.root["materials"]
    textures, samplers = gltf.root["textures"], gltf.root["samplers"]
    surface = material["pbrMetallicRoughness"]
    assert surface["baseColorFactor"] == [1.0, 0.5, 0.25, 0.125]
    assert (surface["metallicFactor"], surface["roughnessFactor"]) == (0.75, 0.1)
    packed = surface["metallicRoughnessTexture"]["index"]
    assert material["occlusionTexture"] == {"index": packed, "strength": 0.5}
    wanted = {"magFilter": 9728, "minFilter": 9986, "wrapS": 10497, "wrapT": 33648}
    assert samplers[textures[packed]["sampler"]] == wanted
    normal = material["normalTexture"]
    assert (normal["texCoord"], normal["scale"]) == (1, -0.5)
    assert material["emissiveFactor"] == [0.0, 1.0, 0.5]
    assert material["extensions"] == {
        "KHR_materials_emissive_strength": {"emissiveStrength": 3.0},
        "KHR_materials_unlit": {},
    }
    assert set(gltf.root["extensionsUsed"]) == set(material["extensions"])
    assert (material["alphaMode"], material["alphaCutoff"]) == ("MASK", 0.75)
    assert material["doubleSided"] is False
    # Both images are written once.
    assert len(gltf.root["images"]) == 2


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_gltf_preserves_texture_transforms(tmp_path, angle):
    """T R S maps the file's coordinates, whose v starts at the first row, to the same point."""
    cos, sin = math.cos(angle), math.sin(angle)
    matrix = np.array([[2.0 * cos, -3.0 * sin, 0.25], [2.0 * sin, 3.0 * cos, -0.5]])
    material = Material("", Texture("a.png", PICTURE, transform=matrix), is_physical=True)
    gltf, notes = write(tmp_path, textured(material))
    assert not [note for note in notes if "shear" in note]
    used = gltf.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]
    placed = used["KHR_texture_transform"]
    (x, y), r = placed["scale"], placed["rotation"]
    rotated = np.array([[x * math.cos(r), y * math.sin(r)], [-x * math.sin(r), y * math.cos(r)]])
    down = UVS * [1.0, -1.0] + [0.0, 1.0]
    found = down @ rotated.T + placed["offset"]
    wanted = UVS @ matrix[:, :2].T + matrix[:, 2]
    assert_allclose(found * [1.0, -1.0] + [0.0, 1.0], wanted, atol=1e-12)


def test_gltf_packs_metallic_and_roughness(tmp_path):
    """Roughness is stored in green, metallic in blue; the smaller image is enlarged."""
    metal = Texture("m.png", np.full((1, 1, 4), 40, np.uint8), channel=3)
    rough = Texture("r.png", ORM, channel=0)
    material = Material("", None, None, 1.0, 1.0, metal, rough, is_physical=True)
    gltf, _ = write(tmp_path, textured(material))
    with Image.open(io.BytesIO(gltf.picture(0))) as picture:
        pixels = np.asarray(picture.convert("RGBA"))
    assert_array_equal(pixels[..., 1], ORM[..., 0])
    assert (pixels[..., 2] == 40).all()


def test_material_libraries_round_trip(tmp_path):
    wanted = replace(everything(), alpha_mode="blend", unlit=False, emissive=(0.0, 3.0, 1.5))
    notes = export(textured(wanted), tmp_path / "out.obj")
    (lost,) = (note for note in notes if note.key == "X003.parts")
    assert (lost.values["format"], [part.sentence for part in lost.values["parts"]]) == (
        ".obj and .mtl",
        [
            "the skeleton",
            "the skin",
            "occlusion maps",
            "single-sided surfaces",
            "second texture coordinates",
            "rotated or mirrored textures",
            "unfiltered textures",
        ],
    )
    (found,) = obj.read(Source.open(tmp_path / "out.obj")).mesh.materials
    for name in ("base_color", "metallic", "roughness", "normal_scale", "emissive", "alpha_mode"):
        assert getattr(found, name) == getattr(wanted, name), name
    assert found.is_physical
    assert_array_equal(found.image, wanted.image)
    assert_array_equal(found.roughness_texture.image[..., 0], ORM[..., 1])
    assert_array_equal(found.metallic_texture.image[..., 0], ORM[..., 2])
    assert_array_equal(found.emissive_texture.image, PICTURE)
