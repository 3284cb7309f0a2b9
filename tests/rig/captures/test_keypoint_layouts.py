"""Keypoint layouts: counts, names, sides, limbs, and corresponding joints."""

import numpy as np
import pytest

from viewer.errors import RigError
from viewer.rig.bodies.smpl_family import FAMILY
from viewer.rig.captures.keypoint_layouts import (
    TITLES,
    joined_layout,
    keypoint_layout,
    matching_joints,
)


def limbs(layout):
    """Return the limbs as pairs of keypoint names."""
    return {(layout.names[a], layout.names[b]) for a, b in layout.limbs.tolist()}


@pytest.mark.parametrize(
    ("count", "title", "n_limbs"),
    [
        (25, "body25", 24),
        (15, "body15", 14),
        (19, "body19", 18),
        (17, "coco", 18),
        (21, "hand", 20),
        (42, "hands", 40),
        (67, "bodyhand", 24 + 40),
        (118, "bodyhandface", 24 + 40 + 47),
        (137, "total", 24 + 40 + 47 + 16),
        (24, "smpl", 23),
        (52, "smplh", 51),
        (33, "mediapipe", 35),
        (468, "mediapipe_face", 0),
        (535, "body25_hands_face", 24 + 40),
        (543, "mediapipe_total", 35 + 40),
    ],
)
def test_number_of_keypoints_determines_the_layout(count, title, n_limbs):
    layout = keypoint_layout(count)
    assert (layout.title, len(layout.names), len(layout.limbs)) == (title, count, n_limbs)
    assert len(set(layout.names)) == count


@pytest.mark.parametrize("title", [title for titles in TITLES.values() for title in titles])
def test_sides_match_the_names_and_mirror_each_other(title):
    count = next(count for count, titles in TITLES.items() if title in titles)
    layout = keypoint_layout(count, title)
    for name, side in zip(layout.names, layout.sides.tolist(), strict=True):
        assert side == {"left": 1, "right": -1}.get(name.split("_")[0], 0)
        if side:
            other = name.replace("left_", "right_") if side > 0 else name.replace("right_", "left_")
            assert other in layout.names

    # Limbs are the same on both sides.
    def mirrored(pair):
        table = {"left": "right_", "right": "left_"}
        return frozenset(
            table[side] + rest if side in table else name
            for name in pair
            for side, _, rest in [name.partition("_")]
        )

    found = {frozenset(pair) for pair in limbs(layout)}
    # Polylines of the face start on one side, so they are not symmetric.
    if not title.startswith("face") and count not in (118, 137):
        assert {mirrored(pair) for pair in limbs(layout)} == found


def test_body25_matches_openpose():
    layout = keypoint_layout(25)
    places = {0: "nose", 1: "neck", 4: "right_wrist", 7: "left_wrist", 8: "mid_hip", 9: "right_hip",
              14: "left_ankle", 15: "right_eye", 18: "left_ear", 19: "left_big_toe",
              21: "left_heel", 24: "right_heel"}  # fmt: skip
    assert {index: layout.names[index] for index in places} == places
    assert layout.limbs[0].tolist() == [8, 1]  # the torso is drawn first
    assert ("right_heel", "right_ankle") in limbs(layout)


def test_seventeen_keypoints_are_coco_by_default():
    assert keypoint_layout(17).names[5] == "left_shoulder"
    h36m = keypoint_layout(17, "h36m")
    assert h36m.names[1:4] == ("left_hip", "left_knee", "left_ankle")
    assert ("head", "head_top") in limbs(h36m)
    # EasyMocap's table has 5-12 instead of 6-12 by mistake.
    assert ("right_shoulder", "right_hip") in limbs(keypoint_layout(17))


def test_nineteen_keypoints_may_be_panoptic():
    assert keypoint_layout(19).names == keypoint_layout(25).names[:19]
    assert keypoint_layout(19, "panoptic").names[:3] == ("neck", "nose", "mid_hip")


def test_fingers_attach_to_the_wrists_of_the_body():
    layout = keypoint_layout(67)
    assert (layout.names[25], layout.names[46]) == ("left_hand_wrist", "right_hand_wrist")
    assert ("left_wrist", "left_thumb1") in limbs(layout)
    assert ("right_wrist", "right_pinky1") in limbs(layout)
    assert not any("hand_wrist" in name for pair in limbs(layout) for name in pair)
    assert ("left_ring3", "left_ring_tip") in limbs(layout)


def test_face_without_contour_omits_only_the_contour():
    whole, part = keypoint_layout(70), keypoint_layout(51)
    assert part.names == whole.names[17:68]
    kept = whole.limbs[(whole.limbs >= 17).all(axis=1)] - 17
    np.testing.assert_array_equal(part.limbs, kept)
    assert ("right_eyelid6", "right_eyelid1") in limbs(part)  # closed
    assert whole.names[68:] == ("right_pupil", "left_pupil")


def test_unknown_counts_have_no_limbs():
    layout = keypoint_layout(7)
    assert (layout.title, layout.names[6], len(layout.limbs)) == ("points", "point6", 0)


@pytest.mark.parametrize(
    ("title", "message"),
    [
        ("h36m", "h36m: expected 17 keypoints, found 25"),
        ("dog", "keypoints: expected one of body25, body15, body19, panoptic, coco, h36m, "),
    ],
)
def test_layouts_of_another_size_or_unknown_name_are_refused(title, message):
    with pytest.raises(RigError) as caught:
        keypoint_layout(25, title)
    assert str(caught.value).startswith(message)


def test_equivalent_joints_are_matched():
    matches = matching_joints(keypoint_layout(25))
    assert matches == {
        1: "neck", 2: "right_shoulder", 3: "right_elbow", 4: "right_wrist", 5: "left_shoulder",
        6: "left_elbow", 7: "left_wrist", 8: "pelvis", 9: "right_hip", 10: "right_knee",
        11: "right_ankle", 12: "left_hip", 13: "left_knee", 14: "left_ankle",
    }  # fmt: skip


def test_finger_joints_match_by_number_in_spite_of_a_different_order():
    matches = matching_joints(keypoint_layout(67))
    # In keypoints, ring precedes pinky; the second point of the wrist and the tips are not joints.
    assert (matches[25 + 1], matches[25 + 13], matches[25 + 17]) == (
        "left_thumb1", "left_ring1", "left_pinky1",
    )  # fmt: skip
    assert 25 not in matches and 25 + 4 not in matches
    assert set(matches.values()) <= set(FAMILY[52].names)
    assert len(matches) == 14 + 30


def test_joint_layouts_of_the_smpl_family_match_themselves():
    for count in (24, 52, 55):
        assert matching_joints(keypoint_layout(count)) == dict(enumerate(FAMILY[count].names))


def test_joint_layouts_keep_their_order_when_joined():
    hands = keypoint_layout(42)
    layout = joined_layout("both", [keypoint_layout(7), hands])
    assert layout.names[7:] == hands.names
    np.testing.assert_array_equal(layout.limbs, hands.limbs + 7)
