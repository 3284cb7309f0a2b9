"""Curves of ``.fbx``: extrapolation, fast rotations, weights of blend shapes."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from formats.fbx.tiny_fbx import QUAD_5000, write_joints, write_strip, write_two_strips
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.formats.fbx.contents import target_weights
from viewer.linting import lint_files
from viewer.rigs.captures.carried_view import view_in
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skinning import Skinning, file_method

pytestmark = pytest.mark.skipif(find_spec("ufbx") is None, reason="ufbx is not installed")


def posed(actor: Actor, time: float) -> np.ndarray:
    """Return the vertices of an actor at one time of its clip."""
    actor.clip = actor.figure.animations[0].clip()
    pose_actors([actor], time)
    return viewer.deform(actor.figure, actor.pose)[0]


def continued(side: str, kind: str) -> str:
    return f"{side}-Extrapolation:  {{\n Type: {kind}\n Repetition: -1\n }}"


CURVES = {
    "hold": ("0 0.5", "0 40", 4, ""),
    "repeat": ("0 0.5", "0 40", 4, continued("Post", "R")),
    "mirror": ("0 0.5", "0 40", 4, continued("Post", "M")),
    "slope": ("0 0.5", "0 40", 4, continued("Post", "K")),
    "relative": ("0 0.5", "0 40", 4, continued("Post", "A")),
    "before": ("1.6 2", "0 40", 4, continued("Pre", "R")),
    "spin": ("0 2", "0 14400", 4, ""),
    "step": ("0 0.5 1", "0 40 40", 2, ""),
}


@pytest.fixture(scope="module")
def joints(tmp_path_factory: pytest.TempPathFactory) -> Actor:
    """Return joints that rotate by the curves above for 2 seconds."""
    (actor,) = viewer.load(write_joints(tmp_path_factory.mktemp("fbx"), CURVES, 2.0)).actors
    return actor


def angle(actor: Actor, name: str, time: float) -> float:
    """Return the angle of a joint about z, in degrees."""
    actor.clip = actor.figure.animations[0].clip()
    pose_actors([actor], time)
    skeleton = actor.figure.require_skeleton()
    world = world_matrices(skeleton, actor.pose)[skeleton.names.index(name)]
    return float(np.degrees(np.arctan2(world[1, 0], world[0, 0])))


@pytest.mark.parametrize(
    ("name", "angles"),
    [
        # 80 degrees per second up to 0.5 s; then as the curve says.
        ("hold", [40.0, 40.0, 40.0, 40.0]),
        ("repeat", [8.0, 8.0, 32.0, 16.0]),
        ("mirror", [32.0, 8.0, 32.0, 24.0]),
        ("slope", [48.0, 88.0, 112.0, 136.0]),
        ("relative", [48.0, 88.0, 112.0, 136.0]),
        # 100 degrees per second from 1.6 to 2 s, and the same before.
        ("before", [20.0, 30.0, 20.0, 10.0]),
        ("step", [40.0, 40.0, 40.0, 40.0]),
    ],
)
def test_curves_continue_as_they_say(joints, name, angles):
    # Keys are in single precision, and slopes of lines are measured over 1 ms.
    found = [angle(joints, name, time) for time in (0.6, 1.1, 1.4, 1.7)]
    assert_allclose(found, angles, atol=1e-4)


def test_a_spin_of_more_than_a_half_rotation_per_frame_keeps_its_direction(joints):
    # 20 rotations per second are 300 degrees per frame.
    assert angle(joints, "spin", 0.25 / 24) == pytest.approx(75.0, abs=1e-3)
    assert angle(joints, "spin", 10.5 / 24) == pytest.approx(-90.0, abs=1e-3)


def test_steps_jump_at_their_keys(joints):
    assert_allclose([angle(joints, "step", t) for t in (0.499, 0.501)], [0.0, 40.0], atol=1e-4)


def write_waves(folder: Path, frames: np.ndarray) -> Path:
    """Write joints with a key per frame at 24 fps; one angle is wrapped into -180 to 180."""
    times = " ".join(f"{number / 24:.12g}" for number in range(len(frames)))
    waves = {f"wave{n}": 60.0 * np.sin(0.1 * n * frames + n) for n in range(1, 6)}
    waves["wheel"] = (5.0 * frames + 180.0) % 360.0 - 180.0
    curves = {
        name: (times, " ".join(f"{angle:.6f}" for angle in angles), 4, "")
        for name, angles in waves.items()
    }
    path = write_joints(folder, curves, (len(frames) - 1) / 24.0)
    # The joints have a size, as checks of motions need it.
    place = 'Properties70: { P: "Lcl Translation", "Lcl Translation", "", "A",0,10,0 }'
    head = '"Model::wheel", "LimbNode" { Version: 232'
    text = path.read_text()
    assert head in text
    path.write_text(text.replace(head, f"{head}\n{place}"))
    return path


def test_samples_between_frames_do_not_change_the_rate(tmp_path, capsys):
    path = write_waves(tmp_path, np.arange(61.0))
    (actor,) = viewer.load(path).actors
    clip = actor.figure.animations[0].clip()
    (wheel,) = [each for each in clip.channels if each.key_times is not None]
    # At frame 36, the wheel returns from 175 to -180 degrees within a frame, in steps of 45.
    assert len(wheel.times) == len(wheel.own_times) + 7
    assert clip.frame_rate == 24.0
    assert run(["info", str(path)]) == 0
    assert "keys from 0 to 2.5 s at 24 fps" in capsys.readouterr().out
    output = tmp_path / "waves.bvh"
    assert run(["convert", str(path), "-o", str(output)]) == 0
    assert "Frames: 61\nFrame Time: 0.0416666" in output.read_text()


def test_frozen_frames_are_found_at_the_rate_of_the_file(tmp_path):
    frames = np.arange(61.0)
    assert "C021" not in {each.code for each in lint_files([write_waves(tmp_path, frames)])[1]}
    frames[20:30] = 19.0
    found = [each for each in lint_files([write_waves(tmp_path, frames)])[1] if each.code == "C021"]
    assert [each.frames.tolist() for each in found] == [list(range(20, 30))]


def test_frames_beside_keys_between_frames_are_exact(tmp_path):
    # Frames 9 and 10 at 24 fps are at 0.375 and 0.417 s.
    path = write_joints(tmp_path, {"ease": ("0 0.405 1", "0 90 0", 1032, "")}, 1.0)
    (actor,) = viewer.load(path).actors
    frames = np.arange(25)
    # The curve states slopes of 0 (flags 8 and 1024), so an angle is 3 u^2 - 2 u^3 of the way at a
    # fraction u of the time.
    u = np.where(frames / 24.0 < 0.405, frames / 24.0 / 0.405, (1.0 - frames / 24.0) / 0.595)
    found = [angle(actor, "ease", frame / 24.0) for frame in frames.tolist()]
    assert_allclose(found, 90.0 * (3.0 * u**2 - 2.0 * u**3), atol=1e-4)


def test_blend_shapes_of_the_oldest_version_move(tmp_path):
    path = tmp_path / "quad.fbx"
    path.write_text(QUAD_5000)
    (actor,) = viewer.load(path).actors
    assert posed(actor, 0.5)[:, 0].max() == pytest.approx(1.25)


def test_weights_per_vertex_scale_a_blend_shape(tmp_path):
    edits = {
        "by hand": "Blender (stable FBX IO) - 2.79 (sub 0) - 3.7.13",
        "FullWeights: *1 { a: 100 }": "FullWeights: *2 { a: 100,20 }",
    }
    (actor,) = viewer.load(write_strip(tmp_path, edits=edits)).actors
    rest = actor.figure.require_mesh().positions
    moved = posed(actor, 1.0)
    foot = np.flatnonzero((rest == [1.0, 0.0, 0.0]).all(axis=1))[0]
    assert moved[foot].tolist() == pytest.approx([1.5, 0.0, 0.0])
    # The other vertex is halfway between both joints, and the upper one is at 90 degrees.
    knee = np.flatnonzero((rest == [1.0, 1.0, 0.0]).all(axis=1))[0]
    assert moved[knee].tolist() == pytest.approx([0.55, 1.0 + 0.55, 0.0], abs=1e-6)


def test_a_full_weight_below_100_scales_a_blend_shape(tmp_path):
    edits = {"FullWeights: *1 { a: 100 }": "FullWeights: *1 { a: 50 }"}
    (actor,) = viewer.load(write_strip(tmp_path, edits=edits)).actors
    assert actor.figure.rest_shape_weights.tolist() == [0.5]  # 25 of 50
    assert posed(actor, 0.5)[:, 0].max() == pytest.approx(1.5, abs=1e-6)


IN_BETWEEN = {
    'Geometry: 11, "Geometry::wide"': """Geometry: 12, "Geometry::half", "Shape" {
        Version: 100
        Indexes: *1 { a: 1 }
        Vertices: *3 { a: 0,-0.5,0 }
        Normals: *3 { a: 0,0,0 }
    }
    Geometry: 11, "Geometry::wide\"""",
    'C: "OO",11,44': 'C: "OO",12,44\n    C: "OO",11,44',
    "FullWeights: *1 { a: 100 }": "FullWeights: *2 { a: 60,100 }",
}


