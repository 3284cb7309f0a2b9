"""Keypoints of a posed figure on joints and triangles, and other annotations of files."""

from dataclasses import replace

import numpy as np
import pytest
from builders import family_figure
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, skeleton

from viewer.errors import RigError
from viewer.rigs.annotations import BodyParts, Keypoints, ReducedMesh, keypoint_positions
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.hands import Hand, hand_coefficients, hand_vectors
from viewer.rigs.keypoints import posed_keypoints, some_vertices
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform, joint_matrices

CORNERS = np.array([[0.0, 0, 0], [4, 0, 0], [0, 8, 0], [0, 0, 16]])


def test_keypoint_on_a_triangle_is_the_weighted_mean_of_its_corners():
    points = Keypoints(("a", "b"), [-1, -1], [[0, 1, 2], [3, 3, 1]], [[0.5, 0.25, 0.25], [0, 1, 0]])
    found = keypoint_positions(points, CORNERS, np.zeros((1, 3)))
    assert found.tolist() == [[1, 2, 0], [0, 0, 16]]


def test_keypoint_at_a_joint_follows_the_joint_and_ignores_corners():
    points = Keypoints(("a", "b"), [1, 0], [[3, 3, 3], [0, 0, 0]], [[1, 0, 0], [0, 0, 0]])
    joints = np.array([[7.0, 8, 9], [1, 2, 3]])
    assert keypoint_positions(points, CORNERS, joints).tolist() == [[1, 2, 3], [7, 8, 9]]


def arm() -> Figure:
    """Return a square bound to two joints, the second at (4, 0, 0)."""
    bones = skeleton([-1, 0], [(0, "tx", 0.0), (1, "z", 0.0)], offsets=[[0] * 3, [4, 0, 0]])
    bind = np.array([np.eye(4), matrix(None, (-4, 0, 0))])
    ties = [[(0, 1.0)], [(0, 1.0)], [(1, 1.0)], [(1, 1.0)]]
    points = [[0.0, 1, 0], [1, 1, 0], [5, 0, 0], [6, 0, 0]]
    keypoints = Keypoints(
        ("hand", "elbow", "between"),
        [-1, 1, -1],
        [[2, 2, 2], [0, 0, 0], [3, 1, 1]],
        [[1, 0, 0], [1, 0, 0], [0.5, 0.25, 0.25]],
    )
    return Figure("arm", mesh(points), bones, skin_from_lists(ties, bind), keypoints=keypoints)


def test_keypoints_follow_the_pose():
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 10.0, np.pi / 2
    # The elbow is at (14, 0, 0); vertices 2 and 3 are one and two above it, vertex 1 at (11, 1, 0).
    expected = [[14, 1, 0], [14, 0, 0], [12.5, 1.5, 0]]
    assert_allclose(posed_keypoints(figure, pose), expected, atol=1e-14)


def test_keypoints_follow_the_placement():
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.figure_scale, pose.figure_translation[:] = 2.0, (0, 0, 1)
    expected = [[10, 0, 1], [8, 0, 1], [7, 1, 1]]
    assert_allclose(posed_keypoints(figure, pose), expected, atol=1e-14)


def test_figure_without_keypoints_is_refused():
    figure = replace(arm(), keypoints=None)
    with pytest.raises(RigError) as caught:
        posed_keypoints(figure, rest_pose(figure.skeleton))
    assert str(caught.value) == "figure arm has no keypoints"


@pytest.mark.parametrize(
    "skinning",
    [Skinning(), Skinning("dqs", max_influences=2), Skinning(correctives=False)],
    ids=["lbs", "dqs", "plain"],
)
def test_keypoints_are_those_of_the_whole_mesh_with_shape_and_correctives(tmp_path, skinning):
    figure = family_figure("smplx", tmp_path)
    rng = np.random.default_rng(0)
    pose = figure_pose(figure)
    pose.dofs[:] = rng.uniform(-1, 1, 165)
    pose.shape_weights[:] = rng.normal(size=20)
    pose.figure_scale, pose.figure_translation[:] = 1.5, rng.normal(size=3)
    points = figure.keypoints
    mixed = replace(points, joints=np.where(np.arange(51) % 3, -1, np.arange(51)))
    figure = replace(figure, keypoints=mixed)
    vertices = deform(figure, pose, skinning)[0]
    joints = joint_matrices(figure, pose)[:, :3, 3]
    for index, found in enumerate(posed_keypoints(figure, pose, skinning)):
        place = mixed.weights[index] @ vertices[mixed.vertices[index]]
        expected = place if index % 3 else joints[index]
        assert_allclose(found, expected, atol=1e-13)


def test_subset_of_vertices_moves_as_in_the_whole_figure(tmp_path):
    figure = family_figure("smpl", tmp_path)
    chosen = np.array([90, 3, 3, 41], dtype=np.int32)
    part = some_vertices(figure, chosen)
    pose = figure_pose(figure)
    pose.dofs[:] = np.random.default_rng(1).uniform(-1, 1, 72)
    assert_allclose(deform(part, pose)[0], deform(figure, pose)[0][chosen], atol=1e-14)


