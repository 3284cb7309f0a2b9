"""Feet of driven figures, planted during the stances of the source."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.retargeting.rest_twins import NAMES, PERSON, X, Y, along_x, t_pose, written
from rigs.retargeting.two_people import figure_of, places
from rigs.retargeting.walking import N_WALK, RATE, stands, walk

from viewer.loading import bundled_body, load
from viewer.rigs.arrays import Floats
from viewer.rigs.feet.contacts import FootPath, foot_contacts
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import axis_rotations, matrix_to_quaternion
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.placed_figure import bound_in
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.driven_feet import plant_feet
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.shape import rest_joints
from viewer.rigs.skeleton import ball_skeleton

SIDES = ("Left", "Right")
PLATEAU = 8  # frames at either end of a stance in which the foot lands or rolls off
EXACT = 1e-9  # cm


def person(thigh: float, shin: float, foot: float, hips: float, lift: float = 0.0) -> Figure:
    """Return a person whose thighs, shins, feet and hips are scaled by factors.

    ``lift``: added to the height of all joints but the toes.
    """
    table = {name: (parent, np.array(place, float)) for name, (parent, place) in PERSON.items()}
    old = {name: place.copy() for name, (_, place) in table.items()}

    def bone(end: str, start: str, factor: float) -> None:
        place = table[start][1] + factor * (old[end] - old[start])
        table[end] = (table[end][0], place)

    for side in SIDES:
        hip = table[f"{side}UpLeg"]
        table[f"{side}UpLeg"] = (hip[0], hip[1] * [hips, 1.0, 1.0])
        bone(f"{side}Leg", f"{side}UpLeg", thigh)
        bone(f"{side}Foot", f"{side}Leg", shin)
        bone(f"{side}ToeBase", f"{side}Foot", foot)
    for name, (_, place) in table.items():
        place += 0.0 if name.endswith("ToeBase") else np.array([0.0, lift, 0.0])
    # The hierarchies differ, so joints are matched by meaning.
    names = {name: f"{name}_" for name in table}
    return figure_of({names[n]: (names.get(p, ""), q) for n, (p, q) in table.items()}, "other")


# Relative to the source, the thighs and feet are longer, the shins shorter and the hips wider.
OTHER = person(1.15, 0.85, 1.3, 1.4)


def planted(figure: Figure = OTHER, axes: Floats | None = None, **how: float):
    motion = written(t_pose() if axes is None else axes, *walk(**how), rate=RATE)
    found = retarget(motion, figure, source_rest="auto")
    return found, *plant_feet(found, figure)


def parents(figure: Figure) -> list[str]:
    names = figure.skeleton.names
    return ["" if parent < 0 else names[parent] for parent in figure.skeleton.parents]


def slid(figure: Figure, clip: SampledClip, names: tuple[str, str]) -> list[Floats]:
    """Return the horizontal movement of the balls in the middle of every stance."""
    where, result = places(figure, clip), []
    for side, name in zip(SIDES, names, strict=True):
        flags = stands(side)
        for start in np.flatnonzero(flags[1:] & ~flags[:-1]) + 1:
            part = where[name][start + PLATEAU : start + 60 - PLATEAU]
            if len(part) == 60 - 2 * PLATEAU:
                result.append(np.ptp(part[:, [0, 2]], axis=0))
    return result


TOES = ("LeftToeBase_", "RightToeBase_")


def test_standing_feet_are_fixed_on_the_ground():
    found, clip, changes = planted()
    before, after = slid(OTHER, found.clip, TOES), slid(OTHER, clip, TOES)
    assert len(after) == 3 and np.max(before) > 1.0
    assert_allclose(after, 0.0, atol=EXACT)
    assert changes.n_contacts == 6 and changes.after < changes.source < changes.before
    # The soles of a skeleton are its lowest joints, here the balls, at height 0 in the rest pose.
    where = places(OTHER, clip)
    for side, name in zip(SIDES, TOES, strict=True):
        flags = stands(side) & np.roll(stands(side), PLATEAU) & np.roll(stands(side), -PLATEAU)
        assert_allclose(where[name][flags][:, 1], 0.0, atol=EXACT)
        assert where[name][:, 1].min() > -EXACT
    assert changes.gap_after < EXACT < changes.gap_before


def test_legs_keep_their_length_and_feet_and_trunk_keep_their_orientation():
    found, clip, _ = planted()
    assert_allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0, atol=1e-9)
    old, new = places(OTHER, found.clip), places(OTHER, clip)
    for start, end in (("LeftUpLeg_", "LeftLeg_"), ("LeftLeg_", "LeftFoot_")):
        length = np.linalg.norm(old[end] - old[start], axis=1)
        assert_allclose(np.linalg.norm(new[end] - new[start], axis=1), length, atol=1e-9)
    for start, end in (("LeftFoot_", "LeftToeBase_"), ("Hips_", "Head_")):
        assert_allclose(new[end] - new[start], old[end] - old[start], atol=1e-9)


def test_knees_accelerate_little_more_than_in_the_source():
    found, clip, _ = planted()
    where = places(OTHER, clip), places(found.source.figure, found.source.clip)
    peaks = []
    for points, tail in zip(where, ("_", ""), strict=True):
        hip, knee, ankle = (points[f"Left{part}{tail}"] for part in ("UpLeg", "Leg", "Foot"))
        cosines = np.einsum("fa,fa->f", hip - knee, ankle - knee) / (
            np.linalg.norm(hip - knee, axis=1) * np.linalg.norm(ankle - knee, axis=1)
        )
        peaks.append(np.abs(np.diff(np.arccos(cosines), 2)).max())
    assert peaks[0] < 1.2 * peaks[1]


def test_feet_are_planted_at_the_height_of_each_stair():
    found, clip, changes = planted(rise=8.0)
    assert changes.is_better
    where = places(OTHER, clip)
    for side, name in zip(SIDES, TOES, strict=True):
        own = where[name][stands(side)][:, 1]
        steps = np.unique(np.round(own / (8.0 * found.scale), 2))
        assert_allclose(steps, np.round(steps), atol=0.05)
        assert len(np.unique(np.round(steps))) > 1
    assert_allclose(slid(OTHER, clip, TOES), 0.0, atol=EXACT)


def test_planting_does_not_depend_on_the_rest_pose_of_the_file():
    clips = [planted(axes=axes)[1] for axes in (t_pose(), along_x())]
    first, second = (places(OTHER, clip) for clip in clips)
    for name in ("LeftLeg_", "RightFoot_", "LeftToeBase_"):
        # The tolerance is in cm; the rest pose is estimated.
        assert_allclose(first[name], second[name], atol=0.5)


def test_feet_of_a_figure_with_z_up_are_planted_on_its_ground():
    over = axis_rotations(0, np.asarray(np.pi / 2))
    joints = zip(parents(OTHER), rest_joints(OTHER), strict=True)
    table = dict(zip(OTHER.skeleton.names, joints, strict=True))
    figure = figure_of(table, "z", over, up="z")
    upright, found = places(OTHER, planted()[1]), places(figure, planted(figure)[1])
    for name in TOES:
        assert_allclose(found[name], upright[name] @ over.T, atol=1e-9)


def test_root_with_a_scale_is_supported():
    table = dict(
        zip(OTHER.skeleton.names, zip(parents(OTHER), rest_joints(OTHER), strict=True), strict=True)
    )
    for toe in TOES:  # the balls are above the soles
        table[f"{toe}tip"] = toe, table[toe][1] + [0.0, -4.0, 4.0]
    large = figure_of(table, "tips")
    skeleton = large.skeleton
    moved, scales = skeleton.rest_translations.copy(), skeleton.rest_scales.copy()
    moved[0] *= 0.01
    scales[0] = 0.01
    figure = replace(large, skeleton=replace(skeleton, rest_translations=moved, rest_scales=scales))
    first, second = places(large, planted(large)[1]), places(figure, planted(figure)[1])
    for name in TOES:
        assert_allclose(first[name][stands(name[:-8])].min(axis=0)[1], 4.0, atol=EXACT)
        assert_allclose(100.0 * second[name], first[name], atol=1e-9)


def test_figure_with_the_proportions_of_the_source_is_unchanged():
    twin = figure_of({f"{n}_": (p and f"{p}_", q) for n, (p, q) in PERSON.items()}, "same")
    found, clip, changes = planted(twin)
    assert changes is None and clip is found.clip


@pytest.mark.parametrize(("lift", "rise"), [(22.0, 0.0), (0.0, 20.0)])
def test_feet_stand_on_the_ground_of_a_source_without_toes(lift, rise):
    # The ankles of the figure or of the source, 8 cm above the ground else, are higher than those
    # of the other.
    figure = person(1.15, 0.85, 1.0, 1.4, lift=lift)
    rotations, path = walk()
    full = written(t_pose(), rotations, path + rise * Y, rate=RATE)
    skeleton = full.figure.skeleton
    kept = [j for j, name in enumerate(skeleton.names) if not name.endswith("ToeBase")]
    names = tuple(skeleton.names[joint] for joint in kept)
    parents_of = [kept.index(p) if p >= 0 else -1 for p in skeleton.parents[kept]]
    places_of = rest_joints(full.figure)[kept]
    bare = ball_skeleton(names, np.array(parents_of, dtype=np.int32), places_of)
    motion = replace(
        full,
        figure=replace(full.figure, skeleton=bare),
        clip=replace(
            full.clip,
            rotations=full.clip.rotations[:, kept],
            translations=full.clip.translations[:, kept],
        ),
    )
    clip, changes = plant_feet(retarget(motion, figure), figure)
    assert changes.is_better
    for side in SIDES:
        balls = places(figure, clip)[f"{side}ToeBase_"][stands(side), 1]
        # Without a mesh, the balls are the lowest points of the soles.
        assert_allclose(balls.min(), 0.0, atol=EXACT)


def test_feet_are_unchanged_if_the_source_never_stands():
    rotations, path = walk()
    path[:, 2] += 10.0 * np.arange(N_WALK)  # 6 m/s, as on a bicycle
    found = retarget(written(t_pose(), rotations, path, rate=RATE), OTHER)
    clip, changes = plant_feet(found, OTHER)
    assert clip is found.clip and changes.n_contacts == 0


def test_foot_held_still_in_the_air_is_not_planted():
    rotations, path = np.tile(np.eye(3), (60, len(NAMES), 1, 1)), np.zeros((60, 3))
    swing = 0.2 * np.sin(np.linspace(0.0, 6.0, 60))
    # The body rotates about its left foot, which is planted.
    rotations[:, 0] = axis_rotations(1, swing)
    for name in NAMES[1:]:
        rotations[:, NAMES.index(name)] = rotations[:, 0]
    bent = axis_rotations(0, np.asarray(1.5))
    for name in ("RightLeg", "RightFoot", "RightToeBase"):
        rotations[:, NAMES.index(name)] = rotations[:, 0] @ bent
    found = retarget(written(t_pose(), rotations, path, rate=RATE), OTHER)
    clip, changes = plant_feet(found, OTHER)
    old, new = places(OTHER, found.clip), places(OTHER, clip)
    assert changes.n_contacts == 1
    # The foot follows the body, except that the body is lowered for the straight left leg.
    away = (new["RightToeBase_"] - old["RightToeBase_"]) - (new["Hips_"] - old["Hips_"])
    assert_allclose(away[:, [0, 2]], 0.0, atol=1e-9)
    assert away[:, 1].min() > -1e-9 and away[:, 1].max() < changes.lowered + 1e-9


def test_motions_of_two_frames_or_with_gaps_are_supported():
    motion = written(t_pose(), *walk(), rate=RATE)
    rows = np.arange(N_WALK)
    rows[100:110] = -1
    for timing in (
        replace(motion.clip.timing, rows=rows),
        replace(motion.clip.timing, rows=rows[:2]),
    ):
        moving = replace(motion, clip=replace(motion.clip, timing=timing))
        clip, _ = plant_feet(retarget(moving, OTHER), OTHER)
        assert (clip.timing.present == timing.present).all()


@pytest.mark.parametrize("plants", [True, False])
def test_upside_down_world_results_in_the_same_feet(plants):
    rotations, path = walk()
    over = axis_rotations(0, np.asarray(np.pi))
    # At rest the hips are at a height of 100, which is the origin of their path.
    moved = (path + 100.0 * Y) @ over.T - 100.0 * Y
    motion = written(t_pose(), over @ rotations, moved, rate=RATE)
    upright = written(t_pose(), rotations, path, rate=RATE)
    straight, _ = driven_clip(Drive(upright, plants_feet=plants), OTHER)
    turned, _ = driven_clip(Drive(replace(motion, hangs=True), plants_feet=plants), OTHER)
    first, second = places(OTHER, straight), places(OTHER, turned)
    assert_allclose(second["LeftToeBase_"] @ over, first["LeftToeBase_"], atol=1e-6)


def test_planting_can_be_switched_off_and_is_reported():
    motion = written(t_pose(), *walk(), rate=RATE)
    clip, notes = driven_clip(Drive(motion, plants_feet=False), OTHER)
    assert not any(note.key.startswith("F007.feet") for note in notes)
    assert_allclose(clip.rotations, retarget(motion, OTHER).clip.rotations, atol=0.0)
    _, notes = driven_clip(Drive(motion), OTHER)
    text = str(next(note for note in notes if note.key == "F007.feet-planted"))
    assert "planted during 6 contacts" in text and "--feet off" in text


def test_figure_bound_as_a_runner_stands_on_the_same_ground():
    body = replace(load(bundled_body()).actors[0].figure, correctives=None, joint_regressor=None)
    pose = figure_pose(body)
    for name, vector in (
        *(("left_hip", (-1.0, 0, 0)), ("left_knee", (0.9, 0, 0)), ("right_knee", (1.1, 0, 0))),
        *(("left_shoulder", (0, 0.5, -1.0)), ("right_elbow", (0, 1.2, 0))),
    ):
        pose[name] = vector
    runner = bound_in(body, pose)
    rotations, path = walk()
    drive = Drive(written(t_pose(), rotations, path - 60.0 * Y, rate=RATE))
    wanted, found = (driven_clip(drive, each)[0] for each in (body, runner))
    for name in ("pelvis", "left_foot", "right_ankle", "head"):
        mine, theirs = (
            places(each, clip)[name] + clip.figure_translations
            for each, clip in ((runner, found), (body, wanted))
        )
        # Metres: skin between two joints is bound elsewhere, by a fraction of a millimetre.
        assert_allclose(mine, theirs, rtol=0, atol=1e-3, err_msg=name)


@pytest.mark.parametrize("speed", [0.0, 10.0])
@pytest.mark.parametrize("height", [-60.0, 0.0, 60.0])
def test_ground_far_from_height_0_is_noted(height, speed):
    # As of a motion whose origin is the hip: everything is lower by the height of the legs. At 6
    # m/s, feet never stand.
    rotations, path = walk()
    path[:, 2] += speed * np.arange(N_WALK)
    motion = written(t_pose(), rotations, path + height * Y, rate=RATE)
    found = retarget(motion, OTHER)
    _, changes = plant_feet(found, OTHER)
    # The balls of the feet are 1 cm above the ground.
    assert changes.ground == pytest.approx(found.scale * height, abs=1.5)
    _, notes = driven_clip(Drive(motion), OTHER)
    far = [str(note) for note in notes if note.key.startswith("F007.feet-far")]
    assert len(far) == (height != 0.0)
    for text in far:
        assert ("below" if height < 0.0 else "above") + " height 0" in text and "--ground" in text
        assert ("stand" in text) == (speed == 0.0) == ("lowest" not in text)


def test_rotations_of_the_arms_are_unchanged():
    found, clip, _ = planted()
    arms = [OTHER.skeleton.names.index(f"{side}Arm_") for side in SIDES]
    assert (clip.rotations[:, arms] == found.clip.rotations[:, arms]).all()


def test_legs_that_cannot_be_solved_are_unchanged():
    skeleton = OTHER.skeleton
    mirrored, points = skeleton.rest_scales.copy(), skeleton.rest_translations.copy()
    mirrored[skeleton.names.index("LeftLeg_")] = -1.0, 1.0, 1.0
    below = [skeleton.names.index(f"{side}{part}_") for side in SIDES for part in ("Leg", "Foot")]
    points[below] = 0.0
    for bad in (
        replace(skeleton, rest_scales=mirrored),
        replace(skeleton, rest_translations=points),
    ):
        found, clip, changes = planted(replace(OTHER, skeleton=bad))
        assert changes is None and clip is found.clip


def test_legs_folded_at_rest_have_finite_rotations():
    skeleton, points = OTHER.skeleton, OTHER.skeleton.rest_translations.copy()
    thighs, shins = (
        [skeleton.names.index(f"{side}{part}_") for side in SIDES] for part in ("Leg", "Foot")
    )
    points[shins] = -points[thighs]
    folded = replace(OTHER, skeleton=replace(skeleton, rest_translations=points))
    with np.errstate(divide="raise", invalid="raise"):
        _, clip, changes = planted(folded)
    assert changes is not None and np.isfinite(clip.rotations).all()


def test_feet_of_a_lying_person_are_not_planted():
    rotations, path = np.tile(np.eye(3), (60, len(NAMES), 1, 1)), np.zeros((60, 3))
    rotations[:] = axis_rotations(0, np.asarray(-np.pi / 2))
    found = retarget(written(t_pose(), rotations, path, rate=RATE), OTHER)
    clip, changes = plant_feet(found, OTHER)
    assert clip is found.clip and changes.n_contacts == 0


@pytest.mark.parametrize("height", [0.0, 50.0])
def test_feet_that_never_stand_are_as_low_as_those_of_the_source(height):
    """Runs of games touch the ground for a frame: figures with other ankles floated or sank."""
    rotations, path = walk()
    path[:, 2] += 10.0 * np.arange(N_WALK)  # 6 m/s
    path[:, 1] += height
    motion = written(t_pose(), rotations, path, rate=RATE)
    # Without toes and a mesh, the ankles of the figure are its soles; they used to be as high as
    # those of the source. The soles of the source are level, so its balls are its lowest points.
    joints = {n: place for n, place in PERSON.items() if not n.endswith("ToeBase")}
    for side in SIDES:  # other proportions
        parent, place = joints[f"{side}Leg"]
        joints[f"{side}Leg"] = parent, np.add(place, [0.0, 3.0, 0.0])
    names = {name: f"{name}_" for name in joints}
    figure = figure_of({names[n]: (names.get(p, ""), q) for n, (p, q) in joints.items()}, "other")
    found = retarget(motion, figure)
    clip, changes = plant_feet(found, figure)
    own, theirs = places(figure, clip), places(motion.figure, motion.clip)
    ankles = np.minimum(*(own[f"{side}Foot_"][:, 1] for side in SIDES))
    balls = np.minimum(*(theirs[f"{side}ToeBase"][:, 1] for side in SIDES))
    assert changes.n_contacts == 0 and changes.raised < -5.0
    # Balls that come as near to height 0 as joints are to soles are on the ground.
    assert 0.0 < np.percentile(balls, 2.0) - height < 2.0
    expected = found.scale * np.percentile(balls, 2.0) if height else 0.0
    assert_allclose(np.percentile(ankles, 2.0), expected, rtol=0, atol=EXACT)


def test_contacts_can_begin_and_end_gradually():
    # The foot moves quickly, rests at 20 for 40 frames, and moves on.
    place = np.concatenate([np.arange(20.0), np.full(40, 20.0), np.arange(21.0, 41.0)])
    path = place[:, None] * [0.0, 0.0, 10.0]
    foot = FootPath(path, path, path + 100.0 * Y)
    how = ([foot], [(0, 80)], 60.0, 200.0, Y)
    ((sudden,),), ((eased,),) = foot_contacts(*how), foot_contacts(*how, ease=0.05)
    assert (eased.start, eased.stop) == (sudden.start, sudden.stop)
    # A smooth step over 4 rows, x^2 (3 - 2 x), at both ends: 3 / 60 s and the first firm row.
    step = np.array([0.15625, 0.5, 0.84375])
    assert_allclose(eased.hold[:3], sudden.hold[:3] * step)
    assert_allclose(eased.hold[-3:], sudden.hold[-3:] * step[::-1])
    assert_array_equal(eased.hold[3:-3], sudden.hold[3:-3])
    ((always,),) = foot_contacts([foot], [(25, 55)], *how[2:], ease=0.05)
    assert (always.hold == 1.0).all()  # it neither begins nor ends within the motion


def pitched_walk() -> SkeletonMotion:
    """Return a walk whose toes point down while a foot swings."""
    rotations, path = walk(lift=8.0)
    frames = np.arange(N_WALK)
    for side, start in (("Left", 0), ("Right", 50)):
        phase = np.maximum((frames + start) % 100 - 60, 0) / 40.0
        pitch = matrices((1.0 * 64.0 * (phase * (1.0 - phase)) ** 3)[:, None] * X)
        for part in ("Foot", "ToeBase"):
            joint = NAMES.index(f"{side}{part}")
            rotations[:, joint] = pitch @ rotations[:, joint]
    return written(t_pose(), rotations, path, rate=RATE)


def test_swinging_feet_do_not_sink_into_the_ground():
    found = retarget(pitched_walk(), OTHER)
    clip, changes = plant_feet(found, OTHER)
    assert changes.is_better
    before, after = places(OTHER, found.clip), places(OTHER, clip)
    assert min(before[name][:, 1].min() for name in TOES) < -2.0
    assert min(after[name][:, 1].min() for name in TOES) > -0.3


def test_swinging_feet_that_are_long_are_levelled_rather_than_lifted():
    # Lifting the ankles alone would rotate the shins by 38 degrees.
    figure = person(0.6, 0.5, 2.2, 1.0)
    found = retarget(pitched_walk(), figure)
    clip, changes = plant_feet(found, figure)
    assert changes.is_better
    before, after = places(figure, found.clip), places(figure, clip)
    assert min(before[name][:, 1].min() for name in TOES) < -10.0
    assert min(after[name][:, 1].min() for name in TOES) > -0.3
    for side in SIDES:
        shins = [at[f"{side}Foot_"] - at[f"{side}Leg_"] for at in (before, after)]
        lengths = [np.linalg.norm(shin, axis=1) for shin in shins]
        cosines = np.einsum("na,na->n", *shins) / (lengths[0] * lengths[1])
        assert np.degrees(np.arccos(cosines.min())) < 20.0


def detached(figure: Figure, is_turned: bool, above_feet: str = "Root") -> Figure:
    """Return a person as animators' controls leave it: feet, listed first, are joints of a root.

    ``is_turned``: the root has other axes than the world. ``above_feet``: "" for feet that are
    roots.
    """
    skeleton = figure.skeleton
    world = dict(zip(skeleton.names, rest_joints(figure), strict=True))
    above = dict(zip(skeleton.names, parents(figure), strict=True))
    feet = ("LeftFoot_", "RightFoot_")
    table = {"Root": ("", np.array([0.0, 0.0, -5.0]))}
    table |= {name: (above_feet, world[name]) for name in feet}
    rest = [name for name in skeleton.names if name not in feet]
    table |= {name: (above[name] or "Root", world[name]) for name in rest}
    found = figure_of(table, "detached")
    if not is_turned:
        return found
    axes = axis_rotations(1, np.asarray(0.7))
    # World rotations R = A at the root: its children's offsets become A^T offset, and their own
    # rest rotations A^T, so that all joints stay where they are.
    skeleton = found.skeleton
    below = np.flatnonzero(skeleton.parents == 0)
    offsets, rotations = skeleton.rest_translations.copy(), skeleton.rest_rotations.copy()
    offsets[below] = offsets[below] @ axes
    rotations[0], rotations[below] = matrix_to_quaternion(axes), matrix_to_quaternion(axes.T)
    return replace(
        found, skeleton=replace(skeleton, rest_translations=offsets, rest_rotations=rotations)
    )


@pytest.mark.parametrize("how", [(False, "Root"), (True, "Root"), (False, "")])
@pytest.mark.parametrize("plants", [False, True])
def test_feet_that_are_joints_of_the_root_follow_their_legs(plants, how):
    # The same person with feet below the shins has the same world positions in every frame.
    motion = written(t_pose(), *walk(), rate=RATE)
    drive = Drive(motion, "auto", plants_feet=plants)
    apart = detached(OTHER, *how)
    whole, _ = driven_clip(drive, OTHER)
    clip, notes = driven_clip(drive, apart)
    wanted, found = places(OTHER, whole), places(apart, clip)
    for name, path in wanted.items():
        assert_allclose(found[name], path, atol=1e-6)  # cm
    assert any(note.key == "F007.feet-planted" for note in notes) == plants


def test_joint_maps_reach_joints_with_shared_names_of_detached_feet():
    figure = detached(OTHER, False)
    names = tuple("Nub" if name.endswith("Hand_") else name for name in figure.skeleton.names)
    figure = replace(figure, skeleton=replace(figure.skeleton, names=names))
    motion = written(t_pose(), *walk(), rate=RATE)
    nubs = [joint for joint, name in enumerate(names) if name == "Nub"]
    chosen = JointMap(((f"Nub#{nubs[0]}", "RightLeg"),))
    clip, _ = driven_clip(Drive(motion, "auto", chosen, plants_feet=False), figure)
    plain, _ = driven_clip(Drive(motion, "auto", plants_feet=False), figure)
    moved = np.abs(clip.rotations - plain.rotations).max(axis=(0, 2)) > 1e-6
    assert moved[nubs].tolist() == [True, False]
