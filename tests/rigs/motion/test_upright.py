"""Actors in the world of their file, as exported: the up axis, and upside-down actors."""

from dataclasses import replace

import numpy as np
import pytest
from builders import family_figure
from numpy.testing import assert_allclose
from rigs.hand_made import skeleton as course_skeleton

import viewer
from viewer.loading import bundled_body
from viewer.rigs.captures.keypoint_layouts import keypoint_layout
from viewer.rigs.captures.points import PointClip
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.motion.body_motion import BodyMotion, body_clip
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.evaluation import pose_of
from viewer.rigs.motion.sampled_animation import upright_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.upright import guess_up, own_up, upright_actor, upright_placement
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import deform

OVER = np.array([1.0, -1.0, -1.0])


def standing(up, placement=None, world_up=None, **parts):
    figure = Figure("a", skeleton=ball_skeleton(("a",), np.array([-1]), np.zeros((1, 3))), up=up)
    actor = Actor(replace(figure, **parts))
    if placement is not None:
        actor.placement = placement
    return Scene([actor], world_up=world_up), actor


@pytest.mark.parametrize(
    ("figure", "world", "quarters", "expected"),
    [
        ("y", "y", 0, ("y", False)),
        ("z", "z", 0, ("z", False)),
        ("y", "z", 0, ("z", False)),  # a body in a capture whose world has z up
        ("y", "z", 1, ("y", False)),  # placed upright in the scene: (x, y, z) -> (x, -z, y)
        ("z", "y", -1, ("z", False)),
        ("y", "y", 2, ("y", True)),
        ("y", "z", 2, ("z", True)),
        ("y", "z", -1, ("y", True)),
    ],
)
def test_up_axis_is_that_before_the_placement(figure, world, quarters, expected):
    scene, actor = standing(figure, rotation_transform(0, quarters * np.pi / 2), world)
    assert own_up(scene, actor) == expected


def test_lying_along_x_uses_the_scene_up_axis():
    scene, actor = standing("y", rotation_transform(2, -np.pi / 2), "z")
    actor.placement = rotation_transform(1, np.pi / 2)
    assert own_up(scene, actor) == ("z", False)


def test_upright_actor_is_returned_unchanged():
    scene, actor = standing("z", rotation_transform(0, -np.pi / 2), "y")
    assert upright_actor(scene, actor) is actor


def test_figure_has_the_up_axis_of_the_capture():
    scene, actor = standing("y", None, "z")
    found = upright_actor(scene, actor)
    assert (found.figure.up, actor.figure.up) == ("z", "y")
    assert found.pose is actor.pose and found.figure.skeleton is actor.figure.skeleton


def test_upside_down_body_is_rotated_upright_with_shape_and_placement():
    (actor,) = viewer.load(bundled_body()).actors
    rng = np.random.default_rng(5)
    actor.pose.dofs[:] = rng.uniform(-1, 1, len(actor.pose.dofs))
    actor.pose.shape_weights[:2] = 2.0, -1.0
    actor.pose.translations[0] = 0.1, 0.2, 0.3
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 1.5, [1, 2, 3]
    before = actor.pose.copy()
    actor.placement = rotation_transform(0, np.pi)
    found = upright_actor(Scene([actor], world_up="y"), actor)
    wanted = deform(actor.figure, actor.pose)[0] * OVER
    assert_allclose(deform(found.figure, found.pose)[0], wanted, rtol=0, atol=1e-12)
    for name in ("dofs", "translations", "rotations", "figure_translation"):
        assert np.array_equal(getattr(actor.pose, name), getattr(before, name))
    assert found.figure is actor.figure


def test_every_root_is_rotated_upright():
    figure = Figure(
        "two",
        skeleton=ball_skeleton(("a", "b"), np.array([-1, -1]), np.array([[1, 2, 3], [4, 5, 6.0]])),
    )
    actor = Actor(figure, placement=rotation_transform(0, np.pi))
    actor.pose.dofs[:] = 0.3, -0.2, 0.5, 0.1, 0.2, 0.3
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 2.0, [7, 8, 9]

    found = upright_actor(Scene([actor]), actor)
    wanted = np.diag([*OVER, 1.0]) @ viewer.joint_matrices(figure, actor.pose)
    assert_allclose(viewer.joint_matrices(figure, found.pose), wanted, rtol=0, atol=1e-13)


def test_limits_and_missing_axes_do_not_prevent_rotation():
    dofs = [(0, "tx", 0.5, 0, 1), (0, "x", 0.2, -0.1, 0.3), (0, "z", 0.1), (1, "y", 0.3)]
    skeleton = course_skeleton([-1, 0], dofs, offsets=np.array([[1.0, 2, 3], [0, 1, 0]]))
    actor = Actor(Figure("rig", skeleton=skeleton), placement=rotation_transform(0, np.pi))
    found = upright_actor(Scene([actor]), actor)
    wanted = np.diag([*OVER, 1.0]) @ viewer.joint_matrices(actor.figure, actor.pose)
    assert_allclose(viewer.joint_matrices(actor.figure, found.pose), wanted, rtol=0, atol=1e-12)


