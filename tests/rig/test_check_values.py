"""The check values of section 10 of the specification, on the real files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.rig.kinematics import world_matrices
from viewer.rig.mesh import bounding_box
from viewer.rig.pose import rest_pose

PRINTED = 6e-7  # the values are printed with six decimals


def load(shared, name):
    return viewer.load(shared / f"{name}.skel", shared / f"{name}.skin").actors[0].figure


def test_robot_knee_has_the_check_values(shared):
    robot = viewer.load(shared / "test.skel").actors[0].figure.skeleton
    pose = rest_pose(robot)
    assert robot.names[5] == "knee_r"
    assert pose.dofs[-3:].tolist() == [-2, 0, 0]
    knee = world_matrices(robot, pose)[5]
    assert_allclose(knee[:3, 3], [0.0995, -0.6, -0.009983], atol=PRINTED)
    assert_allclose(knee[0, :3], [0.995004, -0.090778, -0.041545], atol=PRINTED)


def test_wasp_with_all_dofs_zero_has_the_check_values(shared):
    wasp = load(shared, "wasp")
    pose = rest_pose(wasp.skeleton)
    pose.dofs[:] = 0.0
    box = bounding_box(viewer.deform(wasp, pose)[0])
    low, high = [-0.35046, -2.05614, -0.84758], [0.35046, 0.54019, 2.2216]
    assert_allclose(box, [low, high], atol=PRINTED)


def test_wasp_in_its_file_pose_has_the_check_values(shared):
    wasp = load(shared, "wasp")
    positions, _ = viewer.deform(wasp, rest_pose(wasp.skeleton))
    low, high = [-1.149258, -0.962391, -0.84758], [1.149702, 0.611065, 2.006119]
    assert_allclose(bounding_box(positions), [low, high], atol=PRINTED)
    assert_allclose(positions[693], [-0.194991, 0.027316, -0.187903], atol=PRINTED)


def test_tube_in_its_file_pose_has_the_check_values(shared):
    tube = load(shared, "tube")
    positions, normals = viewer.deform(tube, rest_pose(tube.skeleton))
    assert_allclose(positions[0], [0.474766, -0.186004, 0], atol=PRINTED)
    assert_allclose(normals[0], [0.540302, 0.841471, 0], atol=PRINTED)
    low, high = [-0.141612, -0.354298, -0.1], [0.474766, 0.5, 0.1]
    assert_allclose(bounding_box(positions), [low, high], atol=PRINTED)


@pytest.mark.parametrize(("name", "move"), [("wasp", [0, -0.95, 0.15]), ("tube", [0, 0.5, 0])])
def test_all_skinning_matrices_are_the_same_translation_at_zero_dofs(shared, name, move):
    figure = load(shared, name)
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 0.0
    palette = world_matrices(figure.skeleton, pose) @ figure.skin.inverse_bind
    expected = np.eye(4)
    expected[:3, 3] = move
    # Spread given in the specification.
    assert_allclose(palette, np.tile(expected, (len(palette), 1, 1)), atol=1e-5)


@pytest.mark.parametrize("name", ["wasp", "tube", "test"])
def test_real_files_load_without_a_warning(shared, name):
    files = [shared / f"{name}{suffix}" for suffix in (".skel", ".skin")]
    assert viewer.load(*(file for file in files if file.exists())).warnings == ()
