"""Scene locations of findings for posed figures, and their facing directions."""

import numpy as np
import pytest
from lint.sound import column, keypoints, scene_of

from viewer.diagnostics import Diagnostic
from viewer.lint import Finding, places_of, points_of
from viewer.rig.geometry.rotation import rotation_vector_to_matrix


def about(**places: list[int]) -> Finding:
    return Finding(
        Diagnostic("W001.some: text"),
        actor=0,
        **{name: np.array(at) for name, at in places.items()},
    )


def test_locations_of_all_kinds_are_combined() -> None:
    places = places_of(about(vertices=[5, 0], triangles=[0], joints=[1]), scene_of(column()))
    assert places.vertices.tolist() == [[-1, 1, 1], [1, 0, 1]]
    assert places.triangles.tolist() == [[[1, 0, 1], [1, 1, 1], [-1, 0, 1]]]
    assert places.joints.tolist() == [[0, 2, 0]]


def test_locations_follow_pose_and_placement() -> None:
    scene = scene_of(column())
    actor = scene.actors[0]
    actor.pose.dofs[0] = 3.0  # the root, along x
    actor.placement[:3, 3] = 0.0, 10.0, 0.0
    places = places_of(about(vertices=[5], joints=[1]), scene)
    assert places.vertices.tolist() == [[2, 11, 1]] and places.joints.tolist() == [[3, 12, 0]]
    # The mesh in bind pose ignores the pose.
    bound = places_of(about(vertices=[5]), scene, binding=True)
    assert bound.vertices.tolist() == [[-1, 11, 1]]


@pytest.mark.parametrize("scale", [1.0, 0.01, 250.0])
def test_facing_direction_is_the_mean_normal_in_the_scene(scale: float) -> None:
    scene = scene_of(column())
    turn = rotation_vector_to_matrix(np.array([0.0, np.pi / 2, 0.0]))  # z becomes x
    scene.actors[0].placement[:3, :3] = scale * turn
    # Vertices 4 and 5 of the second ring are at the edges of the side z = 1, with normals of about
    # (1, 0, 1) / sqrt(2) and (-1, 0, 1) / sqrt(2); the x of their mean is 0.
    normals = scene.actors[0].figure.mesh.normals[[4, 5]]
    expected = turn @ normals.mean(axis=0)
    facing = places_of(about(vertices=[4, 5]), scene).facing
    np.testing.assert_allclose(facing, expected, atol=1e-12)
    assert facing[0] > 0.5


def test_surrounding_locations_have_no_facing_direction() -> None:
    facing = places_of(about(vertices=[4, 5, 6, 7]), scene_of(column())).facing
    assert np.linalg.norm(facing) < 0.35
    assert not places_of(about(joints=[1]), scene_of(column())).facing.any()


def test_undetected_captured_points_have_no_location() -> None:
    figure, clip = keypoints()
    scene = scene_of(figure, clip)
    scene.actors[0].points = clip.points[0].copy()
    scene.actors[0].points[2, 3] = 0.0
    assert places_of(about(joints=[1, 2]), scene).joints.tolist() == [[0, 0.5, 0]]
    # There is still a position for the camera target.
    assert points_of(about(joints=[2]), scene).tolist() == [[0, 1, 0], [0, 0.5, 0]]


def test_missing_actors_have_no_location() -> None:
    nowhere = Finding(Diagnostic("W001.some: text"), actor=3, vertices=np.array([0]))
    assert points_of(nowhere, scene_of(column())).shape == (0, 3)
    assert len(places_of(nowhere, scene_of(column())).vertices) == 0
