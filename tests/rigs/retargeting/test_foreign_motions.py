"""Motions in many naming schemes and up axes on one figure: every limb moves as in the source.

The source's limbs are computed here, by multiplying matrices down its hierarchy; the figure has
other proportions and an A-pose.
"""

import math

import numpy as np
import pytest
from builders import axis_turn
from numpy.testing import assert_allclose

from viewer.formats import Source, bvh
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.skeleton import ball_skeleton

FRAMES = 5
# Parent and offset in a T-pose with y up, in cm.
SOURCE = {
    "pelvis": ("", (0, 0, 0)),
    "spine": ("pelvis", (0, 10, 0)),
    "neck": ("spine", (0, 40, 0)),
    "head": ("neck", (0, 10, 0)),
    "left_collar": ("spine", (3, 38, 0)),
    "left_shoulder": ("left_collar", (14, 0, 0)),
    "left_elbow": ("left_shoulder", (28, 0, 0)),
    "left_wrist": ("left_elbow", (25, 0, 0)),
    "left_index1": ("left_wrist", (9, 0, 3)),
    "left_index2": ("left_index1", (4, 0, 0)),
    "left_index3": ("left_index2", (3, 0, 0)),
    "right_collar": ("spine", (-3, 38, 0)),
    "right_shoulder": ("right_collar", (-14, 0, 0)),
    "right_elbow": ("right_shoulder", (-28, 0, 0)),
    "right_wrist": ("right_elbow", (-25, 0, 0)),
    "left_hip": ("pelvis", (9, -5, 0)),
    "left_knee": ("left_hip", (0, -42, 0)),
    "left_ankle": ("left_knee", (0, -40, 0)),
    "left_foot": ("left_ankle", (0, -6, 12)),
    "right_hip": ("pelvis", (-9, -5, 0)),
    "right_knee": ("right_hip", (0, -42, 0)),
    "right_ankle": ("right_knee", (0, -40, 0)),
    "right_foot": ("right_ankle", (0, -6, 12)),
}
PARENTS = [[*SOURCE].index(parent) if parent else -1 for parent, _ in SOURCE.values()]
OFFSETS = np.array([offset for _, offset in SOURCE.values()], dtype=float)
LIMBS = [
    (f"{side}_{start}", f"{side}_{end}")
    for side in ("left", "right")
    for start, end in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"),
                       ("elbow", "wrist"), ("index1", "index2"), ("index2", "index3"))
    if f"{side}_{end}" in SOURCE
]  # fmt: skip

