"""Confidence in rigs of a bar with three joints, whose findings are known by construction."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, mesh_of

from viewer.autorig import pipeline
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import Alignment, AlignmentSettings
from viewer.autorig.anatomy import Limb, LimbPair
from viewer.autorig.confidence import (
    Body,
    confidence,
    doubts,
    findings,
    judge,
    refusal,
    remarks,
)
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import TransferSettings
from viewer.autorig.solid import solid_of
from viewer.diagnostics import note
from viewer.errors import RigError
from viewer.loading import bundled_body, bundled_files, load
from viewer.rigs.figure import figure_pose
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import owners, skin_from_entries
from viewer.rigs.skinning import joint_matrices

PARENTS = np.array([-1, 0, 1])
JOINTS = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])


def bar():
    """Return a closed bar from x = -0.2 to 2.2, 0.4 high and 0.3 wide, with rings every 0.05."""
    xs, section = (
        np.linspace(-0.2, 2.2, 49),
        [(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)],
    )
    positions = np.array([(x, y, z) for x in xs for y, z in section])
    index = np.arange(len(positions)).reshape(49, 4)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    sides = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    (p, q, r, s), (t, u, v, w) = index[0], index[-1]
    ends = [(p, r, q), (p, s, r), (t, u, v), (t, v, w)]
    return positions, np.concatenate([sides, ends])[:, ::-1]


def body(scale=(1.0, 1, 1), joints=JOINTS, shift=0.0):
    """Return a bar whose weights blend within 0.2 of the middle joint."""
    positions, triangles = bar()
    fraction = np.clip((positions[:, 0] - 0.8) / 0.4, 0.0, 1.0)
    skin = skin_from_entries(
        len(positions),
        np.tile(np.arange(len(positions)), 2),
        np.repeat([0, 1], len(positions)),
        np.concatenate([1.0 - fraction, fraction]),
        np.tile(np.eye(4), (3, 1, 1)),
    )
    placed = positions * scale + shift
    return Body(placed, triangles, skin, joints * scale + shift, solid_of(placed, triangles, 48))


def alignment(gap=0.0, how="fit", away=0.0):
    still = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
    return Alignment(still, gap, away, (gap, gap), how)


def values(target, gap=0.0):
    found = findings(body(), target, PARENTS, alignment(gap))
    return {finding.sentence[5:].split(":")[0]: finding for finding in found}


@pytest.mark.parametrize("scale", [1.0, 0.01, 100.0])
def test_copy_of_the_template_is_certain_in_any_unit(scale):
    found = findings(body(), body((scale,) * 3, shift=700.0 * scale), PARENTS, alignment())
    assert confidence(found) == 1.0 and not [*doubts(found)] and refusal(found) == ""
    # The same depths, thickness and volume as the template; voxels differ by rounding.
    for finding in found[2:]:
        assert finding.value == pytest.approx(1.0, rel=0.02)


def test_cut_out_picture_is_too_thin():
    found = values(body((1.0, 1.0, 0.03)))
    # Only the least extent has changed; narrow faces count less than before.
    assert 0.02 < found["thickness"].value < 0.1 and found["thickness"].rating == 0.0
    assert found["inside"].rating == 1.0


def test_bones_outside_the_mesh_are_counted():
    # The second bone, half of both, is beside the bar except where it leaves it.
    bent = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0]])
    found = values(body(joints=bent))
    # It is inside up to y = 0.2: at the first of the places 0.2, 0.4 ... 1.8.
    assert found["inside"].value == pytest.approx((9 + 1) / 18, abs=1 / 18)
    far = values(body(joints=JOINTS + np.array([0, 0, 9.0])))
    assert far["inside"].value == 0.0 and far["depth"].value == 0.0


def test_bones_outside_the_template_say_nothing_about_the_target():
    beside = body(joints=JOINTS + np.array([0, 0, 9.0]))
    found = findings(beside, body(), PARENTS, alignment())
    keys = {finding.sentence[5:].split(":")[0] for finding in found}
    assert "volume" in keys and not keys & {"inside", "depth"}
    assert confidence(found) == 1.0


def test_legs_that_leave_their_bones_are_counted():
    # Bones are along x. One leg follows them; the other comes down along y, 2 long, and follows
    # them for 1 only. Of its path from 0.45, after the foot, 12 of 26 points are within its radius,
    # extended by a voxel of 0.05: of those 0.1 apart, also the one before the bend.
    straight = np.linspace([2.0, 0, 0], [0, 0, 0], 21)
    bent = np.concatenate([np.linspace([1.0, 2, 0], [1, 0, 0], 21), straight[11:]])
    limbs = [
        Limb(points, np.full(len(points), 0.08), points[-1], 2.0) for points in (straight, bent)
    ]
    pairs = LimbPair((limbs[0], limbs[0])), LimbPair((limbs[0], limbs[1]))
    for legs, expected in ((pairs[:1], 1.0), (pairs, 0.5 + 6 / 26)):
        found = findings(body(), body(), PARENTS, alignment(), legs)
        (value,) = (each.value for each in found if each.sentence.startswith("R017.legs:"))
        assert value == pytest.approx(expected)


def test_lengths_are_relative_to_the_median():
    joints = np.array([[0.0, 0, 0], [0.1, 0, 0], [2, 0, 0]])
    found = values(body(joints=joints))
    # Lengths of 0.1 and 1.9 for 1 and 1: their median is 1.
    assert found["short"].value == pytest.approx(0.1) and found["short"].rating == 0.0
    assert found["long"].value == pytest.approx(1.9) and found["long"].rating == 1.0


def test_test_pose_finds_weights_that_do_not_bend():
    # A vertex with equal weights of both joints far from the bend collapses; so does the bar.
    target = body()
    half = skin_from_entries(
        len(target.positions),
        np.tile(np.arange(len(target.positions)), 2),
        np.repeat([0, 1], len(target.positions)),
        np.full(2 * len(target.positions), 0.5),
        np.tile(np.eye(4), (3, 1, 1)),
    )
    found = values(replace(target, skin=half))
    # All vertices move by the mean of R and R R, R a rotation by 40 degrees about the same axis:
    # in the plane, cos 20 degrees times a rotation, so the volume is multiplied by its square.
    expected = np.cos(np.radians(20.0)) ** 2
    template = values(target)["volume"].value
    assert found["volume"].value == pytest.approx(expected * template, rel=0.05)


@pytest.mark.parametrize("inside_out", [False, True])
def test_open_sheet_beside_a_bar_has_no_volume(inside_out):
    whole = body()
    # A square of 3 x 3 that turns with the end of the bar, whose volume is 0.3.
    corners = np.array([[1.5, -1.5, 1], [1.5, 1.5, 1], [4.5, 1.5, 1], [4.5, -1.5, 1]])
    count = len(whole.positions)
    rows = np.append(owners(whole.skin), count + np.arange(4))
    skin = skin_from_entries(
        count + 4,
        rows,
        np.append(whole.skin.joints, np.full(4, 1)),
        np.append(whole.skin.weights, np.ones(4)),
        np.tile(np.eye(4), (3, 1, 1)),
    )
    triangles = whole.triangles[:, ::-1] if inside_out else whole.triangles
    both = Body(
        np.concatenate([whole.positions, corners]),
        np.concatenate([triangles, count + np.array([[0, 1, 2], [0, 2, 3]])]),
        skin,
        JOINTS,
        whole.solid,
    )
    assert values(both)["volume"].value == pytest.approx(values(whole)["volume"].value)


def test_a_shape_without_limbs_must_agree_more_closely():
    # A quarter of the way from 0.03 to 0.01, and four fifths of that from 0.045 to 0.02.
    ratings = [
        findings(body(), body(), PARENTS, replace(alignment(0.025), has_limbs=has))[0].rating
        for has in (False, True)
    ]
    np.testing.assert_allclose(ratings, [0.25, 0.8])


def test_surfaces_far_apart_are_a_doubt_with_its_number():
    found = findings(body(), body(), PARENTS, alignment(0.06))
    (line,) = doubts(found)
    assert line.code == "R017" and line.severity == "warning"
    assert str(line) == "template and mesh differ in shape by 6.0% of the size"
    # The plain thing first, then what to do, then the reasons.
    unlike = "this mesh is probably not a figure like the template, or not oriented as assumed; "
    why = refusal(found)
    kinds = "--from body for people, --from fox for four-legged animals"
    assert why.startswith(f"{unlike}use a template of the same kind ({kinds}) or none (--auto), ")
    assert why.endswith("; reasons: template and mesh differ in shape by 6.0% of the size")
    # What helps if only the facing is wrong comes first.
    alike = note("R004.facing: front and back look alike, so if it is {back}, turn it", back="-z")
    assert refusal(found, alike).startswith(
        f"{unlike}front and back look alike, so if it is -z, turn it; otherwise use a template"
    )


@pytest.mark.parametrize("how, away", [("given", 0.0), ("landmarks", 0.0), ("in place", 0.2)])
def test_what_the_user_has_placed_is_not_judged(how, away):
    figure = arm()
    pose = rest_pose(figure.skeleton)
    found = alignment(0.5, how, away)
    assert judge(figure, pose, figure, pose, figure.mesh, found) == ()


@pytest.fixture(scope="module")
def person():
    """The bundled body, and its solid."""
    figure = load(bundled_body()).actors[0].figure
    return figure, solid_of(figure.mesh.positions, figure.mesh.triangles, 24)


def leaning(person, degrees, gap=0.02, up=None):
    """Return the findings about a rig of the person that leans forward."""
    figure, solid = person
    pose, bowed = rest_pose(figure.skeleton), rest_pose(figure.skeleton)
    bowed.dofs[0] = np.radians(degrees)
    found = judge(figure, pose, figure, bowed, figure.mesh, alignment(gap), (solid, solid), up=up)
    return {finding.sentence[5:].split(":")[0]: finding for finding in found}


def test_trunk_that_lies_is_a_figure_of_another_kind(person):
    assert leaning(person, 30.0)["trunk"].rating > 0.5
    found = leaning(person, 60.0)["trunk"]
    # The trunk at rest leans by 2 degrees.
    assert found.value == pytest.approx(60.0, abs=4.0) and found.rating == 0.0


def test_trunk_is_upright_along_the_stated_up_axis(person):
    assert leaning(person, 90.0, up="z")["trunk"].value == pytest.approx(0.0, abs=4.0)
    assert leaning(person, 0.0, up="z")["trunk"].rating == 0.0


@pytest.mark.parametrize(
    ("degrees", "is_right", "is_sure"),
    [(15.0, True, True), (40.0, True, False), (90.0, False, False)],
)
def test_shoulders_that_are_turned_against_the_hips_are_doubtful(
    person, degrees, is_right, is_sure
):
    figure, solid = person
    turned = figure_pose(figure)
    turned["spine1"] = [0.0, np.radians(degrees), 0.0]
    pose = rest_pose(figure.skeleton)
    found = judge(figure, pose, figure, turned, figure.mesh, alignment(0.02), (solid, solid))
    (twist,) = (each for each in found if each.sentence.startswith("R017.twist:"))
    assert twist.value == pytest.approx(degrees, abs=1.0)
    assert (twist.rating >= 0.5) == is_right and (not list(remarks((twist,)))) == is_sure


def test_person_who_bows_fits_closely(person):
    assert "trunk" not in leaning(person, 60.0, gap=0.009)


def raised(person, degrees, neck=0.0, lean=0.0, key="head"):
    """Return findings with a key on a rig of the person with raised arms, horizontal at 0.

    ``neck``: length of the neck relative to the person's. ``lean``: rotation of the root, degrees.
    """
    figure, solid = person
    pose = rest_pose(figure.skeleton)
    joints, names = joint_matrices(figure, pose)[:, :3, 3], figure.skeleton.names
    offsets = figure.skeleton.rest_translations.copy()
    offsets[[names.index("neck"), names.index("head")]] *= neck
    rig = replace(figure, skeleton=replace(figure.skeleton, rest_translations=offsets))
    rigged = figure_pose(rig)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        way = joints[names.index(f"{side}_wrist")] - joints[names.index(f"{side}_shoulder")]
        now = np.arctan2(way[1], sign * way[0])
        rigged[f"{side}_shoulder"] = [0.0, 0.0, sign * (np.radians(degrees) - now)]
    rigged["pelvis"] = np.radians([lean, 0.0, 0.0])
    found = judge(figure, pose, rig, rigged, figure.mesh, alignment(0.02), (solid, solid))
    return [each for each in found if each.sentence.startswith(f"R017.{key}:")]


def test_arms_above_a_head_between_the_shoulders_may_be_ears(person):
    (low,), (level,), (high,) = (raised(person, degrees) for degrees in (-90.0, 0.0, 90.0))
    assert low.value < level.value < high.value
    # Arms that point up instead of down have their middle higher by their length.
    figure, _ = person
    joints = joint_matrices(figure, rest_pose(figure.skeleton))[:, :3, 3]
    at = dict(zip(figure.skeleton.names, joints, strict=True))
    arm = float(np.linalg.norm(at["left_hand"] - at["left_shoulder"]))
    trunk = 0.5 * (at["left_collar"] + at["right_collar"] - at["left_hip"] - at["right_hip"])
    assert high.value - low.value == pytest.approx(arm / np.linalg.norm(trunk), rel=0.05)
    assert low.rating == 1.0 and high.rating == 0.0
    # Whichever way is up.
    (lying,) = raised(person, 90.0, lean=90.0)
    assert lying.value == pytest.approx(high.value, abs=1e-9)
    # A person may raise the arms.
    assert raised(person, 90.0, neck=1.0) == []


def test_head_far_above_the_shoulders_is_that_of_another_figure(person):
    usual, long, longest = (raised(person, 0.0, neck, key="neck")[0] for neck in (1.0, 3.0, 5.0))
    # Neck and head are on a line upwards, nearly: the height grows with the neck's length.
    assert longest.value - long.value == pytest.approx(long.value - usual.value, rel=1e-6)
    assert 0.2 < usual.value < 0.4 and usual.rating == 1.0
    assert longest.value > 1.25 and longest.rating == 0.0
    # Also if the figure lies.
    (lying,) = raised(person, 0.0, 5.0, lean=90.0, key="neck")
    assert lying.value == pytest.approx(longest.value, abs=1e-9)


def test_shoulders_beside_the_head_may_be_hair(person):
    usual, none = (raised(person, 0.0, neck, key="low")[0] for neck in (1.0, 0.0))
    # Without a neck, the head is as low as the chest, from which the collarbones rise.
    assert none.value < 0.0 and none.rating == 0.0 and usual.rating == 1.0
    # The height is linear in the length of the neck.
    half = raised(person, 0.0, 0.5, key="low")[0]
    assert half.value == pytest.approx(0.5 * (usual.value + none.value), abs=1e-9)


def bent(person, **bends):
    """Return the findings about a rig of the person with joints bent by degrees (x, y, z)."""
    figure, solid = person
    pose, posed = rest_pose(figure.skeleton), figure_pose(figure)
    for joint, angles in bends.items():
        posed[joint] = np.radians(angles)
    found = judge(figure, pose, figure, posed, figure.mesh, alignment(0.02), (solid, solid))
    return {finding.sentence[5:].split(":")[0]: finding for finding in found}


def test_arm_in_the_air_is_no_arm(person):
    assert bent(person)["bone"].value == 1.0
    # The mesh is that of outstretched arms; nine tenths of all bones are inside, but no forearm.
    found = bent(person, left_shoulder=[0.0, -90.0, 0.0])
    assert found["inside"].rating > 0.5
    assert found["bone"].value == 0.0 and found["bone"].rating == 0.0
    assert str(found["bone"].line) == (
        "most of the bone that ends at left_wrist is outside the mesh (0% is inside)"
    )
    # Hands may be mittens, and feet stumps.
    assert bent(person, left_wrist=[0.0, -90.0, 0.0])["bone"].value == 1.0


def test_legs_in_the_same_place_are_one_leg(person):
    figure, solid = person
    assert bent(person)["apart"].rating == 1.0
    skeleton, pose = figure.skeleton, rest_pose(figure.skeleton)
    names, joints = skeleton.names, joint_matrices(figure, pose)[:, :3, 3]
    at = {name: joints[names.index(name)] for name in names}
    # The right knee is three quarters of the way to the left one.
    offsets = skeleton.rest_translations.copy()
    offsets[names.index("right_knee")] += 0.75 * (at["left_knee"] - at["right_knee"])
    rig = replace(figure, skeleton=replace(skeleton, rest_translations=offsets))
    found = judge(figure, pose, rig, pose, figure.mesh, alignment(0.02), (solid, solid))
    (apart,) = (each for each in found if each.sentence.startswith("R017.apart:"))
    knees, hips = (at[f"left_{joint}"] - at[f"right_{joint}"] for joint in ("knee", "hip"))
    expected = 0.25 * np.linalg.norm(knees) / np.linalg.norm(hips)
    assert apart.value == pytest.approx(expected) and apart.rating < 0.5


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_arms_that_end_early_are_those_of_a_hidden_arm(person, unit):
    figure, solid = person
    skeleton, pose = figure.skeleton, rest_pose(figure.skeleton)
    names, offsets = skeleton.names, skeleton.rest_translations.copy()
    rows = [names.index(f"{s}_{j}") for s in ("left", "right") for j in ("elbow", "wrist", "hand")]
    offsets[rows] *= 0.25
    rig = replace(figure, skeleton=replace(skeleton, rest_translations=unit * offsets))
    found = judge(
        figure, pose, rig, rest_pose(rig.skeleton), figure.mesh, alignment(0.02), (solid, solid)
    )
    (arms,) = (each for each in found if each.sentence.startswith("R017.arms:"))
    # From the collarbones to the hands; the other bones, most of all, have the template's lengths.
    lengths = dict(zip(names, np.linalg.norm(skeleton.rest_translations, axis=1), strict=True))
    whole = {joint: lengths[f"left_{joint}"] for joint in ("shoulder", "elbow", "wrist", "hand")}
    shorter = 0.25 * sum(whole.values()) + 0.75 * whole["shoulder"]
    assert arms.value == pytest.approx(shorter / sum(whole.values()), rel=1e-3)
    assert arms.value < 0.5 and arms.rating < 0.5
    # Arms may be that short in earnest.
    assert f"the arms are only {arms.value:.2g} times as long as the template's" in refusal(found)
    assert "or keep the rig if it is right (--keep-doubtful); reasons: " in refusal(found)


def test_animal_with_a_low_head_is_no_person():
    figure = load(*bundled_files()).actors[0].figure
    pose = rest_pose(figure.skeleton)
    solid = solid_of(figure.mesh.positions, figure.mesh.triangles, 24)
    found = judge(figure, pose, figure, pose, figure.mesh, alignment(0.02), (solid, solid))
    keys = {each.sentence[5:].split(":")[0] for each in found}
    assert "trunk" in keys and not keys & {"head", "low", "arms"} and {"bone", "apart"} <= keys


def test_what_is_nearly_a_doubt_is_said(person):
    # Leaning by 37 degrees is rated 0.6, by 20 degrees 1.
    unsure, sure, wrong = ((leaning(person, angle)["trunk"],) for angle in (37.0, 20.0, 60.0))
    (line,) = remarks(unsure)
    assert line.key == "R017.unsure" and line.severity == "warning"
    assert str(line).startswith("the rig may be wrong: the lean of the trunk differs from the ")
    assert str(line).endswith(" degrees: check it in several poses")
    assert refusal(unsure) == "" and [*remarks(sure)] == []
    assert [*map(str, remarks(wrong))] == [*map(str, doubts(wrong))] != []


def test_wrong_rig_is_refused_unless_insisted_on(monkeypatch):
    figure = arm()
    positions, triangles = figure.mesh.positions, figure.mesh.triangles
    sheet = mesh_of(positions * [1.0, 1.0, 0.02], triangles)
    pose = rest_pose(figure.skeleton)
    known = AlignmentSettings(up="y", facing="z", samples=100)
    how = TransferSettings(alignment=known, fits=False)
    with pytest.raises(RigError, match="times as thick as the template"):
        transfer(figure, pose, sheet, how)
    kept = transfer(figure, pose, sheet, replace(how, insists=True))
    assert confidence(kept.findings) < 0.5
    assert "R017" in {line.code for line in kept.lines}
    # The refusal also says that the figure may face the other way.
    alike = note("R004.facing: front and back look alike")
    align = pipeline.align_posed
    monkeypatch.setattr(
        pipeline,
        "align_posed",
        lambda *given: replace(found := align(*given), lines=(alike, *found.lines)),
    )
    with pytest.raises(RigError, match="; front and back look alike; otherwise use a"):
        transfer(figure, pose, sheet, how)
