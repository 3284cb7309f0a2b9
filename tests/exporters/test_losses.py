"""Reported export losses, which are the true maximum over all frames, joints and vertices."""

from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from builders import family_figure
from exporting import export_frames
from family_animations import family_animation, family_motion, waves
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose
from plain_bvh import PlainBvh
from plain_gltf import Gltf
from rigs import hand_made
from seamed import seamed_actor
from stretched import GROWTH, JOINTS, NAMES, POSITIONS, WEIGHTS, WORST, chain_animation

import viewer
from viewer.diagnostics import Diagnostic
from viewer.exporters import ExportOptions, export
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.evaluation import pose_of
from viewer.rigs.motion.sampled_animation import (
    SampledAnimation,
    sample_animation,
    upright_animation,
)
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import Animation
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform
from viewer.rigs.units import METRES

TOLD = 5e-3  # messages have three digits


def said(notes: list[Diagnostic]) -> dict[str, tuple[float, str]]:
    """Return size in mm and location of the only measured error of joints and vertices."""
    measured = errors(notes)
    assert len(measured) <= 1
    found = {}
    for note in measured:
        for what, part in (("joints", "joint"), ("vertices", "vertex")):
            if part in note.values:
                far = note.values[part].values
                place = far["joint"] if part == "joint" else f"vertex {far['vertex']}"
                place += f", frame {far['frame']}" if "frame" in far else ""
                found[what] = (1000.0 * METRES[far["unit"]] * far["distance"], place)
    return found


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("out.obj", ["the skeleton", "the skin"]),
        ("out.ply", ["the skeleton", "the skin"]),
        ("out.npz", ["the skin"]),
        ("out.skel", []),
    ],
)
def test_files_of_one_pose_name_the_parts_of_the_rig_that_they_cannot_hold(tmp_path, name, lost):
    figure = seamed_actor(blend_shapes=BlendShapes(("peak",), np.ones((1, 5, 3)))).figure
    moves = tuple(Animation(each, 0.0, 1.0, pytest.fail) for each in ("go", "stop"))
    notes = export(Actor(replace(figure, animations=moves)), tmp_path / name)
    (note,) = (note for note in notes if note.key == "X003.parts")
    lost = [*lost, "1 blend shape (the current shape is kept)", "2 animations"]
    assert [part for part in note.values["parts"] if part in lost] == lost


def errors(notes: list[Diagnostic]) -> list[Diagnostic]:
    """Return the measured errors of whole files."""
    keys = ("X002.joints", "X002.vertices", "X002.both")
    return [note for note in notes if note.key in keys]


def write(
    animation: SampledAnimation, folder: Path, kind: str, name: str, **options
) -> list[Diagnostic]:
    return export_frames(animation, folder / name, kind, ExportOptions(**options))


# Changing shapes


@pytest.mark.parametrize("unit", ["m", "cm", "in"])
def test_bvh_reports_joint_and_skin_errors_of_stretched_bones(tmp_path, unit):
    """Each bone grows by 0.1, so the highest joint is off by 0.2, and its vertex by 0.5."""
    animation = chain_animation(unit)
    found = said(write(animation, tmp_path, "bvh", "a.bvh", digits=9))
    metres = {"m": 1.0, "cm": 0.01, "in": 0.0254}[unit]
    assert found == {
        "joints": (pytest.approx(200 * metres, rel=TOLD), f"high, frame {WORST}"),
        "vertices": (pytest.approx(500 * metres, rel=TOLD), f"vertex 3, frame {WORST}"),
    }
    # A second reader verifies that the file has the bones of the first frame, rotated by 90
    # degrees.
    file = PlainBvh(tmp_path / "a.bvh")
    scale = metres / 0.01
    for joint, name in enumerate(NAMES):
        place = np.array(file.places(WORST)[name]) / scale
        assert_allclose(place, [-JOINTS[joint, 1], 0, 0], rtol=0, atol=1e-8 / scale)


def test_missing_frames_are_not_compared(tmp_path):
    rows = np.arange(len(WEIGHTS))
    rows[WORST] = -1
    whole = chain_animation()
    clip = replace(whole.motion, timing=Timing(10.0, rows))
    animation = sample_animation(Actor(whole.figure, clip=clip))
    for kind, name in (("bvh", "a.bvh"), ("gltf", "a.glb")):
        found = said(write(animation, tmp_path, kind, name))
        # The next frame has three quarters of the weight.
        assert found["joints"] == (pytest.approx(150, rel=TOLD), "high, frame 4")
        assert found["vertices"] == (pytest.approx(375, rel=TOLD), "vertex 3, frame 4")


