"""Mirrored poses of symmetric figures: left and right are exchanged, vertex by vertex."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, skeleton, turn_x, turn_y, turn_z
from rigs.retargeting.two_people import BODY, figure_of

from viewer.errors import RigError
from viewer.rigs.figure import Figure
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import joint_rotations, rest_pose
from viewer.rigs.retargeting.mirror import (
    asymmetry,
    joint_partners,
    mirror_axis,
    mirror_pose,
    posing_partners,
)
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import deform

NAMES = (
    "hips",
    "chest",
    "l_arm",
    "r_arm",
    "l_elbow",
    "r_elbow",
    "l_hand",
    "r_hand",
    "l_leg",
    "r_leg",
)
PARENTS = np.array([-1, 0, 1, 1, 2, 3, 4, 5, 0, 0])
PARTNERS = [0, 1, 3, 2, 5, 4, 7, 6, 9, 8]
LEFT, RIGHT = [2, 4, 6, 8], [3, 5, 7, 9]
# Coordinates are across, up and to the front; mirroring negates the first one.
PLACES = np.zeros((10, 3))
PLACES[1] = 0.0, 1.0, 0.1
PLACES[LEFT] = [[0.3, 1.2, 0.1], [0.8, 1.1, 0.0], [1.3, 1.1, 0.3], [0.2, -0.2, 0.0]]
PLACES[RIGHT] = PLACES[LEFT] * [-1, 1, 1]


def symmetric_figure(axis=0, up="y", with_map=True) -> Figure:
    """Return a point cloud with a mirror counterpart, bound symmetrically, for every vertex."""
    rng = np.random.default_rng(0)
    left = rng.normal(size=(20, 3))
    points = np.vstack([left, left * [-1, 1, 1], rng.normal(size=(4, 3)) * [0, 1, 1]])
    symmetry = np.array([*range(20, 40), *range(20), *range(40, 44)])
    influences = [[(int(j), float(w)) for j, w in rows] for rows in _rows(rng, 20)]
    mirrored = [[(PARTNERS[j], w) for j, w in pairs] for pairs in influences]
    middle = [[(0, 0.5), (1, 0.5)], [(0, 1.0)], [(2, 0.5), (3, 0.5)], [(6, 0.3), (7, 0.3)]]
    order = [0, 1, 2] if axis == 0 else [2, 0, 1]  # the axes across, up and to the front
    joints = PLACES[:, order]
    bind = np.array([matrix(None, -place) for place in joints])
    return Figure(
        "twin",
        mesh(points[:, order]),
        ball_skeleton(NAMES, PARENTS, joints),
        skin_from_lists([*influences, *mirrored, *middle], bind),
        up=up,
        symmetry=symmetry if with_map else None,
    )


def _rows(rng, count):
    joints, weights = rng.integers(0, 10, (count, 3)), rng.uniform(0.1, 0.5, (count, 3))
    return [zip(*row, strict=True) for row in zip(joints, weights, strict=True)]


def random_pose(figure, seed=1, reach=2.0):
    pose = rest_pose(figure.skeleton)
    rng = np.random.default_rng(seed)
    pose.dofs[:] = rng.uniform(-reach, reach, len(pose.dofs))
    pose.figure_translation[:] = rng.normal(size=3)
    return pose


def flipped(points, axis=0):
    flip = np.ones(3)
    flip[axis] = -1.0
    return points * flip


def check_mirror(figure, pose, axis=0):
    positions = deform(figure, pose)[0]
    found = deform(figure, mirror_pose(figure, pose))[0]
    assert_allclose(found[figure.symmetry], flipped(positions, axis), atol=1e-12)


def test_mirror_counterparts_are_left_and_right_joints():
    assert joint_partners(symmetric_figure()).tolist() == PARTNERS
    assert joint_partners(symmetric_figure(1, "z")).tolist() == PARTNERS


def test_bent_left_elbow_becomes_a_bent_right_elbow():
    figure = symmetric_figure()
    pose = rest_pose(figure.skeleton)
    pose.dofs[3 * 4 : 3 * 4 + 3] = 0.3, 0.5, -0.7
    mirrored = mirror_pose(figure, pose)
    expected = np.zeros(30)
    # Mirroring across x preserves rotations about x and reverses those about y and z.
    expected[3 * 5 : 3 * 5 + 3] = 0.3, -0.5, 0.7
    assert_allclose(mirrored.dofs, expected, atol=1e-15)
    assert pose.dofs[12] == 0.3  # unchanged


@pytest.mark.parametrize(("axis", "up"), [(0, "y"), (1, "z")])
@pytest.mark.parametrize("seed", range(3))
def test_vertices_of_the_mirrored_pose_are_the_mirrored_vertices(axis, up, seed):
    figure = symmetric_figure(axis, up)
    check_mirror(figure, random_pose(figure, seed), axis)


@pytest.mark.parametrize("seed", range(3))
def test_mirroring_twice_restores_the_pose(seed):
    figure = symmetric_figure()
    pose = random_pose(figure, seed)
    again = mirror_pose(figure, mirror_pose(figure, pose))
    bones = figure.skeleton
    assert_allclose(joint_rotations(bones, again), joint_rotations(bones, pose), atol=1e-13)
    assert_allclose(again.figure_translation, pose.figure_translation, atol=0)


def test_mirrored_rest_pose_is_the_rest_pose():
    figure = symmetric_figure()
    pose = rest_pose(figure.skeleton)
    assert mirror_pose(figure, pose).dofs.tolist() == pose.dofs.tolist()


def turned_figure(uneven=True) -> Figure:
    """Return the same figure with rotated joint frames, differently on the two sides."""
    figure = symmetric_figure()
    rng = np.random.default_rng(5)
    quaternions = rng.normal(size=(10, 4)) if uneven else np.tile([0, 0, 0, 1.0], (10, 1))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    bare = replace(figure.skeleton, rest_rotations=quaternions)
    turns = joint_rotations(bare, rest_pose(bare))
    worlds = []
    offsets = np.empty((10, 3))
    for joint, parent in enumerate(PARENTS):
        above = worlds[parent] if parent >= 0 else np.eye(4)
        offsets[joint] = np.linalg.solve(above, [*PLACES[joint], 1.0])[:3]
        worlds.append(above @ matrix(turns[joint], offsets[joint]))
    bones = replace(bare, rest_translations=offsets)
    skin = replace(figure.skin, inverse_bind=np.linalg.inv(worlds))
    return replace(figure, skeleton=bones, skin=skin)


@pytest.mark.parametrize("seed", range(3))
def test_rest_rotations_may_differ_between_sides(seed):
    figure = turned_figure()
    check_mirror(figure, random_pose(figure, seed))


def test_scales_are_exchanged_between_sides():
    figure = turned_figure()
    pose = random_pose(figure)
    pose.scales[4] = 2.0
    pose.scales[9] = 0.5
    check_mirror(figure, pose)


@pytest.mark.parametrize("make", [symmetric_figure, turned_figure])
def test_joint_translations_are_exchanged_between_sides(make):
    figure = make()
    pose = random_pose(figure)
    pose.translations[:] = np.random.default_rng(6).normal(size=(10, 3))
    check_mirror(figure, pose)


def moving_figure(figure) -> Figure:
    """Return the figure with translation DOFs at the hips and both hands."""
    bones = figure.skeleton
    moving = np.repeat([0, 6, 7], 3)
    joints, kinds = [*moving, *bones.dof_joints], [*[0, 1, 2] * 3, *bones.dof_kinds]
    wide = replace(
        bones,
        dof_joints=joints,
        dof_kinds=kinds,
        rest_dofs=np.zeros(39),
        dof_limits=np.tile([-np.inf, np.inf], (39, 1)),
    )
    return replace(figure, skeleton=wide)


@pytest.mark.parametrize("make", [symmetric_figure, turned_figure])
def test_translation_dofs_are_exchanged_between_sides(make):
    figure = moving_figure(make())
    check_mirror(figure, random_pose(figure))


def test_root_translation_dof_is_mirrored():
    figure = moving_figure(symmetric_figure())
    pose = rest_pose(figure.skeleton)
    pose.dofs[:6] = 1, 2, 3, 4, 5, 6  # hips, then the left hand
    assert mirror_pose(figure, pose).dofs[:9].tolist() == [-1, 2, 3, 0, 0, 0, -4, 5, 6]


def hinged(low, high) -> Figure:
    """Return two hinges side by side, about x, with limits."""
    places = [[0.0, 0, 0], [1, 1, 0], [-1, 1, 0]]
    bones = skeleton(
        [-1, 0, 0], [(1, "x", low, low, high), (2, "x", low, low, high)], offsets=places
    )
    return Figure("hinges", skeleton=bones)


@pytest.mark.parametrize("limits", [(-2.0, 2.0), (0.25, 2.0), (-2.0, -0.25)])
def test_hinges_with_limits_are_exchanged_between_sides(limits):
    figure = hinged(*limits)
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = np.mean(limits), limits[0]
    found = joint_rotations(figure.skeleton, mirror_pose(figure, pose))
    assert_allclose(found, [np.eye(3), turn_x(limits[0]), turn_x(np.mean(limits))], atol=1e-14)


def test_mirror_axis_without_a_map_follows_the_up_axis():
    figure = symmetric_figure(with_map=False)
    assert mirror_axis(figure) == 0
    assert mirror_axis(replace(figure, up="z")) == 1


def test_mirror_axis_with_a_map_is_the_axis_that_fits_it():
    assert mirror_axis(symmetric_figure(0, "z")) == 0
    assert mirror_axis(symmetric_figure(1, "y")) == 1


def test_asymmetry_is_the_distance_to_the_mirrored_counterpart():
    figure = symmetric_figure()
    assert_allclose(asymmetry(figure), 0.0, atol=1e-15)
    positions = figure.mesh.positions.copy()
    positions[3] += [0.0, 3.0, 4.0]
    found = asymmetry(replace(figure, mesh=replace(figure.mesh, positions=positions)))
    assert_allclose(found[[3, 23]], [5.0, 5.0])
    assert_allclose(np.delete(found, [3, 23]), 0.0, atol=1e-15)


def test_asymmetry_requires_a_symmetry_map():
    with pytest.raises(RigError) as caught:
        asymmetry(symmetric_figure(with_map=False))
    assert str(caught.value) == "figure twin has no symmetry map"


def refused(figure):
    with pytest.raises(RigError) as caught:
        mirror_pose(figure, rest_pose(figure.skeleton))
    return caught.value.diagnostic.key, caught.value.diagnostic.values["joint"]


def test_skeleton_that_is_not_symmetric_is_refused():
    places = PLACES.copy()
    places[5, 1] += 0.2
    bones = ball_skeleton(NAMES, PARENTS, places)
    assert refused(Figure("bent", skeleton=bones)) == ("F004.asymmetric", "l_elbow")
    lone = skeleton([-1, 0], offsets=[[0, 0, 0], [1, 0, 0]], names=["hips", "l_arm"])
    assert refused(Figure("lone", skeleton=lone)) == ("F004.asymmetric", "l_arm")


def test_two_joints_with_one_counterpart_are_refused():
    places = [[0.0, 0, 0], [1, 0, 0], [1.01, 0, 0], [-1, 0, 0]]
    bones = ball_skeleton(("a", "b", "c", "d"), np.array([-1, 0, 0, 0]), np.array(places))
    key, joint = refused(Figure("double", skeleton=bones))
    assert (key, joint) == ("F004.asymmetric", "two joints")


def test_figure_without_skeleton_is_refused():
    with pytest.raises(RigError) as caught:
        joint_partners(Figure("bust", mesh([[0, 0, 0]])))
    assert caught.value.diagnostic.key == "F004.mirror"
    assert caught.value.diagnostic.values == {"figure": "bust"}


def test_mirrored_hip_rotation_is_its_mirror_image():
    figure = symmetric_figure()
    pose = rest_pose(figure.skeleton)
    pose.dofs[:3] = 0.2, 0.4, 0.6
    turn = turn_z(0.6) @ turn_y(0.4) @ turn_x(0.2)
    flip = np.diag([-1.0, 1.0, 1.0])
    found = joint_rotations(figure.skeleton, mirror_pose(figure, pose))[0]
    assert_allclose(found, flip @ turn @ flip, atol=1e-15)


def test_humanoid_bones_pair_the_joints_of_a_figure_with_a_sword():
    table = BODY | {
        "sword": ("left_wrist", (0.6, 0.9, 0.3)),
        "Ear_L": ("head", (0.1, 1.6, 0.0)),
        "Ear_R": ("head", (-0.09, 1.7, 0.0)),
        "knot": ("head", (0.0, 1.7, 0.0)),
    }
    figure = figure_of(table, "hero")
    with pytest.raises(RigError):
        joint_partners(figure)
    # The file states only two bones; the sides of the remaining bones follow from their names.
    names = tuple(table)
    hands = {"leftHand": names.index("left_wrist"), "rightHand": names.index("right_wrist")}
    humanoid = replace(figure.require_skeleton(), humanoid=Humanoid(hands))
    figure = replace(figure, skeleton=humanoid)
    partners = dict(zip(names, posing_partners(figure).tolist(), strict=True))
    assert names[partners["left_elbow"]] == "right_elbow" and names[partners["Ear_L"]] == "Ear_R"
    assert names[partners["knot"]] == "knot" and names[partners["spine1"]] == "spine1"
    assert partners["sword"] == -1
    pose = rest_pose(figure.require_skeleton())
    pose.dofs[:] = np.random.default_rng(3).uniform(-0.5, 0.5, len(pose.dofs))
    mirrored = mirror_pose(figure, pose)
    before, after = (
        dict(zip(names, world_matrices(figure.require_skeleton(), each), strict=True))
        for each in (pose, mirrored)
    )
    flip = np.diag([-1.0, 1.0, 1.0])
    for name, partner in (("left_wrist", "right_wrist"), ("Ear_R", "Ear_L"), ("knot", "knot")):
        expected = flip @ before[partner][:3, :3] @ flip
        np.testing.assert_allclose(after[name][:3, :3], expected, atol=1e-12)
    local = [worlds["left_wrist"][:3, :3].T @ worlds["sword"][:3, :3] for worlds in (before, after)]
    np.testing.assert_allclose(local[1], local[0], atol=1e-12)
