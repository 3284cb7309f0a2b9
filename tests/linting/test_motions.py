"""Checks of motions: ground, jitter and sliding feet."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from faults import told
from linting.planted import moving
from linting.sound import FRAMES, RATE, legs, scene_of, standing

from viewer.linting import Finding, LintOptions, lint_scene
from viewer.linting.jitter import noise_of
from viewer.rigs.feet.ground import Ground, ground_of
from viewer.rigs.motion.timing import Timing

Change = Callable[[np.ndarray], np.ndarray]
FLOORS = [0.0, 0.8, -0.95]
_K = np.arange(FRAMES)


def found(heights: np.ndarray, floor: float, **options: object) -> list[Finding]:
    """Check legs with a root offset from the floor by a given height in each frame."""
    figure = legs()
    clip, count = standing(figure), len(heights)
    places = np.zeros((count, figure.skeleton.n_joints, 3))
    places[:, 0, 1] = heights + floor
    clip = replace(
        clip,
        rotations=np.tile(clip.rotations[:1], (count, 1, 1)),
        translations=places,
        timing=Timing(RATE, np.arange(count), first_frame=100),
    )
    # Where heights change within a frame, the body also jumps.
    checked = lint_scene(scene_of(figure, clip), LintOptions(**options))
    return [one for one in checked if one.code not in ("C003", "C020")]


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("depth", [0.02, 0.05, 0.1, 0.2])
def test_short_sinking_is_found_at_any_depth_and_floor(depth, floor):
    (sunk,) = found(np.where((_K >= 20) & (_K < 30), -depth, 0.0), floor)
    assert sunk.code == "C008" and sorted(sunk.frames.tolist()) == list(range(120, 130))
    values = {"joint": "left_ankle", "depth": f"{1000 * depth:g} mm", "frame": 120}
    assert told([sunk.diagnostic]) == [("C008.foot", {"n": 10, "all": 60, **values})]


@pytest.mark.parametrize("depth", [0.02, 0.05, 0.1, 0.2])
def test_sinking_for_half_of_the_motion_is_found_at_the_default_ground(depth):
    (sunk,) = found(np.where(_K >= 30, -depth, 0.0), 0.0)
    assert sunk.code == "C008" and sorted(sunk.frames.tolist()) == list(range(130, 160))


@pytest.mark.parametrize("depth", [0.05, 0.1, 0.2])
def test_sinking_for_half_of_the_motion_elsewhere_is_ambiguous(depth):
    (note,) = found(np.where(_K >= 30, -depth, 0.0), 0.8)
    # The ankles of the legs are 0.1 above the floor of the root.
    assert (note.code, note.severity) == ("C013", "note")
    levels = [f"{height:.3g} for 1 s" for height in (0.9, 0.9 - depth)]
    assert told([note.diagnostic]) == [("C013.heights", {"n": 2, "levels": levels})]


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("depth", [0.1, 0.2])
def test_ramp_down_after_standing_is_found(depth, floor):
    (sunk,) = found(np.where(_K >= 30, -depth * (_K - 30) / 29, 0.0), floor)
    assert sunk.code == "C008" and sunk.frames[0] == 159
    values = sunk.diagnostic.values
    assert (values["joint"], values["depth"]) == ("left_ankle", f"{1000 * depth:g} mm")


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("depth", [0.05, 0.1, 0.2])
def test_ramp_without_a_level_is_ambiguous(depth, floor):
    assert [f.code for f in found(-depth * _K / 59, floor)] == ["C013"]


@pytest.mark.parametrize("floor", [0.015, 0.02, 0.03, 0.05, -0.02, -0.05, 0.8])
@pytest.mark.parametrize("depth", [0.01, 0.02, 0.03, 0.05])
@pytest.mark.parametrize("count", [6, 8, 12, 14])
def test_feet_sunk_for_some_time_are_found_near_the_default_ground(floor, depth, count):
    # In the rest pose the feet are on floor 0, so sunken feet may be standing there.
    sunk = found(np.where((_K >= 20) & (20 + count > _K), -depth, 0.0), floor)
    assert [f.code for f in sunk] == ["C008"]
    assert sorted(sunk[0].frames.tolist()) == list(range(120, 120 + count))


@pytest.mark.parametrize("height", [0.1, 0.2, 0.4])
@pytest.mark.parametrize("count", [8, 14, 19])
def test_short_stay_on_the_default_ground_far_below_is_ambiguous(height, count):
    # The body may stand or sit higher, or may have sunk, which is undecidable.
    (note,) = found(np.where(count > _K, 0.0, height), 0.0)
    assert note.diagnostic.key == "C013.heights" and note.diagnostic.values["n"] == 2
    highest = note.diagnostic.values["levels"][0]
    assert highest.values["height"] == pytest.approx(0.1 + height)


@pytest.mark.parametrize("count", [8, 14, 19])
def test_long_stay_below_the_default_ground_is_ambiguous(count):
    assert [f.code for f in found(np.where(count > _K, 0.0, -0.05), 0.0)] == ["C013"]


@pytest.mark.parametrize("height", [0.1, 0.4])
@pytest.mark.parametrize("count", [22, 30, 40])
def test_default_ground_breaks_a_near_tie(height, count):
    assert found(np.where(count > _K, 0.0, height), 0.0) == []
    (sunk,) = found(np.where(count > _K, 0.0, -height), 0.0)
    assert sunk.code == "C008" and sorted(sunk.frames.tolist()) == list(range(100 + count, 160))


SOUND = {
    "standing": 0.0 * _K,
    "stairs up": 0.17 * (_K // 10),
    "stairs down": -0.17 * (_K // 10),
    "stairs down after standing": -0.17 * np.clip((_K - 20) // 8, 0, 3),
    # The jump has 0.5 s in the air with v = g t / 2, and 5 frames on the ground.
    "jumping": np.maximum(0.0, np.where(
        _K % 20 >= 5, 2.45 * (_K % 20 - 5) / RATE - 4.9 * ((_K % 20 - 5) / RATE) ** 2, 0.0
    )),
    "walking": 0.006 * np.sin(_K),
    "noise": np.random.default_rng(0).normal(0.0, 0.008, 300),
}  # fmt: skip


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("name", SOUND)
def test_valid_motions_have_no_findings(name, floor):
    jitter = {"C014"} if name == "noise" else set()
    assert {f.code for f in found(SOUND[name], floor)} - {"C013"} == jitter
    if "stairs" not in name:
        assert {f.code for f in found(SOUND[name], floor)} == jitter


def test_single_noisy_frame_is_ignored_unless_deep():
    assert found(np.where(_K == 30, -0.02, 0.0), 0.0) == []
    (sunk,) = found(np.where(_K == 30, -0.03, 0.0), 0.0)
    values = {"n": 1, "all": 60, "joint": "left_ankle", "depth": "30 mm", "frame": 130}
    assert told([sunk.diagnostic]) == [("C008.foot", values)]


def test_ground_can_be_given_or_disabled():
    half = np.where(_K >= 30, -0.1, 0.0)
    (sunk,) = found(half, 0.8, ground=0.9)
    assert sunk.code == "C008" and len(sunk.frames) == 30
    (floats,) = found(half, 0.8, ground=0.8)
    assert floats.code == "C016" and len(floats.frames) == 30
    assert found(half, 0.8, ground="none") == []


@pytest.mark.parametrize("floor", [0.0, 0.8])
@pytest.mark.parametrize("height", [0.03, 0.05])
def test_stay_slightly_above_the_ground_is_found(height, floor):
    # 3 to 6 % of a height of 0.9 is too high for soles and too low for a step.
    (floats,) = found(np.where(_K >= 48, height, 0.0), floor)
    values = {"n": 12, "all": 60, "height": f"{1000 * height:g} mm", "frame": 148}
    assert told([floats.diagnostic]) == [("C016.foot", values)]
    assert floats.frames.tolist() == list(range(148, 160))


def test_short_stay_above_the_ground_is_not_reported_as_floating():
    assert found(np.where((_K >= 40) & (_K < 47), 0.05, 0.0), 0.0) == []


def test_body_that_floats_and_rotates_has_no_ground():
    rises = 2.0 + 0.3 * np.sin(2.0 * np.pi * _K / 20)
    (note,) = found(rises, 0.0)
    assert told([note.diagnostic]) == [("C013.no-height", {})]


def test_ground_levels_are_listed_longest_first():
    lowest = np.concatenate([np.full(40, 5.0), np.full(10, 4.0), np.full(12, 6.0)])
    here = np.ones(62, dtype=np.bool_)
    assert ground_of(lowest, here, 1 / 30, 1.7) == Ground(5.0, ((5.0, 40), (6.0, 12), (4.0, 10)))


def test_empty_scene_has_no_ground():
    assert ground_of(np.zeros(9), np.zeros(9, dtype=np.bool_), 1 / 30, 1.7) == Ground(None)


def test_absent_people_are_ignored():
    lowest = np.where(np.arange(60) < 40, 7.0, 1.0)
    found_ground = ground_of(lowest, np.arange(60) < 40, 1 / 30, 1.7)
    assert found_ground == Ground(7.0, ((7.0, 40),))


def test_longest_level_is_used_except_for_near_ties():
    here = np.ones(240, dtype=np.bool_)

    def ground(count: int) -> float | None:
        lowest = np.where(np.arange(240) < count, -0.02, 0.03)
        return ground_of(lowest, here, 1 / 60, 1.7, (0.0,)).height

    # Of 240 frames, 30 to 60 are at most a third of the others, 70 are more, and 80 or more are
    # half.
    assert [ground(count) for count in (30, 45, 60)] == [0.03] * 3
    assert ground(70) is None
    assert [ground(count) for count in (80, 120, 200)] == [-0.02] * 3


TIME = np.arange(FRAMES) / RATE


def codes(change) -> set[str]:
    return {finding.code for finding in lint_scene(moving(change))}


def test_noise_is_measured_as_its_quadratic_mean():
    places = np.random.default_rng(0).normal(0.0, 0.01, (3000, 4, 3))
    found = noise_of(places, np.ones(3000, dtype=np.bool_), 15)
    middle = found[10:-10]
    # The noise is 17.3 mm in three dimensions; the fifth of 15 overlapping values varies by some 20
    # %.
    assert np.median(middle) == pytest.approx(0.01 * np.sqrt(3.0), rel=0.05)
    assert found[:9].max() == found[-9:].max() == 0.0


def test_noise_of_many_frames_is_that_of_each_batch():
    places = np.random.default_rng(1).normal(size=(4100, 1, 3))
    whole = noise_of(places, np.ones(4100, dtype=np.bool_), 15)
    part = noise_of(places[1990:2030], np.ones(40, dtype=np.bool_), 15)
    np.testing.assert_allclose(whole[2000:2020], part[10:30], atol=1e-15)


@pytest.mark.parametrize(("hertz", "metres"), [(1.0, 0.5), (2.0, 0.12), (0.2, 3.0)])
def test_fast_smooth_motion_is_not_reported_as_jitter(hertz, metres):
    def swing(root, _):
        root[:, 0] = metres * np.sin(2.0 * np.pi * hertz * TIME)

    assert "C014" not in codes(swing)


def test_jumps_are_not_reported_as_jitter():
    def jump(root, _):
        root[:, 0] = 0.5 * (np.arange(FRAMES) // 8)

    assert "C014" not in codes(jump)


def test_noise_does_not_span_gaps():
    places = np.zeros((60, 1, 3))
    places[30:] = 5.0
    present = np.ones(60, dtype=np.bool_)
    present[29] = False
    assert noise_of(places, present, 5).max() == 0.0


def test_slow_recordings_are_not_checked():
    def shake(root, _):
        root[:, 0] = np.random.default_rng(2).normal(0.0, 0.05, FRAMES)

    scene = moving(shake)
    assert "C014" in {finding.code for finding in lint_scene(scene)}
    clip = scene.actors[0].clip
    scene.actors[0].clip = replace(clip, timing=replace(clip.timing, frame_rate=12.0))
    assert "C014" not in {finding.code for finding in lint_scene(scene)}


def codes_of_legs(left: np.ndarray, right: np.ndarray, root: np.ndarray | None = None) -> list[str]:
    """Check legs whose ankles move along z by given distances, always 2 mm above the ground.

    ``root``: distance by which the body moves, in addition.
    """
    figure = legs()
    clip, count = standing(figure), len(left)
    places = np.zeros((count, figure.skeleton.n_joints, 3))
    names = figure.skeleton.names
    for name, path in (("left_ankle", left), ("right_ankle", right)):
        places[:, names.index(name), 2] = path
    places[:, 0, 2] = 0.0 if root is None else root
    clip = replace(clip, rotations=np.tile(clip.rotations[:1], (count, 1, 1)), translations=places)
    # The ankles move alone, so that the shins change their length.
    return [one.code for one in lint_scene(scene_of(figure, clip)) if one.code != "C022"]


def steps(start: int, length: int, distance: float) -> np.ndarray:
    """Return a path that moves smoothly by a distance in some frames and rests otherwise."""
    x = np.clip((_K - start) / length, 0.0, 1.0)
    return distance * x * x * (3.0 - 2.0 * x)


STILL = np.zeros(FRAMES)


def test_low_swings_next_to_a_standing_foot_are_not_slides():
    # 0.5 m in 0.4 s, at up to 1.9 m/s.
    swings = steps(5, 12, 0.5) + steps(40, 12, 0.5)
    assert codes_of_legs(swings, STILL) == []
    assert codes_of_legs(STILL, swings) == []


@pytest.mark.parametrize("speed", [0.35, 0.5, 0.8, 2.5])
def test_feet_that_slide_together_are_found(speed):
    # The body moves with the feet, as if on wheels. Feet slide above 0.2 * 1.6 = 0.32 m/s, and a
    # single one swings above 1.34 * 1.6 = 2.1 m/s.
    assert "C007" in codes_of_legs(STILL, STILL, speed * _K / RATE)


def test_feet_that_stand_on_moving_ground_are_not_slides():
    # The body stays in place, as on a treadmill or in a motion whose travel was removed.
    assert codes_of_legs(-0.5 * _K / RATE, -0.5 * _K / RATE) == []
    # The feet move back at 0.4 m/s and the body ahead at 0.4 m/s.
    assert "C007" in codes_of_legs(-0.8 * _K / RATE, -0.8 * _K / RATE, 0.4 * _K / RATE)


def test_standing_foot_that_starts_to_drift_is_found():
    assert "C007" in codes_of_legs(steps(10, 20, 0.2), STILL)


@pytest.mark.parametrize("speed", [0.4, 0.8])
def test_foot_dragged_next_to_a_standing_foot_is_found(speed):
    assert "C007" in codes_of_legs(speed * _K / RATE, STILL)
    assert "C007" in codes_of_legs(STILL, speed * _K / RATE)


def test_short_landings_are_not_slides():
    # Each foot lands within 0.13 s.
    assert codes_of_legs(steps(10, 4, 0.06), steps(30, 4, 0.06)) == []