def test_each_part_file_reports_its_losses(tmp_path):
    rows = np.array([0, 1, -1, 3, 4])
    whole = chain_animation()
    clip = replace(whole.motion, timing=Timing(10.0, rows))
    animation = sample_animation(Actor(whole.figure, clip=clip))
    for kind, suffix in (("bvh", "bvh"), ("gltf", "glb")):
        notes = write(animation, tmp_path, kind, f"a.{suffix}", gaps="split")
        found = errors(notes)
        assert [note.path for note in found] == [tmp_path / f"a-{i}.{suffix}" for i in (1, 2)]
        assert said(found[:1])["joints"] == (pytest.approx(100, rel=TOLD), "high, frame 1")
        assert said(found[1:])["joints"] == (pytest.approx(200, rel=TOLD), "high, frame 3")


def test_gltf_reports_the_same_loss_for_the_baked_shape(tmp_path):
    notes = write(chain_animation(), tmp_path, "gltf", "a.glb")
    assert said(notes) == {
        "joints": (pytest.approx(200, rel=TOLD), f"high, frame {WORST}"),
        "vertices": (pytest.approx(500, rel=TOLD), f"vertex 3, frame {WORST}"),
    }
    gltf = Gltf(tmp_path / "a.glb")
    drawn = gltf.vertices(WORST / 10)[0]
    wanted = (POSITIONS + GROWTH)[:, [1, 0, 2]] * [-1, 1, 1]  # rotated by 90 degrees about z
    assert_allclose(np.linalg.norm(drawn - wanted, axis=1), [0, 0.1, 0.2, 0.5], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_expressions_are_reported_as_lost_in_bvh(tmp_path):
    """The error of a skin on the joints in the file is calculated by plain formulas for SMPL-X."""
    figure = replace(family_figure("smplx", tmp_path), correctives=None)
    motion = family_motion(55, frames=12, expression=4.0 * waves(12, 10, seed=5.0))
    animation = family_animation(figure, motion)
    found = said(write(animation, tmp_path, "bvh", "a.bvh", unit="m", digits=12))
    file, names = PlainBvh(tmp_path / "a.bvh"), figure.skeleton.names
    weights = animation.frames.shape_weights
    shaped = viewer.rigs.shape.shaped(figure, weights[0])
    rest = viewer.rigs.shape.rest_joints(shaped)
    dense = np.zeros((figure.mesh.n_vertices, len(names)))
    owners = np.repeat(np.arange(len(dense)), np.diff(figure.skin.starts))
    np.add.at(dense, (owners, figure.skin.joints), figure.skin.weights)
    joints, vertices = [], []
    for frame in range(12):
        pose = pose_of(figure, animation.frames, frame)
        there = viewer.joint_matrices(figure, pose)[:, :3, 3]
        placed = file.joints(frame)
        turned, places = (np.array([placed[name][part] for name in names]) for part in (0, 1))
        joints.append(np.linalg.norm(there - places, axis=1))
        carried = np.einsum("jab,vjb->vja", turned, shaped.mesh.positions[:, None] - rest) + places
        driven = np.einsum("vj,vja->va", dense, carried)
        vertices.append(np.linalg.norm(deform(figure, pose)[0] - driven, axis=1))
    assert np.max(joints) > 0.001 and np.max(vertices) > np.max(joints)
    for what, off in (("joints", joints), ("vertices", vertices)):
        frame, index = np.unravel_index(np.argmax(off), np.shape(off))
        label = names[index] if what == "joints" else f"vertex {index}"
        size = pytest.approx(1000 * np.max(off), rel=TOLD)
        assert found[what] == (size, f"{label}, frame {frame}")


# Weights


def weighted(weights, count: int, peak: int, far: float) -> SampledAnimation:
    """Return one point at the origin of each joint; the last joint moves aside in one frame."""
    n_joints = len(weights[0])
    joints = np.zeros((n_joints, 3))
    points = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    mesh = Mesh(points, np.tile([0.0, 0, 1], (3, 1)), np.array([[0, 1, 2]]))
    rows = [[(j, w) for j, w in enumerate(row) if w] for row in weights]
    skin = skin_from_lists(rows, translation_matrix(-joints))
    parents = np.array([-1, *[0] * (n_joints - 1)])
    skeleton = ball_skeleton(tuple(f"j{j}" for j in range(n_joints)), parents, joints)
    turns = np.zeros((count, n_joints, 4))
    turns[..., 3] = 1.0
    moves = np.zeros((count, n_joints, 3))
    moves[peak, -1, 0] = far
    clip = SampledClip("jump", Timing(30.0, np.arange(count)), turns, translations=moves)
    return sample_animation(Actor(Figure("points", mesh, skeleton, skin, unit="m"), clip=clip))


@pytest.mark.parametrize("peak", [0, 7, 50, 101, 119])
def test_raw_weights_report_the_normalisation_error_in_the_worst_frame(tmp_path, peak):
    """Vertex 2 is at (0, 0, 1) with equal weights and a sum of 0.998. With normalised weights it is
    at (1.5, 0, 1) when the second joint is at x = 3; with stored weights at 0.998 of that.
    """
    weights = [(1.0, 0.0), (1.0, 0.0), (0.499, 0.499)]
    notes = write(weighted(weights, 120, peak, 3.0), tmp_path, "gltf", "a.glb")
    drawn = Gltf(tmp_path / "a.glb").vertices(peak / 30)[0]
    assert_allclose(drawn[2], [1.5, 0, 1], rtol=0, atol=1e-5)  # times are in single precision
    wanted = 1000 * 0.002 * np.hypot(1.5, 1.0)
    assert said(notes) == {"vertices": (pytest.approx(wanted, rel=TOLD), f"vertex 2, frame {peak}")}
    (note,) = errors(notes)
    assert note.values["causes"] == [
        ("weights of 1 vertex do not add up to 1: scaled, as glTF requires")
    ]


def test_requested_normalisation_is_compared_with_the_stored_weights(tmp_path):
    weights = [(1.0, 0.0), (1.0, 0.0), (0.499, 0.499)]
    animation = weighted(weights, 5, 2, 3.0)
    notes = write(animation, tmp_path, "gltf", "a.glb", skinning=Skinning(normalize=True))
    wanted = 1000 * 0.002 * np.hypot(1.5, 1.0)
    assert said(notes) == {"vertices": (pytest.approx(wanted, rel=TOLD), "vertex 2, frame 2")}
    (note,) = errors(notes)
    assert note.values["causes"] == ["weights are scaled to a sum of 1, as requested"]


@pytest.mark.parametrize("peak", [13, 77])
def test_four_influence_error_is_reported_for_the_worst_frame(tmp_path, peak):
    """The weakest of five influences, 0.05, is cut; its joint moves by 2 m."""
    row = (0.3, 0.3, 0.2, 0.15, 0.05)
    animation = weighted([row, (1.0, 0, 0, 0, 0), (1.0, 0, 0, 0, 0)], 100, peak, 2.0)
    notes = write(animation, tmp_path, "gltf", "a.glb")
    assert said(notes) == {}
    (note,) = [note for note in notes if note.key == "X002.first-influences"]
    assert note.values["most"] == 5 and note.values["distance"] == pytest.approx(0.1, rel=TOLD)
    cut = write(animation, tmp_path, "gltf", "b.glb", skinning=Skinning(max_influences=4))
    assert said(cut) == {"vertices": (pytest.approx(100.0, rel=TOLD), f"vertex 0, frame {peak}")}
    assert not any(note.key in ("X002.first-influences", "X005.influences") for note in cut)


def test_four_influence_error_is_measured_over_the_motion(tmp_path):
    """The weights sum to 0.95, and the joint of the weakest, 0.05, moves by 2 m along x in one
    frame. In the figure, vertex 1 moves from (0, 1, 0) to (0.1, 0.95, 0); with four normalised
    weights it does not move. With five normalised weights it would move to (0.1 / 0.95, 1, 0).
    """
    row = (0.3, 0.3, 0.2, 0.1, 0.05)
    animation = weighted([row, row, (1.0, 0, 0, 0, 0)], 20, 7, 2.0)
    notes = write(animation, tmp_path, "gltf", "a.glb")
    (note,) = [note for note in notes if note.key == "X002.first-influences"]
    assert note.values["distance"] == pytest.approx(np.hypot(0.1, 0.05), rel=TOLD)


def test_negligible_influences_are_reported_without_an_error(tmp_path):
    animation = weighted([(0.3, 0.3, 0.2, 0.15, 0.05)] * 3, 4, 1, 0.0)
    notes = write(animation, tmp_path, "gltf", "a.glb")
    assert ("X005.influences", {"most": 5}) in faults.told(notes)


# Formats that cannot store some data


def test_amass_and_easymocap_report_omissions(tmp_path):
    """The translation of the knee by 0.25 m, and of all joints below it, is not in the file."""
    figure = family_figure("smpl", tmp_path)
    knee = figure.skeleton.names.index("left_knee")
    rotations = np.tile([0.0, 0, 0, 1], (40, 24, 1))
    moved = np.zeros((40, 24, 3))
    moved[17, knee] = [0.15, 0.2, 0.0]
    clip = SampledClip("a", Timing(30.0, np.arange(40)), rotations, moved)
    for kind, name in (("amass", "a.npz"), ("easymocap", "out")):
        found = said(write(sample_animation(Actor(figure, clip=clip)), tmp_path, kind, name))
        size, place = found["joints"]
        assert size == pytest.approx(250, rel=TOLD) and place.endswith(", frame 17")
        assert found["vertices"][0] <= 250 * (1 + TOLD)


def test_anim_reports_the_mesh_error(tmp_path):
    """A tip of a metre is rotated by 1 radian with a limit of 0.5, an error of 2 sin 0.25."""
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    rows += [(1, "x", 0.0), (1, "y", 0.0), (1, "z", 0.0, -0.5, 0.5)]
    offsets = np.array([[0.0] * 3, [0.0, 1.0, 0.0]])
    skeleton = hand_made.skeleton([-1, 0], rows, None, offsets.tolist())
    mesh = Mesh(np.array([[0.0, 0, 0], [0, 2, 0], [0, 1, 0]]), np.eye(3), np.array([[0, 1, 2]]))
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)], [(1, 1.0)]], translation_matrix(-offsets))
    turns = np.zeros((3, 2, 4))
    turns[..., 3] = 1.0
    turns[1, 1] = [0.0, 0.0, np.sin(0.5), np.cos(0.5)]
    clip = SampledClip("bend", Timing(10.0, np.arange(3)), turns)
    animation = sample_animation(Actor(Figure("arm", mesh, skeleton, skin, unit="m"), clip=clip))
    notes = export_frames(animation, tmp_path / "a.anim", "anim", ExportOptions())
    found = said([notes[1]])
    assert found == {
        "vertices": (pytest.approx(2000 * np.sin(0.25), rel=TOLD), "vertex 1, frame 1")
    }