def test_in_between_targets_are_reached_on_the_way(tmp_path):
    (actor,) = viewer.load(write_strip(tmp_path, edits=IN_BETWEEN)).actors
    assert actor.figure.blend_shapes is not None
    assert actor.figure.blend_shapes.names == ("wide 60%", "wide")
    rest = actor.figure.require_mesh().positions
    foot = np.flatnonzero((rest == [1.0, 0.0, 0.0]).all(axis=1))[0]
    # The weight is the time: at 0.3 half of the first target, at 0.8 half of both.
    assert posed(actor, 0.3)[foot].tolist() == pytest.approx([1.0, -0.25, 0.0], abs=1e-6)
    assert posed(actor, 0.6)[foot].tolist() == pytest.approx([1.0, -0.5, 0.0], abs=1e-6)
    assert posed(actor, 0.8)[foot].tolist() == pytest.approx([1.25, -0.25, 0.0], abs=1e-6)


def test_weights_beyond_the_targets_are_extrapolated():
    found = target_weights(np.array([-0.5, 1.5]), [0.5, 1.0])
    assert_allclose(found, [[-1.0, 0.0], [-1.0, 2.0]])


def test_vertices_without_weights_follow_the_node_of_their_mesh(tmp_path):
    edits = {
        # The upper two vertices have no weights, and the node of the mesh moves instead of a joint.
        "Indexes: *4 { a: 2,3,4,5 }": "Indexes: *2 { a: 2,3 }",
        "Weights: *4 { a: 0.5,0.5,1,1 }": "Weights: *2 { a: 0.5,0.5 }",
        'C: "OP",52,22, "Lcl Rotation"': 'C: "OP",52,20, "Lcl Rotation"',
    }
    scene = viewer.load(write_strip(tmp_path, edits=edits))
    (actor,) = scene.actors
    rest = actor.figure.require_mesh().positions
    (bare,) = (one for one in lint_files(scene.files)[1] if one.code == "W004")
    assert_allclose(sorted(rest[bare.vertices].tolist()), [[0.0, 2.0, 0.0], [1.0, 2.0, 0.0]])
    moved = posed(actor, 1.0)
    for at, expected in (([1.0, 2.0, 0.0], [-2.0, 1.0, 0.0]), ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0])):
        (found, *_) = moved[(rest == at).all(axis=1)]
        assert_allclose(found, expected, atol=1e-6)