def test_keypoints_read_only_the_required_part_of_the_file(tmp_path):
    figure = family_figure("smplx", tmp_path)
    posed_keypoints(figure, figure_pose(figure))
    assert not figure.blend_shapes.offsets.is_loaded
    assert not figure.correctives.offsets.is_loaded


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BodyParts(("a", "b"), [0, 2]), "body parts: expected 0 to 1, found 0 to 2"),
        (lambda: BodyParts(("a",), [-1]), "body parts: expected 0 to 0, found -1 to -1"),
        (
            lambda: ReducedMesh([5, 7], [[0, 1, 2]]),
            "reduced triangles: expected 0 to 1, found 0 to 2",
        ),
        (
            lambda: Keypoints(("a",), [0, 1], [[0, 0, 0]], [[1, 0, 0]]),
            "joints: expected shape 1, found 2",
        ),
        (
            lambda: Keypoints(("a",), [0], [[0, 0]], [[1, 0, 0]]),
            "vertices: expected shape 1 x 3, found 1 x 2",
        ),
    ],
)
def test_annotations_refuse_mismatched_arrays(make, message):
    with pytest.raises(RigError) as caught:
        make()
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"body_parts": BodyParts(("a",), [0])},
            "the body parts have 1 vertices, but the mesh has 4",
        ),
        (
            {"reduced": ReducedMesh([0, 4], [[0, 1, 1]])},
            "the reduced mesh refers to vertices 0 to 4, but the mesh has 4",
        ),
        (
            {"keypoints": Keypoints(("a",), [-1], [[0, 1, 9]], [[1, 0, 0]])},
            "the list of keypoints refers to vertices 0 to 9, but the mesh has 4",
        ),
        (
            {"symmetry": np.array([0, 1, 2, -3])},
            "the symmetry map refers to vertices -3 to 2, but the mesh has 4",
        ),
    ],
)
def test_figure_refuses_annotations_of_another_mesh(parts, message):
    with pytest.raises(RigError) as caught:
        replace(arm(), **parts)
    assert str(caught.value) == f"figure arm: {message}"


def test_parts_and_reduced_meshes_may_be_empty():
    assert BodyParts((), []).of_vertex.tolist() == []
    assert ReducedMesh([], np.zeros((0, 3), int)).triangles.shape == (0, 3)


COMPONENTS = [[1.0, 0, 0, 0, 2, 0], [0, 3, 0, 0, 0, 0], [0, 0, 0, 1, 0, -1]]
MEAN = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
HAND = Hand("left", [7, 8], COMPONENTS, MEAN)


def test_vectors_are_the_mean_plus_the_weighted_components():
    # 2 (1,0,0, 0,2,0) - 1 (0,3,0, 0,0,0), by hand.
    found = hand_vectors(HAND, np.array([2.0, -1.0]), flat=False)
    assert_allclose(found, [[2.1, -2.8, 0.3], [0.4, 4.5, 0.6]], atol=1e-15)


def test_flat_hand_omits_the_mean():
    assert hand_vectors(HAND, np.array([2.0, -1.0]), flat=True).tolist() == [[2, -3, 0], [0, 4, 0]]


def test_empty_coefficients_return_the_mean_hand():
    assert hand_vectors(HAND, np.zeros(0), flat=False).ravel().tolist() == MEAN
    assert hand_vectors(HAND, np.zeros(0), flat=True).tolist() == [[0, 0, 0]] * 2


def test_more_coefficients_than_components_are_refused():
    with pytest.raises(RigError) as caught:
        hand_vectors(HAND, np.zeros(4), flat=True)
    assert str(caught.value) == "expected at most 3 hand coefficients, found 4"


@pytest.mark.parametrize("flat", [True, False])
def test_coefficients_round_trip(flat):
    rng = np.random.default_rng(0)
    components = rng.normal(size=(20, 45))  # not orthogonal
    hand = Hand("right", np.arange(15), components, rng.normal(size=45))
    for count in (0, 1, 6, 20):
        wanted = rng.normal(size=count)
        vectors = hand_vectors(hand, wanted, flat)
        assert_allclose(hand_coefficients(hand, vectors, flat, count), wanted, atol=1e-12)


def test_coefficients_represent_the_nearest_hand():
    # For (5, 7, 0, 0, 0, 0), the coefficient of component 0, of length sqrt 5, is 5 / 5, and that
    # of component 1 is 7 / 3.
    vectors = np.array([[5.0, 7, 0], [0, 0, 0]])
    assert_allclose(hand_coefficients(HAND, vectors, True, 1), [1.0], atol=1e-14)
    assert_allclose(hand_coefficients(HAND, vectors, True, 2), [1.0, 7 / 3], atol=1e-14)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (([[0.0] * 5], MEAN), "hands_components: expected shape any x 6, found 1 x 5"),
        ((COMPONENTS, MEAN[:5]), "hands_mean: expected shape 6, found 5"),
        (([[np.nan] * 6], MEAN), "hands_components: expected finite numbers, found nan at index 0"),
    ],
)
def test_hand_refuses_inconsistent_parts(parts, message):
    with pytest.raises(RigError) as caught:
        Hand("left", [7, 8], *parts)
    assert str(caught.value).startswith(message)
