"""Starts from anatomy, for templates that face any way."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from autorig.test_anatomy import with_staff
from numpy.testing import assert_allclose

from viewer.autorig.alignment import posed_alignment
from viewer.autorig.alignment.anatomy_fit import (
    left_of,
    starts_of,
    straightened,
    template_body,
)
from viewer.autorig.alignment.surface_alignment import AlignmentSettings, Posed
from viewer.autorig.anatomy import anatomy_of
from viewer.loading import bundled_body, load
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, joint_rotations, rest_pose, set_joint_rotations
from viewer.rigs.skin import owners, skin_from_entries

# The body's x, y, z, where its left is +x and its front +z, in a template.
ROTATIONS = {
    "y": np.diag([-1.0, 1.0, -1.0]),  # front -z, as in VRM 0
    "z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),  # front -y, as in Blender
}


def rotated(figure, rotation, up):
    offsets = figure.skeleton.rest_translations @ rotation.T
    skeleton = replace(figure.skeleton, rest_translations=offsets)
    pose = rest_pose(skeleton)
    skin = figure.skin
    inverse = np.linalg.inv(world_matrices(skeleton, pose))
    skin = skin_from_entries(skin.n_vertices, owners(skin), skin.joints, skin.weights, inverse)
    mesh = figure.mesh
    turned = Mesh(mesh.positions @ rotation.T, mesh.normals @ rotation.T, mesh.triangles)
    return Figure("turned", turned, skeleton, skin, up=up), pose


@pytest.mark.parametrize("up", ROTATIONS)
def test_template_that_faces_another_way_is_turned_to_the_target(up):
    figure = load(bundled_body()).actors[0].figure
    rotation = ROTATIONS[up]
    template, pose = rotated(figure, rotation, up)
    assert_allclose(left_of(template, pose), rotation[:, 0])
    body = template_body(template, pose, template.mesh.positions)
    target = anatomy_of(figure.mesh.positions, figure.mesh.triangles, np.array([0.0, 1.0, 0.0]))
    best = starts_of(body, target, None)[0]
    assert best.is_sure
    assert_allclose(best.fitted.similarity.rotation, rotation.T, atol=0.1)
    assert best.error < 0.01


def test_plane_of_a_person_with_a_staff_is_decided_by_the_fit():
    figure = load(bundled_body()).actors[0].figure
    pose = rest_pose(figure.skeleton)
    job = SimpleNamespace(template=figure, pose=pose, settings=AlignmentSettings())
    sides = [Posed(*with_staff()), Posed(figure.mesh.positions, figure.mesh.triangles)]
    starts, _ = posed_alignment._starts(job, sides[1], sides[0])
    # Front and back are more alike than left and right, but have no arms.
    assert_allclose(np.abs(starts[0].plan.left), [1.0, 0.0, 0.0], atol=0.1)
    assert starts[0].is_sure and starts[0].is_usual and starts[0].error < 0.03


def turned_chest(figure: Figure) -> tuple[Pose, np.ndarray]:
    """Return a pose that turns the chest by 40 degrees, and the rotations without that turn."""
    pose, names = rest_pose(figure.skeleton), list(figure.skeleton.names)
    straight = joint_rotations(figure.skeleton, pose).copy()
    vectors = {"spine3": [0.3, 0.0, 0.0], "left_elbow": [0.2, 0.5, 0.1], "head": [0.0, 0.3, 0.1]}
    for name, vector in vectors.items():
        straight[names.index(name)] = rotation_vector_to_matrix(np.array(vector))
    turned, chest = straight.copy(), names.index("spine3")
    turned[chest] = rotation_vector_to_matrix(np.array([0.0, 0.7, 0.0])) @ turned[chest]
    set_joint_rotations(figure.skeleton, pose, np.arange(len(names), dtype=np.int32), turned)
    return pose, straight


def test_straightened_pose_keeps_bends_forwards_and_limbs():
    figure = load(bundled_body()).actors[0].figure
    pose, straight = turned_chest(figure)
    # The mean of Y(a) X(b) and its mirror image Y(-a) X(b) is diag(cos a, 1, cos a) X(b), whose
    # nearest rotation is X(b). The head carries no pair, and keeps its rotation.
    found = joint_rotations(figure.skeleton, straightened(figure, pose))
    assert_allclose(found, straight, atol=1e-4)


@pytest.mark.parametrize("is_mirrored", [True, False])
def test_turned_template_begins_straight_on_a_symmetric_target(monkeypatch, is_mirrored):
    figure = load(bundled_body()).actors[0].figure
    pose, straight = turned_chest(figure)
    job = SimpleNamespace(template=figure, pose=pose, settings=AlignmentSettings())
    plain = figure.mesh.positions, figure.mesh.triangles
    target = plain if is_mirrored else with_staff()
    begun = []
    monkeypatch.setattr(posed_alignment, "starts_of", lambda body, *_: begun.append(body) or [])
    posed_alignment._starts(job, Posed(*plain), Posed(*target))
    given = joint_rotations(figure.skeleton, pose)
    found = joint_rotations(figure.skeleton, begun[0].pose)
    assert_allclose(found, straight if is_mirrored else given, atol=1e-4)
