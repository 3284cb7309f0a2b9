"""The BVH writer, compared with an independent reader for bodies, .skel-style rigs and others."""

import itertools
import re
from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from builders import axis_turn, family_figure, quaternions
from exporting import export_frames
from hypothesis import given
from hypothesis import strategies as st
from plain_bvh import PlainBvh

import viewer
from viewer.errors import OutputError, RigError
from viewer.exporters import ExportOptions, exporters_of
from viewer.exporters._options import ROTATION_ORDERS
from viewer.exporters.bvh.angles import euler_angles, unrolled
from viewer.formats import Source, bvh
from viewer.formats.bvh.text import safe_names
from viewer.loading import bundled_body
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.body_motion import BodyMotion, body_clip
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.evaluation import world_frames
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import skin_from_lists

TENTH = 1e-5  # in metres, 0.01 mm
TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def body_animation(
    figure: Figure, count: int = 12, rows: list[int] | None = None, seed: int = 0
) -> SampledAnimation:
    """Return a body with large random rotations, a constant shape and some missing frames."""
    rng = np.random.default_rng(seed)
    timing = Timing(30.0, np.arange(count) if rows is None else np.array(rows))
    names = figure.skeleton.names
    vectors = rng.uniform(-1.5, 1.5, (count, len(names), 3))
    shape = rng.normal(0, 1, (1, 10))
    motion = BodyMotion("walk", timing, names, vectors, rng.normal(0, 2, (count, 3)), True, shape)
    return sample_animation(Actor(figure, clip=body_clip(motion, figure)[0]))


def rig_animation(skeleton: Skeleton, count: int = 6, seed: int = 0, **changes) -> SampledAnimation:
    rng = np.random.default_rng(seed)
    turns = quaternions(rng.uniform(-2, 2, (count, skeleton.n_joints, 3)))
    clip = SampledClip("dance", Timing(25.0, np.arange(count)), turns, **changes)
    return sample_animation(Actor(Figure("rig", skeleton=skeleton), clip=clip))


def chain(count: int = 3) -> Skeleton:
    names = tuple("abcdefgh"[:count])
    return ball_skeleton(names, np.arange(count) - 1, np.arange(count)[:, None] * [0.0, 1.0, 0.5])


def write(animation: SampledAnimation, folder: Path, **options) -> tuple[PlainBvh, list[str]]:
    path = folder / "out.bvh"
    notes = faults.lines(export_frames(animation, path, "bvh", ExportOptions(**options)))
    return PlainBvh(path), [note.replace(str(path), "PATH") for note in notes]


def joints_of(animation: SampledAnimation) -> np.ndarray:
    """Return the joint positions of the animation, (F, J, 3)."""
    return world_frames(animation.figure, animation.frames)[..., :3, 3]


def assert_places(
    found: PlainBvh,
    animation: SampledAnimation,
    factor: float = 1.0,
    turn=None,
    atol: float = TENTH,
    skip: int = 0,
) -> None:
    wanted = joints_of(animation) * factor
    wanted = wanted if turn is None else wanted @ turn.T
    assert found.n_frames == len(wanted) + skip
    for frame in np.flatnonzero(animation.frames.present):
        places = found.places(int(frame) + skip)
        for joint, name in enumerate(animation.figure.skeleton.names):
            np.testing.assert_allclose(places[name], wanted[frame, joint], atol=atol * factor)


@pytest.fixture(scope="module")
def body(tmp_path_factory) -> Figure:
    return family_figure("smpl", tmp_path_factory.mktemp("model"))


def test_bvh_is_registered():
    assert exporters_of("walk.bvh", "frames") == ["bvh"]


def test_body_joints_match_an_independent_reader(body, tmp_path):
    animation = body_animation(body)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation, 100.0)
    assert notes[0] == (
        "PATH: 24 joints, 12 frames (0 to 11) at 30 fps, centimetres, y up, channels ZYX"
    )
    assert len(notes) == 1  # no loss is reported


