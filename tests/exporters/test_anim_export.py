"""Export to .anim with the keys of the clip, or with one key per frame and a measured error."""

import math
import re
from pathlib import Path

import faults
import numpy as np
import pytest
from exporting import export_frames
from numpy.testing import assert_allclose, assert_array_equal
from rigs import hand_made

import viewer
from viewer.errors import OutputError, RigError
from viewer.exporters import ExportOptions, exporters_of
from viewer.formats import Source, read
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip, evaluate_all
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "cse169"
TINY = 1e-12


def rig(limits=()):
    """Return two joints, one above the other."""
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    rows += [(1, kind, 0.0, *dict(limits).get(kind, ())) for kind in "xyz"]
    return Figure(
        "arm", skeleton=hand_made.skeleton([-1, 0], rows, None, [[0.0] * 3, [0.0, 1.0, 0.0]])
    )


def keyed(end=1.0):
    """Return a clip that moves the root along x from 0 to 3 and rotates it from -0.5 to 0.5."""
    moves = Channel(0, np.array([0.0, 1.0]), np.array([0.0, 3.0]), (("flat", "flat"),) * 2)
    turns = Channel(
        5,
        np.array([-1.0, 1.0]),
        np.array([-0.5, 0.5]),
        (("linear", 0.25),) * 2,
        ("bounce", "cycle"),
    )
    still = [Channel(dof, np.zeros(0), np.zeros(0), ()) for dof in (1, 2, 3, 4, 6, 7, 8)]
    channels = sorted([moves, turns, *still], key=lambda channel: channel.target)
    return Clip("wave", tuple(channels), 0.0, end)


def turning(angles, rate=2.0, rows=None, **more):
    """Return a sampled clip in which the second joint rotates about z by these angles."""
    turns = np.zeros((len(angles), 2, 4))
    turns[:, :, 3] = 1.0
    turns[:, 1, 2] = np.sin(np.asarray(angles) / 2)
    turns[:, 1, 3] = np.cos(np.asarray(angles) / 2)
    rows = np.arange(len(angles)) if rows is None else np.array(rows)
    return SampledClip("turn", Timing(rate, rows), turns, **more)


def written(actor, path, **settings):
    animation = sample_animation(
        actor, **{key: settings.pop(key) for key in ("rate", "frames") if key in settings}
    )
    notes = faults.lines(export_frames(animation, path, "anim", ExportOptions(**settings)))
    return read(Source.open(path)) if path.exists() else None, notes


def test_clip_is_written_unchanged(tmp_path):
    path, clip = tmp_path / "a.anim", keyed(0.99)
    again, notes = written(Actor(rig(), clip=clip), path)
    assert notes == [f"{path}: 9 channels with 4 keys, 0 to 0.99 s, the clip's own"]
    assert (again.start, again.end) == (0.0, 0.99)
    for old, new in zip(clip.channels, again.channels, strict=True):
        assert_array_equal(old.times, new.times)
        assert_array_equal(old.values, new.values)
        assert (old.tangents, old.extrapolation) == (new.tangents, new.extrapolation)


@pytest.mark.skipif(not SHARED.exists(), reason="needs the shared data")
def test_clip_of_a_real_walk_is_written_unchanged(tmp_path):
    scene = viewer.load(*(SHARED / f"wasp{end}" for end in (".skel", ".skin", "_walk.anim")))
    actor = scene.actors[0]
    again, _ = written(actor, tmp_path / "walk.anim")
    times = np.linspace(-3, 9, 121)
    assert_array_equal(evaluate_all(again, times)[1], evaluate_all(actor.clip, times)[1])


def test_part_of_a_clip_is_written_as_keys_on_its_frames(tmp_path):
    path, clip = tmp_path / "a.anim", keyed()
    again, notes = written(Actor(rig(), clip=clip), path, rate=10.0, frames=(2, 8))
    times = np.arange(2, 8) / 10
    assert_array_equal(again.channels[0].times, times)
    assert (again.start, again.end) == (times[0], times[-1])
    assert_array_equal(evaluate_all(again, times)[1], evaluate_all(clip, times)[1])
    # Constant channels need one key each.
    assert [len(channel.times) for channel in again.channels] == [6, 1, 1, 1, 1, 6, 1, 1, 1]
    assert notes[0] == f"{path}: 9 channels with 19 keys, 0.2 to 0.7 s, smooth tangents"
    assert len(notes) == 2 and "differ from the motion between frames" in notes[1]


