"""Layouts of captured keypoints, chosen by keypoint count: names, limbs, sides and joints.

body25 and the orders of hands and face are OpenPose's, panoptic is CMU's; the others come from
COCO, Human3.6M as EasyMocap orders it (left first), the SMPL family and MediaPipe. The joints that
correspond to keypoints show how well a body was fitted to them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from viewer.errors import RigError
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.captures.person import is_tracked
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import joint_matrices

Pairs = tuple[tuple[int, int], ...]
_BODY25 = (
    "nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist mid_hip "
    "right_hip right_knee right_ankle left_hip left_knee left_ankle right_eye left_eye right_ear "
    "left_ear left_big_toe left_small_toe left_heel right_big_toe right_small_toe right_heel"
)
_BODY25_LIMBS = (
    "8-1 1-0 2-1 3-2 4-3 5-1 6-5 7-6 9-8 10-9 11-10 12-8 13-12 14-13 15-0 16-0 17-15 18-16 19-14 "
    "20-19 21-14 22-11 23-22 24-11"
)
_COCO = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow "
    "right_elbow left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle "
    "right_ankle"
)
_COCO_LIMBS = "0-1 0-2 1-3 2-4 0-5 0-6 5-6 5-7 6-8 7-9 8-10 5-11 6-12 11-12 11-13 12-14 13-15 14-16"
_H36M = (
    "mid_hip left_hip left_knee left_ankle right_hip right_knee right_ankle spine neck head "
    "head_top left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist"
)
_H36M_LIMBS = "0-1 1-2 2-3 0-4 4-5 5-6 0-7 7-8 8-9 9-10 8-11 11-12 12-13 8-14 14-15 15-16"
_PANOPTIC = (
    "neck nose mid_hip left_shoulder left_elbow left_wrist left_hip left_knee left_ankle "
    "right_shoulder right_elbow right_wrist right_hip right_knee right_ankle left_eye left_ear "
    "right_eye right_ear"
)

# The specification's list ends at the ankles; eyes and ears are connected as in body25.
_PANOPTIC_LIMBS = (
    "0-1 0-2 0-3 3-4 4-5 0-9 9-10 10-11 2-6 2-12 6-7 7-8 12-13 13-14 1-15 15-16 1-17 17-18"
)
_MEDIAPIPE = (
    "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer "
    "left_ear right_ear left_mouth right_mouth left_shoulder right_shoulder left_elbow "
    "right_elbow left_wrist right_wrist left_pinky right_pinky left_index right_index left_thumb "
    "right_thumb left_hip right_hip left_knee right_knee left_ankle right_ankle left_heel "
    "right_heel left_big_toe right_big_toe"
)
_MEDIAPIPE_LIMBS = (
    "0-1 1-2 2-3 3-7 0-4 4-5 5-6 6-8 9-10 11-12 11-13 13-15 15-17 15-19 15-21 17-19 12-14 14-16 "
    "16-18 16-20 16-22 18-20 11-23 12-24 23-24 23-25 24-26 25-27 26-28 27-29 28-30 29-31 30-32 "
    "27-31 28-32"
)
_FINGERS = ("thumb", "index", "middle", "ring", "pinky")

# First keypoint, name, number of keypoints, and whether their outline is closed.
_FACE = (
    (0, "face_contour", 17, False),
    (17, "right_brow", 5, False),
    (22, "left_brow", 5, False),
    (27, "nose_bridge", 4, False),
    (31, "nose_base", 5, False),
    (36, "right_eyelid", 6, True),
    (42, "left_eyelid", 6, True),
    (48, "outer_lip", 12, True),
    (60, "inner_lip", 8, True),
)
_CONTOUR, _FACE_68, _FACE_70 = 17, 68, 70
_WORDS = {
    "body25": (_BODY25, _BODY25_LIMBS, 25),
    "body15": (_BODY25, _BODY25_LIMBS, 15),
    "body19": (_BODY25, _BODY25_LIMBS, 19),
    "panoptic": (_PANOPTIC, _PANOPTIC_LIMBS, 19),
    "coco": (_COCO, _COCO_LIMBS, 17),
    "h36m": (_H36M, _H36M_LIMBS, 17),
    "mediapipe": (_MEDIAPIPE, _MEDIAPIPE_LIMBS, 33),
}
_JOINTS = {"smpl": 24, "smplh": 52, "smplx": 55}

# Combined layouts of body, hands and face; the 468 points of a face mesh have no names.
_SETS = {
    "hand": ("hand",),
    "hands": ("left_hand", "right_hand"),
    "bodyhand": ("body25", "left_hand", "right_hand"),
    "bodyhandface": ("body25", "left_hand", "right_hand", "face51"),
    "total": ("body25", "left_hand", "right_hand", "face70"),
    "face": ("face70",),
    "face51": ("face51",),
    "mediapipe_face": ("face468",),
    "body25_hands_face": ("body25", "left_hand", "right_hand", "face468"),
    "mediapipe_total": ("mediapipe", "left_hand", "right_hand", "face468"),
}
TITLES: dict[int, tuple[str, ...]] = {
    25: ("body25",),
    15: ("body15",),
    19: ("body19", "panoptic"),
    17: ("coco", "h36m"),
    21: ("hand",),
    42: ("hands",),
    67: ("bodyhand",),
    118: ("bodyhandface",),
    137: ("total",),
    24: ("smpl",),
    52: ("smplh",),
    55: ("smplx",),
    33: ("mediapipe",),
    51: ("face51",),
    70: ("face",),
    468: ("mediapipe_face",),
    535: ("body25_hands_face",),
    543: ("mediapipe_total",),
}
"""Layouts by number of keypoints; the first of each number is the default."""

# Keypoints that SMPLify-X and EasyMocap fit to a joint with a different name.
_SAME = {"mid_hip": "pelvis"}
_ALIKE = (
    "neck left_shoulder left_elbow left_wrist left_hip left_knee left_ankle right_shoulder "
    "right_elbow right_wrist right_hip right_knee right_ankle"
)


def keypoint_layout(count: int, title: str = "") -> PointLayout:
    """Return the layout of a set of keypoints; ``title`` decides if several have this count."""
    known = TITLES.get(count, ())
    if title and title not in known:
        sizes = {name: size for size, names in TITLES.items() for name in names}
        if title not in sizes:
            raise RigError(f"keypoints: expected one of {', '.join(sizes)}, found {title}")
        raise RigError(f"{title}: expected {sizes[title]} keypoints, found {count}")
    if not known:
        return _layout("points", [f"point{index}" for index in range(count)], ())
    return _named(title or known[0])


def _named(title: str) -> PointLayout:
    if title in _WORDS:
        names, limbs, count = _WORDS[title]
        pairs = [(a, b) for a, b in _pairs(limbs) if max(a, b) < count]
        return _layout(title, names.split()[:count], pairs)
    if title in _JOINTS:
        member = FAMILY[_JOINTS[title]]
        joints = ((j, parent) for j, parent in enumerate(member.parents) if parent >= 0)
        return _layout(title, member.names, tuple(joints))
    return joined_layout(title, [_part(name) for name in _SETS[title]])


def _part(name: str) -> PointLayout:
    if name.startswith("face"):
        return _face(int(name.removeprefix("face")))
    if name.endswith("hand"):
        return _hand(name.removesuffix("hand"))
    return _named(name)


def joined_layout(title: str, parts: Sequence[PointLayout]) -> PointLayout:
    """Return one layout of several; a hand is attached to the wrist of the body before it."""
    names: list[str] = []
    limbs: list[tuple[int, int]] = []
    for part in parts:
        start = len(names)
        moved = [start + index for index in range(len(part.names))]
        first = part.names[0] if part.names else ""
        wrist = first.replace("hand_wrist", "wrist")
        # The wrist of a hand is the same point as that of the body before it.
        if first.endswith("_hand_wrist") and wrist in names:
            moved[0] = names.index(wrist)
        limbs += [(moved[a], moved[b]) for a, b in part.limbs.tolist()]
        names += part.names
    return _layout(title, names, limbs)


def _hand(side: str) -> PointLayout:
    """Return 21 keypoints: the wrist, then four per finger, the thumb first."""
    names = [f"{side}hand_wrist" if side else "wrist"]
    limbs = []
    for finger, label in enumerate(_FINGERS):
        first = 4 * finger + 1
        names += [f"{side}{label}{number}" for number in (1, 2, 3)] + [f"{side}{label}_tip"]
        limbs += [(0, first), *((first + i, first + i + 1) for i in range(3))]
    return _layout("hand", names, limbs)


def _face(count: int) -> PointLayout:
    """Return the 70 keypoints of a face, the 51 inside its contour, or an unnamed mesh."""
    if count not in (_FACE_70, _FACE_68 - _CONTOUR):
        return _layout("face", [f"face{index}" for index in range(count)], ())
    names, limbs = [], []
    for first, label, size, is_closed in _FACE:
        names += [f"{label}{number}" for number in range(1, size + 1)]
        limbs += [(first + i, first + i + 1) for i in range(size - 1)]
        limbs += [(first + size - 1, first)] * is_closed
    names += ["right_pupil", "left_pupil"]
    start = 0 if count == _FACE_70 else _CONTOUR
    kept = [(a - start, b - start) for a, b in limbs if min(a, b) >= start]
    return _layout("face", names[start : start + count], kept)


def _layout(title: str, names: Iterable[str], limbs: Iterable[tuple[int, int]]) -> PointLayout:
    names = tuple(names)
    sides = [name.startswith("left_") - name.startswith("right_") for name in names]
    return PointLayout(
        title,
        names,
        np.array(list(limbs), dtype=np.int32).reshape(-1, 2),
        np.array(sides, dtype=np.int32),
    )


def _pairs(text: str) -> Pairs:
    words = (word.split("-") for word in text.split())
    return tuple((int(first), int(second)) for first, second in words)


def matching_joints(layout: PointLayout) -> dict[int, str]:
    """Return the keypoints that correspond to a joint of the SMPL family, as in SMPLify-X.

    These are limbs, fingers, the neck, and the middle of the hips as the pelvis. Eyes, ears, toes
    and heels lie on the skin, where there is no joint.
    """
    if layout.title in _JOINTS:
        return dict(enumerate(layout.names))
    fingers = {name for name in FAMILY[52].names if name[-1] in "123" and "spine" not in name}
    same = {name: name for name in (*_ALIKE.split(), *fingers)} | _SAME
    return {index: same[name] for index, name in enumerate(layout.names) if name in same}


def fitted_body(points: Actor, actors: Sequence[Actor]) -> Actor | None:
    """Return the body of the person to whom captured keypoints belong; None if untracked."""
    for actor in actors:
        same = actor.person == points.person and is_tracked(actor.person)
        if same and actor.own_pose is not None and actor.figure.mesh is not None:
            return actor
    return None


def keypoint_distances(points: Actor, body: Actor) -> dict[str, float]:
    """Return each visible keypoint's distance in scene units to its joint, regressed and posed."""
    layout, skeleton = points.figure.points, body.figure.skeleton
    if layout is None or points.points is None or skeleton is None or body.own_pose is None:
        return {}
    if not (points.is_present and body.is_present):
        return {}
    joints = apply_transform(body.placement, joint_matrices(body.figure, body.own_pose)[:, :3, 3])
    places = apply_transform(points.placement, points.points[:, :3])
    found = {}
    for index, name in matching_joints(layout).items():
        if name in skeleton.names and points.points[index, 3] > 0.0:
            step = places[index] - joints[skeleton.names.index(name)]
            found[layout.names[index]] = float(np.linalg.norm(step))
    return found
