"""EasyMocap export: formulas, round trips through AMASS, gaps, people, and errors."""

import json
from dataclasses import replace

import faults
import numpy as np
import pytest
from builders import rotation
from exporting import export_frames, export_people
from family_animations import family_animation, family_motion, vertices_about_origin, waves
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

from viewer.errors import OutputError, RigError
from viewer.exporters import ExportOptions, easymocap, exporters_of
from viewer.formats import Source, read
from viewer.rigs.motion.body_motion import body_clip
from viewer.rigs.motion.sampled_clip import joined

ATOL = 1e-6  # in metres and radians, for seven decimals summed along an arm
COUNTS = {"smpl": 24, "smplh": 52, "smplx": 55, "mano": 16}


def frames_in(folder):
    """Return the contents of the frame files, by frame."""
    files = sorted((folder / "smpl").iterdir())
    return {int(file.stem): json.loads(file.read_text()) for file in files}


def written(animation, path, **options):
    notes = faults.lines(export_frames(animation, path, "easymocap", ExportOptions(**options)))
    return frames_in(path), notes


def clip_of(path, figure, person=0):
    """Return the clip of one person in a folder with all parts joined."""
    parts = [part.bodies[person] for part in read(Source.open(path)).parts() if part.bodies]
    clips = [body_clip(motion, figure)[0] for motion in parts]
    rows, shift = clips[0].timing.rows.copy(), clips[0].n_rows
    for clip in clips[1:]:
        rows[clip.timing.rows >= 0] = clip.timing.rows[clip.timing.rows >= 0] + shift
        shift += clip.n_rows
    return joined(clips, replace(clips[0].timing, rows=rows))


def test_folder_finds_the_exporter():
    assert exporters_of("out/", "frames") == ["easymocap"]


@pytest.mark.parametrize("kind", COUNTS)
def test_placement_in_records_follows_the_formula(family, tmp_path, kind):
    shape = waves(1, family(kind).blend_shapes.groups.count("shape"), seed=2.0)
    motion = family_motion(COUNTS[kind], shape=shape)
    frames, notes = written(family_animation(family(kind), motion), tmp_path / "out", world_up="z")
    assert notes == [
        f"{tmp_path}/out/smpl: 4 frames of 1 person, z up; EasyMocap does not store the "
        "frame rate of 50 fps"
    ]
    assert list(frames) == [0, 1, 2, 3]
    for frame, people in frames.items():
        (record,) = people
        assert list(record) == ["id", "Rh", "Th", "poses", "shapes"]
        assert (record["id"], record["poses"][0][:3]) == (0, [0.0, 0.0, 0.0])
        vectors = np.reshape(record["poses"], (-1, 3))
        found = vertices_about_origin(
            model(kind), vectors, record["Rh"][0], record["Th"][0], record["shapes"][0]
        )
        expected = vertices_about_origin(
            model(kind),
            motion.vectors[frame],
            motion.vectors[frame, 0],
            motion.translations[frame],
            shape[0],
        )
        assert_allclose(found, expected, rtol=0, atol=ATOL)
        assert_allclose(record["Th"][0], motion.translations[frame], rtol=0, atol=1e-7)
        assert_allclose(record["Rh"][0], motion.vectors[frame, 0], rtol=0, atol=1e-7)


def test_text_matches_easymocap_output(family, tmp_path):
    motion = family_motion(24, frames=1)
    written(family_animation(family("smpl"), motion), tmp_path / "out")
    data = (tmp_path / "out" / "smpl" / "000000.json").read_bytes()
    assert data.startswith(b'[\n    {\n        "id": 0,\n        "Rh": [\n          [')
    assert data.endswith(b"]\n        ]\n    }\n]\n")
    assert b"-0.0000000" not in data and b"0.0000000, 0.0000000, 0.0000000, " in data


