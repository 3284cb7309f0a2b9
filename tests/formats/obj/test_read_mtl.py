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
