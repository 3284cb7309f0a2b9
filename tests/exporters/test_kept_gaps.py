"""Missing frames in formats that can omit them, which stay missing unless requested otherwise."""

import json

import faults
import numpy as np
import pytest
from builders import family_figure, quaternions
from exporters.plain_readers import read_obj
from exporting import export_frames
from family_animations import family_animation, family_motion
from formats.gltf.files import File, skinned
from numpy.testing import assert_allclose, assert_array_equal
from seamed import POSITIONS, seamed_actor

import viewer
from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import ExportOptions
from viewer.exporters._gaps import filled
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

ATOL = 1e-8  # for lengths of 1 to 10 with nine digits
FILLED = {
    "hold": "missing frames 8 to 9: the last pose is held",
    "interpolate": "missing frames 8 to 9: interpolated, held at both ends",
}


def moving_roof():
    """Frames 7 and 10 of a mesh that moves from x = 0 to x = 3; the frames between are missing."""
    figure = seamed_actor(unit="m").figure
    clip = SampledClip(
        "go",
        Timing(10.0, np.array([0, -1, -1, 1]), 7),
        np.tile([0.0, 0.0, 0.0, 1.0], (2, figure.skeleton.n_joints, 1)),
        figure_translations=np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]),
    )
    return sample_animation(Actor(figure, clip=clip))


@pytest.mark.parametrize(
    ("gaps", "places"),
    [
        ("", {7: 0.0, 10: 3.0}),
        ("split", {7: 0.0, 10: 3.0}),
        ("hold", {7: 0.0, 8: 0.0, 9: 0.0, 10: 3.0}),
        ("interpolate", {7: 0.0, 8: 1.0, 9: 2.0, 10: 3.0}),
    ],
)
def test_gaps_of_numbered_meshes_are_kept_or_interpolated(tmp_path, gaps, places):
    name = tmp_path / "m_{frame:02}.obj"
    notes = faults.lines(export_frames(moving_roof(), name, "obj", ExportOptions(gaps=gaps)))
    files = {int(path.stem[2:]): read_obj(path).v for path in tmp_path.iterdir()}
    assert files.keys() == places.keys()
    for frame, x in places.items():
        assert_allclose(files[frame], np.add(POSITIONS, [x, 0.0, 0.0]), atol=ATOL)
    span = f"{name}: {len(places)} files, m_07.obj to m_10.obj"
    if gaps in FILLED:
        assert notes[:-1] == [span, FILLED[gaps]]
    else:
        assert notes[:-1] == [f"{span}; 2 frames are missing in the motion and have no file"]
    assert notes[-1] == "not stored in .obj and .mtl: the skeleton, the skin"


@pytest.mark.parametrize(
    ("gaps", "x"),
    [("", [0, np.nan, np.nan, 3]), ("hold", [0, 0, 0, 3]), ("interpolate", [0, 1, 2, 3])],
)
def test_gaps_of_arrays_are_kept_or_interpolated(tmp_path, gaps, x):
    path = tmp_path / "a.npz"
    notes = faults.lines(export_frames(moving_roof(), path, "npz", ExportOptions(gaps=gaps)))
    with np.load(path) as arrays:
        assert_allclose(arrays["vertices"][:, :, 0], np.add.outer(x, POSITIONS[:, 0]), atol=1e-12)
        assert_array_equal(arrays["present"], ~np.isnan(x))
    assert notes[1:-1] == ([FILLED[gaps]] if gaps else [])
    assert notes[-1] == "not stored in .npz: the skin"
    assert ("2 of them missing, NaN" in notes[0]) == (not gaps)


def test_arrays_are_not_split(tmp_path):
    message = 'gaps of arrays: expected hold or interpolate, found "split"'
    with pytest.raises(RigError, match=f"^{message}$"):
        export_frames(moving_roof(), tmp_path / "a.npz", "npz", ExportOptions(gaps="split"))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("gaps", "rows", "note"),
    [
        ("", [0, None, 2], "frame 6 missing, as in the original motion"),
        ("split", [0, None, 2], "frame 6 missing, as in the original motion"),
        ("hold", [0, 0, 2], "missing frame 6: the last pose is held"),
    ],
)
def test_gaps_of_folders_are_kept_or_interpolated(tmp_path, gaps, rows, note):
    motion = family_motion(24, rows=np.array([0, -1, 2]), first_frame=5)
    animation = family_animation(family_figure("smpl", tmp_path), motion)
    out = tmp_path / "out"
    notes = faults.lines(export_frames(animation, out, "easymocap", ExportOptions(gaps=gaps)))
    assert notes[1:] == [note]
    for frame, row in enumerate(rows, 5):
        people = json.loads((out / "smpl" / f"{frame:06}.json").read_text())
        assert len(people) == (row is not None)
        if row is not None:
            assert_allclose(people[0]["Th"][0], motion.translations[row], atol=1e-6)


