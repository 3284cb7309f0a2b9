"""The BVH writer against a second reader, for bodies, course rigs and whatever else moves."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from family_models import family_figure
from hypothesis import given
from hypothesis import strategies as st
from plain_bvh import PlainBvh, about

import viewer
from viewer.errors import OutputError, RigError
from viewer.export import MotionOptions, export_animation, motion_exporters
from viewer.export._bvh.angles import euler_angles, unrolled
from viewer.export._options import ROTATION_ORDERS
from viewer.formats import Source, bvh
from viewer.loading import bundled_body
from viewer.rig.figure import Figure
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.evaluation import world_frames
from viewer.rig.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.retargeting.retarget import retarget
from viewer.rig.scene import Actor
from viewer.rig.skeleton import Skeleton, ball_skeleton

TENTH = 1e-5  # metres, 0.01 mm: what the issue allows
TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def quaternions(vectors: np.ndarray) -> np.ndarray:
    angles = np.linalg.norm(vectors, axis=-1, keepdims=True)
    axes = vectors / np.where(angles > 0, angles, 1.0)
    return np.concatenate([axes * np.sin(angles / 2), np.cos(angles / 2)], axis=-1)


def body_animation(
    figure: Figure, count: int = 12, rows: list[int] | None = None, seed: int = 0
) -> SampledAnimation:
    """Return random large rotations of a body, one shape, some frames missing."""
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
    notes = export_animation(animation, path, "bvh", MotionOptions(**options))
    return PlainBvh(path), [note.replace(str(path), "PATH") for note in notes]


def joints_of(animation: SampledAnimation) -> np.ndarray:
    """Return where the animation's joints are: (F, J, 3)."""
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


def test_registry_knows_it() -> None:
    assert motion_exporters("walk.bvh") == ["bvh"]


def test_a_body_s_joints_are_where_a_second_reader_finds_them(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation, 100.0)
    assert notes[0] == (
        "PATH: 24 joints, 12 frames (0 to 11) at 30 fps, centimetres, y up, channels ZYX"
    )
    assert len(notes) == 1  # nothing is lost, so nothing is said


def test_the_file_is_what_every_reader_takes(body: Figure, tmp_path: Path) -> None:
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
def test_every_rotation_order(body: Figure, order: str, tmp_path: Path) -> None:
    animation = body_animation(body, seed=3)
    found, notes = write(animation, tmp_path, rotation_order=order)
    assert_places(found, animation, 100.0)
    assert found.channels[5] == [f"{axis.upper()}rotation" for axis in order]
    assert notes[0].endswith(f"channels {order.upper()}")


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
@pytest.mark.parametrize("kind", ["smpl", "smplx"])
def test_units_and_hands_and_face(kind: str, unit: str, factor: float, tmp_path: Path) -> None:
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
def test_up_axes(body: Figure, world: str, up: str, turn: np.ndarray, tmp_path: Path) -> None:
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, world_up=world, up=up)
    assert_places(found, animation, 100.0, turn)
    # With all channels 0 the rest pose stands along the file's up axis.
    height = np.array(found.offsets[found.names.index("left_knee")])
    assert np.abs(height).argmax() == (2 if up == "z" else 1)
    assert f" {up or 'y'} up," in notes[0]


def test_a_figure_with_z_up_rests_upright_in_a_y_up_file(tmp_path: Path) -> None:
    animation = rig_animation(chain())
    animation = replace(animation, figure=replace(animation.figure, up="z"))
    found, _ = write(animation, tmp_path, world_up="z")
    assert_places(found, animation, turn=TO_Y)
    np.testing.assert_allclose(found.offsets[1], [0.0, 0.5, -1.0])


@pytest.mark.parametrize("rate", [24.0, 25.0, 29.97, 30.0, 59.94, 60.0, 120.0, 240.0, 1000.0, 0.25])
def test_frame_time_is_exact(body: Figure, rate: float, tmp_path: Path) -> None:
    animation = replace(body_animation(body), frame_rate=rate)
    found, _ = write(animation, tmp_path)
    assert found.frame_time * rate == pytest.approx(1.0, abs=1e-8)
    again = bvh.read(Source.open(tmp_path / "out.bvh"))
    assert again.clip.timing.frame_rate == pytest.approx(rate, rel=1e-8)


def test_rest_frame_comes_first(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, rest_frame=True)
    assert_places(found, animation, 100.0, skip=1)
    assert found.frames[0][3:] == [0.0] * 72
    assert "the rest pose and 12 frames (0 to 11)" in notes[0]


