"""Auxiliary joints, which lists, labels and counts replace by their ancestors."""

from dataclasses import replace

import numpy as np
import pytest

from viewer.rig.figure import Figure
from viewer.rig.inspection.single_vertices import vertex_facts
from viewer.rig.mesh import Mesh
from viewer.rig.scalars._inputs import Asked
from viewer.rig.scalars.weights import weight
from viewer.rig.skeleton import (
    ball_skeleton,
    joint_label,
    joint_labels,
    shown_joint_of,
    shown_joints,
    shown_parents,
)
from viewer.rig.skin import idle_joints, skin_from_lists
from viewer.rig.skinning import Skinning


@pytest.fixture
def figure():
    """A hip with an auxiliary child, which is the parent of the knee and moves a vertex."""
    parents = np.array([-1, 0, 1, 1], dtype=np.int32)
    joints = np.array([[0.0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]])
    skeleton = ball_skeleton(("hip", "", "knee", ""), parents, joints)
    skeleton = replace(skeleton, auxiliary=np.array([False, True, False, True]))
    skin = skin_from_lists([[(0, 0.25), (3, 0.5), (1, 0.25)]], np.tile(np.eye(4), (4, 1, 1)))
    mesh = Mesh(np.zeros((1, 3)), np.ones((1, 3)), np.zeros((0, 3), dtype=np.int32))
    return Figure("leg", mesh, skeleton, skin)


def test_lists_omit_auxiliary_joints(figure):
    skeleton = figure.skeleton
    assert shown_joints(skeleton).tolist() == [0, 2]
    assert shown_joint_of(skeleton).tolist() == [0, 0, 2, 0]
    assert shown_parents(skeleton).tolist() == [-1, 0, 0, 0]


def test_labels_of_auxiliary_joints_are_those_of_their_ancestors(figure):
    assert joint_labels(figure.skeleton) == ("hip", "hip", "knee", "hip")
    assert joint_label(figure.skeleton, 3) == "hip"


def test_influences_of_auxiliary_joints_are_those_of_their_ancestors(figure):
    facts = vertex_facts(figure, None, Skinning(), 0)
    assert facts.names == ("hip",)
    assert facts.weights.tolist() == [1.0]
    assert weight(Asked(figure, None, Skinning(), joint=0)).tolist() == [1.0]
    assert idle_joints(figure.skin, figure.skeleton).tolist() == [2]
