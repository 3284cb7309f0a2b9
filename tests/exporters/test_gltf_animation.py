"""glTF animations, played by a separate reader and compared with the original poses."""

import json
from dataclasses import replace

import faults
import numpy as np
import pytest
from builders import family_figure, quaternions
from exporting import export_frames
from family_animations import family_animation, family_motion, waves
from gltf_files import AS_IS, EXACT, TO_Y, assert_drawn, corners
from numpy.testing import assert_allclose, assert_array_equal
from plain_gltf import Gltf
from seamed import seamed_actor, seamed_mesh
from small_rigs import clip_text, write_twist

import viewer
from viewer.errors import OutputError, RigError
from viewer.exporters import EXPORTERS, ExportOptions
from viewer.loading import bundled_body
from viewer.rigs.figure import Figure
from viewer.rigs.morph_target import MorphTarget, with_morphs
from viewer.rigs.motion.evaluation import pose_of, world_frames
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import Skinning, deform

LIMIT = "not stored in glTF"
ROOM = 3e-5  # in metres, for keys in single precision accumulated along the longest chain of a body


def roof_animation(rows=None, count=4, rate=10.0, **tracks) -> SampledAnimation:
    """Return the roof with joints that rotate about z, and quaternions of either sign."""
    vectors = np.zeros((count, 2, 3))
    vectors[:, 0, 2] = 0.5 * np.arange(count)
    vectors[:, 1, 2] = -0.25 * np.arange(count)
    rotations = quaternions(vectors)
    rotations[1::2] *= -1.0  # the same rotations with other signs
    timing = Timing(rate, np.arange(count) if rows is None else rows, 7)
    figure = tracks.pop("figure", None) or seamed_actor(unit="m").figure
    clip = SampledClip("bend", timing, rotations, **tracks)
    return sample_animation(Actor(figure, clip=clip))


def write(folder, animation, name="out.glb", **options) -> tuple[Gltf, list[str]]:
    notes = faults.lines(export_frames(animation, folder / name, "gltf", ExportOptions(**options)))
    return Gltf(folder / name), notes


def assert_played(gltf: Gltf, animation: SampledAnimation, turn=AS_IS, frames=None) -> None:
    every = range(animation.frames.n_frames) if frames is None else frames
    for frame in every:
        pose = pose_of(animation.figure, animation.frames, frame)
        assert_drawn(gltf, animation.figure, pose, turn, frame / animation.frame_rate)


def test_frames_are_keys(tmp_path):
    animation = roof_animation()
    gltf, notes = write(tmp_path, animation)
    assert_played(gltf, animation)
    (played,) = gltf.root["animations"]
    assert played["name"] == "bend"
    assert [channel["target"]["path"] for channel in played["channels"]] == ["rotation"] * 2
    times = gltf.accessor(played["samplers"][0]["input"])
    assert_allclose(times, [0, 0.1, 0.2, 0.3], rtol=1e-7)
    # Half-way between two frames on the shorter arc, the root has rotated by 0.75.
    node = gltf.transforms(0.15)[gltf.named("root")]
    wanted = np.array([0, 0, np.sin(0.375), np.cos(0.375)])
    assert_allclose(np.abs(node["rotation"]), wanted, rtol=0, atol=EXACT)
    size = (tmp_path / "out.glb").stat().st_size
    assert notes == [
        f"{tmp_path / 'out.glb'}: 7 vertices (5 before they were split along texture seams), "
        f"3 triangles, 2 joints, 4 frames (7 to 10) at 10 fps, {size / 1000:.3g} kB"
    ]
    # Programs that do not play animations show the rest pose.
    assert_drawn(gltf, animation.figure, Actor(animation.figure).pose)


def test_moving_joints_get_channels(tmp_path):
    moves = np.zeros((4, 2, 3))
    moves[:, 0, 0] = [0, 1, 2, 3]
    moves[:, 1] = 0, 0, 4  # shifted but constant
    places = np.arange(12.0).reshape(4, 3)
    scales = np.array([1.0, 2, 2, 3])
    animation = roof_animation(translations=moves, figure_translations=places, figure_scales=scales)
    gltf, notes = write(tmp_path, animation)
    assert_played(gltf, animation)
    found = [
        (gltf.nodes[channel["target"]["node"]]["name"], channel["target"]["path"])
        for channel in gltf.root["animations"][0]["channels"]
    ]
    assert found[2:] == [("root", "translation"), ("roof", "translation"), ("roof", "scale")]
    assert gltf.nodes[gltf.named("tip")]["translation"] == [1, 0, 4]
    assert len(notes) == 1  # only joints below the root are reported
    moves[:, 1, 1] = [0, 1, 0, 1]
    animation = roof_animation(translations=moves)
    gltf, notes = write(tmp_path, animation)
    assert_played(gltf, animation)
    assert notes[1:] == ["1 joint below the root translates: tip"]