def test_upright_pose_equals_the_frame_of_the_upright_motion():
    (actor,) = viewer.load(bundled_body()).actors
    turns = np.tile([0.0, 0, 0, 1.0], (1, 24, 1))
    turns[0, 0] = np.sin(0.4), 0, 0, np.cos(0.4)
    places = np.array([[1.0, 2.0, 3.0]])
    actor.clip = SampledClip("a", Timing(30.0, np.arange(1)), turns, figure_translations=places)
    actor.placement = rotation_transform(0, np.pi)
    scene = Scene([actor], world_up="z")
    animation, up = upright_animation(scene, actor)
    viewer.rigs.scene.pose_actors([actor], 0.0)
    found = upright_actor(scene, actor)
    assert (up, found.figure.up) == ("z", "z")
    framed = pose_of(actor.figure, animation.frames, 0)
    assert_allclose(
        deform(found.figure, found.pose)[0], deform(actor.figure, framed)[0], rtol=0, atol=1e-12
    )


def test_upright_actor_is_placed_at_the_position_of_the_upside_down_one():
    scene, actor = standing("y", rotation_transform(0, np.pi), "y")
    actor.pose.figure_translation[:] = 1.0, 2.0, 3.0
    upright = upright_actor(scene, actor)
    placed = upright_placement(scene, actor)[:3, :3]
    expected = actor.placement[:3, :3] @ actor.pose.figure_translation
    assert_allclose(placed @ upright.pose.figure_translation, expected, atol=1e-12)


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return family_figure("smpl", tmp_path_factory.mktemp("figure"))


def turning_body(figure, turns, rows=None):
    """Return an actor with a pelvis rotation in every frame; the up axis of the model is y."""
    vectors = np.zeros((len(turns), 1, 3))
    vectors[:, 0] = turns
    timing = Timing(30.0, np.arange(len(turns)) if rows is None else rows)
    motion = BodyMotion("a", timing, ("pelvis",), vectors, np.zeros((len(turns), 3)))
    return Actor(figure, clip=body_clip(motion, figure)[0])


def pointed(direction, count=25, confidence=1.0, title=""):
    layout = keypoint_layout(count, title)
    points = np.zeros((2, count, 4))
    points[..., 3] = confidence
    for name in ("nose", "head", "left_ear", "right_ear"):
        if name in layout.names:
            points[:, layout.names.index(name), :3] = direction
    clip = PointClip("a", Timing(30.0, np.arange(2)), points)
    return Actor(Figure("points", points=layout), clip=clip)


@pytest.mark.parametrize(
    ("turn", "up"),
    [
        ((0, 0, 0), "y"),
        ((np.pi / 2, 0, 0), "z"),
        ((np.pi, 0, 0), "-y"),
        ((-np.pi / 2, 0, 0), "-z"),
        ((0, 2.0, 0), "y"),
        ((0.4, 0, 0.4), "y"),
    ],
)
def test_bodies_determine_the_up_axis(figure, turn, up):
    assert guess_up([turning_body(figure, [turn, turn])]) == up


def test_majority_of_present_frames_decides(figure):
    upright, fallen = (np.pi / 2, 0, 0), (np.pi, 0, 0)
    assert guess_up([turning_body(figure, [upright, upright, fallen])]) == "z"
    actor = turning_body(figure, [fallen, upright], rows=np.array([-1, 1, -1]))
    assert guess_up([actor]) == "z"


@pytest.mark.parametrize(("count", "title"), [(25, ""), (17, "coco"), (17, "h36m"), (33, "")])
@pytest.mark.parametrize(("direction", "up"), [((0, 0.1, -2), "-z"), ((0.3, 1, 0), "y")])
def test_keypoints_determine_the_up_axis(count, title, direction, up):
    assert guess_up([pointed(direction, count, title=title)]) == up


def test_undetected_keypoints_are_ignored():
    assert guess_up([pointed((0, 1, 0), confidence=0.0)]) == "z"


def test_up_axis_defaults_to_z(figure):
    lying = turning_body(figure, [(0, 0, np.pi / 2)])
    clip = Clip("a", (), 0.0, 1.0)
    assert guess_up([]) == "z"
    assert guess_up([lying]) == "z"
    assert guess_up([pointed((0, 1, 0), 21)]) == "z"
    assert guess_up([Actor(figure, clip=clip)]) == "z"