# Names of pelvis, spine, neck, head; of the sided joints from the collar to the wrist, the index
# finger, and from the hip to the toes. "@" stands for the side.
SCHEMES = {
    "mixamo": ("Hips Spine Neck Head", "@Shoulder @Arm @ForeArm @Hand @HandIndex1 @HandIndex2 "
               "@HandIndex3 @UpLeg @Leg @Foot @ToeBase"),
    "soma": ("Hips Spine1 Neck1 Head", "@Shoulder @Arm @ForeArm @Hand @HandIndex1 @HandIndex2 "
             "@HandIndex3 @Leg @Shin @Foot @ToeBase"),
    "makehuman": ("Root Spine1 Neck Head", "Clavicle_@ UpArm_@ LoArm_@ Hand_@ Index1_@ Index2_@ "
                  "Index3_@ UpLeg_@ LoLeg_@ Foot_@ Toe_@"),
    "mmd": ("下半身 上半身 首 頭", "@肩 @腕 @ひじ @手首 @人指１ @人指２ @人指３ @足 @ひざ @足首 "
            "@つま先"),
    "biped": ("Bip01_Pelvis Bip01_Spine Bip01_Neck Bip01_Head", "Bip01_@_Clavicle Bip01_@_UpperArm "
              "Bip01_@_Forearm Bip01_@_Hand Bip01_@_Finger1 Bip01_@_Finger11 Bip01_@_Finger12 "
              "Bip01_@_Thigh Bip01_@_Calf Bip01_@_Foot Bip01_@_Toe0"),
    "rigify": ("DEF-spine DEF-spine.001 DEF-spine.004 DEF-spine.006", "DEF-shoulder.@ "
               "DEF-upper_arm.@ DEF-forearm.@ DEF-hand.@ DEF-f_index.01.@ DEF-f_index.02.@ "
               "DEF-f_index.03.@ DEF-thigh.@ DEF-shin.@ DEF-foot.@ DEF-toe.@"),
    "vroid": ("J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Neck J_Bip_C_Head", "J_Bip_@_Shoulder "
              "J_Bip_@_UpperArm J_Bip_@_LowerArm J_Bip_@_Hand J_Bip_@_Index1 J_Bip_@_Index2 "
              "J_Bip_@_Index3 J_Bip_@_UpperLeg J_Bip_@_LowerLeg J_Bip_@_Foot J_Bip_@_ToeBase"),
    "aist": ("Hips Chest Neck Head", "@Collar @Shoulder @Elbow @Wrist @Index1 @Index2 @Index3 @Hip "
             "@Knee @Ankle @Toe"),
    "daz": ("hip abdomen neck head", "@Collar @Shldr @ForeArm @Hand @Index1 @Index2 @Index3 @Thigh "
            "@Shin @Foot @Toe"),
    "mmd english": ("lower_body upper_body neck head", "shoulder_@ arm_@ elbow_@ wrist_@ fore1_@ "
                    "fore2_@ fore3_@ leg_@ knee_@ ankle_@ toe_@"),
    "unreal": ("pelvis spine_01 neck_01 head", "clavicle_@ upperarm_@ lowerarm_@ hand_@ index_01_@ "
               "index_02_@ index_03_@ thigh_@ calf_@ foot_@ ball_@"),
    "upper case": ("HIPS SPINE NECK HEAD", "@_SHOULDER @_ARM @_FOREARM @_HAND @_INDEX_1 @_INDEX_2 "
                   "@_INDEX_3 @_UPLEG @_LEG @_FOOT @_TOE"),
    "suffixes": ("hips_jnt spine_jnt neck_jnt head_jnt", "@_clavicle_jnt @_uparm_jnt @_lowarm_jnt "
                 "@_wrist_jnt @_index1_jnt @_index2_jnt @_index3_jnt @_upleg_jnt @_lowleg_jnt "
                 "@_foot_jnt @_ball_jnt"),
}  # fmt: skip
SIDES = {
    **dict.fromkeys(("mixamo", "soma", "aist"), ("Left", "Right")),
    **{"mmd": ("左", "右"), "daz": ("l", "r"), "suffixes": ("l", "r"), "unreal": ("l", "r")},
}
PARTS = ("collar", "shoulder", "elbow", "wrist", "index1", "index2", "index3", "hip", "knee",
         "ankle", "foot")  # fmt: skip


def names_of(scheme: str) -> list[str]:
    """Return the names of SOURCE's joints in a scheme."""
    trunk, limbs = (words.split() for words in SCHEMES[scheme])
    names = dict(zip(("pelvis", "spine", "neck", "head"), trunk, strict=True))
    for side, text in zip(("left", "right"), SIDES.get(scheme, ("L", "R")), strict=True):
        for part, word in zip(PARTS, limbs, strict=True):
            names[f"{side}_{part}"] = word.replace("@", text)
    return [names[joint] for joint in SOURCE]


def about(axis: int, degrees: float) -> np.ndarray:
    return axis_turn(axis, math.radians(degrees))


AXES = {"y": np.eye(3), "z": about(0, 90), "x": about(2, -90)}  # y becomes the axis


def angles_zxy(matrix: np.ndarray) -> list[float]:
    """Return the angles a, b, c of Rz(a) Rx(b) Ry(c), in degrees."""
    m = matrix
    return np.degrees([
        np.arctan2(-m[0, 1], m[1, 1]), np.arcsin(m[2, 1]), np.arctan2(-m[2, 0], m[2, 2])
    ]).tolist()  # fmt: skip


def locals_of(frame: int) -> list[np.ndarray]:
    """Return the local rotations of a frame, in the axes of a body with y up."""
    rng = np.random.default_rng(frame)
    angles = rng.uniform(-25.0, 25.0, (len(SOURCE), 3))
    angles[0] *= 0.3
    return [about(0, a) @ about(1, b) @ about(2, c) for a, b, c in angles]


def source_worlds(frame: int) -> list[np.ndarray]:
    """Return the world rotations of a frame, in the axes of a body with y up."""
    worlds: list[np.ndarray] = []
    for parent, local in zip(PARENTS, locals_of(frame), strict=True):
        worlds.append(worlds[parent] @ local if parent >= 0 else local)
    return worlds