def test_constant_placement_gets_no_channel(tmp_path):
    animation = roof_animation(figure_translations=np.tile([1.0, 2, 3], (4, 1)))
    gltf, _ = write(tmp_path, animation)
    assert "translation" not in gltf.nodes[0]  # the node around the figure
    assert gltf.nodes[gltf.named("root")]["translation"] == [1, 2, 3]
    assert len(gltf.root["animations"][0]["channels"]) == 2
    assert_played(gltf, animation)


@pytest.mark.parametrize(
    ("gaps", "angles", "text"),
    [
        (
            "hold",
            [0, 0, 0.5, 0.5, 0.5, 1.5, 1.5],
            "the last pose is held, or the first one at the start",
        ),
        ("interpolate", [0, 0, 0.5, 5 / 6, 7 / 6, 1.5, 1.5], "interpolated, held at both ends"),
    ],
)
def test_poses_in_gaps_are_held_or_interpolated(tmp_path, gaps, angles, text):
    animation = roof_animation(rows=[-1, 0, 1, -1, -1, 3, -1])
    gltf, notes = write(tmp_path, animation, gaps=gaps)
    for frame, angle in enumerate(angles):
        x, y, z, w = gltf.transforms(frame / 10)[gltf.named("root")]["rotation"]
        assert abs(2 * np.arctan2(z, w) - angle) % (2 * np.pi) < EXACT and x == y == 0
    assert_played(gltf, animation, frames=[1, 2, 5])
    assert notes[1] == f"missing frames 7, 10 to 11, 13: {text}"


def test_gaps_split_into_files(tmp_path):
    animation = roof_animation(rows=[-1, 0, 1, -1, -1, 3, -1])
    notes = faults.lines(
        export_frames(animation, tmp_path / "walk.gltf", "gltf", ExportOptions(gaps="split"))
    )
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "walk-1.bin",
        "walk-1.gltf",
        "walk-2.bin",
        "walk-2.gltf",
    ]
    first, second = (Gltf(tmp_path / f"walk-{number}.gltf") for number in (1, 2))
    for gltf, frame, time in ((first, 1, 0), (first, 2, 0.1), (second, 5, 0)):
        assert_drawn(
            gltf, animation.figure, pose_of(animation.figure, animation.frames, frame), time=time
        )
    assert abs(first.duration() - 0.1) < 1e-7 and second.duration() == 0
    assert "walk-1.gltf: 7 vertices" in notes[0] and "2 frames (8 to 9)" in notes[0]
    assert "walk-2.gltf: 7 vertices" in notes[2] and "1 frame (12)" in notes[2]
    assert notes[4] == "missing frames 7, 10 to 11, 13: one file for each run of frames"


def test_one_run_of_frames_is_one_file(tmp_path):
    gltf, _ = write(tmp_path, roof_animation(rows=[-1, 0, 1, 2]), gaps="split")
    assert abs(gltf.duration() - 0.2) < 1e-7


def test_keyed_clip_is_sampled(tmp_path):
    (tmp_path / "twist.anim").write_text(clip_text())
    actor = viewer.load(*write_twist(tmp_path), tmp_path / "twist.anim").actors[0]
    animation = sample_animation(actor, rate=5.0)
    gltf, notes = write(tmp_path, animation)
    assert "11 frames (0 to 10) at 5 fps" in notes[0]
    rest = gltf.vertices()[0]
    # The root moves by 2 units per second along x, also between frames.
    for time in (0.0, 0.6, 1.1, 2.0):
        found = gltf.vertices(time)[0] - rest
        assert_allclose(found, [[2 * time, 0, 0]] * 3, rtol=0, atol=EXACT)


