"""A pose as an animation of one frame: joint positions, motion, and up axis."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import RigError
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.geometry.transform import rotation_transform
from viewer.rig.mesh import Mesh
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.evaluation import world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.single_frame import single_frame, upright_single_frame
from viewer.rig.scene import Actor, Scene
from viewer.rig.skeleton import Skeleton, ball_skeleton

PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
ATOL = 1e-12  # lengths of 1 to 10: rounding


def arm() -> Figure:
    """Return a root, an elbow at x = 1 and a hand at x = 2, all ball joints."""
    names = ("root", "elbow", "hand")
    skeleton = ball_skeleton(names, np.array([-1, 0, 1]), PLACES)
    return Figure("arm", skeleton=skeleton)


def places(animation):
    return world_frames(animation.figure, animation.frames)[0, :, :3, 3]


def set_dof(actor, name, kind, value):
    skeleton = actor.figure.skeleton
    joint = skeleton.names.index(name)
    (row,) = np.flatnonzero((skeleton.dof_joints == joint) & (skeleton.dof_kinds == kind))
    actor.pose.dofs[row] = value


def test_joint_positions_are_those_of_the_pose():
    actor = Actor(arm())
    set_dof(actor, "elbow", 5, np.pi / 2)  # a rotation about z that moves the hand above the elbow
    actor.pose.translations[0] = [0.0, 0.0, 3.0]
    actor.pose.figure_translation[:] = [10.0, 0.0, 0.0]
    actor.pose.figure_scale = 2.0
    animation = single_frame(actor, rate=25.0, number=7, time=0.28)
    # The figure is scaled by 2, then moved by 10.
    assert_allclose(places(animation), [[10, 0, 6], [12, 0, 6], [12, 2, 6]], atol=ATOL)
    assert (animation.name, animation.frame_rate, animation.first_frame) == ("arm", 25.0, 7)
    assert_array_equal(animation.frames.times, [0.28])
    assert animation.frames.present.tolist() == [True]


def test_motion_contains_the_same_frame():
    actor = Actor(arm())
    set_dof(actor, "elbow", 5, 0.5)
    animation = single_frame(actor, number=3, time=0.1)
    assert isinstance(animation.motion, SampledClip)
    assert (animation.motion.start, animation.motion.end, animation.motion.timing.first_frame) == (
        0.1,
        0.1,
        3,
    )
    assert_array_equal(animation.motion.rotations, animation.frames.rotations)


def course_rig() -> Figure:
    """Return a root that translates and rotates, with y limited to 1.6 to 3 radians."""
    limits = np.tile([-np.inf, np.inf], (6, 1))
    limits[4] = 1.6, 3.0
    skeleton = Skeleton(
        names=("root",),
        parents=np.array([-1], dtype=np.int32),
        rest_translations=np.zeros((1, 3)),
        rest_rotations=np.array([[0.0, 0.0, 0.0, 1.0]]),
        rest_scales=np.ones((1, 3)),
        dof_joints=np.zeros(6, dtype=np.int32),
        dof_kinds=np.arange(6, dtype=np.int32),
        rest_dofs=np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0]),
        dof_limits=limits,
    )
    return Figure("rig", skeleton=skeleton)


def test_keyed_rigs_get_raw_pose_values_as_keys():
    # Only these angles are within the limits; the equivalent angles nearest to zero are not.
    actor = Actor(course_rig())
    actor.pose.dofs[:] = [5.0, 0.0, 0.0, 0.25, 2.5, 0.0]
    animation = single_frame(actor, time=1.5)
    assert isinstance(animation.motion, Clip)
    assert (animation.motion.start, animation.motion.end) == (1.5, 1.5)
    keys = [(c.target, c.times.tolist(), c.values.tolist()) for c in animation.motion.channels]
    assert keys == [
        (row, [1.5], [value]) for row, value in enumerate([5.0, 0.0, 0.0, 0.25, 2.5, 0.0])
    ]
    turn = axis_rotations(1, np.array(2.5)) @ axis_rotations(0, np.array(0.25))
    found = world_frames(animation.figure, animation.frames)[0, 0]
    assert_allclose(found[:3, :3], turn, atol=ATOL)
    assert_allclose(found[:3, 3], [5, 0, 0], atol=ATOL)


def test_absent_people_are_missing():
    actor = Actor(arm(), is_present=False)
    assert single_frame(actor).frames.present.tolist() == [False]


def test_joint_scales_are_retained():
    actor = Actor(arm())
    actor.pose.scales[0] = [3.0, 1.0, 1.0]
    assert_allclose(places(single_frame(actor)), [[0, 0, 0], [3, 0, 0], [6, 0, 0]], atol=ATOL)
    assert_array_equal(actor.figure.skeleton.rest_scales, np.ones((3, 3)))


def test_shape_weights_missing_in_the_pose_are_zero():
    mesh = Mesh(np.eye(3), np.eye(3), np.array([[0, 1, 2]]))
    shapes = BlendShapes(("a", "b"), np.zeros((2, 3, 3)))
    actor = Actor(replace(arm(), mesh=mesh, blend_shapes=shapes))
    actor.pose.shape_weights = np.array([0.5])
    assert_array_equal(single_frame(actor).frames.shape_weights, [[0.5, 0.0]])


def test_figures_without_joints_are_refused():
    with pytest.raises(RigError, match=r"^figure stone has no joints to pose$"):
        single_frame(Actor(Figure("stone", mesh=Mesh(np.eye(3), np.eye(3), np.array([[0, 1, 2]])))))


def test_upside_down_figure_is_rotated_upright_unless_the_world_is_kept():
    actor = Actor(arm(), placement=rotation_transform(0, np.pi))
    set_dof(actor, "elbow", 5, np.pi / 2)
    actor.pose.figure_translation[:] = [0.0, 4.0, 0.5]
    scene = Scene([actor], world_up="y")
    animation, up = upright_single_frame(scene, actor)
    # A rotation by 180 degrees about x maps y to -y and z to -z.
    assert up == "y" and animation.figure is actor.figure
    assert_allclose(places(animation), [[0, -4, -0.5], [1, -4, -0.5], [1, -5, -0.5]], atol=ATOL)
    kept, up = upright_single_frame(scene, actor, keeps_world=True)
    assert up == "-y"
    assert_allclose(places(kept), [[0, 4, 0.5], [1, 4, 0.5], [1, 5, 0.5]], atol=ATOL)