def test_error_between_frames_matches_hand_calculation(tmp_path):
    """Frames at 0 and 1 with the slope of the span are a straight line; the clip is at 1.5."""
    clip = Clip(
        "bump",
        (
            Channel(0, np.array([0.0, 0.5, 1.0]), np.array([0.0, 2.0, 0.0]), (("flat",) * 2,) * 3),
            *keyed().channels[1:],
        ),
        0.0,
        1.0,
    )
    clip = Clip(clip.name, (clip.channels[0], *(
        Channel(dof, np.zeros(0), np.zeros(0), ()) for dof in range(1, 9))), 0.0, 2.0)  # fmt: skip
    _, notes = written(Actor(rig(), clip=clip), tmp_path / "a.anim", rate=1.0, frames=(0, 2))
    assert notes[0].endswith(", linear tangents")
    assert notes[1:] == [
        f"{tmp_path}/a.anim: joints differ from the motion between frames by up to 2 units (j0)"
    ]


def test_sampled_angles_are_unwrapped_beyond_180_degrees(tmp_path):
    angles = np.arange(12) * 1.5
    again, notes = written(Actor(rig(), clip=turning(angles)), tmp_path / "a.anim")
    assert_allclose(again.channels[8].values, angles, atol=1e-9)
    assert_array_equal(again.channels[8].times, np.arange(12) / 2)
    # Linear interpolation of angles about one axis follows the shorter arc.
    assert notes[0].endswith(", linear tangents") and len(notes) == 1


def test_angles_of_limited_joints_are_within_the_limits(tmp_path):
    figure = rig(limits={"z": (-1.0, 1.0)})
    again, notes = written(Actor(figure, clip=turning([0.5, 2.0])), tmp_path / "a.anim")
    assert_allclose(again.channels[8].values, [0.5, 1.0], atol=1e-12)
    # The position of the joint is unchanged; only its rotation differs.
    assert len(notes) == 1


@pytest.mark.parametrize(
    ("gaps", "values", "done"),
    [("hold", [0.2, 0.2, 0.2, 0.5], "the last pose is held"),
     ("interpolate", [0.2, 0.3, 0.4, 0.5], "interpolated")],
)  # fmt: skip
def test_gaps_are_closed_as_requested(tmp_path, gaps, values, done):
    clip = turning([0.2, 0.5], rows=[0, -1, -1, 1])
    again, notes = written(Actor(rig(), clip=clip), tmp_path / "a.anim", gaps=gaps)
    assert_allclose(again.channels[8].values, values, atol=1e-12)
    assert notes[1] == f"missing frames 1 to 2: {done}"


def test_gaps_split_into_files(tmp_path):
    clip = turning([0.2, 0.3, 0.5], rows=[0, 1, -1, 2])
    _, notes = written(Actor(rig(), clip=clip), tmp_path / "a.anim", gaps="split")
    first, second = (read(Source.open(tmp_path / f"a-{n}.anim")) for n in (1, 2))
    assert (first.start, first.end, second.start, second.end) == (0.0, 0.5, 1.5, 1.5)
    assert_allclose(first.channels[8].values, [0.2, 0.3], atol=1e-12)
    assert_allclose(second.channels[8].values, [0.5], atol=1e-12)
    assert [note.split(":")[0] for note in notes[:2]] == [
        str(tmp_path / "a-1.anim"),
        str(tmp_path / "a-2.anim"),
    ]
    assert notes[-1] == "missing frame 2: one file for each run of frames"
    assert not (tmp_path / "a.anim").exists()