def test_constraints_move_joints_but_not_the_offsets_of_the_file(tmp_path):
    # The aimed joint points at the arm also at rest, where its own child is turned with it.
    parents = np.array([-1, 0, 1, 1, 3], dtype=np.int32)
    places = np.array([[0.0, 1, 0], [0, 2, 0], [1, 2, 0], [0, 2, 2], [0, 2, 3]])
    rig = ball_skeleton(("hips", "spine", "arm", "aimed", "end"), parents, places)
    rig = replace(rig, constraints=(Constraint(3, 2, "aim", (0.0, 0.0, -1.0)),))
    animation = rig_animation(rig)
    bound = np.tile(np.eye(4), (5, 1, 1))
    bound[:, :3, 3] = -places
    points, rows = places + np.array([0.1, 0.2, 0.3]), [[(joint, 1.0)] for joint in range(5)]
    mesh = Mesh(points, np.tile([0.0, 0, 1], (5, 1)), np.array([[0, 1, 2], [2, 3, 4]]))
    figure = replace(animation.figure, mesh=mesh, skin=skin_from_lists(rows, bound))
    animation = replace(animation, figure=figure)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert found.offsets[4] == pytest.approx([0.0, 0.0, 1.0])
    assert len(notes) == 1  # no loss is reported


def test_file_uses_the_common_syntax(body, tmp_path):
    found, _ = write(body_animation(body), tmp_path)  # the second reader checks the grammar
    assert found.offsets[0] == [0.0, 0.0, 0.0]
    positions = ["Xposition", "Yposition", "Zposition"]
    turns = ["Zrotation", "Yrotation", "Xrotation"]
    assert found.channels[0] == positions + turns
    assert all(channels == turns for channels in found.channels[1:])
    leaves = set(range(24)) - set(found.parents)
    assert set(found.ends) == leaves
    assert all(np.linalg.norm(end) > 1e-3 for end in found.ends.values())
    assert "-0.000000 " not in found.text and "e-" not in found.text.split("MOTION")[1]
    assert sorted(found.names) == sorted(body.skeleton.names)


@pytest.mark.parametrize("order", ROTATION_ORDERS)
def test_every_rotation_order_is_written(body, order, tmp_path):
    animation = body_animation(body, seed=3)
    found, notes = write(animation, tmp_path, rotation_order=order)
    assert_places(found, animation, 100.0)
    assert found.channels[5] == [f"{axis.upper()}rotation" for axis in order]
    assert notes[0].endswith(f"channels {order.upper()}")


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
@pytest.mark.parametrize("kind", ["smpl", "smplx"])
def test_units_hands_and_face_are_written(kind, unit, factor, tmp_path):
    figure = family_figure(kind, tmp_path)
    animation = body_animation(figure)
    found, notes = write(animation, tmp_path, unit=unit)
    assert len(found.names) == figure.skeleton.n_joints
    assert_places(found, animation, factor)
    assert len(notes) == 1


@pytest.mark.parametrize(
    ("world", "up", "turn"),
    [
        ("y", "y", np.eye(3)),
        ("z", "y", TO_Y),
        ("z", "z", np.eye(3)),
        ("y", "z", TO_Y.T),
        ("z", "", TO_Y),
    ],
)
def test_up_axis_of_the_file_rotates_the_motion(body, world, up, turn, tmp_path):
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, world_up=world, up=up)
    assert_places(found, animation, 100.0, turn)
    # With channels of 0, the rest pose is upright along the up axis of the file.
    height = np.array(found.offsets[found.names.index("left_knee")])
    assert np.abs(height).argmax() == (2 if up == "z" else 1)
    assert f" {up or 'y'} up," in notes[0]


def test_figure_with_z_up_is_upright_at_rest_in_a_y_up_file(tmp_path):
    animation = rig_animation(chain())
    animation = replace(animation, figure=replace(animation.figure, up="z"))
    found, _ = write(animation, tmp_path, world_up="z")
    assert_places(found, animation, turn=TO_Y)
    np.testing.assert_allclose(found.offsets[1], [0.0, 0.5, -1.0])


