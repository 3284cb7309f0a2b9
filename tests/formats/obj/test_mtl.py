"""Material libraries: the PBR extension, opacity, texture placement, and unknown statements."""

import numpy as np
import pytest
from faults import fault_of
from numpy.testing import assert_array_equal

from viewer.formats import Source, obj
from viewer.media.png import encode_png

FACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"


@pytest.fixture
def materials(tmp_path):
    """Return a function that reads the materials of a library and its diagnostics."""
    rows = {"grey": (128, 64, 32, 255), "white": (255, 255, 255, 255)}
    for name, color in rows.items():
        (tmp_path / f"{name}.png").write_bytes(encode_png(np.full((2, 4, 4), color, np.uint8)))

    def read(text: str):
        (tmp_path / "m.mtl").write_text(text)
        names = [line.split()[1] for line in text.splitlines() if line.startswith("newmtl")]
        faces = "".join(f"usemtl {name}\nf 1/1 2/1 3/1\n" for name in dict.fromkeys(names))
        (tmp_path / "a.obj").write_text(f"mtllib m.mtl\n{FACE}{faces}")
        source = Source.open(tmp_path / "a.obj")
        found = obj.read(source).mesh.materials
        return found, [(one.path.name, *fault_of(one)) for one in source.diagnostics]

    return read


def test_the_pbr_extension_is_read(materials):
    (made,), said = materials(
        "newmtl a\nKd 0.5 0.25 1\nPr 0.3\nPm 1\nKe 0 2 0\nmap_Kd grey.png\n"
        "map_Pr -imfchan g grey.png\nmap_Pm -imfchan b grey.png\n"
        "norm -bm 0.5 white.png\nmap_Ke white.png\n"
    )
    assert said == []
    assert (made.base_color, made.roughness, made.metallic) == ((0.5, 0.25, 1.0, 1.0), 0.3, 1.0)
    assert (made.emissive, made.normal_scale, made.is_physical) == ((0.0, 2.0, 0.0), 0.5, True)
    textures = made.textures
    assert {name: (one.name, one.channel) for name, one in textures.items()} == {
        "base_texture": ("grey.png", 0),
        "roughness_texture": ("grey.png", 1),
        "metallic_texture": ("grey.png", 2),
        "normal_texture": ("white.png", 0),
        "emissive_texture": ("white.png", 0),
    }
    assert textures["base_texture"].image is textures["roughness_texture"].image


def test_maps_without_factors_have_a_factor_of_1(materials):
    (made,), _ = materials("newmtl a\nmap_Pr grey.png\nmap_Ke grey.png\n")
    assert (made.roughness, made.metallic, made.emissive) == (1.0, 0.0, (1.0, 1.0, 1.0))


def test_older_materials_keep_blinn_phong(materials):
    (plain, black, white), said = materials(
        "newmtl a\nKd .5\nKs 1 1 1\nNs 200\nillum 2\n"
        "newmtl b\nKd 0 0 0\nmap_Kd grey.png\nnewmtl c\nKd 1 1 1\nmap_Kd grey.png\n"
    )
    assert said == []
    assert (plain.base_color, plain.is_physical) == ((0.5, 0.5, 0.5, 1.0), False)
    # Exporters often write a black colour together with a texture.
    assert black.base_color is None and white.base_color is None


@pytest.mark.parametrize(
    ("lines", "opacity"),
    [
        ("d 0.25", 0.25),
        ("d -halo 0.5", 0.5),
        ("Tr 0.25", 0.75),
        ("d 1\nTr 0.5", None),
        ("Tr 1", None),
    ],
)
def test_opacity_is_read_from_d_or_one_minus_tr(materials, lines, opacity):
    (made,), _ = materials(f"newmtl a\n{lines}\n")
    assert made.alpha_mode == ("opaque" if opacity is None else "blend")
    assert made.base_color == (None if opacity is None else (1.0, 1.0, 1.0, opacity))


