"""Retargeting of motions between skeletons with different rest poses, axes, units and names."""

from dataclasses import replace

import numpy as np
import pytest
from builders import quaternion_matrix, quaternions
from faults import told
from rigs.retargeting.two_people import (
    BODY,
    EXACT,
    HIK,
    bones,
    figure_of,
    moving,
    places,
)

from viewer.diagnostics import Diagnostic
from viewer.diagnostics.diagnostic import Phrase
from viewer.errors import RigError
from viewer.rigs.figure import Figure
from viewer.rigs.humanoid import HUMAN_BONES, Humanoid
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.retargeting.retarget import retarget, scaled_motion

SPINE = {"spine1": "spine", "spine2": "chest", "spine3": "upperChest"}
VRM_BONES = {name: bone for bone, name in HUMAN_BONES.items()} | SPINE
LIMBS = [
    (("LeftUpLeg", "LeftLeg"), ("left_hip", "left_knee")),
    (("LeftLeg", "LeftFoot"), ("left_knee", "left_ankle")),
    (("RightUpLeg", "RightLeg"), ("right_hip", "right_knee")),
    (("RightLeg", "RightFoot"), ("right_knee", "right_ankle")),
    (("LeftArm", "LeftForeArm"), ("left_shoulder", "left_elbow")),
    (("LeftForeArm", "LeftHand"), ("left_elbow", "left_wrist")),
    (("RightArm", "RightForeArm"), ("right_shoulder", "right_elbow")),
    (("RightForeArm", "RightHand"), ("right_elbow", "right_wrist")),
]


def assert_same_limbs(source: SkeletonMotion, figure: Figure, clip: SampledClip, turn=None) -> None:
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for pair, own in LIMBS:
        wanted = bones(theirs, pair)
        wanted = wanted if turn is None else wanted @ turn.T
        np.testing.assert_allclose(bones(mine, own), wanted, atol=EXACT, err_msg=own[0])


def test_retargeting_onto_itself_is_the_identity():
    motion = moving(figure_of(HIK, "mocap"))
    found = retarget(motion, motion.figure)
    clip, notes = found.clip, found.notes
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)
    np.testing.assert_allclose(clip.translations, motion.clip.translations, atol=1e-12 * 100)
    matched = {"motion": "mocap", "figure": "mocap", "n": 20, "all": 20, "pairs": []}
    assert told(notes) == [
        ("F007.joints-matched", matched),
        ("F007.path-scaled", {"scale": pytest.approx(1.0), "by": "the ratio of leg lengths"}),
    ]


def test_joints_with_repeated_names_are_matched_by_hierarchy():
    table = {"a": ("", (0, 0, 0)), "b": ("a", (1, 0, 0)), "c": ("b", (2, 0, 0))}
    figure = figure_of(table, "snake")
    figure = replace(figure, skeleton=replace(figure.skeleton, names=("tail", "tail", "")))
    motion = moving(figure)
    clip = retarget(motion, figure).clip
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)


def test_limb_directions_match_the_source_from_t_pose_to_a_pose():
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    assert_same_limbs(source, figure, clip)
    (key, values), *rest = told(notes)
    assert key == "F007.joints-matched-as-follows"
    assert (values["motion"], values["figure"]) == ("mocap", "body")
    assert (values["n"], values["all"], len(values["pairs"])) == (19, 20, 19)
    partners = {pair.values["joint"]: pair.values["partner"] for pair in values["pairs"]}
    for joint, partner in (("pelvis", "Hips"), ("left_hip", "LeftUpLeg")):
        assert partners[joint] == partner
    for joint, partner in (("left_wrist", "LeftHand"), ("right_wrist", "RightHand")):
        assert partners[joint] == partner
    assert rest[:2] == [
        ("F007.joints-at-rest", {"names": ["spine2"]}),
        ("F007.joints-without-partner", {"motion": "mocap", "names": ["LeftToeBase"]}),
    ]


