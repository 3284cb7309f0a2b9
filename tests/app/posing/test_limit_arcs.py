"""Limit arcs, which end at the positions of the bone at the limits."""

import numpy as np
import pytest
from app.posing_rigs import arm_figure
from numpy.testing import assert_allclose

from viewer.app.posing.gizmo import arc_points, limit_arcs
from viewer.app.posing.posed_joint import posed_joint
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.geometry.vectors import unit
from viewer.rig.scene import Actor

LIMITS = {(0, "x"): (-0.5, 0.7), (0, "y"): (-1.0, 0.4), (0, "z"): (-0.3, 1.2)}


def limited_arm():
    actor = Actor(arm_figure(limits=LIMITS))
    actor.pose.dofs[:3] = 0.2, -0.4, 0.9
    actor.placement[:3, :3] = rotation_vector_to_matrix(np.array([0.4, 0.2, -0.7]))
    return actor


@pytest.mark.parametrize("dof", [1, 2])
def test_arc_ends_are_at_the_limits_of_the_bone(dof) -> None:
    actor = limited_arm()
    joint = posed_joint(actor, 0)
    arc = next(arc for arc in limit_arcs(joint, actor.pose) if arc.dof == dof)
    ends = arc_points(arc, joint.center, 1.0)[[0, -1]]
    for end, value in zip(ends, actor.figure.skeleton.dof_limits[dof], strict=True):
        pose = actor.pose.copy()
        pose.dofs[dof] = value
        bone = posed_joint(actor, 1, pose).center - joint.center
        # The arc is about the axis, so only the component of the bone perpendicular to it is
        # compared.
        across = unit(bone - (bone @ arc.axis) * arc.axis)
        assert_allclose(end - joint.center, across, atol=1e-9)


def test_twist_is_shown_by_an_axis_that_rotates_with_the_joint() -> None:
    # The bone points along x, so a rotation about x does not move it.
    actor = Actor(arm_figure(limits=LIMITS))
    joint = posed_joint(actor, 0)
    arc = limit_arcs(joint, actor.pose)[0]
    assert arc.dof == 0 and abs(arc.start @ [1, 0, 0]) < 1e-9
    pose = actor.pose.copy()
    pose.dofs[0] = 0.7
    turned = limit_arcs(posed_joint(actor, 0, pose), pose)[0]
    ahead = rotation_vector_to_matrix(0.7 * arc.axis) @ arc.start
    assert_allclose(turned.start, ahead, atol=1e-9)
    assert (turned.high, turned.is_limited) == (pytest.approx(0.0, abs=1e-12), True)


def test_arcs_have_axis_colours_and_span_the_limits() -> None:
    actor = limited_arm()
    found = limit_arcs(posed_joint(actor, 0), actor.pose)
    assert [arc.color for arc in found] == [0, 1, 2]
    assert_allclose([[a.low, a.high] for a in found], [[-0.7, 0.5], [-0.6, 0.8], [-1.2, 0.3]])
    assert not any(arc.is_limited for arc in found)


def test_dof_without_two_limits_has_no_arc() -> None:
    actor = Actor(arm_figure(limits={(0, "x"): (-np.inf, 1.0), (0, "y"): (0.3, 0.3)}))
    assert limit_arcs(posed_joint(actor, 0), actor.pose) == []


def test_range_over_360_degrees_is_drawn_as_a_full_circle() -> None:
    actor = Actor(arm_figure(limits={(0, "z"): (-9.0, 9.0)}))
    arc = limit_arcs(posed_joint(actor, 0), actor.pose)[0]
    points = arc_points(arc, np.zeros(3), 1.0)
    assert_allclose(points[0], points[-1], atol=1e-9)
    assert len(points) < 100


def test_joint_without_children_shows_its_box_or_the_bone_of_its_parent() -> None:
    actor = Actor(arm_figure(limits={(2, "z"): (-1.0, 1.0)}))
    arc = limit_arcs(posed_joint(actor, 2), actor.pose)[0]
    assert_allclose(arc.start @ arc.axis, 0, atol=1e-12)
    assert_allclose(np.linalg.norm(arc.start), 1)
