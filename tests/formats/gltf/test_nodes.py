"""Nodes of glTF files: tree, transforms, scenes and cameras."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File, read, refused, skinned, source_of, warned
from formats.gltf.spec_evaluator import Evaluator
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.diagnostics import Collector
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeTree
from viewer.formats.gltf import read_nodes
from viewer.rendering.camera import camera_from_view, follow_view
from viewer.rendering.camera_views import drawn_cameras, with_cameras
from viewer.rendering.framing import framed_poses
from viewer.rendering.options import DisplayOptions
from viewer.rendering.recorder import Recording
from viewer.rigs.captures.carried_view import view_in
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.scene import pose_actors

HALF = math.sqrt(0.5)


def local(tree: NodeTree, node: int) -> np.ndarray:
    """Return the local matrix of a node by its definition."""
    if node in tree.matrices:
        return tree.matrices[node]
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(tree.rotations[node]) * tree.scales[node]
    matrix[:3, 3] = tree.translations[node]
    return matrix


def with_matrix(matrix: np.ndarray) -> NodeTree:
    columns = [float(value) for value in np.asarray(matrix, dtype=np.float64).T.ravel()]
    return read(File(nodes=[{"matrix": columns}])).tree


def test_tree_names_and_extras_are_read():
    nodes = [
        {"name": "a", "children": [2]},
        {"children": [0], "extras": {"kind": 1}},
        {"name": "a", "extensions": {"ODD": {"x": 2}}},
    ]
    tree = read(File(nodes=nodes)).tree
    assert tree.names == ("a", "", "a")
    assert tree.parents.tolist() == [1, -1, 0]
    assert tree.extras == {1: {"kind": 1}} and tree.extensions == {2: {"ODD": {"x": 2}}}


def test_transforms_are_read():
    nodes = [{}, {"translation": [1, 2, 3], "rotation": [0, 0, HALF, HALF], "scale": [2, 1, 1]}]
    tree = read(File(nodes=nodes)).tree
    assert local(tree, 0).tolist() == np.eye(4).tolist()
    # The x axis points along y and has length 2.
    expected = [[0, -1, 0, 1], [2, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert np.abs(local(tree, 1) - expected).max() < 1e-15


def test_quaternions_are_normalised():
    file = File(nodes=[{}, {"rotation": [0, 0, 3, 4]}, {"rotation": [0, 0, 0, 0]}])
    tree = read(file).tree
    assert tree.rotations[1] == pytest.approx([0, 0, 0.6, 0.8])
    assert tree.rotations[2].tolist() == [0, 0, 0, 1]
    assert warned(file) == [("G003.rotation", "/nodes/1/rotation")]


@pytest.mark.parametrize(
    "linear",
    [
        [[0, -2, 0], [3, 0, 0], [0, 0, 4]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, -2, 0], [-3, 0, 0]],
        [[0, 0, 0], [0, 1, 0], [0, 0, 2]],
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
    ],
    ids=["scaled", "mirrored", "mirrored and rotated", "flat", "zero"],
)
def test_matrices_are_decomposed(linear):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, (1, 2, 3)
    tree = with_matrix(matrix)
    assert not tree.matrices
    assert np.linalg.norm(tree.rotations[0]) == pytest.approx(1.0)
    assert np.abs(local(tree, 0) - matrix).max() < 1e-14


def test_sheared_matrices_are_kept_exactly():
    matrix = np.array([[1, 0.5, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1.0]])
    tree = with_matrix(matrix)
    assert tree.matrices[0].tolist() == matrix.tolist()
    assert tree.translations.tolist() == [[0, 0, 0]] and tree.scales.tolist() == [[1, 1, 1]]


def test_rounding_is_not_treated_as_shear():
    # A rotation by 30 degrees, rounded to six digits as by exporters to text.
    matrix = np.eye(4)
    matrix[:2, :2] = [[0.866025, -0.5], [0.5, 0.866025]]
    assert not with_matrix(matrix).matrices


@pytest.mark.parametrize(
    ("nodes", "key", "pointer"),
    [
        ([{"children": [1]}, {"children": [0]}], "F002.gltf-cycle", "/nodes/1/children"),
        ([{"children": [0]}], "F002.gltf-cycle", "/nodes/0/children"),
        ([{"children": [2]}, {"children": [2]}, {}], "F002.gltf-parents", "/nodes/1/children/0"),
        ([{"children": [1]}], "F002.gltf-index", "/nodes/0/children/0"),
        ([{"children": [-1]}], "F002.gltf-type", "/nodes/0/children/0"),
        ([{"children": 3}], "F002.gltf-type", "/nodes/0/children"),
        ([7], "F002.gltf-type", "/nodes/0"),
        ([{}, {"mesh": 0}], "F002.gltf-index", "/nodes/1/mesh"),
        ([{"name": 5}], "F002.gltf-type", "/nodes/0/name"),
        ([{}, {"translation": [0, 1]}], "F002.gltf-type", "/nodes/1/translation"),
        ([{"scale": [1, 1, "1"]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, True]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, 10**400]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"scale": [1, 1, math.nan]}], "F002.gltf-type", "/nodes/0/scale/2"),
        ([{"matrix": [1] * 15}], "F002.gltf-type", "/nodes/0/matrix"),
        ([{"matrix": [1] * 16}], "F002.gltf-affine", "/nodes/0/matrix"),
    ],
)
def test_invalid_nodes_are_refused(nodes, key, pointer):
    assert refused(File(nodes=nodes)) == (key, pointer)


def test_all_errors_are_reported_if_errors_are_collected():
    nodes = [{"children": [1, 1]}, {"children": [0]}, {"children": [1]}]
    source = Source("a.gltf", File(nodes=nodes).json(), diagnostics=Collector(keeps_errors=True))
    tree = read_nodes(source).tree
    assert [found.key for found in source.diagnostics.errors] == [
        "F002.gltf-parents",
        "F002.gltf-cycle",
    ]
    assert tree.parents.tolist() == [-1, 0, -1]


def test_deep_trees_are_read_without_recursion():
    count = 20_000
    nodes = [{"children": [index + 1]} for index in range(count - 1)] + [{}]
    tree = read(File(nodes=nodes)).tree
    assert tree.parents.tolist() == list(range(-1, count - 1))


def test_matrix_overrides_other_transforms():
    columns = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]
    file = File(nodes=[{"matrix": columns, "translation": [1, 1, 1]}])
    assert read(file).tree.translations.tolist() == [[5, 0, 0]]
    assert warned(file) == [("G003.matrix-and", "/nodes/0/matrix")]


def test_shown_roots_are_those_of_the_default_or_first_scene():
    nodes = [{"children": [1]}, {}, {}, {}]
    scenes = [{"nodes": [2]}, {"name": "main", "nodes": [3, 0]}]
    assert read(File(nodes=nodes)).roots == (0, 2, 3)
    assert read(File(nodes=nodes, scenes=scenes)).roots == (2,)
    file = File(nodes=nodes, scenes=scenes, scene=1)
    assert read(file).roots == (3, 0)
    assert warned(file) == [("F007.gltf-scenes", "/scenes")]
    file = File(nodes=nodes, scenes=[{"nodes": [1]}])
    assert read(file).roots == (0,)
    assert warned(file) == [("G003.scene-child", "/scenes/0/nodes")]
    assert read(File(nodes=nodes, scenes=[{}])).roots == (0, 2, 3)
    assert refused(File(nodes=nodes, scene=0)) == ("F002.gltf-index", "/scene")


def test_cameras_are_read():
    file = File(
        nodes=[{"camera": 1}],
        cameras=[
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 2}},
            {"name": "flat", "type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2}},
            {"type": "perspective", "perspective": {"yfov": 0}},
        ],
    )
    content = read(file)
    near, flat, _ = content.cameras
    assert (near.vertical_angle, near.aspect) == (0.5, 2.0)
    assert (flat.name, flat.vertical_angle, flat.height, flat.aspect) == ("flat", None, 4.0, 1.5)
    assert content.tree.cameras.tolist() == [1]
    assert warned(file) == [("G003.camera", "/cameras/2/perspective/yfov")]


def test_application_data_are_preserved():
    file = File(nodes=[{}], extras=[1], extensions={"VRMC_vrm": {"specVersion": "1.0"}})
    file.root["asset"]["generator"] = "by hand"
    content = read_nodes(source_of(file, "folder/hero.gltf"))
    assert (content.name, content.up, content.unit) == ("hero", "y", "m")
    assert content.extras == [1] and content.asset["generator"] == "by hand"
    assert content.extensions == {"VRMC_vrm": {"specVersion": "1.0"}}


SIZE = 640, 480
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def carried() -> File:
    """Return a file whose second joint, one unit above the first, carries a camera on a helper.

    The joint rotates by 90 degrees about z, and the camera is 3 units to the side of the helper.
    """
    file = skinned()
    file.root["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"name": "root", "children": [2]},
        {"name": "tip", "translation": [0, 1, 0], "children": [3]},
        {"name": "helper", "translation": [0, 2, 0], "children": [4]},
        {"name": "eye", "translation": [3, 0, 0], "camera": 0},
    ]
    lens = {"yfov": 0.8, "aspectRatio": SIZE[0] / SIZE[1], "znear": 0.1}
    file.root["cameras"] = [{"type": "perspective", "perspective": lens}]
    keys = file.accessor([[0, 0, 0, 1], [0, 0, HALF, HALF]])
    samplers = [{"input": file.times([0.0, 1.0]), "output": keys}]
    channels = [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]
    file.root["animations"] = [{"channels": channels, "samplers": samplers}]
    return file


def saved(file: File, folder: Path) -> Path:
    path = folder / "a.glb"
    path.write_bytes(file.glb())
    return path


def center(view: Any) -> np.ndarray:
    return -view.rotation.T @ view.translation


def test_camera_moves_with_its_joint(tmp_path):
    scene = viewer.load(saved(carried(), tmp_path))
    (view,) = scene.views
    assert_allclose(center(view_in(view, scene)), [3, 3, 0], atol=1e-12)
    scene.time = 1.0
    pose_actors([scene.actors[0]], 1.0)
    # (3, 2, 0) from the joint, rotated by 90 degrees about z.
    there = view_in(view, scene)
    assert_allclose(center(there), [-2, 4, 0], atol=1e-12)
    # The camera looks along -z as before, but its right side points up.
    assert_allclose(there.rotation, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    (drawn,) = drawn_cameras(scene, None, DisplayOptions(cameras=True))
    assert_allclose(center(drawn), [-2, 4, 0], atol=1e-12)


def test_view_through_a_camera_follows_its_joint(tmp_path):
    scene = viewer.load(saved(carried(), tmp_path))
    (view,) = scene.views
    camera = camera_from_view(view, SIZE, "y", seen=view_in(view, scene))
    pose_actors([scene.actors[0]], 1.0)
    follow_view(camera, SIZE, scene, BOX)
    assert camera.fixed is view
    assert_allclose(np.linalg.inv(camera.view_matrix())[:3, 3], [-2, 4, 0], atol=1e-12)


def test_projection_is_that_of_gltf(tmp_path):
    (view,) = viewer.load(saved(carried(), tmp_path)).views
    camera = camera_from_view(view, SIZE, "y")
    # x / (a tan(yfov / 2)) and y / tan(yfov / 2), divided by the distance 4 along -z.
    x, y, _, w = camera.projection_matrix(SIZE[0] / SIZE[1], BOX) @ [0.5, 0.25, -4.0, 1.0]
    reach = math.tan(0.4) * 4.0
    assert x / w == pytest.approx(0.5 / (reach * SIZE[0] / SIZE[1]), abs=1e-12)
    assert y / w == pytest.approx(0.25 / reach, abs=1e-12)


@pytest.mark.parametrize("options", [(), ("--fps", "20")], ids=["keys", "frames"])
def test_camera_is_written_below_its_joint(tmp_path, options):
    path = tmp_path / "b.glb"
    source = saved(carried(), tmp_path)
    assert run(["convert", str(source), "-o", str(path), *options]) == 0
    root = Evaluator(path).root
    nodes = root["nodes"]
    (eye,) = [place for place, node in enumerate(nodes) if "camera" in node]
    (above,) = [node for node in nodes if eye in node.get("children", ())]
    assert above["name"] in ("tip", "helper") and eye not in root["scenes"][0]["nodes"]
    assert root["cameras"][0]["perspective"]["yfov"] == pytest.approx(0.8, abs=1e-12)
    scene = viewer.load(path)
    pose_actors([scene.actors[0]], 1.0)
    assert_allclose(center(view_in(scene.views[0], scene)), [-2, 4, 0], atol=1e-6)


def test_node_around_a_figure_is_no_loss_of_files_of_this_program(tmp_path, capsys):
    Path(tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    first, again = str(tmp_path / "a.glb"), str(tmp_path / "b.glb")
    assert run(["convert", str(tmp_path / "one.obj"), "-o", first]) == 0
    assert run(["convert", first, "-o", again]) == 0
    assert "not copied" not in capsys.readouterr().out


def test_helper_nodes_that_are_not_written_are_named(tmp_path, capsys):
    file = skinned()
    file.root["nodes"] += [
        {"name": "Armature", "children": [0, 1], "extras": {"kind": 1}},
        {"name": "Empty", "translation": [7, 7, 7]},
    ]
    file.root["scenes"], file.root["scene"] = [{"nodes": [3, 4]}], 0
    source = saved(file, tmp_path)
    assert run(["convert", str(source), "-o", str(tmp_path / "b.glb")]) == 0
    assert (
        "2 nodes of the original file without a joint, mesh or camera are not copied: "
        "Armature (with extras), Empty"
    ) in capsys.readouterr().out


def dolly(only: bool = False) -> File:
    """Return a figure beside a camera, 1 unit to the side of a node that animation 0 moves.

    The node slides from x = 0 to 4 at z = 5 and rotates by 90 degrees about y in one second.
    ``only``: the figure is still.
    """
    file = skinned()
    file.root["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"name": "root", "children": [2]},
        {"name": "tip", "translation": [0, 1, 0]},
        {"name": "dolly", "translation": [0, 0, 5], "children": [4]},
        {"name": "eye", "translation": [1, 0, 0], "camera": 0},
    ]
    lens = {"yfov": 0.8, "aspectRatio": SIZE[0] / SIZE[1], "znear": 0.1}
    file.root["cameras"] = [{"type": "perspective", "perspective": lens}]
    times = file.times([0.0, 1.0])
    rows = {
        (3, "translation"): [[0, 0, 5], [4, 0, 5]],
        (3, "rotation"): [[0, 0, 0, 1], [0, HALF, 0, HALF]],
        (2, "rotation"): [[0, 0, 0, 1], [0, 0, HALF, HALF]],
    }
    samplers, channels = [], []
    for (node, path), values in list(rows.items())[: 2 if only else 3]:
        target = {"node": node, "path": path}
        channels.append({"sampler": len(samplers), "target": target})
        samplers.append({"input": times, "output": file.accessor(values)})
    file.root["animations"] = [{"name": "Shot", "channels": channels, "samplers": samplers}]
    return file


# Rotated by 45 and 90 degrees about y, (1, 0, 0) is (c, 0, -c) and (0, 0, -1), from (2, 0, 5) and
# (4, 0, 5).
PATH = {0.0: [1, 0, 5], 0.5: [2 + HALF, 0, 5 - HALF], 1.0: [4, 0, 4]}


def assert_path(path: Path, atol: float = 1e-12) -> None:
    scene = viewer.load(path)
    for seconds, place in PATH.items():
        scene.time = seconds
        pose_actors([scene.actors[0]], seconds)
        assert_allclose(center(view_in(scene.views[0], scene)), place, atol=atol)


@pytest.mark.parametrize("only", [False, True])
def test_animated_nodes_beside_figures_move_a_camera(tmp_path, only, capsys):
    source = saved(dolly(only), tmp_path)
    assert_path(source, 1e-7)
    assert run(["info", str(source)]) == 0
    said = capsys.readouterr()
    assert "Shot: 0 to 1 s" in said.out and "omitted" not in said.out + said.err


def test_camera_keeps_its_own_animation_below_a_still_joint(tmp_path):
    file = dolly()
    # The camera itself is animated, below a joint at (0, 1, 0) that stays at rest.
    file.root["nodes"][2]["children"] = [4]
    del file.root["nodes"][3]["children"]
    eye = file.root["animations"][0]
    eye["channels"] = [{"sampler": 0, "target": {"node": 4, "path": "translation"}}]
    scene = viewer.load(saved(file, tmp_path))
    scene.time = 1.0
    pose_actors([scene.actors[0]], 1.0)
    assert_allclose(center(view_in(scene.views[0], scene)), [4, 1, 5], atol=1e-12)


def test_animated_cameras_are_written_with_their_keys(tmp_path, capsys):
    source, path = saved(dolly(), tmp_path), tmp_path / "b.glb"
    assert run(["convert", str(source), "-o", str(path)]) == 0
    said = capsys.readouterr().out
    assert "first frame" not in said and "not copied" not in said
    assert_path(path, 1e-6)
    # A pose has the camera where it is then.
    assert run(["convert", str(source), "--time", "1", "-o", str(path), "--force"]) == 0
    (view,) = viewer.load(path).views
    assert view.mount is None
    assert_allclose(center(view), [4, 0, 4], atol=1e-6)


@pytest.mark.parametrize(("only", "options"), [(True, ()), (False, ("--fps", "20"))])
def test_camera_motions_that_are_not_written_are_named(tmp_path, only, options, capsys):
    source, path = saved(dolly(only), tmp_path), tmp_path / "b.glb"
    assert run(["convert", str(source), "-o", str(path), *options]) == 0
    assert "1 camera is written at the first frame only, without its motion: eye" in (
        capsys.readouterr().out
    )


def test_videos_frame_the_whole_path_of_a_carried_camera(tmp_path):
    scene = viewer.load(saved(dolly(), tmp_path))
    options = DisplayOptions(cameras=True)
    times = np.array([0.0, 1.0])
    camera = camera_from_view(scene.views[0], SIZE, "y")
    recording = Recording(scene, times, camera, SIZE, options)
    points = np.zeros((1, 3)), np.array([[1.0, 1.0, 1.0]])
    framed = with_cameras(scene, options, np.concatenate(points), framed_poses(recording))
    # Frusta begin at the centres of the cameras, of which both ends of the path are framed.
    for seconds in (0.0, 1.0):
        assert np.abs(framed - PATH[seconds]).max(axis=1).min() < 1e-6
