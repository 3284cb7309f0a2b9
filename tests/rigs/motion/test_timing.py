"""Times of motions: their timing, the chosen animation, and a single frame."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import animated_leg, animation, bow, channel, clip_of, wave

from viewer.errors import FormatError, RigError
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import axis_rotations
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.animation_choice import (
    animation_labels,
    chosen_animation,
    counterpart,
    play_animation,
)
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.evaluation import world_frames
from viewer.rigs.motion.sampled_animation import single_frame, upright_single_frame
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import Animation
from viewer.rigs.scene import Actor, Scene, pose_actors
from viewer.rigs.skeleton import Skeleton, ball_skeleton

# Four frames per second from 1 s on: 1.0, 1.25, (1.5 and 1.75 missing), 2.0, 2.25
GAP = Timing(4.0, np.array([0, 1, -1, -1, 2, 3]), first_frame=7, start=1.0)


def located(timing, time, interpolate=False):
    before, after, fraction = timing.locate(np.array([time]), interpolate)
    return int(before[0]), int(after[0]), float(fraction[0])


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.0, (0, 1, 0.0)),
        (1.125, (0, 1, 0.5)),
        (1.25, (1, 1, 0.0)),  # the next frame is missing, so this one is held until its time
        (1.4, (1, 1, 0.0)),
        (1.5, (-1, -1, 0.0)),
        (1.99, (-1, -1, 0.0)),
        (2.0, (2, 3, 0.0)),
        (2.25, (3, 3, 0.0)),
        (9.0, (3, 3, 0.0)),
        (-9.0, (0, 1, 0.0)),
    ],
)
def test_times_are_mapped_to_rows(time, expected):
    assert located(GAP, time) == pytest.approx(expected, abs=1e-9)


def test_figure_is_absent_outside_the_range_unless_ends_are_held():
    timing = Timing(4.0, GAP.rows, start=1.0, holds=False)
    assert located(timing, 0.99)[0] == located(timing, 2.26)[0] == -1
    assert located(timing, 1.0)[0] == 0 and located(timing, 2.25)[0] == 3


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.25, (1, 2, 0.0)),
        (1.5, (1, 2, 1 / 3)),
        (1.625, (1, 2, 0.5)),
        (2.0, (2, 3, 0.0)),
        (5.0, (3, 3, 0.0)),
        (0.0, (0, 1, 0.0)),
    ],
)
def test_gaps_are_interpolated_if_requested(time, expected):
    assert located(GAP, time, interpolate=True) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("rate", [30.0, 29.97, 120.00004577636719, 23.976])
def test_time_of_every_frame_maps_to_its_row(rate):
    timing = Timing(rate, np.arange(5000))
    frames = np.arange(5000)
    before, _, fraction = timing.locate(frames / rate)
    assert (before == frames).all() and not fraction.any()


def test_times_of_frames_include_gaps():
    assert (GAP.n_frames, GAP.end, GAP.time(4)) == (6, 2.25, 2.0)
    assert GAP.present.tolist() == [True, True, False, False, True, True]


def test_empty_timing_is_absent_at_all_times():
    for rows in ([], [-1, -1]):
        assert located(Timing(30.0, np.array(rows, dtype=int)), 0.0) == (-1, -1, 0.0)


@pytest.mark.parametrize("rate", [0.0, -30.0, 1e-320, 1.5e6, float("nan"), float("inf")])
def test_invalid_rates_are_refused(rate):
    with pytest.raises(RigError, match="frame rate: expected 1e-06 to 1,000,000 "):
        Timing(rate, np.arange(3))


def test_fraction_between_frames_is_linear():
    shares = GAP.locate(np.linspace(1.0, 1.249, 7))[2]
    assert_allclose(shares, np.linspace(0.0, 0.996, 7), atol=1e-12)


def test_animation_is_chosen_by_name_number_or_none():
    figure = animated_leg(wave(), bow(), replace(bow(), name="2"))
    one, two, three = figure.animations
    for text, wanted in {
        "": one, "wave": one, "WAVE": one, "Bow": two, "1": one, "2": three, "3": three,
        "none": None, "None": None,
    }.items():  # fmt: skip
        assert chosen_animation([figure], text) is wanted, text
    assert chosen_animation([], "") is None


@pytest.mark.parametrize("text", ["wavy", "0", "4", "-1"])
def test_unknown_name_is_refused_with_the_nearest_names(text):
    figure = animated_leg(wave(), bow())
    with pytest.raises(RigError) as refused:
        chosen_animation([figure], text)
    found = refused.value.diagnostic
    assert found.key == "F004.animation" and found.values["name"] == text
    assert ("wave" in found.values["hint"]) and (
        ("bow" in found.values["hint"]) == (text != "wavy")
    )


def test_labels_distinguish_equal_and_empty_names():
    figure = animated_leg(wave(), replace(bow(), name=""), wave())
    assert animation_labels(figure) == ("wave", "animation 2", "wave (2)")
    assert chosen_animation([figure], "Wave (2)") is figure.animations[2]
    assert chosen_animation([figure], "animation 2") is figure.animations[1]


def test_figures_of_a_file_play_the_same_animation():
    short = clip_of(channel(0, "scale", [0.0, 1.0], np.ones((2, 3))), name="wave")
    hero, hat = animated_leg(wave(), bow(), short), animated_leg(short)
    # The second figure has only the shorter of the two waves, and no bow.
    assert [counterpart(hat, one) for one in hero.animations] == [0, -1, 0]
    assert [counterpart(hero, one) for one in hat.animations] == [2]
    # Numbers refer to the animations of the figure that has the most.
    assert chosen_animation([hat, hero], "2") is hero.animations[1]


def test_values_not_animated_by_the_next_animation_are_reset_to_the_file():
    figure = animated_leg(wave(), bow())
    actor = Actor(figure)
    play_animation(actor, 0)
    actor.pose.figure_translation[:] = 1.0, 2.0, 3.0
    pose_actors([actor], 2.0)
    assert actor.pose.shape_weights[0] == 1.0 and actor.pose.scales[1, 1] == 2.5
    play_animation(actor, 1)
    pose_actors([actor], 0.0)
    assert_array_equal(actor.pose.scales, figure.skeleton.rest_scales)
    assert_array_equal(actor.pose.translations, np.zeros((3, 3)))
    assert_array_equal(actor.pose.dofs, figure_pose(figure).dofs)
    assert_array_equal(actor.pose.shape_weights, [0.0, 0.0])
    assert_array_equal(actor.pose.figure_translation, [1.0, 2.0, 3.0])
    play_animation(actor, -1)
    assert actor.clip is None and actor.animation == -1


def test_invalid_keys_leave_the_actor_unchanged(tmp_path):
    from viewer.diagnostics import Diagnostic

    def refuse():
        raise FormatError(Diagnostic("F002.misfit: {message}", tmp_path, values={"message": "bad"}))

    figure = replace(animated_leg(), animations=(animation(wave()), Animation("bad", 0, 1, refuse)))
    actor = Actor(figure)
    play_animation(actor, 0)
    clip = actor.clip
    with pytest.raises(FormatError):
        play_animation(actor, 1)
    assert actor.clip is clip and actor.animation == 0


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