def motion(
    scheme: str = "mixamo",
    rest: str = "y",
    world: str = "y",
    place=(0.0, 95.0, 0.0),
    tilt=0.0,
) -> SkeletonMotion:
    """Return a motion whose rest pose and frames stand along two axes, read from a file."""
    at_rest, stands = AXES[rest], AXES[world] @ about(0, tilt)
    names, lines = names_of(scheme), ["HIERARCHY"]

    def put(joint: int) -> None:
        below = [child for child, parent in enumerate(PARENTS) if parent == joint]
        moves = "" if joint else "Xposition Yposition Zposition "
        offset = at_rest @ OFFSETS[joint]
        lines.extend([f"{'JOINT' if joint else 'ROOT'} {names[joint]}", "{"])
        lines.append("OFFSET {:f} {:f} {:f}".format(*offset))
        lines.append(f"CHANNELS {3 if joint else 6} {moves}Zrotation Xrotation Yrotation")
        for child in below:
            put(child)
        lines.extend([*([] if below else ["End Site", "{", "OFFSET 0 1 0", "}"]), "}"])

    put(0)
    lines += ["MOTION", f"Frames: {FRAMES}", "Frame Time: 0.04"]
    for frame in range(FRAMES):
        row = (AXES[world] @ (place + 5.0 * frame * np.eye(3)[2])).tolist()
        for joint, local in enumerate(locals_of(frame)):
            turned = at_rest @ local @ at_rest.T
            row += angles_zxy(turned if joint else stands @ at_rest.T @ turned)
        lines.append(" ".join(f"{value:.9f}" for value in row))
    return bvh.read(Source("a.bvh", "\n".join(lines).encode()))


def figure(up: str = "y") -> Figure:
    """Return a figure with Mixamo's names, longer legs, and arms that are lowered by 40 degrees."""
    points = np.zeros_like(OFFSETS)
    for joint, (name, parent) in enumerate(zip(SOURCE, PARENTS, strict=True)):
        offset = OFFSETS[joint] * (1.3 if name.endswith(("knee", "ankle")) else 1.0)
        if name.endswith(("elbow", "wrist", "index1", "index2", "index3")):
            offset = about(2, -40.0 if name.startswith("left") else 40.0) @ offset
        points[joint] = offset + (points[parent] if parent >= 0 else 0.0)
    skeleton = ball_skeleton(tuple(names_of("mixamo")), np.array(PARENTS), points @ AXES[up].T)
    return Figure("hero", skeleton=skeleton, up=up, unit="cm")


def assert_limbs_follow(found: SkeletonMotion, target: Figure) -> None:
    """Require that limbs point as in the source, and that the head has its rotation."""
    clip = retarget(found, target, source_rest="auto").clip
    worlds = world_frames(target, frames_of(target, clip, np.arange(FRAMES) / 25.0))
    joints = [*SOURCE]
    for frame in range(FRAMES):
        wanted = source_worlds(frame)
        for start, end in LIMBS:
            first, last = joints.index(start), joints.index(end)
            step = worlds[frame, last, :3, 3] - worlds[frame, first, :3, 3]
            expected = AXES[target.up] @ wanted[first] @ OFFSETS[last]
            angle = np.degrees(np.arccos(min(1.0, step @ expected / np.linalg.norm(step)
                                             / np.linalg.norm(expected))))  # fmt: skip
            assert angle < 1e-3, (start, end)
        axes = AXES[target.up]
        # The rest poses of the heads are the same.
        head = axes.T @ worlds[frame, joints.index("head"), :3, :3] @ axes
        assert_allclose(head, wanted[joints.index("head")], atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_limbs_move_as_in_the_source_under_any_names(scheme):
    assert_limbs_follow(motion(scheme), figure())


@pytest.mark.parametrize("up", "yz")
@pytest.mark.parametrize("world", "yz")
@pytest.mark.parametrize("rest", "yzx")
def test_figures_stand_whatever_the_up_axes_of_rest_pose_and_motion(rest, world, up):
    found = motion("mixamo", rest, world)
    assert found.figure.up == world
    assert_limbs_follow(found, figure(up))


def test_feet_reach_the_ground_if_only_the_motion_has_z_up():
    heights = []
    for found in (motion(rest="y", world="y"), motion(rest="y", world="z")):
        clip = retarget(found, figure(), source_rest="auto").clip
        worlds = world_frames(figure(), frames_of(figure(), clip, np.arange(FRAMES) / 25.0))
        heights.append(worlds[:, :, 1, 3])
    assert_allclose(heights[1], heights[0], atol=1e-4)


def test_a_person_lying_on_the_ground_is_no_evidence_for_another_up_axis():
    # On the belly, with the head towards +z; the arms reach the ground, 40 cm below.
    lying = motion(tilt=90.0, place=(0.0, 40.0, -200.0))
    assert lying.figure.up == "y"
    assert [*map(str, lying.up_notes)] == [
        "y up assumed, although the skeleton is upright along +z in the frames"
    ]
    standing = motion(rest="y", world="z")
    assert [*map(str, standing.up_notes)] == [
        "z up assumed: the skeleton is upright along z in the frames, although along +y in the "
        "rest pose"
    ]
