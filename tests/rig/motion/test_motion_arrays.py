"""Motions of captured people as arrays of frames, rotations and joint positions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.synthetic_smpl import joint_parents, model
from formats.video_mocap.plain_smpl import vertices
from formats.video_mocap.tool_files import matrices, scene_of, wham, wham_file
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import RigError
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.scene import Scene


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Scene]:
    path: Path = wham_file(tmp_path_factory.mktemp("wham"))
    return {space: scene_of(path, "smpl", space) for space in ("world", "camera")}


def joints(row: int, pose: str, trans: str) -> Any:
    """Return the joints of the second person by the published equations."""
    found = wham()[4]
    turned = matrices(found[pose][row].reshape(24, 3))
    return vertices("smpl", model("smpl"), found["betas"][row], turned, found[trans][row])[1]


def test_arrays_have_all_frames_and_their_presence(scenes: dict[str, Scene]) -> None:
    motion = viewer.motion(scenes["world"].actors[1])
    assert (motion.name, motion.frame_rate) == ("wham_output 4", 30.0)
    assert motion.frames.tolist() == [*range(8)]
    assert np.flatnonzero(motion.present).tolist() == [3, 4, 6, 7]
    assert motion.joint_names[:2] == ("pelvis", "left_hip")
    assert_array_equal(motion.parents, joint_parents("smpl"))


def test_rotations_and_translations_are_those_of_the_file(scenes: dict[str, Scene]) -> None:
    motion = viewer.motion(scenes["world"].actors[1])
    found = wham()[4]
    for row, frame in enumerate((3, 4, 6, 7)):
        turned = quaternion_to_matrix(motion.rotations[frame])
        assert_allclose(turned, matrices(found["pose_world"][row].reshape(24, 3)), atol=1e-9)
        assert_allclose(motion.translations[frame], found["trans_world"][row], atol=1e-9)
        assert_allclose(motion.shape_weights[frame], found["betas"][row], atol=1e-9)


def test_joints_are_returned_in_the_space_of_the_file_and_upright(scenes: dict[str, Scene]) -> None:
    motion = viewer.motion(scenes["camera"].actors[1])
    wanted = joints(1, "pose", "trans")
    assert_allclose(motion.joints("figure")[4], wanted, atol=1e-6)
    assert_allclose(motion.joints()[4], wanted * [1, -1, -1], atol=1e-6)
    assert np.isnan(motion.joints()[5]).all()


def test_gaps_may_be_interpolated(scenes: dict[str, Scene]) -> None:
    motion = viewer.motion(scenes["world"].actors[1], interpolate=True)
    assert motion.present[5]
    assert_allclose(motion.translations[5], motion.translations[[4, 6]].mean(axis=0), atol=1e-9)


def test_unknown_spaces_are_refused(scenes: dict[str, Scene]) -> None:
    with pytest.raises(RigError, match='no space "camera"'):
        viewer.motion(scenes["world"].actors[0]).joints("camera")
