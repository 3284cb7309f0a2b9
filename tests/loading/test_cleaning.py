"""Clean-up of a scene: order of changes, notes, merging of people, and refusals."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from exporting import export_frames
from faults import told
from formats.capture_files import body, points, write_frames
from formats.easymocap.test_camera_files import cameras
from linting.sound import keypoints, legs, standing
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import leg
from rigs.retargeting.rest_twins import t_pose, written
from rigs.retargeting.walking import RATE, walk

from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import ExportOptions
from viewer.formats.rigged import save
from viewer.loading import Contents, MotionSettings, begin, bundled_body, load
from viewer.loading.cleaning import clean_up
from viewer.loading.placing import placed_views, stand_up
from viewer.loading.scene_draft import SceneDraft
from viewer.loading.settings import CleanUp
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.cleanup.smoothing import SavitzkyGolay
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.placed_figure import placed
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.scene import Actor, Scene, scene_unit

FIGURE = legs()


def person(number: int, first: int, stop: int, x: float = 0.0) -> Actor:
    """Return a person at x who is present in some of the frames 0 to 59, numbered from 100."""
    frames = np.arange(60)
    there = (frames >= first) & (frames < stop)
    clip = standing(FIGURE)
    timing = replace(clip.timing, rows=np.where(there, frames, -1).astype(np.int32), holds=False)
    places = np.tile([x, 0.0, 0.0], (60, 1))
    return Actor(
        FIGURE, clip=replace(clip, timing=timing, figure_translations=places), person=number
    )


def keys(notes) -> list[str]:
    return [note.key for note in notes]


def test_scene_is_not_changed_unless_requested():
    scene = Scene([person(0, 0, 60)])
    clip = scene.actors[0].clip
    assert clean_up(scene, CleanUp()) == [] and scene.actors[0].clip is clip


def test_tracks_are_merged_then_interpolated_then_trimmed_then_resampled():
    scene = Scene([person(3, 0, 20), person(7, 24, 60, x=0.4)])
    wanted = CleanUp(
        merged=((3, 7),), interpolates=True, smoothing=SavitzkyGolay(), frames=(110, 131), rate=60.0
    )
    notes = clean_up(scene, wanted)
    assert keys(notes) == [
        "X006.merged", "X006.gaps", "X006.smoothed", "X006.trimmed", "X006.resampled",
    ]  # fmt: skip
    (actor,) = scene.actors
    assert actor.person == 3
    timing = actor.clip.timing
    assert timing.n_frames == 41 and timing.present.all() and timing.frame_rate == 60.0
    assert actor.clip.start == pytest.approx(10 / 30, abs=1e-12)
    assert actor.is_present
    assert str(notes[1]).endswith(
        "4 missing frames in 1 gap interpolated; the longest is frames 120 to 123 (0.13 s)"
    )


def test_longer_gaps_remain_and_are_reported():
    scene = Scene([person(0, 0, 10), person(1, 45, 60)])
    notes = clean_up(scene, CleanUp(merged=((0, 1),), interpolates=True))
    assert keys(notes) == ["X006.merged", "X006.gaps-left"]  # 35 frames are more than a second
    assert notes[1].values["n"] == 1
    scene = Scene([person(0, 0, 10), person(1, 45, 60)])
    clean_up(scene, CleanUp(merged=((0, 1),), interpolates=True, longest_gap=35))
    assert scene.actors[0].clip.timing.present.all()


@pytest.mark.parametrize(("longest", "frames"), [(0.5, 15), (1.5, 45), (0.4, 12)])
def test_longest_gap_may_be_given_in_seconds(longest, frames):
    # At 30 frames per second, a gap of N frames lasts N / 30 seconds.
    for missing, is_left in ((frames, False), (frames + 1, True)):
        scene = Scene([person(0, 0, 10), person(1, 10 + missing, 60)])
        clean_up(scene, CleanUp(merged=((0, 1),), interpolates=True, longest_gap=longest))
        assert bool((~scene.actors[0].clip.timing.present).any()) == is_left


def test_person_tracked_twice_is_merged_with_the_frames_of_the_first():
    scene = Scene([person(0, 0, 30, x=0.0), person(1, 28, 60, x=0.1)])
    notes = clean_up(scene, CleanUp(merged=((1, 0),)))
    assert keys(notes) == ["X006.merged", "X006.overlap"]
    assert "2 frames (frames 128 to 129), 100 mm apart: the frames of person 1 are used" in str(
        notes[1]
    )
    (actor,) = scene.actors
    places = actor.clip.figure_translations[actor.clip.timing.rows, 0]
    assert_array_equal(places, [0.0] * 28 + [0.1] * 32)


def test_different_people_are_not_merged():
    scene = Scene([person(0, 0, 30, x=0.0), person(1, 28, 60, x=1.0)])
    with pytest.raises(RigError, match="two people"):
        clean_up(scene, CleanUp(merged=((0, 1),)))
    assert len(scene.actors) == 2


def test_missing_people_are_refused_with_the_known_numbers():
    scene = Scene([person(0, 0, 30)])
    with pytest.raises(RigError, match="among 0, found 5"):
        clean_up(scene, CleanUp(merged=((0, 5),)))


def test_motions_without_people_are_not_merged():
    actor = person(0, 0, 30)
    actor.person = None
    with pytest.raises(RigError, match="expected people with numbers, found none"):
        clean_up(Scene([actor]), CleanUp(merged=((0, 5),)))


def test_keypoints_are_cleaned_up():
    figure, clip = keypoints()
    rows = clip.timing.rows.copy()
    rows[5] = -1
    clip = replace(clip, timing=replace(clip.timing, rows=rows))
    scene = Scene([Actor(figure, clip=clip, person=2)])
    notes = clean_up(scene, CleanUp(interpolates=True, smoothing=SavitzkyGolay()))
    assert keys(notes) == ["X006.gaps", "X006.smoothed"]
    found = scene.actors[0].clip
    assert_allclose(found.points[found.timing.rows[5]], clip.points[0], atol=1e-12)


def test_displacement_is_measured_in_millimetres():
    # The spike is 100 mm in one frame; 5 points and degree 2 leave 17 / 35 of it.
    actor = person(0, 0, 60)
    places = np.zeros((60, 3))
    places[30, 2] = 0.1
    actor.clip = replace(actor.clip, figure_translations=places)
    (note,) = clean_up(Scene([actor]), CleanUp(smoothing=SavitzkyGolay(window=5)))
    largest = 100 * 18 / 35
    assert f"by {largest:.3g} mm at most (pelvis, frame 130)" in str(note)


@pytest.mark.parametrize("upside_down", [False, True])
def test_feet_are_moved_to_the_ground(upside_down):
    actor = person(0, 0, 60)
    places = np.tile([0.3, 0.25, 0.0], (60, 1))  # the ankles are 0.1 above the origin
    if upside_down:  # the world of the capture is upside down, and its placement makes it upright
        actor.placement = rotation_transform(0, np.pi)
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (60, 1))
        rotations = actor.clip.rotations.copy()
        rotations[:, 0] = turn
        # The pelvis at height 1 rotates in place and is then 1.25 below the origin of the file.
        places = np.tile([0.3, -2.25, 0.0], (60, 1))
        actor.clip = replace(actor.clip, rotations=rotations)
    actor.clip = replace(actor.clip, figure_translations=places)
    scene = Scene([actor], world_up="y")
    (note,) = clean_up(scene, CleanUp(grounds=True))
    assert str(note).endswith("lowered by 350 mm, so that its feet rest at height 0")
    expected = -1.9 if upside_down else -0.1
    found = scene.actors[0].clip.figure_translations
    assert_allclose(found, np.tile([0.3, expected, 0.0], (60, 1)), atol=1e-12)


def test_sliding_feet_are_held_in_place():
    actor = person(0, 0, 60)
    places = np.zeros((60, 3))
    places[:, 2] = 0.1 * np.arange(60) / 59
    actor.clip = replace(actor.clip, figure_translations=places)
    note, lowered = clean_up(Scene([actor]), CleanUp(locks_feet=True))
    assert note.key == "X006.locked" and note.values["n"] == 2
    assert lowered.key == "X006.locked-lowered"
    assert (note.values["before"], note.values["after"]) == ("200 mm", "0 mm")


def test_actors_without_feet_do_not_move():
    figure, clip = keypoints()
    scene = Scene([Actor(figure, clip=clip)])
    wanted = CleanUp(locks_feet=True, grounds=True)
    assert keys(clean_up(scene, wanted)) == ["X006.no-legs", "X006.no-feet"]
    assert scene.actors[0].clip is clip


def test_keyed_clips_are_refused_without_captures_and_otherwise_reported():
    keyed = Actor(FIGURE, clip=Clip("keys", (), 0.0, 1.0))
    wanted = CleanUp(smoothing=SavitzkyGolay())
    with pytest.raises(RigError, match="captured motion"):
        clean_up(Scene([keyed]), wanted)
    notes = clean_up(Scene([keyed, person(0, 0, 60)]), wanted)
    assert keys(notes) == ["X006.keys", "X006.smoothed"]


@pytest.mark.parametrize("frames", [(0, 10), (150, 161), (120, 120)])
def test_ranges_outside_the_frames_of_the_file_are_refused(frames):
    with pytest.raises(RigError, match="100:160"):
        clean_up(Scene([person(0, 0, 60)]), CleanUp(frames=frames))


def test_note_states_the_smoothing_windows_that_were_used():
    # At 30 frames per second, 0.2 s are 7 frames; a run of 4 frames uses 3, and a run of 1 is not
    # smoothed.
    scene = Scene([person(0, 0, 4), person(1, 8, 9), person(2, 12, 60)])
    wanted = CleanUp(merged=((0, 1, 2),), smoothing=SavitzkyGolay())
    *_, note = clean_up(scene, wanted)
    assert "Savitzky-Golay filter, 3 to 7 frames, degree 2; 1 run with too few frames is un" in str(
        note
    )


def driven() -> Actor:
    """Return a person with a motion retargeted from a skeleton with the same joints."""
    actor = person(0, 0, 60)
    drive = Drive(SkeletonMotion(actor.figure, actor.clip))
    return replace(actor, clip=driven_clip(drive, actor.figure)[0], drive=drive)


def test_motions_that_are_retargeted_again_are_cleaned_up_again():
    actor = driven()
    clean_up(Scene([actor]), CleanUp(smoothing=SavitzkyGolay(), frames=(110, 131), rate=60.0))
    again = actor.drive.finish(driven_clip(actor.drive, actor.figure)[0])
    assert_array_equal(again.rotations, actor.clip.rotations)
    assert again.timing.n_frames == actor.clip.timing.n_frames == 41


def test_keypoints_of_merged_people_get_the_first_number():
    figure, clip = keypoints()
    scene = Scene([person(3, 0, 60), Actor(figure, clip=clip, person=7)])
    (note,) = clean_up(scene, CleanUp(merged=((3, 7),)))
    assert note.key == "X006.renumbered"
    assert str(note) == "keypoints of person 7 assigned to person 3"
    assert [actor.person for actor in scene.actors] == [3, 3]


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    path = tmp_path_factory.mktemp("walk") / "walk.bvh"
    motion = written(t_pose(), *walk(), rate=RATE)
    actor = Actor(motion.figure, clip=motion.clip)
    export_frames(sample_animation(actor), path, "bvh", ExportOptions())
    return path


def feet_notes(scene):
    return [key for key, _ in told(scene.diagnostics) if ".feet-" in key]


def test_feet_are_planted_by_default(walking):
    (planted,) = load(walking, bundled_body()).actors
    plain = load(walking, bundled_body(), motion=MotionSettings(feet=False))
    assert feet_notes(plain) == []
    legs = [planted.figure.skeleton.names.index(f"left_{part}") for part in ("knee", "hip")]
    rotations = plain.actors[0].clip.rotations
    assert np.abs(planted.clip.rotations - rotations)[:, legs].max() > 1e-3
    named = load(walking, motion=MotionSettings(model=bundled_body()))
    assert feet_notes(named)[:2] == ["F007.feet-planted", "F007.feet-gap"]
    np.testing.assert_array_equal(named.actors[0].clip.rotations, planted.clip.rotations)


@pytest.mark.slow
def test_option_and_note_are_the_same_in_every_command(walking, capsys):
    out = str(walking.with_name("out.bvh"))
    for words, is_said in ((), True), (("--feet", "on"), True), (("--feet", "off"), False):
        assert run(["convert", str(walking), "--body", "-o", out, "--force", *words]) == 0
        assert ("feet of body planted during 6 contacts" in capsys.readouterr().err) is is_said
    assert run(["render", str(walking), "--feet", "no", "-o", "x.png"]) == 2
    assert "--feet" in capsys.readouterr().err


def opened(*units):
    figures = [(Path(f"{unit}.glb"), replace(leg(name=unit), unit=unit)) for unit in units]
    return begin(Contents(figures=figures))[0]


@pytest.mark.parametrize(
    ("units", "factors", "unit"),
    [
        (("m", "cm"), (1.0, 0.01), "m"),
        (("cm", "m", "in"), (1.0, 100.0, 2.54), "cm"),
        (("", "mm", "m"), (1.0, 1.0, 1000.0), "mm"),  # unknown units are not scaled
        (("cm", "cm"), (1.0, 1.0), "cm"),
    ],
)
def test_figures_are_scaled_to_the_unit_of_the_first(units, factors, unit):
    scene = opened(*units)
    linear = [actor.placement[:3, :3] for actor in scene.actors]
    assert_allclose(linear, [factor * np.eye(3) for factor in factors], atol=1e-12)
    assert scene_unit(scene) == unit
    notes = [found for found in scene.diagnostics if found.key == "F007.unit-matched"]
    assert [note.values["factor"] for note in notes] == pytest.approx(
        [factor for factor in factors if factor != 1.0]
    )
    assert all(note.severity == "note" for note in notes)


def test_scaled_figures_stand_side_by_side():
    scene = opened("m", "cm")
    sides = [actor.placement[0, 3] for actor in scene.actors]
    # The second is 0.01 times as wide as the first.
    assert 0.0 < sides[1] - sides[0] < 3.0


def test_later_people_and_cameras_of_a_capture_are_scaled(tmp_path):
    known = load(bundled_body()).actors[0].figure
    longer = placed(known, np.diag([100.0, 100.0, 100.0, 1.0]))
    skeleton = longer.skeleton
    names = ("Hips", *skeleton.names[1:])  # another name, so that the capture drives the figure
    save(
        replace(longer, unit="cm", skeleton=replace(skeleton, names=names)),
        tmp_path / "large.npz",
    )
    folder = tmp_path / "capture"
    first, both = (0,), (0, 1)
    for name, record in {"smpl": body, "keypoints3d": points}.items():
        frames = {
            n: [record(person) for person in people] for n, people in enumerate([first, both])
        }
        write_frames(folder / name, frames)
    cameras(folder)
    scene = load(tmp_path / "large.npz", folder)
    assert scene_unit(scene) == "cm"
    scales = [np.linalg.norm(a.placement[:3, 0]) for a in scene.actors if a.figure.points]
    assert scales == pytest.approx([100.0, 100.0])
    assert_allclose(scene.views[0].translation, [50.0, -100.0, 300.0])
    notes = [found for found in scene.diagnostics if found.key == "F007.unit-matched"]
    assert len(notes) == 1  # of the first person only


def test_later_people_and_cameras_are_upright():
    late, draft = SimpleNamespace(placement=np.eye(4), up="y", views=(), unit=""), SceneDraft([])
    late.views = (CameraView("1", np.eye(3), np.eye(3), np.array([0.0, 1.0, 0.0])),)
    draft.builders = [late]
    stand_up(draft, "z")
    assert_allclose(late.placement[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    view = placed_views(draft)[0]
    assert_allclose(-view.rotation.T @ view.translation, [0.0, 0.0, -1.0], atol=1e-12)
