"""Round trips of figures through ``.glb``: parts, colours, textures and materials."""

import io
from dataclasses import fields, replace

import numpy as np
import pytest
from exporters.seamed import UVS, seamed_mesh
from exporting import export_clips, export_figures
from formats.gltf.files import File, animated, skinned
from formats.gltf.spec_evaluator import Evaluator
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from two_parts import two_parts

import viewer
from viewer.exporters import export
from viewer.formats._source import Source
from viewer.formats.gltf import read_nodes
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.evaluation import frames_of, pose_of
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning, deform

PIXELS = np.arange(48, dtype=np.uint8).reshape(3, 4, 4) | 128


def jpeg() -> Texture:
    """Return an embedded JPEG texture with every property of a sampler."""
    stream = io.BytesIO()
    Image.fromarray(PIXELS[..., :3]).save(stream, "JPEG")
    with Image.open(stream) as picture:
        pixels = np.array(picture.convert("RGBA"))
    return Texture(
        "skin",
        pixels,
        uv_set=2,
        transform=np.array([[1.5, -0.5, 0.25], [0.5, 1.5, 0.125]]),
        wrap=("mirror", "clamp"),
        is_smooth=False,
        minification="linear_mipmap_nearest",
        encoded=stream.getvalue(),
    )


def roof_of_two_parts() -> Mesh:
    """Return a roof with triangles of two parts and two materials."""
    painted = Material(
        "painted", jpeg(), (1.0, 1.0, 1.0, 1.0), 0.5, 0.25, double_sided=False, is_physical=True
    )
    lamp = Material(
        "lamp", None, (0.5, 0.25, 0.0, 1.0), emissive=(4.0, 2.0, 0.0), unlit=True, is_physical=True
    )
    return replace(
        seamed_mesh(),
        materials=(painted, lamp),
        triangle_materials=np.array([0, 1, 0]),
        other_uvs=(UVS[::-1], UVS * 2.0),
        colors=np.linspace(0.0, 1.0, 20).reshape(5, 4),
        parts=("hull", "lid"),
        triangle_parts=np.array([1, 0, 1]),
    )


def corners(mesh: Mesh, name: str) -> np.ndarray:
    """Return the values at the corners of all triangles."""
    if name == "uvs":
        index = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
        return np.stack([uvs[index] for uvs in (mesh.uvs, *mesh.other_uvs)])
    return getattr(mesh, name)[mesh.triangles]


def test_parts_colours_and_materials_round_trip(tmp_path):
    wanted = roof_of_two_parts()
    export(Actor(Figure("roof", wanted, unit="m")), tmp_path / "roof.glb")
    found = viewer.load(tmp_path / "roof.glb").actors[0].figure.mesh
    assert found.parts == ("hull", "lid")
    order = [1, 0, 2]  # sorted by part, then by material
    assert found.part_indices.tolist() == [0, 1, 1]
    for name in ("positions", "colors", "uvs"):
        expected = corners(wanted, name)
        expected = expected[:, order] if name == "uvs" else expected[order]
        assert_allclose(corners(found, name), expected, atol=1e-6)
    names = [found.materials[index].name for index in found.material_indices]
    assert names == ["lamp", "painted", "painted"]
    by_name = {material.name: material for material in found.materials}
    for material in wanted.materials:
        other = by_name[material.name]
        for field in fields(Material):
            if field.name != "base_texture":
                assert getattr(other, field.name) == getattr(material, field.name), field.name
    texture, image = by_name["painted"].base_texture, wanted.materials[0].base_texture
    for field in fields(Texture):
        one, other = getattr(texture, field.name), getattr(image, field.name)
        if isinstance(other, np.ndarray):
            assert_allclose(one, other, atol=1e-12)
        else:
            assert one == other, field.name


def test_parts_are_separate_meshes_and_nodes(tmp_path):
    export(Actor(Figure("roof", roof_of_two_parts(), unit="m")), tmp_path / "roof.glb")
    file = read_nodes(Source.open(tmp_path / "roof.glb"))
    assert [mesh.name for mesh in file.meshes] == ["hull", "lid"]
    names = [file.tree.names[node] for node in np.flatnonzero(file.tree.meshes >= 0)]
    assert names == ["hull", "lid"]
    triangles = [sum(len(p.triangles) for p in mesh.primitives) for mesh in file.meshes]
    assert triangles == [1, 2]
    assert {len(primitive.positions) for primitive in file.meshes[0].primitives} == {3}