def test_opacity_maps_are_stored_as_alpha(materials):
    (made, alone), _ = materials(
        "newmtl a\nmap_Kd white.png\nmap_d grey.png\nnewmtl b\nmap_d grey.png\n"
    )
    for one in (made, alone):
        assert one.alpha_mode == "blend"
        assert_array_equal(one.image, np.full((2, 4, 4), (255, 255, 255, 128)))


def test_pictures_are_placed_by_their_options(materials):
    (made, clamped), _ = materials(
        "newmtl a\nmap_Kd -s 2 3 1 -o 0.5 grey.png\nnewmtl b\nmap_Kd -clamp on grey.png\n"
    )
    assert_array_equal(made.base_texture.matrix, [[2.0, 0.0, 0.5], [0.0, 3.0, 0.0]])
    assert made.base_texture.wrap == ("repeat", "repeat")
    assert (
        clamped.base_texture.wrap == ("clamp", "clamp") and clamped.base_texture.is_placed_plainly
    )


def test_errors_and_ignored_statements_are_reported_by_line(materials):
    (made,), said = materials(
        "newmtl a\nKd 1 0\nPr rough\nPm 1.5\nmap_Bump b.png\nmap_Ks s.png\nKe -1 0 0\nd\n"
    )
    assert said == [
        ("m.mtl", "F006.mtl-color", 2, {"word": "Kd", "limits": "from 0 to 1", "found": b"1 0"}),
        ("m.mtl", "F006.mtl-number", 3, {"word": "Pr", "found": b"rough"}),
        ("m.mtl", "F006.mtl-number", 4, {"word": "Pm", "found": b"1.5"}),
        ("m.mtl", "F006.mtl-color", 7, {"word": "Ke", "limits": "from 0", "found": b"-1 0 0"}),
        ("m.mtl", "F006.mtl-number", 8, {"word": "d", "found": b""}),
        ("m.mtl", "F007.mtl-statements", 5, {"statements": ["map_Bump", "map_Ks"]}),
    ]
    assert (made.base_color, made.roughness, made.is_physical) == (None, 0.6, False)


@pytest.mark.parametrize("option", ["-s 2 3", "-o", "-clamp", "-clamp on", "-bm 0.5", "-imfchan r"])
def test_maps_without_a_file_are_ignored(materials, option):
    (made,), _ = materials(f"newmtl a\nKd 1 0 0\nmap_Kd {option}\nbump {option}\n")
    assert made.base_color == (1.0, 0.0, 0.0, 1.0)
    assert made.textures == {}


GREY, NORMAL, SOLID = (128, 64, 32, 255), (128, 128, 255, 255), (255, 255, 255, 255)


def rows(*colors) -> np.ndarray:
    return np.array([colors], dtype=np.uint8)


IMAGES = {
    "skin.png": rows(GREY, GREY),
    "my skin.png": rows(GREY, GREY),
    "textures/skin.png": rows(SOLID),
    "normal.png": rows(NORMAL, (200, 128, 230, 255)),
    "height.png": rows((90, 90, 90, 255), (200, 200, 200, 255)),
    "leaf.png": rows((0, 255, 0, 255), (0, 255, 0, 0)),
    "cut.png": rows((0, 0, 0, 255), (255, 255, 255, 255)),
    "soft.png": rows((90, 90, 90, 255), (160, 160, 160, 255)),
}


@pytest.fixture
def read(tmp_path):
    """Return a function that reads the material ``a`` of a library, and the keys of warnings."""
    (tmp_path / "textures").mkdir()
    for name, image in IMAGES.items():
        (tmp_path / name).write_bytes(encode_png(image))

    def made(text, name="a", library="m.mtl", uses=None, stored="m.mtl"):
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / stored).write_bytes(data)
        face = f"mtllib {library}\n{FACE}usemtl {uses or name}\nf 1/1 2/1 3/1\n"
        (tmp_path / "a.obj").write_text(face)
        source = Source.open(tmp_path / "a.obj")
        (material,) = obj.read(source).mesh.materials
        return material, [one.key for one in source.diagnostics]

    return made


