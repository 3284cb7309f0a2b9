"""Rendered motion paths: position, width, visible part, and caching."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, square
from rendering.front_view import drawn, front_view, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.colors import path_colors
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes import motion_path_pass
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene

PATH = ((0, 0),)


def walker(*places, rows=None, rate=1.0) -> Actor:
    """Return an invisible point that moves through positions, one per second."""
    points = np.ones((len(places), 1, 4))
    points[:, 0, :3] = places
    timing = Timing(rate, np.arange(len(places)) if rows is None else rows)
    layout = PointLayout("one", ("a",), np.zeros((0, 2)), [0])
    return Actor(Figure("walker", points=layout), clip=PointClip("walk", timing, points))


ACROSS = [(-1.5, 0.0, 0.0), (0.0, 0.0, 0.0), (1.5, 0.0, 0.0)]


def test_path_is_a_line_a_few_pixels_wide(offscreen):
    mask = drawn(front_view(offscreen, Scene([walker(*ACROSS)]), path_joints=PATH))
    # The path is from -1.5 to 1.5 of +-2, columns 10 to 69, and 2.5 pixels wide.
    assert mask[:, 12:68].sum(axis=0).min() >= 2 and mask[:, 12:68].sum(axis=0).max() <= 3
    assert not mask[:, :9].any() and not mask[:, 71:].any()
    assert not mask[:37].any() and not mask[43:].any()


def test_line_width_does_not_depend_on_distance_or_size(offscreen):
    actor = walker((0.0, -1.0, 0.0), (0.0, 1.0, 0.0))
    for scale in (0.5, 1.0, 1.8):
        actor.placement[1, 1] = scale
        mask = drawn(front_view(offscreen, Scene([actor]), path_joints=PATH))
        assert 2 <= mask[40].sum() <= 3
        rows = np.nonzero(mask.any(axis=1))[0]
        assert rows.max() - rows.min() + 1 == pytest.approx(40 * scale, abs=1)


def test_missing_and_absent_frames_interrupt_the_path(offscreen):
    actor = walker(*ACROSS, rows=[0, 1, -1, 2])
    mask = drawn(front_view(offscreen, Scene([actor]), path_joints=PATH))
    assert mask[40, 20] and not mask[40, 55]
    # A path stays visible while its actor is absent, but not if it is hidden.
    actor.is_present = False
    assert drawn(front_view(offscreen, Scene([actor]), path_joints=PATH)).any()
    actor.visible = False
    assert not drawn(front_view(offscreen, Scene([actor]), path_joints=PATH)).any()


def test_paths_fade_into_past_and_future(offscreen):
    scene = Scene([walker(*ACROSS)], time=1.0)
    picture = front_view(offscreen, scene, path_joints=PATH, path_seconds=0.5)
    alpha = [pixel(picture, x, 0.01)[3] for x in (-1.2, -0.375, 0.0, 0.375, 1.2)]
    # A second is 1.5 units. At a quarter of a second, half of the opacity remains; beyond half a
    # second, none.
    assert alpha == pytest.approx([0, 128, 255, 128, 0], abs=12)
    scene.actors[0].offset = -1.0  # the clip is a second ahead, so the actor is at its end
    picture = front_view(offscreen, scene, path_joints=PATH, path_seconds=0.5)
    assert pixel(picture, 1.45, 0.01)[3] > 200 and pixel(picture, 0.0, 0.01)[3] == 0


def test_whole_path_is_drawn_with_equal_opacity(offscreen):
    scene = Scene([walker(*ACROSS)], time=0.0)
    picture = front_view(offscreen, scene, path_joints=PATH)
    assert {pixel(picture, x, 0.01)[3] for x in (-1.2, 0.0, 1.2)} == {255}


def test_paths_behind_a_surface_are_faint(offscreen):
    wall = Actor(Figure("wall", square(z=0.5, half=1.0)))
    scene = Scene([wall, walker(*ACROSS)])
    bare = pixel(front_view(offscreen, Scene([wall])), 0.0, 0.01)
    picture = front_view(offscreen, scene, path_joints=((1, 0),))
    color = 255 * path_colors(1)[0]
    seen = pixel(picture, 0.0, 0.01)
    assert seen[:3] == pytest.approx(0.7 * np.array(bare[:3]) + 0.3 * color, abs=3)
    assert pixel(picture, 1.3, 0.01)[:3] == pytest.approx(color, abs=2)


def test_joint_paths_follow_placement(offscreen):
    figure = arm(2)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (31, 2, 1))
    angles = np.linspace(0.0, np.pi, 31)
    turns[:, 0, 2], turns[:, 0, 3] = np.sin(angles / 2), np.cos(angles / 2)
    actor = Actor(figure, clip=SampledClip("turn", Timing(30.0, np.arange(31)), turns))
    actor.placement[1, 3] = -1.0
    scene = Scene([replace_mesh(actor)])
    picture = front_view(offscreen, scene, show="skeleton", path_joints=((0, 1),))
    # Joint 1 swings from (1, -1) through (0, 0) to (-1, -1).
    for angle in (0.3, np.pi / 2, 2.0):
        x, y = np.cos(angle), np.sin(angle) - 1.0
        assert pixel(picture, x, y)[:3] == pytest.approx(255 * path_colors(1)[0], abs=3)


def replace_mesh(actor: Actor) -> Actor:
    """Return the actor without a mesh, with boxes far out of view."""
    skeleton = replace(actor.figure.skeleton, boxes=np.full((2, 2, 3), -50.0))
    actor.figure = replace(actor.figure, mesh=None, skin=None, skeleton=skeleton)
    return actor


def test_paths_are_computed_once(offscreen, monkeypatch):
    calls = []
    original = motion_path_pass.motion_path

    def counted(*args, **kwargs):
        calls.append(args)
        return original(*args, **kwargs)

    monkeypatch.setattr(motion_path_pass, "motion_path", counted)
    actor = walker(*ACROSS)
    scene = Scene([actor])
    for time in (0.0, 0.5, 1.0):
        scene.time = time
        front_view(offscreen, scene, path_joints=PATH, path_seconds=0.5)
    assert len(calls) == 1
    actor.clip = replace(actor.clip, name="another")
    front_view(offscreen, scene, path_joints=PATH)
    actor.offset = 0.25
    front_view(offscreen, scene, path_joints=PATH)
    assert len(calls) == 3


def test_path_follows_dofs_without_channels(offscreen, monkeypatch):
    calls = []
    original = motion_path_pass.motion_path
    monkeypatch.setattr(
        motion_path_pass, "motion_path", lambda *a, **k: calls.append(1) or original(*a, **k)
    )
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (2, 2, 1))
    actor = Actor(arm(2), clip=SampledClip("c", Timing(1.0, [0, 1]), turns))
    scene = Scene([actor])
    for change, count in (
        (lambda: None, 1),
        (lambda: actor.pose.dofs.__setitem__(4, 0.3), 1),  # the clip moves it
        (lambda: actor.pose.figure_translation.__setitem__(0, 1.0), 2),
        (lambda: setattr(actor.pose, "figure_scale", 2.0), 3),
        (lambda: actor.placement.__setitem__((0, 3), 1.0), 3),
    ):
        change()
        front_view(offscreen, scene, path_joints=((0, 1),))
        assert len(calls) == count


def test_lines_that_pass_the_camera_are_clipped(offscreen):
    """The line from behind the eye to the image centre must not cover other pixels."""
    scene = Scene([walker((0.0, 0.5, 9.0), (0.0, 0.0, -3.0))])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=60.0, distance=2.0)
    options = DisplayOptions(background="transparent", grid=False, samples=1, path_joints=PATH)
    box = np.array([[-1.0, -1.0, -3.0], [1.0, 1.0, 1.0]])
    mask = drawn(offscreen.render(scene, (80, 80), camera, options, box))
    rows, columns = np.nonzero(mask)
    assert len(rows) and columns.min() >= 38 and columns.max() <= 41
    assert rows.min() == 0 and rows.max() <= 41


def test_actors_without_a_clip_and_clips_without_points_have_no_path(offscreen):
    still = Actor(arm(2))
    empty = walker(*ACROSS, rows=[-1, -1])
    scene = Scene([still, empty])
    bare = front_view(offscreen, scene)
    both = front_view(offscreen, scene, path_joints=((0, 1), (1, 0), (5, 0)))
    assert np.array_equal(bare, both)


def test_paths_of_removed_actors_are_freed(offscreen):
    front_view(offscreen, Scene([walker(*ACROSS)]), path_joints=PATH)
    assert len(offscreen.renderer.buffers.motion_paths) == 1
    front_view(offscreen, Scene([]), path_joints=PATH)
    assert len(offscreen.renderer.buffers.motion_paths) == 0