def test_offsets_are_those_of_the_shape(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    found, _ = write(animation, tmp_path)
    shaped = viewer.rig.shape.shaped(body, animation.frames.shape_weights[0]).skeleton
    for name, offset in list(zip(found.names, found.offsets, strict=True))[1:]:
        joint = body.skeleton.names.index(name)
        np.testing.assert_allclose(offset, 100 * shaped.rest_translations[joint], atol=1e-6)


def test_a_shape_that_changes_is_said_with_its_size(tmp_path: Path) -> None:
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
    assert float(said[1]) == pytest.approx(10 * off.max(), rel=5e-3)  # three digits are told
    # Nobody else's bones or mesh: the skin in the shape of frame 0, on the joints of frame 7.
    assert float(said[3]) > float(said[1])
    assert notes[2] == "the shape changes over time: bone lengths are those of frame 0"
    # The root is where it was; the others hang from it in the first frame's shape.
    np.testing.assert_allclose(
        found.places(7)["pelvis"], 100 * joints_of(changing)[7, 0], atol=1e-5
    )


GAPS = [0, 1, -1, -1, 2, 3, -1, 4, -1]


def test_gaps_hold_the_last_pose(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body, 5, GAPS)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation, 100.0)
    for gap, shown in ((2, 1), (3, 1), (6, 5), (8, 7)):
        assert found.frames[gap] == found.frames[shown]
    assert notes[1] == "missing frames 2 to 3, 6, 8: the last pose is held"
    assert len(notes) == 2


def test_a_gap_at_the_start_holds_the_first_pose(body: Figure, tmp_path: Path) -> None:
    found, notes = write(body_animation(body, 2, [-1, -1, 0, 1]), tmp_path)
    assert found.frames[0] == found.frames[1] == found.frames[2] != found.frames[3]
    assert notes[1] == "missing frames 0 to 1: the last pose is held"


def test_gaps_are_interpolated_on_the_shorter_arc(tmp_path: Path) -> None:
    turns = quaternions(np.array([[[0, 0, 0.2]], [[0, 0, 0.8]]]))
    turns[1] *= -1.0
    shifts = np.array([[[0.0, 0, 0]], [[3.0, 0, 6]]])
    clip = SampledClip("turn", Timing(10.0, np.array([0, -1, -1, 1])), turns, shifts)
    animation = sample_animation(Actor(Figure("rig", skeleton=chain(1)), clip=clip))
    found, notes = write(animation, tmp_path, gaps="interpolate")
    expected = [[1.0, 0, 2, np.degrees(0.4), 0, 0], [2.0, 0, 4, np.degrees(0.6), 0, 0]]
    np.testing.assert_allclose(found.frames[1:3], expected, atol=1e-6)
    assert notes[1] == "missing frames 1 to 2: interpolated, held at both ends"


def test_gaps_split_into_files(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body, 5, GAPS)
    notes = export_animation(animation, tmp_path / "out.bvh", "bvh", MotionOptions(gaps="split"))
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