MOVED = ["F005.mtl-moved"]


@pytest.mark.parametrize(
    ("written", "used", "said"),
    [
        ("skin.png", "skin.png", []),
        (".\\textures\\skin.png", ".\\textures\\skin.png", []),
        ("textures\\skin.png", "textures/skin.png", []),
        ("my skin.png", "my skin.png", []),
        ('"my skin.png"', "my skin.png", []),
        ("'skin.png'", "skin.png", []),
        ("SKIN.PNG", "skin.png", MOVED),
        ("Textures/Skin.png", "textures/skin.png", MOVED),
        ("C:\\Users\\me\\my skin.png", "my skin.png", MOVED),
        ("/home/me/maps/skin.png", "skin.png", MOVED),
        ("../maps/skin.png", "skin.png", MOVED),
        ("//server/maps/skin.png", "skin.png", MOVED),
        ("file:///C:/maps/skin.png", "skin.png", MOVED),
        ("-bm\t1\tskin.png", "skin.png", []),
        ("-S 1 1 1 -O 0 0 0 -MM 0 1 skin.png", "skin.png", []),
        ("-blendu on -blendv off -cc off -texres 512 skin.png", "skin.png", []),
        ("-type sphere skin.png", "skin.png", []),
    ],
)
def test_images_are_found_under_the_names_that_programs_write(read, written, used, said):
    """Maya and 3ds Max write absolute paths; Windows programs write backslashes and any case."""
    material, keys = read(f"newmtl a\nmap_Kd {written}\n")
    assert material.image is not None and keys == said
    assert material.texture.replace("\\", "/") == used.replace("\\", "/")


def test_missing_images_are_reported(read):
    assert read("newmtl a\nmap_Kd C:\\maps\\gone.png\n")[1] == ["F005.texture-refused"]
    assert read("newmtl a\nmap_Kd gone.png\n")[1] == ["F005.texture"]


@pytest.mark.parametrize(
    ("library", "stored"),
    [
        ("m.mtl", "m.mtl"),
        ("my model.mtl", "my model.mtl"),
        ('"my model.mtl"', "my model.mtl"),
        ("C:\\work\\m.mtl", "m.mtl"),
        ("./m.mtl", "m.mtl"),
        ("M.MTL", "m.mtl"),
    ],
)
def test_libraries_are_found_under_the_names_that_programs_write(read, library, stored):
    material, keys = read("newmtl a\nKd 1 0 0\n", library=library, stored=stored)
    assert material.base_color == (1.0, 0.0, 0.0, 1.0) and keys == []


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbfnewmtl a\nKd 1 0 0\n",
        b"newmtl a\r\nKd 1 0 0\r\n",
        b"newmtl a\rKd 1 0 0\r",
        b"\tnewmtl\ta  \n\t\tKd\t1\t0\t0 1 # red\n",
        b"# comment\nKd 0 1 0\nnewmtl a\nkd 1e0 0.0e+00 0.\nKa 0 0 0\nillum 4\nNi 1.45\nTf 1 1 1\n",
        b"newmtl a\nKd 1.0000001 0 0\n",
        b"newmtl a\nKd 1 0 0\nKd 0 1 0\nmap_Kd\nmap_Kd \n\nnewmtl a\nKd 0 0 1\n",
    ],
)
def test_encodings_and_line_endings_of_programs_and_editors_are_read(read, text):
    material, keys = read(text)
    assert material.base_color == (1.0, 0.0, 0.0, 1.0) and keys == []


def test_names_of_materials_may_contain_spaces(read):
    material, keys = read("newmtl old skin (2)\nKd 1 0 0\n", uses="old skin (2)")
    assert material.base_color == (1.0, 0.0, 0.0, 1.0) and keys == []