@pytest.mark.parametrize("kind", ["smpl", "smplx"])
def test_motion_round_trips_through_amass(family, tmp_path, kind):
    figure, motion = family(kind), family_motion(COUNTS[kind])
    written(family_animation(figure, motion), tmp_path / "a")
    there = animation_of_clip(figure, clip_of(tmp_path / "a", figure))
    export_frames(there, tmp_path / "a.npz", "amass", ExportOptions(world_up="z"))
    back = read(Source.open(tmp_path / "a.npz"))
    again = animation_of_clip(figure, body_clip(back, figure)[0])
    frames, _ = written(again, tmp_path / "b")
    for first, second in zip(frames_in(tmp_path / "a").values(), frames.values(), strict=True):
        for key in ("Rh", "Th", "poses", "shapes"):
            assert_allclose(second[0][key], first[0][key], rtol=0, atol=ATOL)


def animation_of_clip(figure, clip):
    from viewer.rigs.motion.sampled_animation import sample_animation
    from viewer.rigs.scene import Actor

    return sample_animation(Actor(figure, clip=clip))


def test_recording_round_trips(shared_data, tmp_path):
    folder = shared_data / "smpl_synthetic"
    if not folder.is_dir():
        pytest.skip("no synthetic recording")
    figure = read(Source.open(folder / "SMPL_NEUTRAL.npz"))
    animations = [
        animation_of_clip(figure, clip_of(folder / "easymocap", figure, person))
        for person in (0, 1)
    ]
    notes = faults.lines(export_people(animations, tmp_path / "out", ExportOptions(world_up="z")))
    assert notes[0].startswith(f"{tmp_path}/out/smpl: 30 frames of 2 people, z up")
    found = frames_in(tmp_path / "out")
    wanted = frames_in(folder / "easymocap")
    assert found.keys() == wanted.keys()
    for frame, people in wanted.items():
        assert [record["id"] for record in found[frame]] == [record["id"] for record in people]
        for record, other in zip(people, found[frame], strict=True):
            assert_allclose(rotation(other["Rh"][0]), rotation(record["Rh"][0]), rtol=0, atol=ATOL)
            for key in ("Th", "poses", "shapes"):
                assert_allclose(other[key], record[key], rtol=0, atol=ATOL)


def test_people_and_gaps_are_written_to_common_files(family, tmp_path):
    figure = family("smpl")
    first = family_animation(figure, family_motion(24, rows=np.array([0, -1, 1]), first_frame=5))
    second = family_animation(
        figure, family_motion(24, first_frame=9, shape=waves(1, 10, seed=9.0))
    )
    notes = faults.lines(export_people([first, second], tmp_path, ExportOptions(), [7, 3]))
    frames = frames_in(tmp_path)
    assert {frame: [record["id"] for record in people] for frame, people in frames.items()} == {
        5: [7], 6: [], 7: [7], 8: [], 9: [3], 10: [3], 11: [3], 12: [3],
    }  # fmt: skip
    assert frames[7][0]["shapes"] == [np.round(waves(10, seed=2.0), 7).tolist()]
    assert frames[9][0]["shapes"] == [np.round(waves(10, seed=9.0), 7).tolist()]
    assert notes[1:] == ["person 7: frame 6 missing, as in the original motion"]
    timing = clip_of(tmp_path, figure, 7).timing
    assert (timing.first_frame, timing.present.tolist()) == (5, [True, False, True, *[False] * 5])


def test_expression_is_written(family, tmp_path):
    motion = family_motion(55, expression=waves(4, 10, seed=5.0))
    frames, _ = written(family_animation(family("smplx"), motion), tmp_path / "out")
    found = [people[0]["expression"][0] for people in frames.values()]
    assert_allclose(found, waves(4, 10, seed=5.0), rtol=0, atol=1e-7)


def test_different_up_axis_rotates_rh_and_th(family, tmp_path):
    animation = family_animation(family("smpl"), family_motion(24))
    frames, notes = written(animation, tmp_path / "out", up="z")
    quarter = rotation([np.pi / 2, 0, 0])
    motion = family_motion(24)
    for frame, people in frames.items():
        turned = quarter @ rotation(motion.vectors[frame, 0])
        assert_allclose(rotation(people[0]["Rh"][0]), turned, rtol=0, atol=ATOL)
        moved = quarter @ motion.translations[frame]
        assert_allclose(people[0]["Th"][0], moved, rtol=0, atol=ATOL)
    assert "z up" in notes[0]


