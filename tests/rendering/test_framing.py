"""Cameras that frame a whole motion, also as a turntable, and the target of following cameras."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm
from rendering.moving import moving_arm

from viewer.errors import RigError
from viewer.rendering.camera import Camera, fit
from viewer.rendering.framing import (
    find_follow,
    fit_turntable,
    follow_candidates,
    frame_motion,
    outermost,
)
from viewer.rendering.recorder import Follow, Recording
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.morph_target import MorphTarget, with_morphs
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene, points_of_scenes, pose_actors, scene_points

ASPECT = 16 / 9
LAYOUT = PointLayout("two", ("left_knee", "nose"), np.zeros((0, 2)), np.array([1, 0]))


def recording_of(*actors, times=(0.0, 0.2, 0.4, 1.0), **changes) -> Recording:
    return Recording(Scene(list(actors)), np.array(times), Camera(), (64, 36), **changes)


def is_seen(camera: Camera, points: np.ndarray) -> bool:
    """Return whether all points are within the image, using only the camera's matrices."""
    box = np.array([points.min(axis=0), points.max(axis=0)])
    matrix = camera.projection_matrix(ASPECT, box) @ camera.view_matrix()
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    return bool((np.abs(clip[:, :2]) <= clip[:, 3:]).all() and (clip[:, 3] > 0).all())


def all_points(seconds) -> np.ndarray:
    actor, clouds = moving_arm(), []
    for time in seconds:
        pose_actors([actor], float(time))
        clouds.append(scene_points(Scene([actor])))
    return np.concatenate(clouds)


def test_box_and_points_cover_all_frames():
    times = np.linspace(0.0, 1.0, 11)
    points, box = frame_motion(recording_of(moving_arm(), times=times[[0, 1, 2, 3, 4, 6, 10]]))
    every = all_points(times[[0, 1, 2, 3, 4, 6, 10]])
    np.testing.assert_allclose(box, [every.min(axis=0), every.max(axis=0)], atol=1e-12)
    camera = Camera()
    fit(camera, points, ASPECT)
    assert is_seen(camera, every)
    exact = Camera()
    fit(exact, every, ASPECT)
    # The outermost points may differ a little.
    assert camera.distance == pytest.approx(exact.distance, rel=0.005)
    np.testing.assert_allclose(camera.target, exact.target, atol=1e-12)


def test_at_most_32_frames_are_sampled(monkeypatch):
    looked = []
    monkeypatch.setattr(
        "viewer.rendering.framing.pose_scene", lambda scene, recording, time: looked.append(time)
    )
    frame_motion(recording_of(moving_arm(), times=np.linspace(0.0, 5.0, 1001)))
    assert len(looked) == 32 and looked[0] == 0.0 and looked[-1] == 5.0


def test_framing_does_not_change_the_scene():
    actor = moving_arm()
    before = actor.pose.copy()
    frame_motion(recording_of(actor))
    assert (actor.pose.figure_translation == before.figure_translation).all()


def test_frames_without_people_are_ignored():
    _, box = frame_motion(recording_of(moving_arm(), times=(0.55, 0.2)))
    wanted = all_points([0.2])
    np.testing.assert_allclose(box, [wanted.min(axis=0), wanted.max(axis=0)], atol=1e-12)
    nobody, empty = frame_motion(recording_of(moving_arm(), times=(0.55, 0.56)))
    assert nobody.tolist() == [[0, 0, 0]] and empty.tolist() == [[0, 0, 0]] * 2


def test_still_scene_is_fitted_as_posed():
    actor = moving_arm()
    actor.pose.figure_translation[:] = (9.0, 0.0, 0.0)
    _, box = frame_motion(recording_of(actor, moves=False))
    assert box[0, 0] == pytest.approx(9.0)  # the arm starts at x = 0


def test_following_camera_fits_the_motion_relative_to_its_target():
    straight = moving_arm(turns=False)
    follow = Follow(0, 0, np.array([0.0, 0.0, 0.0]))
    points, box = frame_motion(recording_of(straight, follow=follow))
    still = scene_points(Scene([Actor(arm(3))]))
    np.testing.assert_allclose(points.min(axis=0), still.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), still.max(axis=0), atol=1e-12)
    assert box[1, 0] == pytest.approx(3.0 + 2.0)  # one second at 2 units per second


def test_actors_at_several_times_are_posed_together():
    early = moving_arm(turns=False)
    raised = affine_matrices(np.eye(3), np.array([0.0, 5.0, 0.0]))
    late = replace(early.copy(), offset=0.1, placement=raised)
    times = [0.8, 0.2, 0.5]
    scenes = [Scene([early.copy(), late.copy()]) for _ in times]
    pose_actors([actor for scene in scenes for actor in scene.actors], np.repeat(times, 2))
    rest = early.figure.mesh.positions
    for time, points in zip(times, points_of_scenes(scenes), strict=True):
        # Two units per second; the frame at 0.5 s is missing.
        places = np.array([[2.0 * time, 0.0, 0.0], [2.0 * (time - 0.1), 5.0, 0.0]])
        clouds = [rest + place for place in (places[1:] if time == 0.5 else places)]
        np.testing.assert_allclose(points, np.concatenate(clouds), atol=1e-12)