# Nothing


@pytest.mark.slow
def test_lossless_exports_report_no_error(tmp_path):
    figure = replace(family_figure("smpl", tmp_path), correctives=None)
    animation = family_animation(figure, family_motion(24, frames=30))
    for kind, name in (("bvh", "a.bvh"), ("gltf", "a.glb"), ("amass", "a.npz"), ("easymocap", "e")):
        assert said(write(animation, tmp_path, kind, name)) == {}
    actor = viewer.load().actors[0]
    still = tuple(Channel(d, np.zeros(0), np.zeros(0), ()) for d in range(len(actor.pose.dofs)))
    actor.clip = Clip("still", still, 0.0, 1.0)
    for kind, name in (("bvh", "f.bvh"), ("gltf", "f.glb"), ("anim", "f.anim")):
        assert said(write(sample_animation(actor), tmp_path, kind, name)) == {}


@pytest.mark.parametrize("suffix", ["glb", "gltf", "skel"])
def test_static_bodies_with_a_different_shape_have_no_loss(tmp_path, suffix):
    """Correctives are zero at rest, so no error is reported, not even 0 mm."""
    np.savez(tmp_path / "body.npz", **model("smplx"))
    actor = viewer.load(tmp_path / "body.npz").actors[0]
    actor.pose.shape_weights[:3] = 2.0, -1.0, 0.5
    notes = export(actor, tmp_path / f"a.{suffix}")
    assert not any(note.code == "X002" for note in notes)
    (note,) = [note for note in notes if note.key == "X003.parts"]
    assert "pose correctives" in note.values["parts"]


