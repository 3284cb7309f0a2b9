"""The lowest point of a foot, compared with the mesh, or with the ankle if there is no mesh."""

import numpy as np
import pytest
from lint.sound import legs, scene_of, standing

import viewer
from viewer.loading import bundled_body
from viewer.rig.feet.soles import extent, soles_of
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.pose import rest_pose
from viewer.rig.posing.pose_vector import set_joint_rotations
from viewer.rig.skinning import deform, joint_matrices

HEIGHT = np.array([0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize("turn", [-1.0, -0.5, -0.2, 0.0, 0.3, 0.7])
def test_lowest_point_of_rotated_feet_is_that_of_the_mesh(turn: float) -> None:
    figure = viewer.load(bundled_body()).actors[0].figure
    pose = rest_pose(figure.skeleton)
    ankles = np.array([figure.skeleton.names.index(f"{s}_ankle") for s in ("left", "right")])
    turns = rotation_vector_to_matrix(np.array([[turn, 0.0, 0.0], [turn, 0.0, 0.2]]))
    set_joint_rotations(figure.skeleton, pose, ankles.astype(np.int32), turns)
    positions = deform(figure, pose)[0]
    found = soles_of(figure, True).heights(joint_matrices(figure, pose)[None], HEIGHT, 1.0)[0]
    for height, side in zip(found, (1.0, -1.0), strict=True):
        # The points chosen for sampled tilts are the lowest for all tilts, to within 2 mm.
        assert height == pytest.approx(positions[side * positions[:, 0] > 0.0, 1].min(), abs=2e-3)


def test_ankles_replace_soles_without_a_mesh() -> None:
    figure = legs()
    scene = scene_of(figure, standing(figure))
    soles = soles_of(figure, True)
    world = joint_matrices(figure, scene.actors[0].pose)[None]
    # Both ankles are 0.1 high at rest, which is the lowest height.
    assert soles.heights(world, HEIGHT, 1.0) == pytest.approx(np.full((1, 2), 0.1))
    assert soles.joints.tolist() == [3, 6]
    assert extent(figure) == pytest.approx((0.1, 0.9))


def test_figures_without_ankles_have_no_soles() -> None:
    assert soles_of(viewer.load().actors[0].figure, True) is None
