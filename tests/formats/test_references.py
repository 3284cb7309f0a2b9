"""References to files, which must be below the referencing file's folder after resolving links."""

import json

import numpy as np
import pytest
from faults import fault_of
from formats.pig_text import write as write_pig
from formats.skin_text import BINDINGS, NORMALS, POSITIONS, TRIANGLES, WEIGHTS
from PIL import Image

import viewer
from viewer.errors import FormatError
from viewer.formats import Source, read, referenced_path
from viewer.formats.rig import NamedFiles
from viewer.loading.contents import read_files

UVS = "texcoords 3 {\n 0 0\n 1 0\n 0 1\n}\n"
OBJ = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
PLY = (
    "ply\nformat ascii 1.0\ncomment TextureFile {}\nelement vertex 3\nproperty float x\n"
    "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
)


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a model, with a secret image next to it, and links to that image."""
    model = tmp_path / "model"
    (tmp_path / "secret").mkdir()
    (model / "sub").mkdir(parents=True)
    for path in (tmp_path / "secret" / "x.png", model / "in.png", model / "sub" / "in.png"):
        Image.new("RGB", (1, 1), (9, 8, 7)).save(path)
    (model / "link.png").symlink_to(tmp_path / "secret" / "x.png")
    (model / "way").symlink_to(tmp_path / "secret")
    (model / "same.png").symlink_to("sub/in.png")
    return model


OUTSIDE = [
    "../secret/x.png",
    "..\\secret\\x.png",
    "sub/../../secret/x.png",
    "link.png",
    "way/x.png",
    "{top}/secret/x.png",
    "{top}/model/in.png",  # an absolute name, valid only on this machine
    "C:\\x.png",
    "C:x.png",
    "../model2/x.png",
    "..",
    ".",
    "",
]
INSIDE = [
    "in.png",
    "sub/in.png",
    "sub\\in.png",
    "same.png",
    "sub/../in.png",
    "./in.png",
    "gone.png",
]


@pytest.mark.parametrize("name", OUTSIDE)
def test_paths_outside_the_folder_are_refused(folder, name):
    (folder.parent / "model2").mkdir()
    assert referenced_path(folder, name.format(top=folder.parent)) is None


@pytest.mark.parametrize("name", INSIDE)
def test_paths_within_the_folder_are_found(folder, name):
    assert referenced_path(folder, name) == folder / name.replace("\\", "/")


def test_circular_links_are_not_followed(folder):
    (folder / "round.png").symlink_to("round.png")
    assert referenced_path(folder, "round.png") == folder / "round.png"


def skin_text(name):
    material = f"material a {{\n texture {name}\n}}\n"
    return POSITIONS + NORMALS + UVS + WEIGHTS + material + TRIANGLES + BINDINGS


def write_model(folder, kind, name):
    """Write a model that refers to an image; return its path, and the reference's file and line."""
    path = folder / f"a.{kind}"
    if kind == "obj":
        (folder / "m.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
        path.write_text(OBJ)
        return path, folder / "m.mtl", 2
    text = skin_text(name) if kind == "skin" else PLY.format(name)
    path.write_text(text)
    line = next(number for number, row in enumerate(text.splitlines(), 1) if name in row)
    return path, path, line


@pytest.mark.parametrize("kind", ["skin", "obj", "ply"])
@pytest.mark.parametrize("name", ["../secret/x.png", "{top}/secret/x.png", "link.png", "way/x.png"])
def test_texture_outside_the_folder_is_not_read(folder, kind, name):
    name = name.format(top=folder.parent)
    path, named, line = write_model(folder, kind, name)
    source = Source.open(path)
    (material,) = read(source).mesh.materials
    assert (material.texture, material.image) == (name, None)
    reason = (
        "is an absolute path: not read"
        if name.startswith("/")
        else "is outside the folder: not read"
    )
    (warning,) = source.diagnostics
    fault = ("F005.texture-refused", line, {"name": name, "reason": reason})
    assert (warning.path, fault_of(warning)) == (named, fault)


@pytest.mark.parametrize("kind", ["skin", "ply"])
def test_absolute_path_is_reported_even_within_the_folder(folder, kind):
    path, named, line = write_model(folder, kind, f"{folder}/in.png")
    source = Source.open(path)
    assert read(source).mesh.materials[0].image is None
    (warning,) = source.diagnostics
    values = {"name": f"{folder}/in.png", "reason": "is an absolute path: not read"}
    assert (warning.path, fault_of(warning)) == (named, ("F005.texture-refused", line, values))


def test_absolute_path_in_a_library_is_replaced_by_the_image_next_to_it_with_a_warning(folder):
    path, named, line = write_model(folder, "obj", "/home/elsewhere/in.png")
    source = Source.open(path)
    (material,) = read(source).mesh.materials
    assert (material.texture, material.image.tolist()) == ("in.png", [[[9, 8, 7, 255]]])
    (warning,) = source.diagnostics
    values = {"name": "/home/elsewhere/in.png", "used": "in.png"}
    assert (warning.path, fault_of(warning)) == (named, ("F005.mtl-moved", line, values))


@pytest.mark.parametrize("kind", ["skin", "obj", "ply"])
@pytest.mark.parametrize("name", ["in.png", "sub/in.png", "same.png"])
def test_texture_within_the_folder_is_read(folder, kind, name):
    path, _, _ = write_model(folder, kind, name)
    source = Source.open(path)
    (material,) = read(source).mesh.materials
    assert material.image.tolist() == [[[9, 8, 7, 255]]]
    assert source.warnings == []


def test_library_behind_a_link_is_not_read(folder):
    path, _, _ = write_model(folder, "obj", "in.png")
    (folder / "m.mtl").rename(folder.parent / "secret" / "m.mtl")
    (folder / "m.mtl").symlink_to(folder.parent / "secret" / "m.mtl")
    source = Source.open(path)
    assert read(source).mesh.materials[0].image is None
    assert source.warnings[0] == (
        f"{path}:1: material library m.mtl is outside the folder: not read"
    )


@pytest.mark.parametrize("item", ["skeleton {}", "skin {}", "morphs 1 {{ {} }}"])
@pytest.mark.parametrize("name", ["../secret/a.skel", "{top}/secret/a.skel", "way/a.skel"])
def test_rig_with_files_outside_its_folder_is_refused(folder, item, name):
    name = name.format(top=folder.parent)
    with pytest.raises(FormatError) as caught:
        read(Source(folder / "a.rig", f"rig a {{\n{item.format(name)}\n}}\n".encode()))
    assert caught.value.line == 2
    assert f'within the folder of the .rig, found "{name[:39]}' in str(caught.value)


def test_rig_may_use_backslashes(folder):
    named = read(Source(folder / "a.rig", b"rig a { skeleton sub\\a.skel }"))
    assert isinstance(named, NamedFiles)
    assert named.paths == (folder / "sub" / "a.skel",)


def test_texture_of_a_pig_folder_must_not_be_a_link_out_of_the_folder(folder):
    pig = write_pig(folder / "pig")
    (pig / "skin.png").symlink_to(folder.parent / "secret" / "x.png")
    contents = read_files([pig])
    assert contents.figures[0][1].mesh.materials == ()
    assert f"{pig}: texture skin.png is outside the folder: not read" in contents.warnings


def test_linked_file_finds_companions_next_to_the_link(folder):
    path, _, _ = write_model(folder, "skin", "in.png")
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "b.skin").symlink_to(path)
    source = Source.open(elsewhere / "b.skin")
    assert read(source).mesh.materials[0].image is None
    assert f"texture {elsewhere}/in.png: cannot be read" in source.warnings[0]
    Image.new("RGB", (1, 1), (1, 2, 3)).save(elsewhere / "in.png")
    (material,) = read(Source.open(elsewhere / "b.skin")).mesh.materials
    assert material.image.tolist() == [[[1, 2, 3, 255]]]


def test_image_given_by_the_user_may_be_anywhere(folder):
    path, _, _ = write_model(folder, "skin", "gone.png")
    scene = viewer.load(path, folder / "link.png")
    (material,) = scene.actors[0].figure.mesh.materials
    assert np.asarray(material.image).tolist() == [[[9, 8, 7, 255]]]


def test_texture_outside_the_folder_is_not_exported(folder, tmp_path, capsys):
    from viewer.cli import run

    path, named, line = write_model(folder, "skin", "../secret/x.png")
    out = tmp_path / "out"
    out.mkdir()
    assert run(["convert", str(path), "-o", str(out / "a.gltf")]) == 0
    assert sorted(file.name for file in out.iterdir()) == ["a.bin", "a.gltf"]
    assert "images" not in json.loads((out / "a.gltf").read_text())
    assert f"{named}:{line}: texture ../secret/x.png is outside the folder: not read" in (
        capsys.readouterr().err
    )