@pytest.mark.parametrize("rate", [24.0, 25.0, 29.97, 30.0, 59.94, 60.0, 120.0, 240.0, 1000.0, 0.25])
def test_frame_time_is_exact(body, rate, tmp_path):
    animation = replace(body_animation(body), frame_rate=rate)
    found, _ = write(animation, tmp_path)
    assert found.frame_time * rate == pytest.approx(1.0, abs=1e-8)
    again = bvh.read(Source.open(tmp_path / "out.bvh"))
    assert again.clip.timing.frame_rate == pytest.approx(rate, rel=1e-8)


def test_rest_frame_is_first(body, tmp_path):
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, rest_frame=True)
    assert_places(found, animation, 100.0, skip=1)
    assert found.frames[0][3:] == [0.0] * 72
    assert "the rest pose and 12 frames (0 to 11)" in notes[0]


def test_offsets_are_those_of_the_shape(body, tmp_path):
    animation = body_animation(body)
    found, _ = write(animation, tmp_path)
    shaped = viewer.rigs.shape.shaped(body, animation.frames.shape_weights[0]).skeleton
    for name, offset in list(zip(found.names, found.offsets, strict=True))[1:]:
        joint = body.skeleton.names.index(name)
        np.testing.assert_allclose(offset, 100 * shaped.rest_translations[joint], atol=1e-6)


def test_error_of_a_changing_shape_is_reported(tmp_path):
    figure = family_figure("smpl", tmp_path)
    animation = body_animation(figure)
    weights = np.repeat(animation.frames.shape_weights, 12, axis=0)
    weights[7] += 3.0
    changing = replace(animation, frames=replace(animation.frames, shape_weights=weights))
    found, notes = write(changing, tmp_path)
    found_names = figure.skeleton.names
    wanted = 100 * joints_of(changing)
    off = np.array(
        [
            [np.linalg.norm(found.places(f)[n] - wanted[f, j]) for j, n in enumerate(found_names)]
            for f in range(12)
        ]
    )
    frame, joint = np.unravel_index(off.argmax(), off.shape)
    assert frame == 7
    said = re.fullmatch(
        r"PATH: joints differ from the motion by up to (\S+) mm \((\w+), frame 7\); "
        r"vertices of a skin driven by it by up to (\S+) mm \(vertex \d+, frame 7\)",
        notes[1],
    )
    assert said and said[2] == found_names[joint]
    assert float(said[1]) == pytest.approx(10 * off.max(), rel=5e-3)  # three digits are printed
    # The expected error is that of the skin in the shape of frame 0 on the joints of frame 7.
    assert float(said[3]) > float(said[1])
    assert notes[2] == "the shape changes over time: bone lengths are those of frame 0"
    # The root is unchanged; other joints follow it in the shape of the first frame.
    np.testing.assert_allclose(
        found.places(7)["pelvis"], 100 * joints_of(changing)[7, 0], atol=1e-5
    )


GAPS = [0, 1, -1, -1, 2, 3, -1, 4, -1]


def test_last_pose_is_held_in_gaps(body, tmp_path):
    animation = body_animation(body, 5, GAPS)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation, 100.0)
    for gap, shown in ((2, 1), (3, 1), (6, 5), (8, 7)):
        assert found.frames[gap] == found.frames[shown]
    assert notes[1] == "missing frames 2 to 3, 6, 8: the last pose is held"
    assert len(notes) == 2


def test_first_pose_is_held_in_a_gap_at_the_start(body, tmp_path):
    found, notes = write(body_animation(body, 2, [-1, -1, 0, 1]), tmp_path)
    assert found.frames[0] == found.frames[1] == found.frames[2] != found.frames[3]
    assert notes[1] == "missing frames 0 to 1: the first pose is held"


def test_gaps_are_interpolated_on_the_shorter_arc(tmp_path):
    turns = quaternions(np.array([[[0, 0, 0.2]], [[0, 0, 0.8]]]))
    turns[1] *= -1.0
    shifts = np.array([[[0.0, 0, 0]], [[3.0, 0, 6]]])
    clip = SampledClip("turn", Timing(10.0, np.array([0, -1, -1, 1])), turns, shifts)
    animation = sample_animation(Actor(Figure("rig", skeleton=chain(1)), clip=clip))
    found, notes = write(animation, tmp_path, gaps="interpolate")
    expected = [[1.0, 0, 2, np.degrees(0.4), 0, 0], [2.0, 0, 4, np.degrees(0.6), 0, 0]]
    np.testing.assert_allclose(found.frames[1:3], expected, atol=1e-6)
    assert notes[1] == "missing frames 1 to 2: interpolated, held at both ends"


