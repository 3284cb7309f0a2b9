"""Joint maps: chosen matches, and how each joint was matched."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig.retargeting.two_people import BODY, HIK, figure_of, moving

from viewer.errors import RigError
from viewer.rig.humanoid import Humanoid
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.retargeting.drive import Drive
from viewer.rig.retargeting.driven_clip import driven_clip, full_map, matches_of
from viewer.rig.retargeting.joint_map import JointMap
from viewer.rig.retargeting.retarget import retarget

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
    clip, _ = retarget(motion, snake, joint_map)
    worlds = world_frames(snake, frames_of(snake, clip, np.arange(5) / 30.0))[:, :, :3, :3]
    np.testing.assert_allclose(worlds[:, 2], worlds[:, 1], atol=1e-12)
    clip, _ = retarget(motion, snake, JointMap((*joint_map.pairs[:2], ("tip", ""))))
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