def test_animations_of_one_name_stay_with_their_figures(tmp_path):
    scene = viewer.load(write_two_strips(tmp_path))
    numbers = [[each.number for each in actor.figure.animations] for actor in scene.actors]
    assert numbers == [[0], [1]]
    for actor in scene.actors:
        assert posed(actor, 1.0)[:, 0].min() == pytest.approx(-1.0, abs=1e-6)
    # Both are written as animations of their own, although name and range are equal.
    out = tmp_path / "two.glb"
    assert run(["convert", str(tmp_path / "strip.fbx"), "-o", str(out)]) == 0
    written = viewer.load(out)
    assert [[each.number for each in a.figure.animations] for a in written.actors] == [[0], [1]]


CAMERA = {
    "    Material: 30,": """    Model: 60, "Model::Shot", "Camera" {
        Version: 232
        Properties70:  { P: "Lcl Translation", "Lcl Translation", "", "A",-5,1,0 }
    }
    NodeAttribute: 61, "NodeAttribute::Shot", "Camera" {
        Properties70:  {
            P: "FieldOfView", "FieldOfView", "", "A",90
            P: "ApertureMode", "enum", "", "",2
            P: "AspectWidth", "double", "Number", "",200
            P: "AspectHeight", "double", "Number", "",100
        }
    }
    Material: 30,""",
    'C: "OO",20,0': 'C: "OO",20,0\n    C: "OO",60,0\n    C: "OO",61,60',
}


def test_cameras_look_along_x_of_their_node(tmp_path):
    scene = viewer.load(write_strip(tmp_path, edits=CAMERA))
    (view,) = scene.views
    assert view.name == "Shot"
    # A vertical angle of 90 degrees sees half the height at half of it; the width is twice.
    assert view.intrinsic[1, 1] == pytest.approx(view.size[1] / 2)
    assert view.size[0] == 2 * view.size[1]
    # 3 in front of the camera at x = -5, 1 above it, and 2 to its right: x, -y and z of its axes.
    point = view.rotation @ [-2.0, 2.0, 2.0] + view.translation
    assert_allclose(point, [2.0, -1.0, 3.0], atol=1e-12)
    assert scene.actors[0].figure.require_skeleton().names == ("RootNode", "low", "high", "Shot")