def test_animated_fox_matches_its_frames(tmp_path):
    figure = viewer.load().actors[0].figure
    rotations = quaternions(waves(6, figure.skeleton.n_joints, 3))
    clip = SampledClip("wave", Timing(24.0, np.arange(6)), rotations)
    animation = sample_animation(Actor(figure, clip=clip))
    gltf, _ = write(tmp_path, animation)
    played = 6 - 1
    # The joint limits of the fox are not applied to a motion, as in the frames.
    skin = figure.skin
    palette = world_frames(figure, animation.frames)[played] @ skin.inverse_bind
    owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))
    blended, sums = np.zeros((skin.n_vertices, 4, 4)), np.zeros(skin.n_vertices)
    np.add.at(blended, owners, skin.weights[:, None, None] * palette[skin.joints])
    np.add.at(sums, owners, skin.weights)
    points = np.append(figure.mesh.positions, np.ones((skin.n_vertices, 1)), axis=1)
    positions = np.einsum("vab,vb->va", blended, points)[:, :3] / sums[:, None]
    size = np.linalg.norm(np.ptp(positions, axis=0))
    found = corners(gltf, gltf.vertices(played / 24)[0])
    assert_allclose(found, positions[figure.mesh.triangles], rtol=0, atol=2e-6 * size)


@pytest.mark.slow
def test_error_of_a_body_with_correctives_and_shape_is_reported(tmp_path):
    figure = viewer.load(bundled_body()).actors[0].figure
    animation = family_animation(figure, family_motion(24, frames=40))
    gltf, notes = write(tmp_path, animation)
    errors = []
    for frame in range(40):
        pose = pose_of(figure, animation.frames, frame)
        plain = deform(figure, pose, Skinning(correctives=False))[0]
        errors.append(np.linalg.norm(deform(figure, pose)[0] - plain, axis=1))
        found = corners(gltf, gltf.vertices(frame / 50)[0])
        assert_allclose(found, plain[figure.mesh.triangles], rtol=0, atol=ROOM)
    frame, vertex = np.unravel_index(np.argmax(errors), np.shape(errors))
    assert notes[1:] == [
        "the shape is baked into mesh and joints",
        f"{tmp_path}/out.glb: vertices differ from the motion by up to {1000 * np.max(errors):.3g} "
        f"mm (vertex {vertex}, frame {frame}): pose correctives are not supported",
        f"{LIMIT}: 10 blend shapes (baked into the mesh), pose correctives, the symmetry map, the "
        "joint regressor",
    ]


def test_changing_shape_is_written_as_its_first_frame(tmp_path):
    figure = replace(family_figure("smpl", tmp_path), correctives=None)
    motion = family_motion(24, frames=3, rows=[-1, 1, 2], shape=waves(3, 10))
    animation = family_animation(figure, motion)
    gltf, notes = write(tmp_path, animation)
    weights = animation.frames.shape_weights
    apart = []
    for frame in (1, 2):
        pose = pose_of(figure, animation.frames, frame)
        own = deform(figure, pose)[0]
        pose.shape_weights[:10] = weights[1, :10]
        fixed = deform(figure, pose)[0]
        apart.append(np.linalg.norm(own - fixed, axis=1).max())
        found = corners(gltf, gltf.vertices(frame / 50)[0])
        assert_allclose(found, fixed[figure.mesh.triangles], rtol=0, atol=ROOM)
    (line,) = [note for note in notes if "differ" in note]
    assert f"; vertices by up to {1000 * max(apart):.3g} mm (vertex " in line
    assert line.endswith(", frame 2): the shape changes over time, which is not supported")


def test_changing_morphs_are_animated(tmp_path):
    targets = [
        MorphTarget("lift", [1, 3], [[1, 0, 2], [1, 2, 5]], [[0, 0, 1], [1, 0, 0]]),
        MorphTarget("idle", [0], [[9, 9, 9]]),
        MorphTarget("wide", [1], [[5, 0, 0]]),
    ]
    figure = with_morphs(seamed_actor(unit="m").figure, targets)
    weights = np.array([[0, 0, 1], [0.5, 0, 0], [1, 0, 0], [0.25, 0, 0.75]])
    animation = roof_animation(figure=figure, shape_weights=weights)
    gltf, notes = write(tmp_path, animation)
    assert_played(gltf, animation)
    assert gltf.transforms(0.15)[gltf.mesh_node]["weights"] == pytest.approx([0.75, 0], abs=1e-6)
    assert notes[1:] == ["2 blend shapes are morph targets", f"{LIMIT}: 1 blend shape"]
    still = roof_animation(figure=figure, shape_weights=weights[1:2])
    gltf, _ = write(tmp_path, still)
    assert_played(gltf, still)
    assert gltf.root["meshes"][0]["weights"] == [0.5]