def test_corrective_loss_is_taken_from_the_worst_frame(tmp_path):
    """The frames exceed one batch and are compared with a slow evaluation of every frame."""
    figure = family_figure("smpl", tmp_path)
    animation = family_animation(figure, family_motion(24, frames=150))
    notes = write(animation, tmp_path, "gltf", "a.glb")
    off = []
    for frame in range(150):
        pose = pose_of(figure, animation.frames, frame)
        plain = deform(figure, pose, Skinning(correctives=False))[0]
        off.append(np.linalg.norm(deform(figure, pose)[0] - plain, axis=1))
    frame, vertex = np.unravel_index(np.argmax(off), np.shape(off))
    size = pytest.approx(1000 * np.max(off), rel=TOLD)
    assert said(notes) == {"vertices": (size, f"vertex {vertex}, frame {frame}")}


# Losses between frames


def spike(at: float) -> SampledAnimation:
    """Return the chain moved along x by 3 m at one key and back, at one frame per second."""
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    skeleton = hand_made.skeleton([-1], rows, None, [[0.0] * 3])
    mesh = Mesh(np.eye(3), np.eye(3), np.array([[0, 1, 2]]))
    skin = skin_from_lists([[(0, 1.0)]] * 3, np.eye(4)[None])
    times, values = np.array([0.0, at, 4.0]), np.array([0.0, 3.0, 0.0])
    moves = Channel(0, times, values, (("linear", "linear"),) * 3)
    still = [Channel(dof, np.zeros(0), np.zeros(0), ()) for dof in range(1, 6)]
    figure = Figure("point", mesh, skeleton, skin, unit="m")
    return sample_animation(Actor(figure, clip=Clip("spike", (moves, *still), 0.0, 4.0)), rate=1.0)