def test_each_actor_of_a_figure_keeps_its_shape():
    figure, up = arm(3), np.array([0.0, 1.0, 0.0])
    rest = figure.mesh.positions
    figure = with_morphs(figure, [MorphTarget("lift", np.arange(len(rest)), rest + up)])
    actors = [Actor(figure) for _ in range(3)]
    for actor, weight in zip(actors, (0.5, 0.0, 0.5), strict=True):
        actor.pose.shape_weights[:] = weight
    points = scene_points(Scene(actors))
    np.testing.assert_allclose(
        points, np.concatenate([rest + up / 2, rest, rest + up / 2]), atol=1e-12
    )


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_orbiting_camera_keeps_all_points_in_view(up, orthographic):
    points = np.random.default_rng(1).uniform(-1, 1, (500, 3)) * [8.0, 1.0, 0.5]
    camera = Camera(up=up, azimuth=90.0, orthographic=orthographic)
    fit_turntable(camera, points, ASPECT, 360.0)
    assert camera.azimuth == 90.0
    for azimuth in np.arange(0.0, 360.0, 7.0):
        turned = camera.copy()
        turned.azimuth = azimuth
        assert is_seen(turned, points)


def test_camera_that_does_not_orbit_is_fitted_to_the_view():
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    camera, plain = Camera(), Camera()
    fit_turntable(camera, points, ASPECT, 0.0)
    fit(plain, points, ASPECT)
    assert camera.distance == plain.distance and (camera.target == plain.target).all()


@pytest.mark.parametrize("count", [1, 1000, 1001, 45_000])
def test_outermost_points_have_the_same_extent_in_every_direction(count):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(count, 3)) * [5.0, 1.0, 2.0] + [100.0, 0.0, -7.0]
    chosen = outermost(points)
    assert len(chosen) <= 1006
    assert (chosen.min(axis=0) == points.min(axis=0)).all()
    assert (chosen.max(axis=0) == points.max(axis=0)).all()
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    missed = (points @ directions.T).max(axis=0) - (chosen @ directions.T).max(axis=0)
    size = np.linalg.norm(np.ptp(points, axis=0))
    assert missed.max() <= 0.005 * size


# Targets to follow


def captured(person: int | None = None) -> Actor:
    points = np.array([[[1.0, 2.0, 3.0, 1.0], [3.0, 2.0, 1.0, 1.0]]])
    clip = PointClip("points", Timing(10.0, np.zeros(1, dtype=np.int32)), points)
    actor = Actor(Figure("keypoints", points=LAYOUT), clip=clip, person=person)
    pose_actors([actor], 0.0)
    return actor


@pytest.mark.parametrize(
    ("name", "actor", "joint", "origin"),
    [
        ("arm", 0, 0, (0.5, 0, 0)),
        ("ARM", 0, 0, (0.5, 0, 0)),
        ("j2", 0, 2, (2.5, 0, 0)),
        ("arm/J1", 0, 1, (1.5, 0, 0)),
        ("keypoints 4", 1, -1, (2, 2, 2)),
        ("nose", 1, 1, (3, 2, 1)),
        ("keypoints 4/left_knee", 1, 0, (1, 2, 3)),
        ("4", 1, -1, (2, 2, 2)),
        ("4:nose", 1, 1, (3, 2, 1)),
        ("4/Left_Knee", 1, 0, (1, 2, 3)),
        ("arm:j1", 0, 1, (1.5, 0, 0)),
    ],
)
def test_target_is_found_by_the_name_of_an_actor_or_joint(name, actor, joint, origin):
    first = Actor(arm(3))
    first.pose.figure_translation[0] = 0.5
    follow = find_follow(Scene([first, captured(4)]), name)
    assert (follow.actor, follow.joint) == (actor, joint)
    np.testing.assert_allclose(follow.origin, origin, atol=1e-12)


def test_name_may_match_several_actors():
    scene = Scene([Actor(arm(3)), captured(4), Actor(arm(2)), captured(7)])
    assert follow_candidates(scene, "j1") == [(0, 1), (2, 1)]
    assert follow_candidates(scene, "arm") == [(0, 0), (2, 0)]
    assert follow_candidates(scene, "arm:j2") == [(0, 2)]
    assert follow_candidates(scene, "nose") == [(1, 1), (3, 1)]
    assert follow_candidates(scene, "7:nose") == [(3, 1)] and follow_candidates(scene, "5") == []


def test_joint_names_may_contain_a_colon():
    figure = arm(2)
    names = ("mixamorig:Hips", "mixamorig:Spine")
    named = replace(figure, skeleton=replace(figure.skeleton, names=names))
    scene = Scene([Actor(named), Actor(named, person=2)])
    assert follow_candidates(scene, "mixamorig:spine") == [(0, 1), (1, 1)]
    assert follow_candidates(scene, "2:mixamorig:spine") == [(1, 1)]


@pytest.mark.parametrize("name", ["leg", "leg/j1", "", "/", ":", "none:j1", ":j1"])
def test_unknown_name_is_refused_with_a_list_of_actors(name):
    with pytest.raises(RigError) as caught:
        find_follow(Scene([Actor(arm(3)), captured()]), name)
    assert str(caught.value) == (
        f'no actor, joint or point is called "{name}"; actors: arm, keypoints'
    )


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("arm/j9", "there are 3: j0, j1, j2"),
        ("j11", "did you mean j1?"),
        ("keypoint", "did you mean keypoints?"),
        ("2:mixamorig:Spin", "did you mean mixamorig:Spine?"),
        ("mixamorig:Hps", "did you mean mixamorig:Hips?"),
    ],
)
def test_unknown_joint_is_refused_with_the_nearest_of_its_actor(name, hint):
    figure = arm(2)
    names = ("mixamorig:Hips", "mixamorig:Spine")
    named = replace(figure, name="fox", skeleton=replace(figure.skeleton, names=names))
    scene = Scene([Actor(arm(3)), captured(), Actor(named, person=2)])
    with pytest.raises(RigError) as caught:
        find_follow(scene, name)
    assert str(caught.value) == f'no actor, joint or point is called "{name}"; {hint}'