def test_gaps_split_into_files(body, tmp_path):
    animation = body_animation(body, 5, GAPS)
    notes = faults.lines(
        export_frames(animation, tmp_path / "out.bvh", "bvh", ExportOptions(gaps="split"))
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"out-{i}.bvh" for i in (1, 2, 3)]
    wanted = joints_of(animation) * 100
    for number, frames in ((1, (0, 1)), (2, (4, 5)), (3, (7,))):
        found = PlainBvh(tmp_path / f"out-{number}.bvh")
        assert found.n_frames == len(frames)
        for row, frame in enumerate(frames):
            np.testing.assert_allclose(found.places(row)["pelvis"], wanted[frame, 0], atol=1e-5)
        assert notes[number - 1].startswith(f"{tmp_path}/out-{number}.bvh: 24 joints")
    assert "(4 to 5)" in notes[1]
    assert notes[-1] == "missing frames 2 to 3, 6, 8: one file for each run of frames"


def test_failure_of_one_file_removes_all_files(body, tmp_path):
    (tmp_path / "out-1.bvh").write_text("old")
    (tmp_path / "out-3.bvh").mkdir()
    with pytest.raises(OutputError):
        export_frames(
            body_animation(body, 5, GAPS), tmp_path / "out.bvh", "bvh", ExportOptions(gaps="split")
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out-1.bvh", "out-3.bvh"]
    assert (tmp_path / "out-1.bvh").read_text() == "old"


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_bundled_body_is_exact(unit, tmp_path):
    animation = body_animation(viewer.load(bundled_body()).actors[0].figure, 20, seed=7)
    found, notes = write(animation, tmp_path, unit=unit)
    assert_places(found, animation, {"m": 1.0, "cm": 100.0}[unit])
    assert len(notes) == 1


def test_motion_of_the_wasp_round_trips(shared, tmp_path):
    actor = viewer.load(shared / "wasp.skel", shared / "wasp_walk.anim").actors[0]
    animation = sample_animation(actor)
    found, _ = write(animation, tmp_path)
    assert_places(found, animation)
    found = retarget(bvh.read(Source.open(tmp_path / "out.bvh")), actor.figure)
    clip, notes = found.clip, found.notes
    assert str(notes[0]).endswith("drives 23 of 23 joints of wasp")
    again = sample_animation(Actor(actor.figure, clip=clip))
    np.testing.assert_allclose(joints_of(again), joints_of(animation), atol=1e-6)


def test_bvh_round_trips_with_its_end_sites(tmp_path):
    first, _ = write(rig_animation(chain(4)), tmp_path)
    motion = bvh.read(Source.open(tmp_path / "out.bvh"))
    animation = sample_animation(Actor(motion.figure, clip=motion.clip))
    again, _ = write(animation, tmp_path, unit="m")
    assert again.ends == first.ends and again.offsets == first.offsets
    np.testing.assert_allclose(again.frames, first.frames, atol=2e-6)


@pytest.mark.slow
def test_keyed_clips_with_root_translation_are_written(tmp_path):
    figure = viewer.load().actors[0].figure
    rng = np.random.default_rng(2)
    channels = tuple(
        Channel(dof, np.array([0.0, 1.0]), rng.uniform(-0.5, 0.5, 2), (("smooth", "smooth"),) * 2)
        for dof in range(figure.skeleton.n_dofs)
    )
    animation = sample_animation(Actor(figure, clip=Clip("walk", channels, 0.0, 1.0)))
    found, notes = write(animation, tmp_path, rotation_order="xyz")
    assert found.n_frames == 31
    assert_places(found, animation)
    assert np.ptp(np.array(found.frames)[:, :3], axis=0).min() > 0.0
    assert not [note for note in notes[1:] if " between frames " not in note]


def test_fewer_digits_lose_precision_with_a_note(body, tmp_path):
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, digits=2)
    wanted = joints_of(animation) * 100
    worst = max(
        np.linalg.norm(np.array(found.places(f)[n]) - wanted[f, j])
        for f in range(12)
        for j, n in enumerate(body.skeleton.names)
    )
    said = float(re.search(r"joints differ from the motion by up to (\S+) mm", notes[1])[1])
    assert said == pytest.approx(10 * worst, rel=5e-3)  # three digits are printed
    assert said > 0.01


