"""Recognition of the joint names of many programs."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigs.hand_made import skeleton
from rigs.retargeting.joint_tables import TABLES
from rigs.retargeting.two_people import BODY, HIK, figure_of, moving

from viewer.errors import RigError
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip, full_map, matches_of
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.retargeting.joint_names import (
    canonical_names,
    joint_meanings,
    other_side,
    sided_words,
)
from viewer.rigs.retargeting.retarget import retarget


def tree(text: str) -> tuple[list[str], list[str], np.ndarray]:
    """Return names, their expected meanings ("-" for none) and parents of an indented list."""
    names, meanings, parents, above = [], [], [], []
    for line in text.strip("\n").split("\n"):
        depth = len(line) - len(line.lstrip())
        above = above[:depth]
        parents.append(above[-1] if above else -1)
        above.append(len(names))
        name, _, meaning = line.strip().partition(" = ")
        names.append(name)
        meanings.append("" if meaning == "-" else meaning)
    return names, meanings, np.array(parents, dtype=np.int32)


@pytest.mark.parametrize("table", TABLES)
def test_program_names_map_to_family_joints(table):
    names, meanings, parents = tree(TABLES[table])
    found = canonical_names(names, parents)
    assert dict(zip(names, found, strict=True)) == dict(zip(names, meanings, strict=True))


@pytest.mark.parametrize(("length", "meaning"), [(0.3, "left_ankle"), (0.05, "")])
def test_joint_next_to_a_knee_is_no_foot(length, meaning):
    names = ["Hips", "LeftUpLeg", "LeftLeg", "Extra"]
    offsets = np.array([[0, 1, 0], [0.1, 0, 0], [0, -0.4, 0], [0, -length, 0]])
    figure = skeleton(np.array([-1, 0, 1, 2]), names=names, offsets=offsets)
    assert joint_meanings(figure)[3] == meaning


@pytest.mark.parametrize("count", [24, 52, 55, 16])
def test_family_names_map_to_themselves(count):
    member = FAMILY[count]
    assert canonical_names(member.names, np.array(member.parents)) == member.names


@pytest.mark.parametrize(
    "name",
    ["left_hip", "LeftHip", "L_Hip", "l_hip", "hip.L", "Hip_L", "hip_left", "LEFT_HIP", "lHip",
     "hip-l", "LeftThigh", "thigh.left", "L Thigh", "lthigh", "leftupleg", "ns:sub:LHip"],
)  # fmt: skip
def test_sides_are_recognised_at_either_end_of_a_name(name):
    assert canonical_names(["pelvis", name], np.array([-1, 0]))[1] == "left_hip"


def test_no_canonical_name_occurs_twice():
    names = ["Hips", "LeftShin", "LeftKnee", "Head", "Head"]
    found = canonical_names(names, np.array([-1, 0, 1, 0, 3]))
    assert found == ("pelvis", "left_knee", "", "head", "")


@pytest.mark.parametrize("word", ["leg", "index", "foot", "shoulder"])
def test_numbers_of_thousands_of_digits_are_no_error(word):
    names = ["hips", f"{word}_l", f"{word}{'1' * 5000}_l"]
    meanings = canonical_names(names, np.array([-1, 0, 1], dtype=np.int32))
    assert meanings[2] == ""


def test_unknown_names_have_no_canonical_name():
    names = ["", "bone1", "bone2", "left", "tail_01", "wing_02_r", "123", "é"]
    assert canonical_names(names, np.arange(8) - 1) == ("",) * 8


def test_huge_skeletons_are_not_bodies():
    start = time.process_time()
    assert set(canonical_names(["LeftArm"] * 50000, np.arange(50000) - 1)) == {""}
    deep = canonical_names(["spine", "LeftArm", "RightArm"] * 600, np.arange(1800) - 1)
    assert "spine1" in deep
    assert time.process_time() - start < 2.0


BODY_FIGURE = figure_of(BODY, "body")
MOTION = moving(figure_of(HIK, "mocap"))
SNAKE = {"base": ("", (0, 0, 0)), "mid": ("base", (0, 0, 1)), "tip": ("mid", (0, 0, 2))}


def matched(drive, figure=BODY_FIGURE):
    """Return the source joint and the origin of the match for each joint of a figure."""
    found, names = matches_of(drive, figure), drive.motion.figure.skeleton.names
    return {
        name: (names[partner] if partner >= 0 else "", origin)
        for name, partner, origin in zip(
            figure.skeleton.names, found.partners.tolist(), found.origins, strict=True
        )
    }


def test_map_of_the_automatic_match_does_not_change_the_motion():
    twin = moving(BODY_FIGURE)  # the hierarchies are equal, so local rotations are copied
    for motion in (MOTION, twin):
        drive = Drive(motion)
        mapped = replace(drive, joint_map=full_map(drive, BODY_FIGURE))
        assert matched(mapped) == matched(drive)
        plain, again = driven_clip(drive, BODY_FIGURE)[0], driven_clip(mapped, BODY_FIGURE)[0]
        assert np.array_equal(plain.rotations, again.rotations)
        assert np.array_equal(plain.figure_translations, again.figure_translations)


def test_mapped_source_joint_is_not_matched_by_name_too():
    drive = Drive(MOTION, joint_map=JointMap((("left_elbow", "RightForeArm"),)))
    found = matched(drive)
    assert found["left_elbow"] == ("RightForeArm", "map")
    assert found["right_elbow"] == ("", "")
    assert found["left_wrist"] == ("LeftHand", "name")


def test_source_joint_may_drive_several_joints_and_unmapped_joints_stay_at_rest():
    snake = figure_of(SNAKE, "snake")
    motion = moving(figure_of({"x": ("", (0, 0, 0)), "y": ("x", (0, 0, 1))}, "worm"))
    joint_map = JointMap((("base", "x"), ("mid", "y"), ("tip", "y")))
    clip = retarget(motion, snake, joint_map).clip
    worlds = world_frames(snake, frames_of(snake, clip, np.arange(5) / 30.0))[:, :, :3, :3]
    np.testing.assert_allclose(worlds[:, 2], worlds[:, 1], atol=1e-12)
    clip = retarget(motion, snake, JointMap((*joint_map.pairs[:2], ("tip", "")))).clip
    np.testing.assert_allclose(clip.rotations[:, 2], [[0, 0, 0, 1]] * 5, atol=1e-12)


def test_origins_state_how_joints_were_matched():
    own = matched(Drive(MOTION))
    assert own["pelvis"] == ("Hips", "name") and own["left_knee"] == ("LeftLeg", "name")
    twin = matched(Drive(moving(BODY_FIGURE)))
    assert {origin for _, origin in twin.values()} == {"hierarchy"}
    table = {("root" if name == "Hips" else name): row for name, row in HIK.items()}
    table = {name: ("root" if p == "Hips" else p, at) for name, (p, at) in table.items()}
    assert matched(Drive(moving(figure_of(table, "m"))))["pelvis"] == ("root", "place")
    skeleton = BODY_FIGURE.skeleton
    stated = {"hips": 0, "leftUpperLeg": 1, "rightUpperLeg": 2, "leftLowerLeg": 4}
    stated = Humanoid(stated)
    vrm = replace(BODY_FIGURE, skeleton=replace(skeleton, humanoid=stated))
    found = matched(Drive(MOTION), vrm)
    assert found["left_hip"] == ("LeftUpLeg", "humanoid")
    snake = figure_of(SNAKE, "snake")
    wasp = figure_of({**SNAKE, "sting": ("tip", (0, 0, 3))}, "wasp")
    assert matched(Drive(moving(snake)), wasp)["tip"] == ("tip", "same name")


@pytest.mark.parametrize(
    ("pairs", "line", "key"),
    [
        ((("pelvis", "Hips"), ("left_kne", "LeftLeg")), 4, "F004.mapping-joint"),
        ((("pelvis", "Hip"), ("left_knee", "LeftLeg")), 2, "F004.mapping-joint"),
        ((("pelvis", "Hips"), ("pelvis", "Spine")), 4, "F004.mapping-again"),
        ((("pelvis", "Hips"), ("left_knee", "tail")), 4, "F004.mapping-joints"),
    ],
)
def test_errors_in_a_map_are_reported_with_their_location(pairs, line, key):
    table = {**HIK, "a": ("Hips", (0, 0, 1)), "b": ("a", (0, 0, 2))}
    figure = figure_of(table, "mocap")
    names = tuple({"a": "tail", "b": "tail"}.get(name, name) for name in table)
    figure = replace(figure, skeleton=replace(figure.skeleton, names=names))
    with pytest.raises(RigError) as caught:
        retarget(moving(figure), BODY_FIGURE, JointMap(pairs, Path("map.txt"), (2, 4)))
    found = caught.value.diagnostic
    assert (found.key, found.path, found.line) == (key, Path("map.txt"), line)


def test_map_that_leaves_all_joints_at_rest_is_refused():
    pairs = tuple((name, "") for name in BODY)
    with pytest.raises(RigError) as caught:
        retarget(MOTION, BODY_FIGURE, JointMap(pairs))
    assert caught.value.diagnostic.key == "F004.joints-unmatched"


def test_hips_beside_the_legs_are_the_spine_of_the_joint_above_both():
    # A rig with controls: feet are joints of the root, and legs are not below the hips.
    names = ["Root", "Foot.L", "Body", "Hips", "Abdomen", "Torso", "UpperLeg.L", "LowerLeg.L",
             "UpperLeg.R", "LowerLeg.R", "Foot.R"]  # fmt: skip
    parents = np.array([-1, 0, 0, 2, 3, 4, 2, 6, 2, 8, 0])
    found = dict(zip(names, canonical_names(names, parents), strict=True))
    assert found["Body"] == "pelvis"
    assert [found[name] for name in names[3:6]] == ["spine1", "spine2", "spine3"]
    # Legs below the root leave the hips what they are.
    parents[[6, 8]] = 0
    assert dict(zip(names, canonical_names(names, parents), strict=True))["Hips"] == "pelvis"


@pytest.mark.parametrize(
    "names",
    [
        ("bras_gauche", "bras_droit"),
        ("MainGauche", "MainDroite"),
        ("brazo_izquierdo", "brazo_derecho"),
        ("Pierna.Izq", "Pierna.Der"),
        ("gamba_sinistra", "gamba_destra"),
        ("braccio_sinistro", "braccio_destro"),
        ("piede_sx", "piede_dx"),
    ],
)
def test_sides_have_french_spanish_and_italian_words(names):
    (left, word), (right, other) = sided_words(names)
    assert (left, right) == ("left", "right") and word == other
    # In French, the arm is masculine and the hand is not; the left side does not show it.
    left_name, right_name = names
    assert other_side(right_name) == left_name
    assert other_side(left_name) in (right_name, right_name + "e")


@pytest.mark.parametrize(
    "names",
    [
        *(("Bras_G", "Bras_D"), ("PiedG", "PiedD"), ("g_coude", "d_coude")),
        *(("pierna_i", "pierna_d"), ("Gamba.S", "Gamba.D"), ("coxa_e", "coxa_d")),
        *(("pouce1_G", "pouce1_D"), ("Mignolo.S", "Mignolo.D"), ("Arm_L", "Arm_R")),
    ],
)
def test_other_side_has_the_initial_of_the_language(names):
    left_name, right_name = names
    assert other_side(left_name) == right_name
    assert other_side(right_name) == left_name


def test_main_is_a_hand_only_among_french_words():
    parents = np.array([-1, 0, 1, 2])
    french = ["bassin", "bras_l", "avantbras_l", "main_l"]
    assert canonical_names(french, parents)[3] == "left_wrist"
    # A control beside the arm: the hand keeps its name.
    english = ["hips", "main_l", "upperarm_l", "lowerarm_l", "hand_l"]
    found = canonical_names(english, np.array([-1, 0, 0, 2, 3]))
    assert found == ("pelvis", "", "left_shoulder", "left_elbow", "left_wrist")
    # Without a hand, it is none either.
    found = canonical_names(english[:4], np.array([-1, 0, 0, 2]))
    assert found == ("pelvis", "", "left_shoulder", "left_elbow")
