"""Names and limbs of the Momentum Human Rig's 127 joints, and of 70 keypoints on its body."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from viewer.rig.captures.points import PointLayout

__all__ = ["JOINTS", "KEYPOINTS", "ORIGIN", "PARENTS", "point_layout"]

ORIGIN = "body_world"
"""Name of the joint that is the origin of the rig, and not part of the body."""

_TWISTS = ["twist1_proc", "twist2_proc", "twist3_proc", "twist4_proc"]


_HEAD = (
    "c_neck c_neck_twist1_proc c_neck_twist0_proc c_head c_jaw c_teeth c_jaw_null c_tongue0 "
    "c_tongue1 c_tongue2 c_tongue3 c_tongue4 r_eye r_eye_null l_eye l_eye_null c_head_null"
)


def _leg(side: str) -> list[str]:
    chain = ["upleg", "lowleg", "foot", "talocrural", "subtalar", "transversetarsal", "ball"]
    twists = [f"lowleg_{name}" for name in _TWISTS]
    twists += [f"upleg_{name}" for name in ("twist0_proc", *_TWISTS)]
    return [f"{side}_{name}" for name in chain + twists]


def _arm(side: str) -> list[str]:
    names = ["clavicle", "uparm", "lowarm", "wrist_twist", "wrist", "pinky0"]
    for finger in ("pinky", "ring", "middle", "index"):
        names += [f"{finger}{number}" for number in (1, 2, 3)] + [f"{finger}_null"]
    names += ["thumb0", "thumb1", "thumb2", "thumb3", "thumb_null"]
    names += [f"lowarm_{name}" for name in _TWISTS]
    names += [f"uparm_{name}" for name in ("twist0_proc", *_TWISTS)]
    return [f"{side}_{name}" for name in names]


JOINTS = (
    *(ORIGIN, "root", *_leg("l"), *_leg("r")),
    *("c_spine0", "c_spine1", "c_spine2", "c_spine3", *_arm("r"), *_arm("l")),
    *_HEAD.split(),
)
"""Names of the rig's joints; "null" marks ends, "proc" joints that share a twist."""

# Parents of joints that do not continue the joint before them.
_BRANCHES = {
    "l_upleg": "root", "r_upleg": "root", "c_spine0": "root",
    "r_clavicle": "c_spine3", "l_clavicle": "c_spine3", "c_neck": "c_spine3",
    "c_neck_twist1_proc": "c_neck", "c_neck_twist0_proc": "c_neck", "c_head": "c_neck",
    "c_jaw": "c_head", "c_teeth": "c_jaw", "c_jaw_null": "c_jaw", "c_tongue0": "c_jaw",
    "r_eye": "c_head", "l_eye": "c_head", "c_head_null": "c_head",
    **{f"{side}_{finger}": f"{side}_wrist" for side in "lr"
       for finger in ("pinky0", "ring1", "middle1", "index1", "thumb0")},
    **{f"{side}_{part}_{name}": f"{side}_{part}" for side in "lr"
       for part in ("upleg", "lowleg", "uparm", "lowarm") for name in ("twist0_proc", *_TWISTS)},
}  # fmt: skip

PARENTS = tuple(
    JOINTS.index(_BRANCHES[name]) if name in _BRANCHES else index - 1
    for index, name in enumerate(JOINTS)
)
"""Index of each joint's parent; -1 for the origin."""

_BODY = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow "
    "right_elbow left_hip right_hip left_knee right_knee left_ankle right_ankle left_big_toe "
    "left_small_toe left_heel right_big_toe right_small_toe right_heel"
)
_FINGERS = ("thumb", "index", "middle", "ring", "pinky")


def _hand(side: str) -> list[str]:
    fingers = [f"{side}_{finger}{end}" for finger in _FINGERS for end in ("_tip", "3", "2", "1")]
    return [*fingers, f"{side}_wrist"]


KEYPOINTS = (
    *(*_BODY.split(), *_hand("right"), *_hand("left")),
    *("left_olecranon", "right_olecranon", "left_cubital_fossa", "right_cubital_fossa"),
    *("left_acromion", "right_acromion", "neck"),
)
"""Names of the keypoints; names of fingers begin at the tip."""

_LIMBS = (
    "ankle-knee knee-hip shoulder-hip shoulder-elbow elbow-wrist ankle-big_toe ankle-small_toe "
    "ankle-heel nose-eye eye-ear neck-shoulder"
)
_MIDDLE = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"), ("nose", "neck"))


def _keypoint_limbs() -> list[tuple[int, int]]:
    pairs = [*_MIDDLE]
    for side in ("left", "right"):
        for limb in _LIMBS.split():
            ends = [
                name if name in ("nose", "neck") else f"{side}_{name}" for name in limb.split("-")
            ]
            pairs.append((ends[0], ends[1]))
        for finger in _FINGERS:
            chain = [
                f"{side}_{name}" for name in ("wrist", f"{finger}1", f"{finger}2", f"{finger}3")
            ]
            chain.append(f"{side}_{finger}_tip")
            pairs += pairwise(chain)
    return [(KEYPOINTS.index(first), KEYPOINTS.index(second)) for first, second in pairs]


def point_layout(n_keypoints: int, n_joints: int, n_vertices: int) -> PointLayout:
    """Return the layout of keypoints, joints and vertices, in this order.

    Parameters
    ----------
    n_keypoints, n_joints : int
        70 and 127, or 0; other numbers have no names and limbs.
    n_vertices : int
        Number of vertices, which have no limbs.
    """
    names, limbs = _named("keypoint", KEYPOINTS, n_keypoints), []
    if n_keypoints == len(KEYPOINTS):
        limbs += _keypoint_limbs()
    if n_joints == len(JOINTS):
        limbs += [
            (n_keypoints + joint, n_keypoints + parent)
            for joint, parent in enumerate(PARENTS)
            if parent > 0
        ]
    names += _named("joint", JOINTS, n_joints) + [f"vertex{index}" for index in range(n_vertices)]
    sides = [name.startswith(("left_", "l_")) - name.startswith(("right_", "r_")) for name in names]
    return PointLayout(
        "MHR",
        tuple(names),
        np.array(limbs, dtype=np.int32).reshape(-1, 2),
        np.array(sides, dtype=np.int32),
    )


def _named(kind: str, known: tuple[str, ...], count: int) -> list[str]:
    return [*known] if count == len(known) else [f"{kind}{index}" for index in range(count)]
