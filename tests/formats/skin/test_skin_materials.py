"""Texture coordinates, materials and textures of ``.skin`` files."""

import pytest
from formats.skin_text import BINDINGS, NORMALS, POSITIONS, TRIANGLES, WEIGHTS, read
from PIL import Image

UVS = "texcoords 3 {\n 0 0\n 1.07 0\n 0 1\n}\n"


@pytest.fixture
def folder(tmp_path):
    Image.new("RGB", (2, 1), (255, 0, 0)).save(tmp_path / "red.bmp")
    Image.new("RGBA", (1, 2), (0, 255, 0, 128)).save(tmp_path / "my green.png")
    return tmp_path


def textured(folder, material, rest=TRIANGLES):
    return read(POSITIONS + NORMALS + UVS + WEIGHTS + material + rest + BINDINGS, folder / "a.skin")


@pytest.mark.parametrize(
    "material",
    [
        "material face {\n texture red.bmp\n}\n",
        "material face { texture red.bmp }",
        "material face{texture red.bmp}",
        "material face\n{\r\n\ttexture\r\n\tred.bmp\r\n}",
        "material face { texture red.bmp \t }",
    ],
)
def test_material_applies_to_the_triangles_after_it(folder, material):
    figure, warnings = textured(folder, material)
    assert warnings == []
    assert figure.mesh.uvs.tolist() == [[0, 0], [1.07, 0], [0, 1]]
    assert figure.mesh.material_indices.tolist() == [0]
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("face", "red.bmp")]
    assert figure.mesh.materials[0].image.tolist() == [[[255, 0, 0, 255]] * 2]


def test_texture_name_may_contain_spaces_and_backslashes(folder):
    (folder / "tex").mkdir()
    (folder / "my green.png").rename(folder / "tex" / "my green.png")
    figure, warnings = textured(folder, "material { texture tex\\my green.png\n}")
    assert warnings == []
    assert figure.mesh.materials[0].texture == "tex\\my green.png"
    assert figure.mesh.materials[0].image.tolist() == [[[0, 255, 0, 128]]] * 2


def test_several_materials_apply_to_the_triangles_that_follow(folder):
    rest = (
        "material b { texture my green.png }\n" + TRIANGLES * 2 + "material c { texture red.bmp }\n"
    )
    figure, warnings = textured(
        folder, TRIANGLES + "material a { texture red.bmp }" + TRIANGLES, rest
    )
    assert warnings == []
    assert [material.name for material in figure.mesh.materials] == ["a", "b", "c"]
    assert figure.mesh.material_indices.tolist() == [-1, 0, 1, 1]


def test_materials_with_the_same_texture_share_it(folder):
    material = "material { texture red.bmp }"
    figure, _ = textured(folder, material * 3)
    first, second, third = (material.image for material in figure.mesh.materials)
    assert first is second is third


def test_material_without_texture_is_reported_as_a_warning(folder):
    figure, warnings = textured(folder, "material a { }\nmaterial { texture }\n")
    assert [(m.name, m.texture) for m in figure.mesh.materials] == [("a", None), ("", None)]
    assert warnings == [
        f"{folder}/a.skin:21: material without a texture: drawn untextured",
        f"{folder}/a.skin:11: texcoords without a texture: drawn untextured",
    ]


@pytest.mark.parametrize("item", ["shininess 20 30", "shine { 1 { 2 } }", "shine 3 { }", "shine"])
def test_unknown_item_of_a_material_is_skipped(folder, item):
    figure, warnings = textured(folder, f"material a {{ {item} texture red.bmp }}")
    assert figure.mesh.materials[0].texture == "red.bmp"
    assert figure.mesh.material_indices.tolist() == [0]
    assert warnings == [
        f'{folder}/a.skin:21: ignored unknown material property "{item.split()[0]}"'
    ]


def test_texture_without_texcoords_is_reported_as_a_warning(folder):
    text = POSITIONS + NORMALS + WEIGHTS + "material { texture red.bmp }\n" + TRIANGLES + BINDINGS
    figure, warnings = read(text, folder / "a.skin")
    assert figure.mesh.materials[0].image is not None
    assert warnings == [f"{folder}/a.skin:16: texture without texcoords: drawn untextured"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gone.png", "cannot be read: No such file or directory"),
        ("folder", "expected a file, found a folder"),
        ("text.png", "unsupported or damaged image"),
        ("new\x1bline.png", "cannot be read: No such file or directory"),
    ],
)
def test_unreadable_texture_is_reported_as_a_warning(folder, name, reason):
    (folder / "folder").mkdir()
    (folder / "text.png").write_text("no picture")
    figure, warnings = textured(folder, f"material {{ texture {name} }}")
    assert figure.mesh.materials[0].image is None
    assert figure.mesh.materials[0].texture == name
    path = f"{folder}/{name}".replace("\x1b", "\\x1b")
    assert warnings == [f"{folder}/a.skin:21: texture {path}: {reason}; drawn untextured"]


def test_truncated_texture_is_reported_as_a_warning(folder):
    whole = (folder / "red.bmp").read_bytes()
    (folder / "cut.bmp").write_bytes(whole[:-3])
    figure, warnings = textured(folder, "material { texture cut.bmp }")
    assert figure.mesh.materials[0].image is None
    assert len(warnings) == 1
    assert warnings[0].startswith(f"{folder}/a.skin:21: texture {folder}/cut.bmp: ")
    assert warnings[0].endswith("; drawn untextured")


def test_texture_that_ends_in_ctrl_z_is_read_completely(folder):
    # The last byte of a one-pixel-wide 24-bit BMP is padding, so four pixels are used.
    Image.new("RGB", (4, 1), (26, 26, 26)).save(folder / "dark.bmp")
    assert (folder / "dark.bmp").read_bytes().endswith(b"\x1a" * 12)
    figure, warnings = textured(folder, "material { texture dark.bmp }")
    assert warnings == []
    assert figure.mesh.materials[0].image.tolist() == [[[26, 26, 26, 255]] * 4]