def test_vertex_colours_are_not_tinted_by_the_colour_of_the_figure(tmp_path):
    mesh = replace(seamed_mesh(), colors=np.full((5, 4), 0.5))
    actor = Actor(Figure("roof", mesh, unit="m"), color=(1.0, 0.0, 0.0))
    export(actor, tmp_path / "roof.glb")
    (material,) = viewer.load(tmp_path / "roof.glb").actors[0].figure.mesh.materials
    assert material.base_color == (1.0, 1.0, 1.0, 1.0)
    assert_array_equal(mesh.colors, 0.5)


def test_application_data_of_a_file_is_kept_or_reported(tmp_path):
    """Materials, scenes and animations keep their data; members that are not read are listed."""
    file = animated()
    file.root["nodes"] = [{"mesh": file.mesh(_SPEED=file.accessor([1, 2, 3]))}]
    file.primitive.update(material=0, extras={"layer": 3})
    file.add("materials", {"name": "red", "extras": {"kind": "cloth"}})
    file.root["animations"][0]["extras"] = {"loop": True}
    file.root["animations"][0]["extensions"] = {"ACME_events": {}}
    file.root["scenes"] = [{"nodes": []}, {"name": "stage", "extras": [1], "nodes": [0]}]
    file.root["scene"] = 1
    (tmp_path / "a.glb").write_bytes(file.glb())
    (actor,) = viewer.load(tmp_path / "a.glb").actors
    path = tmp_path / "b.glb"
    notes = export_clips(actor, path, clips=[each.clip() for each in actor.figure.animations])
    root = Evaluator(path).root
    assert root["materials"][0]["extras"] == {"kind": "cloth"}
    assert root["animations"][0]["extras"] == {"loop": True}
    (scene,) = root["scenes"]
    assert (scene["name"], scene["extras"]) == ("stage", [1])
    (note,) = [note for note in notes if note.key == "X003.file-members"]
    lost = ("animations.ACME_events", "attributes._SPEED", "primitives.extras")
    assert sorted(note.values["names"]) == sorted(lost)


@pytest.mark.parametrize("mirrored", [False, True])
def test_tangents_are_kept(tmp_path, mirrored):
    """Normal maps made for other tangents would look different in other programs."""
    file, tangents = File(), [[1, 0, 0, 1], [0, 1, 0, -1], [0.6, 0.8, 0, 1]]
    normals, rows = file.accessor([[0, 0, 1]] * 3), file.accessor(tangents)
    mesh = file.mesh(NORMAL=normals, TANGENT=rows)
    scale = [1, 1, -2] if mirrored else [2, 2, 2]
    file.root["nodes"] = [{"mesh": mesh, "scale": scale}]
    (tmp_path / "a.glb").write_bytes(file.glb())
    figure = viewer.load(tmp_path / "a.glb").actors[0].figure
    export(Actor(figure), tmp_path / "b.glb")
    back = read_nodes(Source.open(tmp_path / "b.glb")).meshes[0].primitives[0]
    assert back.tangents is not None and back.normals is not None
    # The mesh is written in the space of the scene, in which the mirrored normals point along -z.
    assert_array_equal(back.normals, [[0, 0, -1 if mirrored else 1]] * 3)
    rows = back.tangents()
    assert_allclose(rows[:, :3], np.array(tangents)[:, :3], rtol=0, atol=1e-7)
    # Directions of v, s n x t, which lie in the plane and are not mirrored.
    found = rows[:, 3:] * np.cross(back.normals, rows[:, :3])
    assert_allclose(found, [[0, 1, 0], [1, 0, 0], [-0.8, 0.6, 0]], rtol=0, atol=1e-7)


def test_invalid_tangents_are_omitted(tmp_path):
    file = File()
    file.root["nodes"] = [{"mesh": file.mesh(TANGENT=file.accessor([[1, 0, 0, 1]] * 2))}]
    (tmp_path / "a.glb").write_bytes(file.glb())
    export(Actor(viewer.load(tmp_path / "a.glb").actors[0].figure), tmp_path / "b.glb")
    assert read_nodes(Source.open(tmp_path / "b.glb")).meshes[0].primitives[0].tangents is None


@pytest.mark.parametrize("called", ["", "eye"])
def test_names_are_kept_or_listed(tmp_path, called):
    file = skinned()
    file.root["skins"][0]["name"] = "Armature"
    file.root["nodes"][2] |= {"name": called, "camera": 0}
    lens = {"yfov": 1.0, "znear": 0.1}
    file.root["cameras"] = [{"name": "lens", "type": "perspective", "perspective": lens}]
    file.root["samplers"] = [{"name": "smooth"}]
    (tmp_path / "a.glb").write_bytes(file.glb())
    scene = viewer.load(tmp_path / "a.glb")
    path = tmp_path / "b.glb"
    notes = export_figures(scene.actors, path, scene=scene)
    root = Evaluator(path).root
    assert [skin["name"] for skin in root["skins"]] == ["Armature"]
    # A camera is called like its node, if the node has a name.
    assert root["cameras"][0]["name"] == (called or "lens")
    (note,) = [note for note in notes if note.key == "X003.file-members"]
    assert set(note.values["names"]) == {"samplers.name", *(["cameras.name"] if called else [])}