def test_very_different_rest_pose_of_the_trunk_is_aligned():
    bowed = {**HIK, "Head": ("Neck", (0, 145, 12)), "Spine1": ("Spine", (0, 112, 14))}
    source, figure = moving(figure_of(bowed, "mocap")), figure_of(BODY, "body")
    clip = retarget(source, figure).clip
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for pair, own in (
        (("Neck", "Head"), ("neck", "head")),
        (("Spine", "Spine1"), ("spine1", "spine3")),
    ):
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


@pytest.mark.parametrize("ahead", [-8, 2, 12])
def test_head_looks_ahead_whatever_the_slant_of_the_neck(ahead):
    # The joint of the head is 10 cm above that of the neck, and up to 50 degrees behind or ahead.
    slanted = figure_of({**HIK, "Head": ("Neck", (0, 160, ahead))}, "slanted")
    source = moving(figure_of(BODY, "body"))
    clip = retarget(source, slanted).clip
    names = list(HIK)
    # In the source's rest pose, the figure's own neck and head do not move.
    for name in ("Spine", "Spine1", "Neck", "Head"):
        np.testing.assert_allclose(
            np.abs(clip.rotations[0, names.index(name), 3]), 1.0, atol=EXACT, err_msg=name
        )
    # And the head turns as the source's does in all others.
    worlds = [
        world_frames(each, frames_of(each, one, np.arange(5) / 30.0))[:, joint, :3, :3]
        for each, one, joint in (
            (source.figure, source.clip, list(BODY).index("head")),
            (slanted, clip, names.index("Head")),
        )
    ]
    np.testing.assert_allclose(worlds[1], worlds[0], atol=EXACT)


def test_motion_of_the_same_rig_is_copied_whatever_its_rest_pose():
    source = moving(figure_of(BODY, "body"))
    rng = np.random.default_rng(3)
    vectors = rng.uniform(-0.2, 0.2, (len(BODY), 3))  # less than what makes the bones differ
    posed = replace(source.figure.skeleton, rest_rotations=quaternions(vectors))
    for scale in (1.0, 2.0):
        skeleton = replace(posed, rest_translations=scale * posed.rest_translations)
        figure = Figure("bound in another pose", skeleton=skeleton)
        for rest in ("zero", "auto"):
            clip = retarget(source, figure, source_rest=rest).clip
            theirs, mine = places(source.figure, source.clip), places(figure, clip)
            for name in BODY:
                np.testing.assert_allclose(mine[name], scale * theirs[name], atol=1e-11)


def test_limb_directions_match_the_source_from_a_pose_to_t_pose():
    source, figure = moving(figure_of(BODY, "body")), figure_of(HIK, "mocap")
    clip = retarget(source, figure).clip
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for own, pair in LIMBS:
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


def test_trunk_and_feet_keep_their_rest_shape():
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip = retarget(source, figure).clip
    # In the rest pose of the source, the slightly bent spine of the figure keeps its shape.
    still = {"pelvis": 0, "spine1": 3, "spine3": 9, "neck": 10, "head": 13, "left_collar": 11}
    for name, joint in still.items():
        np.testing.assert_allclose(
            np.abs(clip.rotations[0, joint, 3]), 1.0, atol=EXACT, err_msg=name
        )