@pytest.mark.parametrize("head", ["# Blender 4.2.0 MTL File: 'a.blend'", "# 3ds Max Wavefront OBJ"])
def test_maps_of_blender_and_3ds_max_replace_values(read, head):
    """These programs write the default of an input in addition to the image connected to it."""
    text = "newmtl a\nKd 0.8 0.8 0.8\nmap_Kd skin.png\nPr 0.5\nmap_Pr skin.png\nKs 0 0 0\n"
    replaced, _ = read(f"{head}\n{text}")
    assert (replaced.base_color, replaced.roughness) == (None, 1.0)
    scaled, _ = read(text)
    assert (scaled.base_color, scaled.roughness) == ((0.8, 0.8, 0.8, 1.0), 0.5)
    plain, _ = read(f"{head}\nnewmtl a\nKd 0.8 0.8 0.8\nPr 0.5\n")
    assert (plain.base_color, plain.roughness) == ((0.8, 0.8, 0.8, 1.0), 0.5)


def test_metallic_map_is_used_in_spite_of_pm_0(read):
    material, _ = read("newmtl a\nPm 0\nmap_Pm skin.png\nPr 0\nmap_Pr skin.png\n")
    assert (material.metallic, material.roughness) == (1.0, 0.0)


def test_bump_maps_are_drawn_if_they_contain_normals(read):
    material, keys = read("newmtl a\nmap_Bump -bm 0.5 normal.png\n")
    assert keys == [] and material.normal_scale == 0.5
    assert material.normal_texture.name == "normal.png"
    material, keys = read("newmtl a\nbump height.png\n")
    assert keys == ["F007.mtl-statements"] and material.normal_texture is None
    both, _ = read("newmtl a\nmap_bump normal.png\nnorm -bm 2 normal.png\n")
    assert both.normal_scale == 2.0


@pytest.mark.parametrize(
    ("lines", "mode", "alpha"),
    [
        ("map_Kd leaf.png", "opaque", [255, 0]),
        ("map_Kd leaf.png\nmap_d leaf.png", "mask", [255, 0]),
        ("map_Kd skin.png\nmap_d cut.png", "mask", [0, 255]),
        ("map_Kd skin.png\nmap_d soft.png", "blend", [90, 160]),
        ("map_Kd skin.png\nmap_d skin.png", "opaque", [255, 255]),
        ("map_Kd skin.png\nmap_d cut.png\nd 0.5", "blend", [0, 255]),
        ("map_Kd skin.png\nTr 1\nillum 2", "opaque", [255, 255]),
        ("map_Kd skin.png\nd 1.0\nTr 1.0", "opaque", [255, 255]),
    ],
)
def test_opacity_of_images_is_a_mask_if_nearly_all_values_are_0_or_1(read, lines, mode, alpha):
    material, keys = read(f"newmtl a\n{lines}\n")
    assert (keys, material.alpha_mode) == ([], mode)
    assert_array_equal(material.image[0, :, 3], alpha)


def test_ambient_maps_replace_missing_diffuse_maps(read):
    alone, keys = read("newmtl a\nmap_Ka skin.png\n")
    assert (alone.texture, keys) == ("skin.png", [])
    both, _ = read("newmtl a\nmap_Ka my skin.png\nmap_Kd skin.png\n")
    assert both.texture == "skin.png"


def test_statements_that_are_not_drawn_are_reported(read):
    text = "newmtl a\nmap_Tr cut.png\nrefl -type sphere sky.png\nPs 0.1\naniso 0.5\nmap_Ns a.png\n"
    assert read(text)[1] == ["F007.mtl-statements"]


def test_missing_library_with_spaces_in_its_name_is_reported_once(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(f"mtllib Part Studio 1.mtl\nusemtl a\n{FACE}f 1 2 3\n")
    source = Source.open(path)
    obj.read(source)
    (warning,) = [found for found in source.diagnostics.warnings if found.key == "F005.library"]
    assert "Part Studio 1.mtl" in warning.message