STEP = 1.0 / 32767.0  # relative to half the size of 2 units


def document(path) -> tuple[dict, bytes]:
    file = Evaluator(path)
    return file.root, file.binary


def test_attributes_are_normalised_integers_with_exact_sums(tmp_path):
    export_clips(Actor(two_parts()), tmp_path / "small.glb", optimizes=True)
    root, binary = document(tmp_path / "small.glb")
    assert root["extensionsUsed"] == root["extensionsRequired"] == ["KHR_mesh_quantization"]
    (bar,) = (mesh for mesh in root["meshes"] if mesh["name"] == "bar mesh")
    attributes = bar["primitives"][0]["attributes"]
    accessors = {name: root["accessors"][index] for name, index in attributes.items()}
    kinds = {name: each["componentType"] for name, each in accessors.items()}
    assert kinds == {"POSITION": 5122, "NORMAL": 5122, "JOINTS_0": 5121, "WEIGHTS_0": 5123}
    assert all(root["accessors"][index]["normalized"] for index in (attributes["POSITION"],))
    for name in ("POSITION", "NORMAL"):
        assert root["bufferViews"][accessors[name]["bufferView"]]["byteStride"] == 8
    start = root["bufferViews"][accessors["WEIGHTS_0"]["bufferView"]]["byteOffset"]
    weights = np.frombuffer(binary, "<u2", 24, start).reshape(6, 4)
    assert weights.sum(axis=1).tolist() == [65535] * 6


def test_extensions_of_all_figures_are_declared(tmp_path):
    figure = two_parts()
    mesh = figure.require_mesh()
    slots = np.zeros(mesh.n_triangles, dtype=np.int32)
    bright = Material("bright", unlit=True)
    own = replace(mesh, materials=(bright,), triangle_materials=slots)
    actors = [Actor(replace(figure, mesh=own)), Actor(two_parts())]
    export_figures(actors, tmp_path / "small.glb", optimizes=True)
    root, _ = document(tmp_path / "small.glb")
    assert root["materials"][0]["extensions"] == {"KHR_materials_unlit": {}}
    assert root["extensionsUsed"] == ["KHR_mesh_quantization", "KHR_materials_unlit"]
    assert root["extensionsRequired"] == ["KHR_mesh_quantization"]


def test_quantised_figure_moves_like_the_original(tmp_path):
    figure = two_parts()
    notes = export_clips(Actor(figure), tmp_path / "small.glb", optimizes=True)
    back = viewer.load(tmp_path / "small.glb").actors[0].figure
    (measured,) = (note.values["distance"] for note in notes if note.key == "X002.animations")
    assert 0.0 < measured < 3.0 * STEP
    order = [6, 7, 8, 0, 1, 2, 3, 4, 5]
    for animation, other in zip(figure.animations, back.animations, strict=True):
        for time in (0.2, 0.7, 1.4):
            shapes = []
            for each, played in ((figure, animation), (back, other)):
                frames = frames_of(each, played.clip(), np.array([time]))
                shapes.append(deform(each, pose_of(each, frames, 0), Skinning())[0])
            assert_allclose(shapes[1], shapes[0][order], rtol=0, atol=3.0 * STEP)


@pytest.mark.parametrize("unbound", [False, True])
def test_single_pose_is_quantised(tmp_path, unbound):
    figure = replace(two_parts(), animations=(), record=None)
    if unbound:
        figure = replace(figure, skin=None, skeleton=None)
    notes = viewer.export(Actor(figure), tmp_path / "small.glb", optimizes=True)
    assert "X002.quantized" in [note.key for note in notes]
    back = viewer.load(tmp_path / "small.glb").actors[0]
    found = deform(back.figure, back.pose, Skinning())[0]
    for point in figure.mesh.positions:
        assert np.linalg.norm(found - point, axis=1).min() < 2.0 * STEP


def test_optimisation_of_other_formats_is_refused(tmp_path):
    with pytest.raises(viewer.ViewerError, match=r"\.obj: only glTF files can be optimised"):
        export(Actor(two_parts()), tmp_path / "small.obj", optimizes=True)
    assert not (tmp_path / "small.obj").exists()