def test_feet_without_toes_stay_level_whatever_the_knees_at_rest():
    # The source stands with straight legs, 20 degrees apart, and has no toes; the figure with
    # parallel legs, whose knees are 10 cm ahead. Both stand on level soles.
    legs = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        hip = np.array([sign * 10.0, 95.0, 0.0])
        down = np.array([sign * np.sin(np.radians(20.0)), -np.cos(np.radians(20.0)), 0.0])
        legs[f"{side}Leg"] = (f"{side}UpLeg", hip + 45.0 * down)
        legs[f"{side}Foot"] = (f"{side}Leg", hip + 90.0 * down)
    source = figure_of({name: place for name, place in {**HIK, **legs}.items()
                        if not name.endswith("ToeBase")}, "source")  # fmt: skip
    bent = {}
    for side, x in (("Left", 10), ("Right", -10)):
        bent[f"{side}Leg"] = (f"{side}UpLeg", (x, 50, 10))
        bent[f"{side}Foot"] = (f"{side}Leg", (x, 8, 0))
    toes = {"RightToeBase": ("RightFoot", (-10, 1, 12))}
    figure = figure_of(renamed({**HIK, **bent, **toes}, Hips="pelvis"), "figure")
    # The source swings its legs down by 20 degrees, and its feet with them.
    motion = moving(source, count=2, angle=0.0)
    rotations = motion.clip.rotations.copy()
    names = source.skeleton.names
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        swing = [0.0, 0.0, -sign * np.sin(np.radians(10.0)), np.cos(np.radians(10.0))]
        rotations[1, names.index(f"{side}UpLeg")] = swing
    motion = replace(motion, clip=replace(motion.clip, rotations=rotations))
    clip = retarget(motion, figure).clip
    worlds = world_frames(figure, frames_of(figure, clip, np.arange(2) / clip.timing.frame_rate))
    own = figure.skeleton.names
    for side in ("Left", "Right"):
        foot = worlds[1, own.index(f"{side}Foot"), :3, :3]
        # Parallel legs: the foot points as at rest, although the shin does not.
        np.testing.assert_allclose(foot @ [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], atol=1e-9)


def test_eyes_and_jaw_do_not_tilt_the_head():
    """One person has the head joint at the neck, the other one between the ears."""
    high = {"LeftEye": ("Head", (3, 172, 4)), "RightEye": ("Head", (-3, 172, 4))}
    far = {
        "left_eye": ("head", (0.03, 1.5, 0.1)),
        "right_eye": ("head", (-0.03, 1.5, 0.1)),
        "jaw": ("head", (0.0, 1.45, 0.05)),
    }
    source, figure = moving(figure_of(HIK | high, "mocap")), figure_of(BODY | far, "body")
    clip = retarget(source, figure).clip
    head = figure.skeleton.names.index("head")
    # The trunk of both people is upright.
    np.testing.assert_allclose(np.abs(clip.rotations[0, head, 3]), 1.0, atol=EXACT)


def test_result_does_not_depend_on_the_joint_axes_of_the_figure():
    source, plain = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    rng = np.random.default_rng(1)
    skeleton = plain.skeleton
    turns = quaternions(rng.uniform(-2, 2, (skeleton.n_joints, 3)))
    # The same positions with rotated joints: offsets are relative to the parent's axes.
    worlds, offsets = [], []
    for joint, parent in enumerate(skeleton.parents):
        above = np.eye(3) if parent < 0 else worlds[parent]
        offsets.append(above.T @ skeleton.rest_translations[joint])
        worlds.append(above @ quaternion_matrix(turns[joint]))
    turned = replace(skeleton, rest_rotations=turns, rest_translations=np.array(offsets))
    figure = replace(plain, skeleton=turned)
    expected = places(plain, retarget(source, plain).clip)
    found = places(figure, retarget(source, figure).clip)
    for name, place in expected.items():
        np.testing.assert_allclose(found[name], place, atol=1e-12)


TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def test_source_with_z_up_is_rotated_upright():
    source = moving(figure_of(HIK, "mocap", TO_Y.T, "z"))
    figure = figure_of(BODY, "body")
    clip = retarget(source, figure).clip
    assert_same_limbs(source, figure, clip, TO_Y)
    theirs = {name: way @ TO_Y.T for name, way in places(source.figure, source.clip).items()}
    assert_same_path(places(figure, clip), theirs)