def test_placement_moves_the_root_and_omitted_values_are_reported(tmp_path):
    places = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    inner = np.zeros((2, 2, 3))
    inner[:, 1, 0] = 0.5
    clip = turning([0.1, 0.2], figure_translations=places, translations=inner,
                   figure_scales=np.array([2.0, 2.0]))  # fmt: skip
    again, notes = written(Actor(rig(), clip=clip), tmp_path / "a.anim")
    assert [channel.values.tolist() for channel in again.channels[:3]] == [
        [0.5, 1.0], [1.0, 2.0], [1.5, 3.0]]  # fmt: skip
    assert notes[3:] == [
        ".anim cannot store the figure's scale of 2, which is omitted",
        ".anim translates only the root: translations of other joints, up to 0.5 "
        "units, are omitted",
    ]
    # The figure in the file has a scale of 1 about the root's position, half of the original scale,
    # and its second joint is at rest.
    skeleton = rig().skeleton
    assert_array_equal(skeleton.parents, [-1, 0])
    root, offset = skeleton.rest_translations
    there = [place + 2.0 * (root + offset + [0.5, 0, 0]) for place in places]
    found = [place / 2.0 + root + offset for place in places]
    worst = np.linalg.norm(np.subtract(there, found), axis=1)
    said = re.search(r"a\.anim: joints differ from the motion by up to (\S+) units", notes[1])
    assert float(said[1]) == pytest.approx(worst.max(), rel=5e-3)
    assert "(j1, frame 1)" in notes[1]


def test_placement_of_a_keyed_figure_is_omitted_with_a_note(tmp_path):
    actor = Actor(rig(), clip=keyed())
    actor.pose.figure_translation[0] = 1.0
    _, notes = written(actor, tmp_path / "a.anim")
    assert notes[1].startswith(f"{tmp_path}/a.anim: joints differ from the motion by up to 1 units")
    assert notes[-1] == "the placement of the whole figure is not part of its clip and is omitted"


def test_figures_without_dofs_are_refused(tmp_path):
    rows = [(joint, axis, 0.0) for joint in (0, 1) for axis in "xyz"]
    body = Figure("body", skeleton=hand_made.skeleton([-1, 0], rows))
    with pytest.raises(RigError) as caught:
        written(Actor(body, clip=turning([0.0, 1.0])), tmp_path / "a.anim")
    assert str(caught.value) == (
        ".anim needs a root translation and three angles per joint, as in .skel files; "
        "body has other DOFs"
    )
    assert list(tmp_path.iterdir()) == []


def test_empty_motions_and_unknown_options_are_refused(tmp_path):
    with pytest.raises(RigError, match="no person is present in frame"):
        written(Actor(rig(), clip=turning([0.0], rows=[-1, -1])), tmp_path / "a.anim")
    with pytest.raises(RigError, match='expected one of hold, interpolate, split, found "jump"'):
        written(Actor(rig(), clip=keyed()), tmp_path / "a.anim", gaps="jump")


def test_failed_export_leaves_no_file(tmp_path):
    (tmp_path / "a-2.anim").mkdir()
    clip = turning([0.2, 0.5], rows=[0, -1, 1])
    with pytest.raises(OutputError):
        written(Actor(rig(), clip=clip), tmp_path / "a.anim", gaps="split")
    assert [path.name for path in tmp_path.iterdir()] == ["a-2.anim"]


def test_exporter_is_found_by_its_suffix():
    assert exporters_of("walk.anim", "frames") == ["anim"]


def test_written_clip_reproduces_the_poses_of_the_frames(tmp_path):
    """All three axes are compared with explicit products of rotations."""
    rng = np.random.default_rng(4)
    angles = rng.uniform(-1.4, 1.4, (6, 3))
    turns = np.array([
        hand_made.turn_z(z) @ hand_made.turn_y(y) @ hand_made.turn_x(x) for x, y, z in angles
    ])  # fmt: skip
    quaternions = np.zeros((6, 2, 4))
    quaternions[:, 0, 3] = 1.0
    quaternions[:, 1] = [_quaternion(turn) for turn in turns]
    clip = SampledClip("any", Timing(30.0, np.arange(6)), quaternions)
    again, _ = written(Actor(rig(), clip=clip), tmp_path / "a.anim")
    found = evaluate_all(again, np.arange(6) / 30.0)[1][:, 6:]
    assert_allclose(found, angles, atol=1e-9)


def _quaternion(turn):
    w = math.sqrt(max(0.0, 1.0 + np.trace(turn))) / 2.0
    x, y, z = (turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return np.array([x / (4 * w), y / (4 * w), z / (4 * w), w])
