"""Figures in centimetres and other units, written by every exporter that handles units."""

import json
from dataclasses import replace

import faults
import numpy as np
import pytest
from builders import rotation
from exporting import export_frames
from formats.bvh_text import PERSON_JOINTS, PERSON_TURNED, person
from numpy.testing import assert_allclose
from plain_bvh import PlainBvh
from plain_gltf import Gltf
from seamed import POSITIONS, seamed_actor

import viewer
from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import ExportOptions, export
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton

GUESS = "centimetres assumed (skeleton 170 high); --unit overrides it"
TO_Z = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up


@pytest.fixture
def walk(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(person(100.0))
    return path


def take_in(path):
    (actor,) = viewer.load(path).actors
    return sample_animation(actor)


def bvh_places(path, frame=1):
    found = PlainBvh(path).places(frame)
    return [found[name] for name in PERSON_JOINTS]


@pytest.mark.parametrize(
    ("options", "factor", "word"),
    [
        ([], 100.0, "centimetres"),
        (["--to-unit", "m"], 1.0, "metres"),
        (["--to-unit", "mm"], 1000.0, "millimetres"),
        (["--to-unit", "in"], 1 / 0.0254, "inches"),
    ],
)
def test_estimated_unit_is_used_for_bvh_and_reported_once(
    walk, tmp_path, capsys, options, factor, word
):
    out = tmp_path / "out.bvh"
    assert run(["convert", str(walk), "-o", str(out), *options]) == 0
    assert_allclose(bvh_places(out), factor * np.array(PERSON_TURNED), rtol=0, atol=2e-6)
    text, error = capsys.readouterr()
    assert error == f"note: {walk}: {GUESS}\n"
    lines = text.splitlines()
    assert len(lines) == 1 and f", {word}, y up" in lines[0]


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254)]
)
def test_requested_unit_is_used_without_a_note(walk, tmp_path, capsys, unit, metres):
    out = tmp_path / "out.bvh"
    assert run(["convert", str(walk), "--unit", unit, "--to-unit", "m", "-o", str(out)]) == 0
    wanted = 100.0 * metres * np.array(PERSON_TURNED)
    assert_allclose(bvh_places(out), wanted, rtol=0, atol=2e-6)
    text, error = capsys.readouterr()
    assert error == "" and "differ" not in text


def test_error_in_millimetres_uses_the_unit_of_the_file(tmp_path):
    # Rounding removes the 0.04 cm of each coordinate, 0.4 mm along each axis.
    skeleton = ball_skeleton(("a", "b"), np.array([-1, 0]), np.array([[0, 0, 0], [0, 100.0, 0]]))
    turns = np.tile([0.0, 0, 0, 1], (1, 2, 1))
    shifts = np.array([[[7.04, 0.0, 0.0], [0.0, 0.0, 0.0]]])
    clip = SampledClip("a", Timing(30.0, np.arange(1)), turns, translations=shifts)
    for unit, millimetres in (("cm", 10.0), ("mm", 1.0), ("in", 25.4)):
        animation = sample_animation(Actor(Figure("a", skeleton=skeleton, unit=unit), clip=clip))
        options = ExportOptions(unit=unit, digits=1)
        notes = faults.lines(export_frames(animation, tmp_path / "a.bvh", "bvh", options))
        assert f"joints differ from the motion by up to {0.04 * millimetres:.3g} mm (" in notes[1]


def test_gltf_of_centimetres_is_in_metres(walk, tmp_path, capsys):
    for name, options in (("motion.glb", []), ("pose.gltf", ["--time", "0.1"])):
        assert run(["convert", str(walk), "-o", str(tmp_path / name), *options]) == 0
        text, error = capsys.readouterr()
        assert error == f"note: {walk}: {GUESS}\n"
        assert text.splitlines()[-1] == (
            "lengths are in centimetres: a node above the figure scales them to metres by 0.01"
        )
        gltf = Gltf(tmp_path / name)
        world = gltf.world(0.1) if name == "motion.glb" else gltf.world()
        found = [world[gltf.named(joint), :3, 3] for joint in PERSON_JOINTS]
        assert_allclose(found, PERSON_TURNED, rtol=0, atol=1e-6)
        assert gltf.nodes[gltf.top(gltf.named("pelvis"))]["name"] == "centimetres"


def test_gltf_in_requested_metres_has_no_scale_node(walk, tmp_path, capsys):
    assert run(["convert", str(walk), "--unit", "cm", "-o", str(tmp_path / "a.glb")]) == 0
    gltf = Gltf(tmp_path / "a.glb")
    assert gltf.nodes[0]["name"] == "walk" and gltf.top(gltf.named("pelvis")) == 0
    world = gltf.world(0.1)
    found = [world[gltf.named(joint), :3, 3] for joint in PERSON_JOINTS]
    assert_allclose(found, PERSON_TURNED, rtol=0, atol=1e-6)
    assert capsys.readouterr().err == ""


def test_gltf_rotates_and_scales_a_skinned_mesh_with_one_node(tmp_path):
    actor = seamed_actor(unit="in", up="z")
    actor.pose.figure_translation[:], actor.pose.figure_scale = [1, 2, 3], 2.0
    notes = faults.lines(export(actor, tmp_path / "a.glb"))
    gltf = Gltf(tmp_path / "a.glb")
    order = np.unique(np.round(gltf.vertices()[0], 6), axis=0)
    wanted = 0.0254 * (2 * POSITIONS + [1, 2, 3]) @ TO_Z  # (x, y, z) -> (x, z, -y)
    assert_allclose(order, np.unique(np.round(wanted, 6), axis=0), rtol=0, atol=2e-6)
    assert gltf.named("z up, inches") == gltf.top(gltf.named("root"))
    assert "lengths are in inches: a node above the figure scales them to metres by 0.0254" in notes