def assert_same_path(mine: dict[str, np.ndarray], theirs: dict[str, np.ndarray]) -> None:
    """Assert that the hips follow the scaled path, and that the feet have equal heights at rest."""
    raised = mine["pelvis"] - path_scale() * theirs["Hips"]
    # The first frame is the rest pose.
    height = mine["left_ankle"][0, 1] - path_scale() * theirs["LeftFoot"][0, 1]
    np.testing.assert_allclose(height, 0.0, atol=1e-12)
    np.testing.assert_allclose(raised[:, [0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(raised[:, 1]), 0.0, atol=1e-12)


def path_scale() -> float:
    """Return the ratio of the leg lengths of BODY and HIK, which are equal on both sides."""
    mine = [np.array(BODY[name][1]) for name in ("left_hip", "left_knee", "left_ankle")]
    theirs = [np.array(HIK[name][1]) for name in ("LeftUpLeg", "LeftLeg", "LeftFoot")]
    lengths = [
        np.linalg.norm(leg[1] - leg[0]) + np.linalg.norm(leg[2] - leg[1]) for leg in (mine, theirs)
    ]
    return lengths[0] / lengths[1]


def test_path_is_scaled_by_leg_length():
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    assert_same_path(places(figure, clip), places(source.figure, source.clip))
    values = {"scale": pytest.approx(path_scale()), "by": "the ratio of leg lengths"}
    assert told(notes)[-1] == ("F007.path-scaled", values)
    assert clip.figure_translations is None


def test_path_in_a_different_unit_than_the_skeleton_is_scaled_by_leg_length():
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    count, ahead = source.clip.n_rows, np.array([0.0, 0.0, 3.0])
    metres = replace(
        source.clip,
        figure_scales=np.full(count, 0.01),
        figure_translations=np.tile(ahead, (count, 1)),
    )
    found = retarget(replace(source, clip=metres), figure)
    clip, notes = found.clip, found.notes
    plain, moved = places(figure, retarget(source, figure).clip), places(figure, clip)
    scale = told(notes)[-1][1]["scale"]
    assert scale == pytest.approx(100.0 * path_scale())
    for name, place in plain.items():
        np.testing.assert_allclose(moved[name], place + scale * ahead, atol=1e-12)


def test_skinned_figure_moves_with_its_root():
    source, bare = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    corners = np.eye(3)
    figure = replace(bare, mesh=Mesh(corners, corners, np.array([[0, 1, 2]], dtype=np.int32)))
    clip = retarget(source, figure).clip
    assert clip.translations is None
    expected = places(bare, retarget(source, bare).clip)
    for name, place in places(figure, clip).items():
        np.testing.assert_allclose(place, expected[name], atol=1e-12)


def test_source_with_a_different_front_at_rest_rotates_the_figure():
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # maps z, the front, to x
    source = moving(figure_of(HIK, "mocap", quarter))
    figure = figure_of(BODY, "body")
    clip = retarget(source, figure).clip
    assert_same_limbs(source, figure, clip)
    where = places(figure, clip)
    # The line between the hips is along x at rest, and is aligned with the source's, along -z.
    np.testing.assert_allclose(bones(where, ("right_hip", "left_hip"))[0], [0, 0, -1], atol=EXACT)


def test_humanoid_with_arbitrary_names_that_faces_backwards_moves_forwards():
    half = np.diag([-1.0, 1.0, -1.0])  # VRM 0.x
    bones = {VRM_BONES[name]: joint for joint, name in enumerate(BODY)}
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body", half)
    names = tuple(f"n{joint}" for joint in range(len(BODY)))
    skeleton = replace(figure.skeleton, names=names, humanoid=Humanoid(bones))
    clip = retarget(source, replace(figure, skeleton=skeleton)).clip
    assert_same_limbs(source, figure, clip)
    assert_same_path(places(figure, clip), places(source.figure, source.clip))


def test_source_with_a_lying_rest_pose_stands_up_in_its_frames():
    down = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    source = moving(figure_of(HIK, "mocap", down))  # y is up, but the body is along z
    figure = figure_of(BODY, "body")
    clip = retarget(source, figure).clip
    assert_same_limbs(source, figure, clip)


def test_rotations_of_joints_between_matched_joints_are_included():
    table = dict(HIK)
    table["LeftArmRoll"] = ("LeftArm", (30, 145, 0))
    table["LeftForeArm"] = ("LeftArmRoll", HIK["LeftForeArm"][1])
    order = [*list(HIK)[:14], "LeftArmRoll", *list(HIK)[14:]]
    source = moving(figure_of({name: table[name] for name in order}, "mocap"))
    figure = figure_of(BODY, "body")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(
        bones(mine, ("left_elbow", "left_wrist")),
        bones(theirs, ("LeftForeArm", "LeftHand")),
        atol=EXACT,
    )
    names = ["LeftToeBase", "LeftArmRoll"]
    assert ("F007.joints-without-partner", {"motion": "mocap", "names": names}) in told(notes)


def test_unmapped_joints_stay_at_rest_relative_to_their_parent():
    table = {**BODY, "jaw": ("head", (0.0, 1.52, 0.08)), "tail": ("pelvis", (0, 0.9, -0.2))}
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(table, "body")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    np.testing.assert_array_equal(clip.rotations[:, -2:], np.tile([0.0, 0, 0, 1], (5, 2, 1)))
    assert ("F007.joints-at-rest", {"names": ["spine2", "jaw", "tail"]}) in told(notes)


def test_fingers_rotate_with_the_hand_and_bend_about_the_knuckles():
    def with_fingers(table: dict, wrist: str, names: list[str], turn: np.ndarray) -> dict:
        base = np.array(table[wrist][1], dtype=float)
        size = 0.01 if base[1] > 10 else 0.0001
        places = [(8, 0, 3), (12, 0, 3), (8, 0, -3), (12, 0, -3)]
        tips = [tuple(base + size * 100 * (turn @ np.array(p))) for p in places]
        return {
            **table,
            names[0]: (wrist, tips[0]),
            names[1]: (names[0], tips[1]),
            names[2]: (wrist, tips[2]),
            names[3]: (names[2], tips[3]),
        }

    hik = ["LeftHandIndex1", "LeftHandIndex2", "LeftHandPinky1", "LeftHandPinky2"]
    own = ["left_index1", "left_index2", "left_pinky1", "left_pinky2"]
    # The hand of the figure hangs down, palm to the body; that of the source is stretched out, palm
    # down.
    hang = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    source = moving(figure_of(with_fingers(HIK, "LeftHand", hik, np.eye(3)), "mocap"))
    figure = figure_of(with_fingers(BODY, "left_wrist", own, hang), "body")
    clip = retarget(source, figure).clip
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    pairs = [
        ((hik[0], hik[2]), (own[0], own[2])),
        ((hik[0], hik[1]), (own[0], own[1])),
        ((hik[2], hik[3]), (own[2], own[3])),
        (("LeftHand", hik[0]), ("left_wrist", own[0])),
    ]
    for pair, ours in pairs:
        np.testing.assert_allclose(bones(mine, ours), bones(theirs, pair), atol=EXACT)


def test_equal_hierarchy_with_different_proportions_receives_equal_rotations():
    source = moving(figure_of(BODY, "one"))
    names = list(BODY)
    # Depth-first instead of breadth-first, with 0.9 times the width and 1.1 times the height.
    order = [
        "pelvis",
        "spine1",
        "spine2",
        "spine3",
        "neck",
        "head",
        *[n for n in names if "_" in n],
    ]
    table = {n: (BODY[n][0], tuple(np.array(BODY[n][1]) * [0.9, 1.1, 1.0])) for n in order}
    figure = figure_of(table, "two")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    for joint, name in enumerate(order):
        same = np.einsum(
            "na,na->n", clip.rotations[:, joint], source.clip.rotations[:, names.index(name)]
        )
        np.testing.assert_allclose(np.abs(same), 1.0, atol=EXACT)
    values = {"motion": "one", "figure": "two", "n": 20, "all": 20, "pairs": []}
    assert told(notes)[0] == ("F007.joints-matched", values)


def test_joint_translations_are_transferred_between_equal_hierarchies():
    figure = figure_of(BODY, "one")
    motion = moving(figure)
    shifts = motion.clip.translations.copy()
    shifts[2:, 4] = 0.05, -0.01, 0.02
    motion = SkeletonMotion(figure, replace(motion.clip, translations=shifts))
    clip = retarget(motion, figure).clip
    np.testing.assert_allclose(clip.translations, shifts, atol=EXACT)
    bigger = scaled_motion(motion, 2.0).figure
    clip = retarget(motion, bigger).clip
    np.testing.assert_allclose(clip.translations[:, 4], 2 * shifts[:, 4], atol=EXACT)
    notes = retarget(motion, figure_of(HIK, "mocap")).notes
    values = {"n": 1, "most": pytest.approx(np.sqrt(0.003)), "joint": "left_knee"}
    assert told(notes)[-1] == ("F007.joint-positions-left-out", values)


def joint_map(drivers: dict[str, str]) -> JointMap:
    """Return a map from source joints and the target joints that they drive."""
    return JointMap(tuple((target, source) for source, target in drivers.items()))


def test_mapping_matches_names_without_rules():
    strange = {
        f"x{i}": (f"x{list(HIK).index(p)}" if p else "", at)
        for i, (p, at) in enumerate(HIK.values())
    }
    source, figure = moving(figure_of(strange, "strange")), figure_of(BODY, "body")
    with pytest.raises(RigError):
        retarget(source, figure)
    arm = {"x0": "pelvis", "x13": "left_shoulder", "x14": "left_elbow", "x15": "left_wrist"}
    found = retarget(source, figure, joint_map(arm))
    clip, notes = found.clip, found.notes
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(
        bones(mine, ("left_elbow", "left_wrist")), bones(theirs, ("x14", "x15")), atol=EXACT
    )
    names = ("pelvis", "x0"), ("left_shoulder", "x13"), ("left_elbow", "x14"), ("left_wrist", "x15")
    pairs = [
        Phrase("{joint} by {partner}", joint=joint, partner=partner) for joint, partner in names
    ]
    values = {"motion": "strange", "figure": "body", "n": 4, "all": 20, "pairs": pairs}
    (matched, resting, *_) = told(notes)
    assert matched == ("F007.joints-matched-as-follows", values)
    assert resting[0] == "F007.joints-at-rest"
    assert resting[1]["names"][:2] == ["left_hip", "right_hip"]


def test_equal_names_match_without_a_known_meaning():
    table = {
        "base": ("", (0, 0, 0)),
        "tail_01": ("base", (0, 0, 1)),
        "tail_02": ("tail_01", (0, 0, 2)),
    }
    more = {**table, "sting": ("tail_02", (0, 0, 3))}
    source, figure = moving(figure_of(table, "snake")), figure_of(more, "wasp")
    found = retarget(source, figure)
    clip, notes = found.clip, found.notes
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(mine["tail_02"], theirs["tail_02"], atol=EXACT)
    values = {"motion": "snake", "figure": "wasp", "n": 3, "all": 4, "pairs": []}
    assert told(notes)[:2] == [
        ("F007.joints-matched", values),
        ("F007.joints-at-rest", {"names": ["sting"]}),
    ]


@pytest.mark.parametrize(
    ("mapping", "key", "values"),
    [
        (
            None,
            "F004.joints-unmatched",
            {
                "motion": "snake",
                "figure": "body",
                "n": 0,
                "unused": ["base", "tail"],
                "idle": list(BODY),
            },
        ),
        (
            {"tial": "head"},
            "F004.mapping-joint",
            {"joint": "tial", "figure": "snake", "n": 0, "near": "did you mean tail?"},
        ),
        (
            {"tail": "haed"},
            "F004.mapping-joint",
            {"joint": "haed", "figure": "body", "n": 0, "near": "did you mean head?"},
        ),
        (
            {"tail": "head", "base": "head"},
            "F004.mapping-again",
            {"joint": "head", "figure": "body"},
        ),
    ],
)
def test_incompatible_figures_are_refused(mapping, key, values):
    snake = figure_of({"base": ("", (0, 0, 0)), "tail": ("base", (0, 0, 1))}, "snake")
    with pytest.raises(RigError) as caught:
        retarget(moving(snake), figure_of(BODY, "body"), mapping and joint_map(mapping))
    found = caught.value.diagnostic
    assert found is not None and (found.key, found.values) == (key, values)


def test_gaps_are_preserved():
    motion = moving(figure_of(HIK, "mocap"))
    timing = Timing(25.0, np.array([0, 1, -1, -1, 2, 3, 4]), first_frame=7)
    clip = retarget(
        SkeletonMotion(motion.figure, replace(motion.clip, timing=timing)), figure_of(BODY, "b")
    ).clip
    assert clip.timing is timing and clip.n_rows == 5


def test_scaled_motion_scales_all_lengths():
    motion = moving(figure_of(HIK, "mocap"))
    boxes = np.tile([[-1.0, -1, -1], [1, 1, 2]], (20, 1, 1))
    figure = replace(motion.figure, skeleton=replace(motion.figure.skeleton, boxes=boxes))
    small = scaled_motion(SkeletonMotion(figure, motion.clip), 0.01, "m")
    assert small.figure.unit == "m"
    np.testing.assert_allclose(small.figure.skeleton.boxes, 0.01 * boxes)
    before, after = places(motion.figure, motion.clip), places(small.figure, small.clip)
    for name, place in before.items():
        np.testing.assert_allclose(after[name], 0.01 * place, atol=1e-14)
    with pytest.raises(RigError, match="expected a factor above 0, found 0"):
        scaled_motion(motion, 0.0)


def limb_warnings(motion: SkeletonMotion, figure: Figure, mapping=None) -> list[Diagnostic]:
    return [
        note
        for note in retarget(motion, figure, mapping and joint_map(mapping)).notes
        if note.code == "C018"
    ]


def renamed(table: dict, **names: str) -> dict:
    return {names.get(name, name): (names.get(parent, parent), at)
            for name, (parent, at) in table.items()}  # fmt: skip


def test_limbs_without_a_recognised_joint_of_the_motion_are_a_warning():
    body = figure_of(BODY, "body")
    assert limb_warnings(moving(figure_of(HIK, "walk")), body) == []
    foreign = renamed(HIK, LeftLeg="Knie_l", RightLeg="Knie_r")
    (found,) = limb_warnings(moving(figure_of(foreign, "walk")), body)
    assert str(found) == (
        "left_knee, right_knee of body stay at rest: nothing in walk is recognised as these joints "
        "(unused: Knie_l, Knie_r); match them in the Joint match panel or with --joint-map"
    )
    pairs = {"Knie_l": "left_knee", "Knie_r": "right_knee"}
    assert limb_warnings(moving(figure_of(foreign, "walk")), body, pairs) == []
    # Feet that stay at rest cannot stand.
    footless = {name: at for name, at in HIK.items() if not name.endswith(("Foot", "ToeBase"))}
    (found,) = limb_warnings(moving(figure_of(footless, "walk")), body)
    said = "left_ankle, right_ankle of body stay at rest: walk has no such joints"
    assert str(found) == said


def test_limbs_without_a_recognised_joint_of_the_figure_are_a_warning():
    body = figure_of(renamed(BODY, left_elbow="codo"), "body")
    (found,) = limb_warnings(moving(figure_of(HIK, "walk")), body)
    assert (found.key, found.values["parts"]) == ("C018.limbs-unknown", ["left elbow"])
    assert found.values["idle"] == ["codo"]


def test_knees_that_never_bend_in_a_moving_leg_are_a_warning():
    motion, body = moving(figure_of(HIK, "walk")), figure_of(BODY, "body")
    names, rotations = motion.figure.skeleton.names, motion.clip.rotations.copy()
    for name in ("LeftLeg", "RightLeg"):
        rotations[:, names.index(name)] = [0, 0, 0, 1]
    (found,) = limb_warnings(replace(motion, clip=replace(motion.clip, rotations=rotations)), body)
    assert (found.key, found.values["names"]) == ("C018.limbs-still", ["left_knee", "right_knee"])
    # A figure that does not move at all is no fault.
    still = np.broadcast_to([0.0, 0.0, 0.0, 1.0], rotations.shape)
    assert limb_warnings(replace(motion, clip=replace(motion.clip, rotations=still)), body) == []
    one = motion.clip.rotations.copy()
    one[:, names.index("LeftLeg")] = [0, 0, 0, 1]
    (found,) = limb_warnings(replace(motion, clip=replace(motion.clip, rotations=one)), body)
    assert str(found) == (
        "left_knee of body never bends, because LeftLeg of walk never does; if this is wrong, "
        "match other joints in the Joint match panel or with --joint-map"
    )