# Folders


def test_older_frames_are_removed(family, tmp_path):
    long = family_animation(family("smpl"), family_motion(24, frames=6))
    short = family_animation(family("smpl"), family_motion(24, frames=2))
    written(long, tmp_path / "out")
    (tmp_path / "out" / "intri.yml").write_text("kept")
    frames, _ = written(short, tmp_path / "out")
    assert list(frames) == [0, 1]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["intri.yml", "smpl"]


def test_other_files_are_never_deleted(family, tmp_path):
    animation = family_animation(family("smpl"), family_motion(24))
    (tmp_path / "smpl").mkdir()
    (tmp_path / "smpl" / "000000.jpg").write_text("mine")
    with pytest.raises(OutputError) as caught:
        written(animation, tmp_path)
    assert str(caught.value) == (
        f"{tmp_path}/smpl: contains files other than frames (000000.jpg) and is not replaced"
    )
    assert [path.name for path in tmp_path.rglob("*")] == ["smpl", "000000.jpg"]


def test_file_in_place_of_the_folder_is_refused(family, tmp_path):
    path = tmp_path / "out"
    path.write_text("mine")
    with pytest.raises(OutputError, match=r"out: expected a folder, found a file$"):
        written(family_animation(family("smpl"), family_motion(24)), path)
    assert path.read_text() == "mine"


@pytest.mark.parametrize("problem", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("exists", [False, True])
def test_interrupted_export_keeps_existing_files(family, tmp_path, monkeypatch, exists, problem):
    animation = family_animation(family("smpl"), family_motion(24))
    path = tmp_path / "out"
    if exists:
        written(animation, path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.json")}
    calls = []

    def text(self, frame):
        calls.append(frame)
        if len(calls) == 3:
            raise problem
        return "{}"

    monkeypatch.setattr(easymocap._Records, "text", text)
    wanted = OutputError if isinstance(problem, OSError) else KeyboardInterrupt
    with pytest.raises(wanted) as caught:
        written(animation, path)
    if wanted is OutputError:
        assert str(caught.value) == f"{path}: No space left on device"
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.json")} == before
    assert [file.name for file in tmp_path.iterdir()] == ["out"] * exists
    assert not list(tmp_path.rglob(".*"))


# Refusals


def test_people_must_be_compatible(family, tmp_path):
    animation = family_animation(family("smpl"), family_motion(24))
    other = replace(animation, frame_rate=25.0)
    for animations, persons, message in (
        ([], [], "expected at least one actor to write, found none"),
        ([animation, animation], [1, 1], "expected a number for each of 2 people, found [1, 1]"),
        ([animation, other], None, "expected one frame rate for all people, found 25, 50"),
        (
            [replace(animation, first_frame=-2)],
            None,
            "walk: expected frame numbers from 0, found -2",
        ),
    ):
        with pytest.raises(RigError) as caught:
            export_people(animations, tmp_path / "out", ExportOptions(), persons)
        assert str(caught.value).replace(f"{animation.name}:", "walk:") == message
    nobody = replace(animation, frames=replace(animation.frames, present=np.zeros(4, dtype=bool)))
    with pytest.raises(RigError, match="no person is present in frame"):
        export_people([nobody], tmp_path / "out", ExportOptions())
    assert not list(tmp_path.iterdir())


def test_figures_of_other_families_are_refused(tmp_path):
    import viewer

    scene = viewer.load()
    clip = body_less(scene.actors[0].figure)
    with pytest.raises(RigError) as caught:
        written(animation_of_clip(scene.actors[0].figure, clip), tmp_path / "out")
    assert str(caught.value) == (
        "fox cannot be written as an EasyMocap folder: expected the joints of SMPL, SMPL+H, "
        "SMPL-X or MANO, found different ones"
    )


def body_less(figure):
    """Return a clip of one frame at rest."""
    from viewer.rigs.motion.sampled_clip import SampledClip
    from viewer.rigs.motion.timing import Timing

    rotations = np.tile([0.0, 0, 0, 1], (1, figure.skeleton.n_joints, 1))
    return SampledClip("rest", Timing(30.0, np.arange(1)), rotations)