def test_file_drives_the_body_from_which_it_was_written(body, tmp_path):
    animation = body_animation(body)
    flat = replace(animation.frames, shape_weights=np.zeros((1, body.n_shapes)))
    animation = replace(animation, frames=flat)
    write(animation, tmp_path, rotation_order="yxz")
    motion = bvh.read(Source.open(tmp_path / "out.bvh"))
    clip = retarget(motion, body).clip
    again = sample_animation(Actor(body, clip=clip))
    np.testing.assert_allclose(joints_of(again), joints_of(animation), atol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "inch"}, 'unit: expected one of m, cm, mm, in, found "inch"'),
        ({"up": "x"}, 'up axis: expected one of y, z, found "x"'),
        (
            {"rotation_order": "zyz"},
            'rotation order: expected one of zyx, zxy, xyz, xzy, yxz, yzx, found "zyz"',
        ),
        (
            {"gaps": "fill"},
            'handling of gaps: expected one of hold, interpolate, split, found "fill"',
        ),
        ({"digits": 0}, "digits: expected 1 to 15, found 0"),
    ],
)
def test_unknown_options_are_refused(options, message, tmp_path):
    with pytest.raises(RigError) as caught:
        write(rig_animation(chain()), tmp_path, **options)
    assert str(caught.value) == message


def test_absent_or_non_finite_motion_is_refused(body, tmp_path):
    animation = body_animation(body)
    none = replace(animation, frames=replace(animation.frames, present=np.zeros(12, dtype=bool)))
    with pytest.raises(RigError, match="no person is present in frame"):
        write(none, tmp_path)
    wild = animation.frames.figure_translations.copy()
    wild[3, 0] = np.inf
    with pytest.raises(RigError, match="expected finite numbers in every frame"):
        write(
            replace(animation, frames=replace(animation.frames, figure_translations=wild)), tmp_path
        )
    assert not (tmp_path / "out.bvh").exists()


def test_deep_chains_are_written(tmp_path):
    count = 3000
    names = tuple(f"j{i}" for i in range(count))
    deep = ball_skeleton(names, np.arange(count) - 1, np.arange(count)[:, None] * [0.0, 0.001, 0.0])
    animation = rig_animation(deep, 2)
    found, _ = write(animation, tmp_path)
    assert found.parents == list(range(-1, count - 1))
    assert len(found.text) < 2e6


def test_rest_rotations_are_removed_from_the_rest_pose(tmp_path):
    rng = np.random.default_rng(5)
    skeleton = chain(4)
    skeleton = replace(skeleton, rest_rotations=quaternions(rng.uniform(-2, 2, (4, 3))))
    still = SampledClip("still", Timing(25.0, np.array([0])), skeleton.rest_rotations[None])
    animation = sample_animation(Actor(Figure("rig", skeleton=skeleton), clip=still))
    found, _ = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.frames[0], np.zeros(15), atol=1e-6)
    moving = rig_animation(skeleton, 6)
    assert_places(write(moving, tmp_path)[0], moving)