# The SMPL family is in metres.

ROOT = np.array([1.0, 95.0, 2.0])  # centimetres: J0


def smpl_animation(unit="cm", n_frames=3):
    """Return a bare skeleton with the joints of SMPL, joint positions and root rotations."""
    names = FAMILY[24].names
    joints = ROOT + np.arange(24)[:, None] * [0.0, 3.0, 0.5]
    parents = np.arange(24) - 1
    rng = np.random.default_rng(11)
    vectors = rng.uniform(-0.8, 0.8, (n_frames, 24, 3))
    shifts = np.zeros((n_frames, 24, 3))
    shifts[:, 0] = rng.uniform(-200, 200, (n_frames, 3))
    turns = rotation_vector_to_quaternion(vectors)
    clip = SampledClip("walk", Timing(30.0, np.arange(n_frames)), turns, translations=shifts)
    figure = Figure("walk", skeleton=ball_skeleton(names, parents, joints), unit=unit)
    return sample_animation(Actor(figure, clip=clip)), vectors, ROOT + shifts[:, 0]


@pytest.mark.parametrize("up", ["", "z"])
def test_amass_of_a_skeleton_is_in_metres_relative_to_its_root(tmp_path, up):
    animation, vectors, places = smpl_animation()
    notes = faults.lines(
        export_frames(animation, tmp_path / "a.npz", "amass", ExportOptions(up=up))
    )
    turn = TO_Z if up else np.eye(3)
    with np.load(tmp_path / "a.npz") as arrays:
        for frame in range(3):
            # For the pelvis X = J0, V = R (X - J0) + J0 + transl is its position.
            found = 0.01 * ROOT + arrays["trans"][frame]
            assert_allclose(found, 0.01 * turn @ places[frame], rtol=0, atol=1e-12)
            poses = arrays["poses"][frame].reshape(24, 3)
            assert_allclose(poses[1:], vectors[frame, 1:], rtol=0, atol=1e-12)
            expected = turn @ rotation(vectors[frame, 0])
            assert_allclose(rotation(poses[0]), expected, rtol=0, atol=1e-12)
    assert notes[1:] == [
        "lengths were converted from centimetres to metres",
        "translations are relative to the root at rest, (0.01, 0.95, 0.02) m: a model whose root "
        "is elsewhere is offset (--model makes translations exact)",
    ]


def test_easymocap_of_a_skeleton_rotates_about_the_origin(tmp_path):
    animation, vectors, places = smpl_animation()
    notes = faults.lines(export_frames(animation, tmp_path / "out", "easymocap", ExportOptions()))
    for frame in range(3):
        (record,) = json.loads((tmp_path / "out" / "smpl" / f"{frame:06}.json").read_text())
        # For the pelvis X = J0, the position is V = R X + T.
        found = rotation(np.array(record["Rh"][0])) @ (0.01 * ROOT) + record["Th"][0]
        assert_allclose(found, 0.01 * places[frame], rtol=0, atol=1e-6)
        assert_allclose(record["Rh"][0], vectors[frame, 0], rtol=0, atol=1e-6)
    assert notes[1] == "lengths were converted from centimetres to metres"


@pytest.mark.parametrize(
    ("kind", "what"), [("amass", "an AMASS motion"), ("easymocap", "an EasyMocap folder")]
)
def test_skeletons_of_unknown_unit_are_refused(tmp_path, kind, what):
    animation, _, _ = smpl_animation("")
    with pytest.raises(RigError) as caught:
        export_frames(animation, tmp_path / "out.npz", kind, ExportOptions())
    assert str(caught.value) == (
        f"walk cannot be written as {what}, which is in metres: its unit is unknown (for a BVH, "
        "--unit sets it)"
    )
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(("kind", "title"), [("amass", "AMASS"), ("easymocap", "EasyMocap")])
def test_units_other_than_metres_are_refused_for_the_smpl_family(tmp_path, kind, title):
    animation, _, _ = smpl_animation("m")
    with pytest.raises(RigError) as caught:
        export_frames(animation, tmp_path / "out.npz", kind, ExportOptions(unit="cm"))
    assert str(caught.value) == f'unit of {title}: expected m, found "cm"'
    assert not any(tmp_path.iterdir())
    assert export_frames(animation, tmp_path / "out.npz", kind, ExportOptions(unit="m"))


def test_obj_states_its_unit(tmp_path):
    actor = seamed_actor(unit="cm")
    export(actor, tmp_path / "a.obj")
    assert (tmp_path / "a.obj").read_text().startswith("# roof: y up, centimetres\n")
    export(Actor(replace(actor.figure, unit="")), tmp_path / "a.obj")
    assert (tmp_path / "a.obj").read_text().startswith("# roof: y up\n")


def test_end_sites_without_bones_have_equal_length_in_any_unit(tmp_path):
    skeleton = ball_skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    turns = np.tile([0.0, 0, 0, 1], (1, 1, 1))
    clip = SampledClip("a", Timing(30.0, np.arange(1)), turns)
    for unit in ("m", "cm", "mm", "in"):
        animation = sample_animation(Actor(Figure("a", skeleton=skeleton, unit=unit), clip=clip))
        export_frames(animation, tmp_path / "a.bvh", "bvh", ExportOptions(unit="m"))
        assert_allclose(PlainBvh(tmp_path / "a.bvh").ends[0], [0, 0.05, 0], rtol=0, atol=1e-6)
