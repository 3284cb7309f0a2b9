"""Poses of keyed transforms: single poses, frames, and features that use frames."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rig.animated import STACKED, about, animated_leg, channel, clip_of, leg, plain_value, wave

from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.kinematics import world_matrices
from viewer.rig.motion.evaluation import (
    frames_between,
    frames_of,
    pose_actors,
    pose_of,
    scene_rate,
    world_frames,
)
from viewer.rig.motion.motion_paths import motion_path, path_times
from viewer.rig.motion.onion import onion
from viewer.rig.motion.sampled_animation import baked, frame_range, sample_animation
from viewer.rig.motion.single_frame import single_frame
from viewer.rig.pose import joint_rotations, local_matrices
from viewer.rig.scene import Actor, Scene, figure_pose
from viewer.rig.skeleton import Skeleton

EXACT = 1e-13  # a few products of numbers near 1
TIMES = np.array([0.0, 0.5, 0.8, 1.0, 1.7, 2.2, 9.0])


def plain_local(figure: Figure, clip, time: float) -> np.ndarray:
    """Return local matrices T R S from the keys: (J, 4, 4)."""
    skeleton = figure.require_skeleton()
    parts = {
        "translation": skeleton.rest_translations.copy(),
        "rotation": skeleton.rest_rotations.copy(),
        "scale": skeleton.rest_scales.copy(),
    }
    for one in clip.channels:
        if one.path != "weights":
            parts[one.path][one.joint] = plain_value(one, time)
    local = np.tile(np.eye(4), (skeleton.n_joints, 1, 1))
    local[:, :3, :3] = quaternion_to_matrix(parts["rotation"]) * parts["scale"][:, None, :]
    local[:, :3, 3] = parts["translation"]
    return local


@pytest.mark.parametrize("time", TIMES)
def test_pose_has_the_transforms_of_the_keys(time):
    actor = Actor(leg(), clip=wave(), offset=-0.25)
    pose_actors([actor], time - 0.25)
    skeleton = actor.figure.require_skeleton()
    assert_allclose(
        local_matrices(skeleton, actor.pose), plain_local(actor.figure, wave(), time), atol=EXACT
    )
    assert_allclose(actor.pose.shape_weights, plain_value(wave().channels[4], time), atol=EXACT)
    # The DOFs contain the whole rotation, so that sliders show it; the quaternions are the
    # identity.
    assert_array_equal(actor.pose.rotations, skeleton.rest_rotations)


def test_euler_angles_in_gimbal_lock_reproduce_the_exact_rotation():
    lock = [about(1, 90.0), about(1, -90.0), (np.array(about(1, 90.0)) + about(0, 90.0)) / 2]
    clip = clip_of(channel(1, "rotation", [0.0, 1.0, 2.0], lock))
    actor = Actor(leg(), clip=clip)
    for time in (0.0, 1.0, 2.0, 1e-9):
        pose_actors([actor], time)
        found = joint_rotations(actor.figure.skeleton, actor.pose)[1]
        wanted = quaternion_to_matrix(plain_value(clip.channels[0], time))
        assert_allclose(found, wanted, atol=EXACT)


def test_joints_without_channels_keep_their_pose():
    actor = Actor(leg(), clip=clip_of(channel(1, "rotation", [0.0, 1.0], [about(2, 0.0)] * 2)))
    actor.pose.dofs[6:] = 0.3
    actor.pose.translations[2] = 1.0, 2.0, 3.0
    actor.pose.scales[2], actor.pose.shape_weights[1] = 4.0, 0.5
    before = actor.pose.copy()
    pose_actors([actor], 0.5)
    for name in ("translations", "scales", "shape_weights"):
        assert_array_equal(getattr(actor.pose, name), getattr(before, name))
    assert_array_equal(actor.pose.dofs[6:], before.dofs[6:])
    frames = frames_of(actor.figure, actor.clip, TIMES, actor.pose)
    assert_allclose(
        world_frames(actor.figure, frames)[3],
        world_matrices(actor.figure.skeleton, actor.pose),
        atol=EXACT,
    )


def test_translation_dofs_receive_the_offset_within_their_limits():
    skeleton = leg().require_skeleton()
    slides = Skeleton(
        skeleton.names, skeleton.parents, skeleton.rest_translations, skeleton.rest_rotations,
        np.ones((3, 3)), [1, 1, 2], [1, 1, 0], np.zeros(3), [[-1.0, 1], [-9, 9], [-9, 9]],
    )  # fmt: skip
    clip = clip_of(
        channel(1, "translation", [0.0, 1.0], [STACKED[1], [5.0, 7, 0]]),
        channel(2, "translation", [0.0], [[3.0, 1, 0]]),
    )
    actor = Actor(Figure("slides", skeleton=slides), clip=clip)
    pose_actors([actor], 1.0)
    assert_array_equal(actor.pose.dofs, [1.0, 0.0, 3.0])
    assert_array_equal(actor.pose.translations, [[0.0, 0, 0], [5, 5, 0], [0, 0, 0]])
    places = local_matrices(slides, actor.pose)[:, :3, 3]
    assert_array_equal(places, [[0.0, 0, 0], [5, 7, 0], [3, 1, 0]])


def test_frames_equal_the_poses_and_store_repeated_rows_once():
    figure, clip = leg(), wave()
    frames = frames_of(figure, clip, TIMES)
    assert frames.scales.shape == (len(TIMES), 3, 3) and frames.shape_weights.shape[0] == len(TIMES)
    worlds = world_frames(figure, frames)
    for row, time in enumerate(TIMES):
        actor = Actor(figure, clip=clip)
        pose_actors([actor], time)
        again = pose_of(figure, frames, row)
        assert_allclose(worlds[row], world_matrices(figure.skeleton, actor.pose), atol=EXACT)
        assert_allclose(worlds[row], world_matrices(figure.skeleton, again), atol=EXACT)
        assert_allclose(again.shape_weights, actor.pose.shape_weights, atol=EXACT)
    part = frames_between(frames, slice(2, 4))
    assert_allclose(world_frames(figure, part), worlds[2:4], atol=EXACT)
    still = frames_of(figure, clip_of(clip.channels[1]), TIMES)
    assert len(still.scales) == len(still.shape_weights) == 1


def test_actors_of_one_clip_are_posed_together():
    figure, clip = leg(), wave()
    skeleton = figure.require_skeleton()
    hinged = replace(
        skeleton,
        dof_joints=skeleton.dof_joints[:-1],
        dof_kinds=skeleton.dof_kinds[:-1],
        rest_dofs=skeleton.rest_dofs[:-1],
        dof_limits=skeleton.dof_limits[:-1],
    )
    turning = clip_of(
        *clip.channels, channel(2, "rotation", [0.0, 3.0], [about(0, 0), about(1, 80)])
    )
    for one in (figure, replace(figure, skeleton=hinged)):
        together = [Actor(one, clip=turning, offset=0.3 * number) for number in range(4)]
        alone = [actor.copy() for actor in together]
        pose_actors(together, 1.9)
        for actor, other in zip(together, alone, strict=True):
            pose_actors([other], 1.9)
            for name in ("dofs", "translations", "rotations", "scales", "shape_weights"):
                assert_allclose(getattr(actor.pose, name), getattr(other.pose, name), atol=EXACT)


def test_frames_of_an_animation_have_the_rate_of_its_keys():
    figure = animated_leg()
    bow = figure.animations[1].clip()
    actor = Actor(figure, clip=bow)
    assert scene_rate([actor]) == 24.0 and scene_rate([actor, Actor(figure, clip=wave())]) == 30.0
    animation = sample_animation(actor)
    assert animation.frame_rate == 24.0 and animation.first_frame == 0
    assert_allclose(animation.frames.times, np.arange(6) / 24.0, atol=EXACT)
    assert frame_range(bow, 24.0, (0, 99)) == (0, 6)
    assert sample_animation(Actor(figure, clip=wave())).frames.times[0] == 0.5


def test_baked_frames_have_the_same_poses():
    figure, clip = leg(), wave()
    sampled = baked(figure, clip)
    times = clip.start + np.arange(sampled.timing.n_frames) / 30.0
    assert sampled.timing.frame_rate == 30.0 and sampled.timing.n_frames == 61
    assert_allclose(
        world_frames(figure, frames_of(figure, sampled, times)),
        world_frames(figure, frames_of(figure, clip, times)),
        atol=EXACT,
    )
    actor = Actor(figure, clip=sampled)
    pose_actors([actor], 1.5)
    assert_allclose(
        local_matrices(figure.skeleton, actor.pose), plain_local(figure, clip, 1.5), atol=EXACT
    )


def test_single_frames_keep_scales_of_joints():
    actor = Actor(leg(), clip=wave())
    pose_actors([actor], 1.2)
    frame = single_frame(actor)
    assert frame.figure is actor.figure
    found = world_frames(frame.figure, frame.frames)[0]
    assert_allclose(found, world_matrices(actor.figure.skeleton, actor.pose), atol=EXACT)


def test_motion_paths_and_onion_skins_follow_the_clip():
    figure, clip = leg(), wave()
    assert_allclose(path_times(clip)[[0, -1]], [0.5, 2.5])
    path = motion_path(figure, clip, [0, 2], np.array([0.5, 2.0]))
    assert_array_equal(path.points[:, 0], [[0.0, 0, 0], [1, 2, 0]])
    ghosts = onion(Scene([Actor(figure, clip=clip)]), 3).actors
    assert len(ghosts) == 3 and figure_pose(figure).scales[1, 2] == 1.0
    assert_allclose(ghosts[0].pose.scales[1], [1.0, 3.0, -1.0])