def test_scales_at_rest_are_baked(tmp_path):
    skeleton = replace(chain(4), rest_scales=np.array([[2.0] * 3, [0.5] * 3, [3.0] * 3, [1.0] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.offsets[1:], [[0, 2, 1], [0, 1, 0.5], [0, 3, 1.5]])
    assert all(len(channels) == 3 for channels in found.channels[1:]) and len(notes) == 1


def test_non_uniform_scales_are_written_as_position_channels(tmp_path):
    skeleton = replace(chain(4), rest_scales=np.array([[2.0, 1.0, 0.5], *[[1.0] * 3] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 6, 6]
    assert notes[1] == ("2 joints below the root translate and have position channels: c, d")


def test_moving_joints_get_position_channels_and_shifted_joints_an_offset(tmp_path):
    shifts = np.zeros((6, 4, 3))
    shifts[:, 1] = 0.25, 0.5, -1.0
    shifts[3:, 3, 0] = 2.0
    animation = rig_animation(chain(4), translations=shifts)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6]
    np.testing.assert_allclose(found.offsets[1], [0.25, 1.5, -0.5])
    assert notes[1] == ("1 joint below the root translates and has position channels: d")


def test_constant_scale_is_exact_and_changing_scale_is_reported(tmp_path):
    animation = rig_animation(
        chain(), figure_scales=np.full(6, 2.5), figure_translations=np.ones((6, 3))
    )
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.offsets[1], [0, 2.5, 1.25])
    assert len(notes) == 1
    growing = rig_animation(chain(), figure_scales=np.linspace(1, 2, 6))
    notes = write(growing, tmp_path)[1]
    assert notes[1].startswith("PATH: joints differ from the motion by up to ")
    assert notes[1].endswith(" units (c, frame 5)")
    assert notes[2] == ("the figure's scale changes from 1 to 2: bone lengths are written with 1")


def test_several_roots_get_a_common_parent(tmp_path):
    skeleton = replace(chain(4), parents=np.array([-1, 0, -1, 2]), names=("root", "b", "c", "d"))
    shifts = np.zeros((6, 4, 3))
    shifts[:, 2, 1] = np.arange(6)
    animation = rig_animation(skeleton, translations=shifts, figure_translations=np.ones((6, 3)))
    found, notes = write(animation, tmp_path, world_up="z")
    assert found.names[0] == "common_root" and found.parents == [-1, 0, 1, 0, 3]
    assert_places(found, animation, turn=TO_Y)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6, 3]
    assert notes[1] == "several roots: a common parent joint common_root was added"


ODD = ("left leg", "", "left leg", "é:x", "mixamorig:Hips", "spine.001", "センター", "a  b")


def test_names_are_written_as_they_are(tmp_path):
    animation = rig_animation(replace(chain(8), names=ODD))
    found, notes = write(animation, tmp_path)
    assert found.names == [*ODD]
    assert (
        b"\tJOINT \xe3\x82\xbb\xe3\x83\xb3\xe3\x82\xbf\xe3\x83\xbc\n"
        in (tmp_path / "out.bvh").read_bytes()
    )
    assert bvh.read(Source.open(tmp_path / "out.bvh")).figure.skeleton.names == ODD
    # Colons and full stops are read by all programs.
    assert notes[1] == (
        "some programs cannot read 5 joint names that are empty or repeated, or have spaces or "
        'characters outside ASCII: left leg, "", é:x, センター, a  b; --safe-names changes them'
    )
    # Repeated names do not confuse the comparison with the motion, which finds no error.
    assert len(notes) == 2


def test_safe_names_are_unique_and_ascii_and_each_change_is_said(tmp_path):
    animation = rig_animation(replace(chain(8), names=ODD))
    found, notes = write(animation, tmp_path, safe_names=True)
    assert found.names == ["left_leg", "joint1", "left_leg_2", "e_x", "mixamorig_Hips",
                           "spine_001", "joint6", "a__b"]  # fmt: skip
    assert notes[1].startswith("8 joint names changed: left leg to left_leg, ")
    assert "センター to joint6" in notes[1]


def test_names_that_the_format_cannot_hold_are_changed_and_said(tmp_path):
    names = ("a{b}", "c\nd", " e ", "offset 3", "f\ud800")
    found, notes = write(rig_animation(replace(chain(5), names=names)), tmp_path)
    assert found.names == ["a_b_", "c_d", "e", "offset_3", "f_"]
    assert notes[1].startswith("5 joint names changed: a{b} to a_b_, ")


def test_lengths_of_a_figure_without_a_unit_are_unscaled(tmp_path):
    animation = rig_animation(chain())
    found, notes = write(animation, tmp_path, unit="cm")
    assert_places(found, animation)
    assert "the figure's unit, y up" in notes[0]
    assert notes[1] == "lengths are unchanged: the unit of rig is unknown"


def test_end_sites_are_half_the_last_bone_or_end_at_the_skin(tmp_path):
    found, _ = write(rig_animation(chain()), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.5, 0.25])
    boxes = np.zeros((3, 2, 3))
    boxes[2] = [[-0.1, 0, -0.1], [0.1, 0.75, 0.1]]
    found, _ = write(rig_animation(replace(chain(), boxes=boxes)), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.75, 0])
    found, _ = write(rig_animation(chain(1)), tmp_path)
    np.testing.assert_allclose(found.ends[0], [0, 0.5, 0])  # no bone determines the direction