def filmed(path: Path) -> Path:
    """Add curves to a file with a camera: the camera moves from x = -5 to -1 in one second."""
    text = path.read_text()
    head, rest = text.split("Objects:  {", 1)
    curve = """
    AnimationCurveNode: 70, "AnimCurveNode::T", "" {
        Properties70:  { P: "d|X", "Number", "", "A",-5
            P: "d|Y", "Number", "", "A",1 }
    }
    AnimationCurve: 71, "AnimCurve::", "" {
        Default: -5
        KeyVer: 4008
        KeyTime: *2 { a: 0,46186158000 }
        KeyValueFloat: *2 { a: -5,-1 }
        KeyAttrFlags: *1 { a: 4 }
        KeyAttrDataFloat: *4 { a: 0,0,0,0 }
        KeyAttrRefCount: *1 { a: 2 }
    }"""
    links = """    C: "OO",70,51
    C: "OP",70,60, "Lcl Translation"
    C: "OP",71,70, "d|X"
"""
    rest = rest.replace("Connections:  {\n", "Connections:  {\n" + links)
    path.write_text(f"{head}Objects:  {{{curve}{rest}")
    return path


@pytest.mark.parametrize("write", [write_strip, write_two_strips])
def test_animated_cameras_move(tmp_path, write):
    path = write(tmp_path)
    text = path.read_text()
    for old, new in CAMERA.items():
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    scene = viewer.load(filmed(path))
    (view,) = scene.views
    for seconds, x in ((0.0, -5.0), (0.5, -3.0), (1.0, -1.0)):
        scene.time = seconds
        pose_actors(scene.actors, seconds)
        there = view_in(view, scene)
        assert_allclose(-there.rotation.T @ there.translation, [x, 1.0, 0.0], atol=1e-6)


def skinned_by(kind: str, more: str = "") -> dict[str, str]:
    old = 'Deformer: 40, "Deformer::Skin", "Skin" { Version: 101 }'
    return {old: old.replace("101 }", f'101\n        SkinningType: "{kind}"\n{more} }}')}


def test_skins_are_deformed_by_the_method_of_the_file(tmp_path):
    (actor,) = viewer.load(write_strip(tmp_path, edits=skinned_by("DualQuaternion"))).actors
    assert file_method([actor.figure]) == ("dqs", 0.5)
    (actor,) = viewer.load(write_strip(tmp_path)).actors
    assert file_method([actor.figure]) == ("lbs", 0.5)


def test_methods_are_blended_by_the_fraction_of_each_vertex(tmp_path):
    # Vertices 2 and 3, (1, 1) and (0, 1), are halfway between both joints.
    stated = "Indexes: *2 { a: 2,3 }\nBlendWeights: *2 { a: 0.25,1 }"
    (actor,) = viewer.load(write_strip(tmp_path, edits=skinned_by("Blend", stated))).actors
    assert file_method([actor.figure]) == ("mix", None)
    posed(actor, 1.0)
    found = viewer.deform(actor.figure, actor.pose, Skinning("mix", blend_factor=None))[0]
    rest = actor.figure.require_mesh().positions
    knee = found[(rest == [1.0, 1.0, 0.0]).all(axis=1)][0] - [0.0, 1.0, 0.0]
    # The blend shape is full: (1.5, 0) from the joint, which rotates by 90 degrees. LBS averages
    # with (0, 1.5); DQS rotates by 45 degrees.
    linear, dual = np.array([0.75, 0.75, 0.0]), np.array([1.5, 1.5, 0.0]) / np.sqrt(2.0)
    assert_allclose(knee, 0.75 * linear + 0.25 * dual, atol=1e-6)


@pytest.mark.parametrize("is_cut", [True, False])
def test_text_cut_before_its_takes_is_reported(tmp_path, is_cut, capsys):
    """Version 6100 ends with the animations, after the connections; all braces are closed."""
    text = QUAD_5000.replace("5.0.0", "6.1.0").replace("FBXVersion: 5000", "FBXVersion: 6100")
    head, takes = text.split("Takes:  {")
    start = 'Model: "Model::Quad" {'
    assert head.count(start) == 1
    objects = head.replace(start, 'Objects:  {\nModel: "Model::Quad", "Mesh" {')
    links = '}\nConnections:  {\n    Connect: "OO", "Model::Quad", "Model::Scene"\n}\n'
    path = tmp_path / "quad.fbx"
    path.write_text(objects + links + ("" if is_cut else "Takes:  {" + takes))
    assert run(["info", str(path)]) == 0
    said = capsys.readouterr()
    assert ("no section Takes before the end of the file" in said.out + said.err) is is_cut
    assert ("Move: 0 to 1 s" in said.out) is not is_cut
