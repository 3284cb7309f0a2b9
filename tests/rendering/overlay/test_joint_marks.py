"""Joint overlays: bones, axes, dots, and picking them at a pixel."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import skeleton

from viewer.rendering.camera import Camera
from viewer.rendering.overlay.joint_marks import (
    HIGHLIGHT,
    axis_segments,
    bone_segments,
    joint_at,
    joint_dots,
    joint_marks_of,
)
from viewer.rendering.view import view_of
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor

SIZE = (800, 800)  # a unit is 200 pixels; marks are scaled by 600 / 720, so 8 pixels are 6.7
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])


@pytest.fixture
def view():
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    return view_of(camera, SIZE, BOX)


def chain() -> Actor:
    """Return joints at (0, 0, 0), (1, 0, 0) and (1, 1, 0), and a leaf at the last position."""
    offsets = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]
    return Actor(Figure("chain", skeleton=skeleton([-1, 0, 1, 2], offsets)))


def test_marks_follow_pose_and_placement():
    actor = chain()
    actor.pose.dofs[2] = np.pi / 2  # the root rotates about z
    actor.pose.figure_translation[:] = 0.0, 0.0, 5.0
    actor.pose.figure_scale = 2.0
    actor.placement[0, 3] = 10.0
    (marks,) = joint_marks_of([actor])
    # (1, 1, 0) is rotated to (-1, 1, 0), scaled by two, and moved by both translations.
    assert_allclose(marks.points[2], [10.0 - 2.0, 2.0, 5.0], atol=1e-12)


def test_hidden_actors_have_no_marks():
    first, second, third = chain(), chain(), chain()
    first.visible, second.is_present = False, False
    assert [marks.actor for marks in joint_marks_of([first, second, third])] == [2]


def test_bones_connect_parents_and_children_over_dark_borders():
    (marks,) = joint_marks_of([chain()])
    bones = bone_segments(marks, 1, 2.0)
    assert_allclose(bones.starts[3:], [[0, 0, 0], [1, 0, 0], [1, 1, 0]], atol=1e-12)
    assert_allclose(bones.ends[3:], [[1, 0, 0], [1, 1, 0], [1, 1, 0]], atol=1e-12)
    assert_allclose(bones.starts[:3], bones.starts[3:])
    assert_allclose(bones.widths, [10.0] * 3 + [6.0] * 3)
    assert_allclose(bones.colors[4], HIGHLIGHT)  # the bone that the selected joint rotates
    assert (bones.colors[3] != bones.colors[4]).any()


def test_selected_joint_has_a_larger_dot():
    (marks,) = joint_marks_of([chain()])
    plain, chosen = joint_dots(marks, -1, 1.0), joint_dots(marks, 1, 1.0)
    assert len(plain) == 2 and len(chosen) == 4
    assert_allclose(chosen[-1].starts, [[1, 0, 0]], atol=1e-12)
    assert chosen[-1].widths[0] > chosen[1].widths[0]


def test_axes_follow_the_joint_and_are_shorter_than_the_bone():
    actor = chain()
    actor.pose.dofs[2] = np.pi / 2
    (marks,) = joint_marks_of([actor])
    axes = axis_segments(marks, 1.0)
    ways = (axes.ends - axes.starts).reshape(4, 3, 3)
    # The size of the skeleton is sqrt(2); a twentieth of it is less than 0.4 of a bone.
    length = 0.05 * np.sqrt(2.0)
    assert_allclose(ways[0], length * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), atol=1e-12)
    colors = axes.colors.reshape(4, 3, 4)[0, :, :3]
    assert colors.argmax(axis=1).tolist() == [0, 1, 2]  # red, green, blue


def test_axes_of_joints_close_together_are_short():
    near = skeleton([-1, 0, 1], [[0, 0, 0], [10, 0, 0], [0, 0.5, 0]])
    (marks,) = joint_marks_of([Actor(Figure("near", skeleton=near))])
    axes = axis_segments(marks, 1.0)
    lengths = np.linalg.norm(axes.ends - axes.starts, axis=1)[::3]
    size = np.linalg.norm([10.0, 0.5])
    assert_allclose(lengths, [0.05 * size, 0.2, 0.2], atol=1e-12)


def test_single_joint_has_axes():
    (marks,) = joint_marks_of([Actor(Figure("one", skeleton=skeleton([-1], [[0, 0, 0]])))])
    axes = axis_segments(marks, 1.0)
    assert_allclose(np.linalg.norm(axes.ends - axes.starts, axis=1), 0.05)
    assert len(bone_segments(marks, 0, 1.0).widths) == 0


def at(view, x, y, with_bones=True, actors=None):
    """Return the actor and joint at a point of the plane z = 0."""
    marks = joint_marks_of([chain()] if actors is None else actors)
    found = joint_at(marks, view, SIZE, (400 + 200 * x, 400 - 200 * y), with_bones)
    return None if found is None else found[:2]


def test_joint_is_found_by_its_dot(view):
    assert at(view, 0.0, 0.0) == (0, 0) and at(view, 1.0, 0.0) == (0, 1)
    assert at(view, 1.0, 0.03, with_bones=False) == (0, 1)
    assert at(view, 1.0, 0.05, with_bones=False) is None  # ten pixels away from the dot


def test_bone_belongs_to_the_joint_that_rotates_it(view):
    assert at(view, 0.5, 0.0) == (0, 0) and at(view, 1.0, 0.5) == (0, 1)
    assert at(view, 0.5, 0.0, with_bones=False) is None
    assert at(view, 0.5, 0.1) is None and at(view, -1.0, -1.0) is None


def test_dot_takes_precedence_over_bones(view):
    # On the bone of joint 1, five pixels below the dot of joint 2.
    assert at(view, 1.0, 0.975) == (0, 2)


def test_nearer_of_two_coincident_actors_is_picked(view):
    far, near = chain(), chain()
    near.placement[2, 3] = 0.5
    assert at(view, 1.0, 0.0, actors=[far, near]) == (1, 1)
    assert at(view, 1.0, 0.0, actors=[near, far]) == (0, 1)
    # The returned point is the position of the joint.
    found = joint_at(joint_marks_of([near]), view, SIZE, (600.0, 400.0), True)
    assert_allclose(found[2], [1.0, 0.0, 0.5], atol=1e-12)


def test_empty_scene_has_no_joint(view):
    assert at(view, 0.0, 0.0, actors=[]) is None