@pytest.mark.parametrize("at", [1.25, 2.5])
def test_peak_between_frames_is_reported(tmp_path, at):
    """The frames around the peak are on its flanks; a straight line between them is lower."""
    animation = spike(at)
    before, after = np.floor(at), np.ceil(at)
    ends = 3.0 * before / at, 3.0 * (4.0 - after) / (4.0 - at)
    low = ends[0] + (at - before) * (ends[1] - ends[0])
    size = pytest.approx(1000 * (3.0 - low), rel=TOLD)
    for kind, name in (("bvh", "a.bvh"), ("gltf", "a.glb")):
        notes = write(animation, tmp_path, kind, name)
        (note,) = errors(notes)
        assert note.values["rate"] == 1.0
        assert note.values["original"] == "the motion between frames"
        found = said([note])
        assert found["joints"][0] == size and found["vertices"][0] == size


def test_captures_at_a_different_rate_report_dropped_frames(tmp_path):
    """Every second frame is written; in the frame between, the figure is 2 m aside."""
    moves = np.zeros((7, 3))
    moves[3, 0] = 2.0
    figure = chain_animation().figure
    turns = np.tile([0.0, 0, 0, 1], (7, 3, 1))
    clip = SampledClip("jump", Timing(20.0, np.arange(7)), turns, figure_translations=moves)
    for kind, name in (("bvh", "a.bvh"), ("gltf", "a.glb")):
        for rate, size in ((10.0, 2000.0), (20.0, None)):
            found = said(
                write(sample_animation(Actor(figure, clip=clip), rate), tmp_path, kind, name)
            )
            assert found.get("joints", (None,))[0] == (size and pytest.approx(size, rel=TOLD))


def test_upside_down_motions_are_compared_as_written(tmp_path):
    """A resampled upside-down capture differs only by the omitted frames."""
    moves = np.zeros((7, 3))
    moves[:, 1] = np.arange(7)
    moves[3, 0] = 2.0
    figure = chain_animation().figure
    turns = np.tile([1.0, 0, 0, 0], (7, 3, 1))
    turns[:, 1:] = [0.0, 0.0, 0.0, 1.0]
    clip = SampledClip("hang", Timing(20.0, np.arange(7)), turns, figure_translations=moves)
    actor = Actor(figure, clip=clip, placement=np.diag([1.0, -1.0, -1.0, 1.0]))
    animation, _ = upright_animation(Scene([actor], world_up="y"), actor, 10.0)
    assert animation.is_rotated
    found = said(write(animation, tmp_path, "bvh", "a.bvh"))
    assert found["joints"][0] == pytest.approx(2000.0, rel=TOLD)
