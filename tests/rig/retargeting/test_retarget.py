"""Retargeting of motions between skeletons with different rest poses, axes, units and names."""

from dataclasses import replace

import numpy as np
import pytest
from faults import told
from rig.retargeting.two_people import (
    BODY,
    EXACT,
    HIK,
    bones,
    figure_of,
    moving,
    places,
    quaternions,
)

from viewer.rig.figure import Figure
from viewer.rig.humanoid import HUMAN_BONES, Humanoid
from viewer.rig.mesh import Mesh
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.retargeting.retarget import retarget

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


def test_retargeting_onto_itself_is_the_identity() -> None:
    motion = moving(figure_of(HIK, "mocap"))
    clip, notes = retarget(motion, motion.figure)
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)
    np.testing.assert_allclose(clip.translations, motion.clip.translations, atol=1e-12 * 100)
    matched = {"motion": "mocap", "figure": "mocap", "n": 20, "all": 20, "pairs": []}
    assert told(notes) == [
        ("F007.joints-matched", matched),
        ("F007.path-scaled", {"scale": pytest.approx(1.0), "by": "the ratio of leg lengths"}),
    ]


def test_joints_with_repeated_names_are_matched_by_hierarchy() -> None:
    table = {"a": ("", (0, 0, 0)), "b": ("a", (1, 0, 0)), "c": ("b", (2, 0, 0))}
    figure = figure_of(table, "snake")
    figure = replace(figure, skeleton=replace(figure.skeleton, names=("tail", "tail", "")))
    motion = moving(figure)
    clip, _ = retarget(motion, figure)
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)


def test_limb_directions_match_the_source_from_t_pose_to_a_pose() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, notes = retarget(source, figure)
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


def test_very_different_rest_pose_of_the_trunk_is_aligned() -> None:
    bowed = {**HIK, "Head": ("Neck", (0, 145, 12)), "Spine1": ("Spine", (0, 112, 14))}
    source, figure = moving(figure_of(bowed, "mocap")), figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for pair, own in (
        (("Neck", "Head"), ("neck", "head")),
        (("Spine", "Spine1"), ("spine1", "spine3")),
    ):
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


def test_limb_directions_match_the_source_from_a_pose_to_t_pose() -> None:
    source, figure = moving(figure_of(BODY, "body")), figure_of(HIK, "mocap")
    clip, _ = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for own, pair in LIMBS:
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


def test_trunk_and_feet_keep_their_rest_shape() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    # In the rest pose of the source, the slightly bent spine of the figure keeps its shape.
    still = {"pelvis": 0, "spine1": 3, "spine3": 9, "neck": 10, "head": 13, "left_collar": 11}
    for name, joint in still.items():
        np.testing.assert_allclose(
            np.abs(clip.rotations[0, joint, 3]), 1.0, atol=EXACT, err_msg=name
        )


def test_eyes_and_jaw_do_not_tilt_the_head() -> None:
    """One person has the head joint at the neck, the other one between the ears."""
    high = {"LeftEye": ("Head", (3, 172, 4)), "RightEye": ("Head", (-3, 172, 4))}
    far = {
        "left_eye": ("head", (0.03, 1.5, 0.1)),
        "right_eye": ("head", (-0.03, 1.5, 0.1)),
        "jaw": ("head", (0.0, 1.45, 0.05)),
    }
    source, figure = moving(figure_of(HIK | high, "mocap")), figure_of(BODY | far, "body")
    clip, _ = retarget(source, figure)
    head = figure.skeleton.names.index("head")
    # The trunk of both people is upright.
    np.testing.assert_allclose(np.abs(clip.rotations[0, head, 3]), 1.0, atol=EXACT)


def test_result_does_not_depend_on_the_joint_axes_of_the_figure() -> None:
    source, plain = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    rng = np.random.default_rng(1)
    skeleton = plain.skeleton
    turns = quaternions(rng.uniform(-2, 2, (skeleton.n_joints, 3)))
    # The same positions with rotated joints: offsets are relative to the parent's axes.
    worlds, offsets = [], []
    for joint, parent in enumerate(skeleton.parents):
        above = np.eye(3) if parent < 0 else worlds[parent]
        offsets.append(above.T @ skeleton.rest_translations[joint])
        worlds.append(above @ matrix(turns[joint]))
    turned = replace(skeleton, rest_rotations=turns, rest_translations=np.array(offsets))
    figure = replace(plain, skeleton=turned)
    expected = places(plain, retarget(source, plain)[0])
    found = places(figure, retarget(source, figure)[0])
    for name, place in expected.items():
        np.testing.assert_allclose(found[name], place, atol=1e-12)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def test_source_with_z_up_is_rotated_upright() -> None:
    source = moving(figure_of(HIK, "mocap", TO_Y.T, "z"))
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
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


def test_path_is_scaled_by_leg_length() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, notes = retarget(source, figure)
    assert_same_path(places(figure, clip), places(source.figure, source.clip))
    values = {"scale": pytest.approx(path_scale()), "by": "the ratio of leg lengths"}
    assert told(notes)[-1] == ("F007.path-scaled", values)
    assert clip.figure_translations is None


def test_path_in_a_different_unit_than_the_skeleton_is_scaled_by_leg_length() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    count, ahead = source.clip.n_rows, np.array([0.0, 0.0, 3.0])
    metres = replace(
        source.clip,
        figure_scales=np.full(count, 0.01),
        figure_translations=np.tile(ahead, (count, 1)),
    )
    clip, notes = retarget(replace(source, clip=metres), figure)
    plain, moved = places(figure, retarget(source, figure)[0]), places(figure, clip)
    scale = told(notes)[-1][1]["scale"]
    assert scale == pytest.approx(100.0 * path_scale())
    for name, place in plain.items():
        np.testing.assert_allclose(moved[name], place + scale * ahead, atol=1e-12)


def test_skinned_figure_moves_with_its_root() -> None:
    source, bare = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    corners = np.eye(3)
    figure = replace(bare, mesh=Mesh(corners, corners, np.array([[0, 1, 2]], dtype=np.int32)))
    clip, _ = retarget(source, figure)
    assert clip.translations is None
    expected = places(bare, retarget(source, bare)[0])
    for name, place in places(figure, clip).items():
        np.testing.assert_allclose(place, expected[name], atol=1e-12)


def test_source_with_a_different_front_at_rest_rotates_the_figure() -> None:
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # maps z, the front, to x
    source = moving(figure_of(HIK, "mocap", quarter))
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    assert_same_limbs(source, figure, clip)
    where = places(figure, clip)
    # The line between the hips is along x at rest, and is aligned with the source's, along -z.
    np.testing.assert_allclose(bones(where, ("right_hip", "left_hip"))[0], [0, 0, -1], atol=EXACT)


def test_humanoid_with_arbitrary_names_that_faces_backwards_moves_forwards() -> None:
    half = np.diag([-1.0, 1.0, -1.0])  # VRM 0.x
    bones = {VRM_BONES[name]: joint for joint, name in enumerate(BODY)}
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body", half)
    names = tuple(f"n{joint}" for joint in range(len(BODY)))
    skeleton = replace(figure.skeleton, names=names, humanoid=Humanoid(bones))
    clip, _ = retarget(source, replace(figure, skeleton=skeleton))
    assert_same_limbs(source, figure, clip)
    assert_same_path(places(figure, clip), places(source.figure, source.clip))


def test_source_with_a_lying_rest_pose_stands_up_in_its_frames() -> None:
    down = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    source = moving(figure_of(HIK, "mocap", down))  # y is up, but the body is along z
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    assert_same_limbs(source, figure, clip)