def test_a_failing_file_of_several_leaves_none(body: Figure, tmp_path: Path) -> None:
    (tmp_path / "out-1.bvh").write_text("old")
    (tmp_path / "out-3.bvh").mkdir()
    with pytest.raises(OutputError):
        export_animation(
            body_animation(body, 5, GAPS), tmp_path / "out.bvh", "bvh", MotionOptions(gaps="split")
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out-1.bvh", "out-3.bvh"]
    assert (tmp_path / "out-1.bvh").read_text() == "old"


def test_joints_turned_at_rest_rest_without_rotation(tmp_path: Path) -> None:
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


def test_scales_at_rest_are_baked(tmp_path: Path) -> None:
    skeleton = replace(chain(4), rest_scales=np.array([[2.0] * 3, [0.5] * 3, [3.0] * 3, [1.0] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.offsets[1:], [[0, 2, 1], [0, 1, 0.5], [0, 3, 1.5]])
    assert all(len(channels) == 3 for channels in found.channels[1:]) and len(notes) == 1


def test_uneven_scales_give_position_channels(tmp_path: Path) -> None:
    skeleton = replace(chain(4), rest_scales=np.array([[2.0, 1.0, 0.5], *[[1.0] * 3] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 6, 6]
    assert notes[1] == ("2 joints below the root translate and have position channels: c, d")


def test_joints_that_move_get_position_channels_and_shifted_ones_an_offset(tmp_path: Path) -> None:
    shifts = np.zeros((6, 4, 3))
    shifts[:, 1] = 0.25, 0.5, -1.0
    shifts[3:, 3, 0] = 2.0
    animation = rig_animation(chain(4), translations=shifts)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6]
    np.testing.assert_allclose(found.offsets[1], [0.25, 1.5, -0.5])
    assert notes[1] == ("1 joint below the root translates and has position channels: d")


def test_scaled_figures(tmp_path: Path) -> None:
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


def test_several_roots_hang_from_one(tmp_path: Path) -> None:
    skeleton = replace(chain(4), parents=np.array([-1, 0, -1, 2]), names=("root", "b", "c", "d"))
    shifts = np.zeros((6, 4, 3))
    shifts[:, 2, 1] = np.arange(6)
    animation = rig_animation(skeleton, translations=shifts, figure_translations=np.ones((6, 3)))
    found, notes = write(animation, tmp_path, world_up="z")
    assert found.names[0] == "common_root" and found.parents == [-1, 0, 1, 0, 3]
    assert_places(found, animation, turn=TO_Y)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6, 3]
    assert notes[1] == "several roots: a common parent joint common_root was added"


def test_names_become_unique_and_plain(tmp_path: Path) -> None:
    skeleton = replace(chain(4), names=("left leg", "", "left leg", "é:x"))
    found, _ = write(rig_animation(skeleton), tmp_path)
    assert found.names == ["left_leg", "joint1", "left_leg_2", "e_x"]


def test_lengths_of_a_figure_without_a_unit_stay(tmp_path: Path) -> None:
    animation = rig_animation(chain())
    found, notes = write(animation, tmp_path, unit="cm")
    assert_places(found, animation)
    assert "the figure's unit, y up" in notes[0]
    assert notes[1] == "lengths are unchanged: the unit of rig is unknown"


def test_end_sites_are_half_the_last_bone_or_reach_to_the_skin(tmp_path: Path) -> None:
    found, _ = write(rig_animation(chain()), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.5, 0.25])
    boxes = np.zeros((3, 2, 3))
    boxes[2] = [[-0.1, 0, -0.1], [0.1, 0.75, 0.1]]
    found, _ = write(rig_animation(replace(chain(), boxes=boxes)), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.75, 0])
    found, _ = write(rig_animation(chain(1)), tmp_path)
    np.testing.assert_allclose(found.ends[0], [0, 0.5, 0])  # no bone to go by


def test_end_sites_of_the_bundled_body_lie_at_its_skin(tmp_path: Path) -> None:
    figure = viewer.load(bundled_body()).actors[0].figure
    found, _ = write(body_animation(figure, 2), tmp_path, unit="m")
    head = found.ends[found.names.index("head")]
    top = figure.mesh.positions[:, 1].max() - viewer.rig.shape.rest_joints(figure)[15, 1]
    # Shape and slant of the neck move it by a few centimetres.
    assert head[1] == pytest.approx(top, abs=0.06)


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_the_bundled_body_is_exact(unit: str, tmp_path: Path) -> None:
    animation = body_animation(viewer.load(bundled_body()).actors[0].figure, 20, seed=7)
    found, notes = write(animation, tmp_path, unit=unit)
    assert_places(found, animation, {"m": 1.0, "cm": 100.0}[unit])
    assert len(notes) == 1


def test_the_wasp_walks_in_and_out(shared: Path, tmp_path: Path) -> None:
    actor = viewer.load(shared / "wasp.skel", shared / "wasp_walk.anim").actors[0]
    animation = sample_animation(actor)
    found, _ = write(animation, tmp_path)
    assert_places(found, animation)
    clip, notes = retarget(bvh.read(Source.open(tmp_path / "out.bvh")), actor.figure)
    assert str(notes[0]).endswith("drives 23 of 23 joints of wasp")
    again = sample_animation(Actor(actor.figure, clip=clip))
    np.testing.assert_allclose(joints_of(again), joints_of(animation), atol=1e-6)


def test_a_bvh_comes_back_with_its_end_sites(tmp_path: Path) -> None:
    first, _ = write(rig_animation(chain(4)), tmp_path)
    motion = bvh.read(Source.open(tmp_path / "out.bvh"))
    animation = sample_animation(Actor(motion.figure, clip=motion.clip))
    again, _ = write(animation, tmp_path, unit="m")
    assert again.ends == first.ends and again.offsets == first.offsets
    np.testing.assert_allclose(again.frames, first.frames, atol=2e-6)


@pytest.mark.slow
def test_keyed_clips_with_root_translation(tmp_path: Path) -> None:
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


def test_fewer_digits_are_less_exact_and_said(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    found, notes = write(animation, tmp_path, digits=2)
    wanted = joints_of(animation) * 100
    worst = max(
        np.linalg.norm(np.array(found.places(f)[n]) - wanted[f, j])
        for f in range(12)
        for j, n in enumerate(body.skeleton.names)
    )
    said = float(re.search(r"joints differ from the motion by up to (\S+) mm", notes[1])[1])
    assert said == pytest.approx(10 * worst, rel=5e-3)  # three digits are told
    assert said > 0.01


def test_a_file_moves_the_body_it_was_made_from(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    flat = replace(animation.frames, shape_weights=np.zeros((1, body.n_shapes)))
    animation = replace(animation, frames=flat)
    write(animation, tmp_path, rotation_order="yxz")
    motion = bvh.read(Source.open(tmp_path / "out.bvh"))
    clip, _ = retarget(motion, body)
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
def test_unknown_options_are_refused(options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(RigError) as caught:
        write(rig_animation(chain()), tmp_path, **options)
    assert str(caught.value) == message


def test_nothing_present_or_not_finite_is_refused(body: Figure, tmp_path: Path) -> None:
    animation = body_animation(body)
    none = replace(animation, frames=replace(animation.frames, present=np.zeros(12, dtype=bool)))
    with pytest.raises(RigError, match="every frame is missing, there is nothing to write"):
        write(none, tmp_path)
    wild = animation.frames.figure_translations.copy()
    wild[3, 0] = np.inf
    with pytest.raises(RigError, match="expected finite numbers in every frame"):
        write(
            replace(animation, frames=replace(animation.frames, figure_translations=wild)), tmp_path
        )
    assert not (tmp_path / "out.bvh").exists()


def test_deep_chains_are_written(tmp_path: Path) -> None:
    count = 3000
    names = tuple(f"j{i}" for i in range(count))
    deep = ball_skeleton(names, np.arange(count) - 1, np.arange(count)[:, None] * [0.0, 0.001, 0.0])
    animation = rig_animation(deep, 2)
    found, _ = write(animation, tmp_path)
    assert found.parents == list(range(-1, count - 1))
    assert len(found.text) < 2e6


def angle_product(order: str, angles: np.ndarray) -> np.ndarray:
    result = np.eye(3)
    for axis, angle in zip(order, angles, strict=True):
        result = result @ np.array(about("xyz".index(axis), float(angle)))
    return result


quarter = st.integers(-8, 8).map(lambda n: n * np.pi / 4)
angle = quarter | st.floats(-7, 7)


@given(
    st.sampled_from(ROTATION_ORDERS),
    st.lists(st.tuples(angle, angle, angle), min_size=1, max_size=8),
)
def test_angles_give_the_rotations_back_also_where_axes_coincide(order: str, rows: list) -> None:
    turns = np.array([angle_product(order, row) for row in rows])
    for angles in (euler_angles(turns, order), unrolled(euler_angles(turns, order), order)):
        for row, turn in zip(angles, turns, strict=True):
            np.testing.assert_allclose(angle_product(order, row), turn, atol=1e-8)


@pytest.mark.parametrize("order", ROTATION_ORDERS)
@pytest.mark.parametrize("which", [0, 1, 2])
def test_angles_run_on_without_jumps(order: str, which: int) -> None:
    # One axis turns round several times, through where the middle angle passes 90 degrees.
    wanted = np.tile([0.3, 0.2, -0.4], (400, 1))
    wanted[:, which] += np.linspace(0, 15, 400)
    turns = np.array([angle_product(order, row) for row in wanted])
    found = unrolled(euler_angles(turns, order), order)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(wanted, axis=0), atol=1e-9)


def test_a_locked_frame_keeps_the_angles_of_the_one_before() -> None:
    wanted = np.array([[1.0, 1.2, 0.5], [1.0, np.pi / 2, 0.5], [1.0, 1.3, 0.5]])
    for order in ROTATION_ORDERS:
        turns = np.array([angle_product(order, row) for row in wanted])
        np.testing.assert_allclose(unrolled(euler_angles(turns, order), order), wanted, atol=1e-8)


def test_all_orders_are_offered() -> None:
    assert sorted(ROTATION_ORDERS) == sorted("".join(p) for p in itertools.permutations("xyz"))
