"""Captures: views of cameras, errors of fits, layouts of keypoints, and sampled points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.captures.cameras import (
    CameraMotion,
    CameraView,
    motion_times,
    placed_view,
    view_at,
)
from viewer.rigs.captures.keypoint_layouts import (
    TITLES,
    fitted_body,
    joined_layout,
    keypoint_distances,
    keypoint_layout,
    matching_joints,
)
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import axis_rotations
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.motion.sampled_animation import sample_upright_points
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import ball_skeleton

ROTATIONS = axis_rotations(1, np.array([0.0, np.pi / 2]))
CENTERS = np.array([[0.0, 1.0, 0.0], [2.0, 1.0, 0.0]])


def moving(rows: list[int]) -> CameraView:
    translations = -np.einsum("nab,nb->na", ROTATIONS, CENTERS)
    motion = CameraMotion(Timing(10.0, rows), ROTATIONS, translations)
    return CameraView("video", np.eye(3), ROTATIONS[0], translations[0], motion=motion)


def test_fixed_camera_is_the_same_at_all_times():
    view = CameraView("1", np.eye(3), np.eye(3), np.zeros(3))
    assert view_at(view, 5.0) is view


@pytest.mark.parametrize(("seconds", "row"), [(0.0, 0), (0.1, 1), (-3.0, 0), (9.0, 1)])
def test_moving_camera_has_the_placement_of_its_frame(seconds, row):
    view = view_at(moving([0, 1]), seconds)
    assert_allclose(view.rotation, ROTATIONS[row], atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, CENTERS[row], atol=1e-12)


@pytest.mark.parametrize(("rows", "seconds"), [([0, 1], 0.05), ([0, -1, 1], 0.1)])
def test_halfway_between_frames_rotation_and_centre_are_interpolated(rows, seconds):
    view = view_at(moving(rows), seconds)
    assert_allclose(view.rotation, axis_rotations(1, np.array(np.pi / 4)), atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, [1.0, 1.0, 0.0], atol=1e-12)
    assert view.motion is None


def test_camera_placed_with_its_scene_shows_the_same_pixels():
    placement = np.eye(4)
    placement[:3, :3] = axis_rotations(0, np.array(np.pi)) @ axis_rotations(2, np.array(0.3))
    placement[:3, 3] = 4.0, -1.0, 2.5
    point = np.array([0.4, 0.2, 7.0])
    before = moving([0, -1, 1])
    after = placed_view(before, placement)
    for seconds in (0.0, 0.1, 0.17):
        old, new = view_at(before, seconds), view_at(after, seconds)
        moved = placement[:3, :3] @ point + placement[:3, 3]
        seen = new.rotation @ moved + new.translation
        assert_allclose(seen, old.rotation @ point + old.translation, atol=1e-12)
    assert_allclose(after.rotation, view_at(after, 0.0).rotation)


def test_camera_scaled_with_its_scene_shows_the_same_pixels():
    placement = np.diag([0.01, 0.01, 0.01, 1.0])
    placement[:3, :3] = placement[:3, :3] @ axis_rotations(1, np.array(0.4))
    placement[:3, 3] = 4.0, -1.0, 2.5
    point, before = np.array([40.0, 20.0, 700.0]), moving([0, -1, 1])
    after = placed_view(before, placement)
    for seconds in (0.0, 0.1, 0.17):
        old, new = view_at(before, seconds), view_at(after, seconds)
        seen = new.rotation @ (placement[:3, :3] @ point + placement[:3, 3]) + new.translation
        # Only the depths of all points change, by the same factor.
        assert_allclose(seen, 0.01 * (old.rotation @ point + old.translation), atol=1e-12)
        assert_allclose(new.rotation @ new.rotation.T, np.eye(3), atol=1e-12)


def test_clipping_planes_are_scaled_with_the_scene():
    view = CameraView("1", np.eye(3), np.eye(3), np.zeros(3), near=5.0, far=2000.0)
    after = placed_view(view, np.diag([0.01, 0.01, 0.01, 1.0]))
    assert (after.near, after.far) == pytest.approx((0.05, 20.0))
    endless = placed_view(replace(view, near=None, far=None), np.eye(4))
    assert (endless.near, endless.far) == (None, None)


def test_motion_times_skip_gaps_and_include_both_ends():
    assert_allclose(motion_times(moving([-1, 0, -1, 1]), 5), [0.1, 0.3])
    rotations = np.tile(np.eye(3), (11, 1, 1))
    motion = CameraMotion(Timing(10.0, np.arange(11)), rotations, np.zeros((11, 3)))
    view = CameraView("video", np.eye(3), np.eye(3), np.zeros(3), motion=motion)
    assert_allclose(motion_times(view, 3), [0.0, 0.5, 1.0])
    assert_allclose(motion_times(CameraView("1", np.eye(3), np.eye(3), np.zeros(3)), 3), [0.0])


def pointed(person):
    """Return keypoints of body25 at (1, 2, 3), of which only right elbow and nose are detected."""
    layout = keypoint_layout(25)
    points = np.zeros((25, 4))
    points[:, :3] = 1.0, 2.0, 3.0
    for name in ("right_elbow", "nose"):
        points[layout.names.index(name), 3] = 0.5
    return Actor(Figure("points", points=layout), person=person, points=points)


def body(person):
    bones = ball_skeleton(
        ("pelvis", "right_elbow"), np.array([-1, 0]), np.array([[0.0] * 3, [1, 2, 0]])
    )
    return Actor(Figure("body", mesh(np.eye(3)), bones), person=person)


def test_body_of_the_same_person_is_matched():
    bodies = [body(2), body(3)]
    assert fitted_body(pointed(3), bodies) is bodies[1]
    assert fitted_body(pointed(4), bodies) is None


@pytest.mark.parametrize("person", [None, -1, -2])
def test_untracked_keypoints_match_no_body(person):
    assert fitted_body(pointed(person), [body(person)]) is None


def test_skeleton_without_a_mesh_is_not_a_body():
    assert (
        fitted_body(pointed(1), [Actor(Figure("bones", skeleton=skeleton((-1,))), person=1)])
        is None
    )


def test_distances_cover_only_detected_keypoints():
    seen, fitted = pointed(1), body(1)
    # The elbow is at (1, 2, -1), at distance 4 from the point.
    fitted.placement[:3, 3] = 0.0, 0.0, -1.0
    found = keypoint_distances(seen, fitted)
    assert list(found) == ["right_elbow"]
    assert_allclose(found["right_elbow"], 4.0, atol=1e-12)
    fitted.is_present = False
    assert keypoint_distances(seen, fitted) == {}


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


LAYOUT = PointLayout("two", ("a", "b"), np.array([[0, 1]]), np.array([-1, 1]))
POINTS = np.array(
    [
        [[1, 2, 3, 0.5], [0, 0, 0, 0]],
        [[3, 2, 3, 1.0], [4, 5, 6, 0.25]],
    ]
)
NAN = np.nan


def scene_of(up="z", rows=(0, -1, 1), placement=None):
    clip = PointClip("take", Timing(10.0, np.array(rows), first_frame=7, holds=False), POINTS)
    actor = Actor(Figure("two", points=LAYOUT), clip=clip, person=4)
    actor.placement = np.eye(4) if placement is None else placement
    return Scene([actor], world_up=up), actor


def test_frames_are_returned_as_captured():
    animation, up = sample_upright_points(*scene_of())
    assert (animation.name, animation.layout, animation.frame_rate, up) == (
        "two 4",
        LAYOUT,
        10.0,
        "z",
    )
    assert (animation.first_frame, animation.times.tolist()) == (7, [0.0, 0.1, 0.2])
    assert animation.present.tolist() == [True, False, True]
    assert animation.confidences.tolist() == [[0.5, 0.0], [0.0, 0.0], [1.0, 0.25]]
    expected = [[[1, 2, 3], [NAN] * 3], [[NAN] * 3] * 2, [[3, 2, 3], [4, 5, 6]]]
    assert_array_equal(animation.points, expected)


def test_range_is_cut_and_gaps_are_interpolated():
    animation, _ = sample_upright_points(*scene_of(), frames=(1, 3), interpolate=True)
    assert (animation.first_frame, animation.present.tolist()) == (8, [True, True])
    # Point b is detected in only one of the adjacent frames.
    assert_array_equal(animation.points[0], [[2, 2, 3], [NAN] * 3])


def test_frames_at_another_rate_are_numbered_from_zero():
    animation, _ = sample_upright_points(*scene_of(rows=(0, 1)), rate=20.0)
    assert (animation.first_frame, animation.frame_rate) == (0, 20.0)
    assert animation.points[:, 0, 0].tolist() == [1.0, 2.0, 3.0]


def test_upside_down_world_is_rotated_upright():
    animation, up = sample_upright_points(*scene_of("y", placement=rotation_transform(0, np.pi)))
    assert up == "y"
    assert_array_equal(animation.points[2], [[3, -2, -3], [4, -5, -6]])


def test_rotation_between_up_axes_is_left_out():
    quarter = rotation_transform(0, -np.pi / 2)  # z in the capture is y in the scene
    animation, up = sample_upright_points(*scene_of("y", placement=quarter))
    assert up == "z"
    assert_array_equal(animation.points[2], POINTS[1, :, :3])


def test_ranges_outside_the_capture_and_actors_without_points_are_refused():
    scene, actor = scene_of()
    with pytest.raises(RigError, match=r"^frames: expected a range within 0 to 3, found 5 to 9$"):
        sample_upright_points(scene, actor, frames=(5, 9))
    actor.clip = None
    with pytest.raises(RigError, match=r"^two 4 has no motion of points$"):
        sample_upright_points(scene, actor)