def test_interpolated_frames_of_folders_are_written(tmp_path):
    # The rotation half-way between two unit quaternions is their normalised sum.
    motion = family_motion(24, rows=np.array([0, -1, 2]), first_frame=5)
    animation = family_animation(family_figure("smpl", tmp_path), motion)
    export_frames(animation, tmp_path / "out", "easymocap", ExportOptions(gaps="interpolate"))
    (person,) = json.loads((tmp_path / "out" / "smpl" / "000006.json").read_text())
    ends = [quaternions(motion.vectors[row, 4]) for row in (0, 2)]
    ends[1] = ends[1] if ends[0] @ ends[1] > 0 else -ends[1]
    middle = (ends[0] + ends[1]) / np.linalg.norm(ends[0] + ends[1])
    found = quaternions(np.array(person["poses"][0][12:15]))
    assert_allclose(abs(found @ middle), 1.0, atol=1e-9)


@pytest.mark.parametrize("key", ["obj", "npz", "easymocap"])
def test_unknown_gap_modes_are_refused(tmp_path, key):
    animation = moving_roof()
    if key == "easymocap":
        animation = family_animation(family_figure("smpl", tmp_path), family_motion(24))
    before = sorted(tmp_path.iterdir())
    message = 'handling of gaps: expected one of hold, interpolate, split, found "jump"'
    with pytest.raises(RigError, match=f"^{message}$"):
        export_frames(animation, tmp_path / "m_{frame}", key, ExportOptions(gaps="jump"))
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("fills", "x"), [(False, [1, 1, 1, 3]), (True, [1, 5 / 3, 7 / 3, 3])])
def test_scales_of_joints_are_interpolated_in_gaps(fills, x):
    figure = seamed_actor(unit="m").figure
    scales = np.ones((2, figure.skeleton.n_joints, 3))
    scales[1, 0, 0] = 3.0
    clip = SampledClip(
        "grow",
        Timing(10.0, np.array([0, -1, -1, 1])),
        np.tile([0.0, 0.0, 0.0, 1.0], (2, figure.skeleton.n_joints, 1)),
        scales=scales,
    )
    found = filled(sample_animation(Actor(figure, clip=clip)).frames, fills)
    assert_allclose(found.scales[:, 0, 0], x, atol=1e-12)


IRREGULAR = "the keys are at irregular times, so the motion is sampled at 30 frames per second"


def keyed(times: np.ndarray) -> File:
    """Return a skinned triangle whose second joint turns to a new angle at each key."""
    file, angles = skinned(), 0.5 * np.sin(0.7 * np.arange(len(times)))
    zero = 0.0 * angles
    keys = file.accessor(np.stack([zero, zero, np.sin(angles), np.cos(angles)], axis=1))
    samplers = [{"input": file.times(times.tolist()), "output": keys}]
    channels = [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]
    file.root["animations"] = [{"channels": channels, "samplers": samplers}]
    return file


@pytest.mark.parametrize("suffix", [".bvh", ".glb"])
def test_frames_are_the_keys(tmp_path, suffix, capsys):
    source, path = tmp_path / "keys.glb", tmp_path / f"frames{suffix}"
    source.write_bytes(keyed(np.arange(13) / 120.0).glb())
    assert run(["convert", str(source), "-o", str(path), "--frames", "0:"]) == 0
    assert "13 frames (0 to 12) at 120 fps" in capsys.readouterr().out
    (actor,) = viewer.load(path).actors
    assert actor.clip.frame_rate == pytest.approx(120.0, rel=1e-6)
    assert actor.clip.end - actor.clip.start == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(("options", "said"), [((), True), (("--fps", "50"), False)])
def test_rate_of_irregular_keys_is_reported(tmp_path, options, said, capsys):
    source, path = tmp_path / "keys.glb", tmp_path / "frames.npz"
    source.write_bytes(keyed(np.array([0.0, 0.1, 0.1234, 0.2])).glb())
    assert run(["convert", str(source), "-o", str(path), *options]) == 0
    assert (IRREGULAR in capsys.readouterr().out) is said