def test_end_sites_of_the_bundled_body_are_on_its_skin(tmp_path):
    figure = viewer.load(bundled_body()).actors[0].figure
    found, _ = write(body_animation(figure, 2), tmp_path, unit="m")
    head = found.ends[found.names.index("head")]
    top = figure.mesh.positions[:, 1].max() - viewer.rigs.shape.rest_joints(figure)[15, 1]
    # Shape and slant of the neck move the end site by a few centimetres.
    assert head[1] == pytest.approx(top, abs=0.06)


def angle_product(order: str, angles: np.ndarray) -> np.ndarray:
    result = np.eye(3)
    for axis, angle in zip(order, angles, strict=True):
        result = result @ axis_turn("xyz".index(axis), float(angle))
    return result


quarter = st.integers(-8, 8).map(lambda n: n * np.pi / 4)
angle = quarter | st.floats(-7, 7)


@pytest.mark.slow
@given(
    st.sampled_from(ROTATION_ORDERS),
    st.lists(st.tuples(angle, angle, angle), min_size=1, max_size=8),
)
def test_angles_reproduce_rotations_even_at_gimbal_lock(order, rows):
    turns = np.array([angle_product(order, row) for row in rows])
    for angles in (euler_angles(turns, order), unrolled(euler_angles(turns, order), order)):
        for row, turn in zip(angles, turns, strict=True):
            np.testing.assert_allclose(angle_product(order, row), turn, atol=1e-8)


@pytest.mark.parametrize("order", ROTATION_ORDERS)
@pytest.mark.parametrize("which", [0, 1, 2])
def test_angles_are_unwrapped(order, which):
    # One axis rotates by several revolutions, and the middle angle passes 90 degrees.
    wanted = np.tile([0.3, 0.2, -0.4], (400, 1))
    wanted[:, which] += np.linspace(0, 15, 400)
    turns = np.array([angle_product(order, row) for row in wanted])
    found = unrolled(euler_angles(turns, order), order)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(wanted, axis=0), atol=1e-9)


def test_gimbal_locked_frame_keeps_the_previous_angles():
    wanted = np.array([[1.0, 1.2, 0.5], [1.0, np.pi / 2, 0.5], [1.0, 1.3, 0.5]])
    for order in ROTATION_ORDERS:
        turns = np.array([angle_product(order, row) for row in wanted])
        np.testing.assert_allclose(unrolled(euler_angles(turns, order), order), wanted, atol=1e-8)


def test_all_rotation_orders_are_supported():
    assert sorted(ROTATION_ORDERS) == sorted("".join(p) for p in itertools.permutations("xyz"))


def test_repeated_empty_and_foreign_names_become_safe():
    names = ["hip", "hip", "hip_2", "", "left knee", "Zähler", "日本", "a:b", "a_b"]
    expected = ("hip", "hip_3", "hip_2", "joint3", "left_knee", "Zahler", "joint6", "a_b_2", "a_b")
    assert safe_names(names) == expected


@given(st.lists(st.text(max_size=6) | st.sampled_from(["a", "a_2", "a_3", "joint1"]), max_size=12))
def test_safe_names_of_arbitrary_names_are_valid_and_unique(names):
    found = safe_names(names)
    assert len(set(found)) == len(names)
    assert all(name and set(name) <= set(PLAIN) for name in found)
    assert safe_names(found) == found
    first = {name: index for index, name in reversed(list(enumerate(names)))}
    for index, (old, new) in enumerate(zip(names, found, strict=True)):
        if old and set(old) <= set(PLAIN) and old.strip("_") and first[old] == index:
            assert new == old


PLAIN = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"