def test_up_axis_is_that_of_the_frames(tmp_path):
    animation = roof_animation(figure_translations=np.arange(12.0).reshape(4, 3))
    gltf, notes = write(tmp_path, animation, world_up="z")
    assert_played(gltf, animation, TO_Y)
    assert notes[1:] == ["z is up: a node above the figure rotates it by -90 degrees about x"]


def test_skeleton_without_mesh_is_animated(tmp_path):
    joints = np.array([[0, 1, 0], [0, 2, 0]], dtype=float)
    skeleton = ball_skeleton(("low", "high"), np.array([-1, 0]), joints)
    animation = roof_animation(figure=Figure("bare", skeleton=skeleton, unit="m"))
    gltf, _ = write(tmp_path, animation, "bare.gltf")
    assert "meshes" not in gltf.root
    # The lower joint rotates by 0.5 per frame about z.
    place = gltf.world(0.2)[gltf.named("high"), :3, 3]
    assert_allclose(place, [-np.sin(1.0), 1 + np.cos(1.0), 0], rtol=0, atol=EXACT)


def test_other_skinning_is_the_reference_for_losses(tmp_path):
    animation = roof_animation(figure=seamed_actor(unit="m", mesh=seamed_mesh(uvs=False)).figure)
    _, notes = write(tmp_path, animation, skinning=Skinning("mix"))
    apart = [
        np.linalg.norm(
            deform(animation.figure, pose, "mix")[0] - deform(animation.figure, pose)[0], axis=1
        )
        for pose in (pose_of(animation.figure, animation.frames, frame) for frame in range(4))
    ]
    worst = 1000 * np.max(apart)
    assert f"vertices differ from the motion by up to {worst:.3g} mm (vertex " in notes[1]
    assert notes[1].endswith(
        "): Between LBS and DQS skinning is not supported: glTF uses linear blending"
    )


def test_long_animations_are_small_and_exact(tmp_path):
    """All keys of ten thousand frames have exact times and values."""
    count = 10_000
    skeleton = ball_skeleton(("a", "b"), np.array([-1, 0]), np.eye(3)[:2])
    animation = roof_animation(count=count, rate=120.0, figure=Figure("bare", skeleton=skeleton))
    gltf, _ = write(tmp_path, animation)
    samplers = gltf.root["animations"][0]["samplers"]
    times = gltf.accessor(samplers[0]["input"])
    assert_array_equal(times, (np.arange(count) / 120).astype(np.float32))
    output = gltf.accessor(samplers[0]["output"]).astype(float)
    angles = 0.5 * np.arange(count)
    wanted = np.stack([np.sin(angles / 2), np.cos(angles / 2)], axis=1)
    same = np.abs(np.einsum("fa,fa->f", output[:, 2:], wanted))
    assert_allclose(same, 1.0, rtol=0, atol=1e-6)
    assert len(gltf.buffer) == count * 4 * (1 + 2 * 4)


def test_invalid_animations_are_refused(tmp_path):
    def refused(animation, message, **options):
        with pytest.raises(RigError) as caught:
            write(tmp_path, animation, **options)
        assert str(caught.value) == message

    text = "no person is present in frames 7 to 8: there is nothing to write"
    refused(roof_animation(rows=[-1, -1]), text)
    refused(roof_animation(), 'unit of glTF: expected m, found "cm"', unit="cm")
    refused(roof_animation(), 'up axis of glTF: expected y, found "z"', up="z")
    text = 'handling of gaps of glTF: expected one of hold, interpolate, split, found "x"'
    refused(roof_animation(), text, gaps="x")
    places = np.full((4, 3), 1e39)
    places[0] = 0
    text = "roof: expected numbers that fit glTF's single precision, found 1e+39"
    refused(roof_animation(figure_translations=places), text)
    with pytest.raises(OutputError, match=r"x\.glb: the folder .* does not exist$"):
        write(tmp_path, roof_animation(), "none/x.glb")
    assert list(tmp_path.iterdir()) == []


def test_registry_lists_motion_and_pose(tmp_path):
    kind = EXPORTERS["gltf"]
    assert kind.suffixes == (".glb", ".gltf") and kind.stores == {"pose", "clips", "frames"}
    gltf, _ = write(tmp_path, roof_animation(), "x.GLTF")
    assert json.loads((tmp_path / "x.GLTF").read_text())["asset"]["version"] == "2.0"
    assert gltf.root["buffers"][0]["uri"] == "x.bin"
