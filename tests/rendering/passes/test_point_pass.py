"""Rendered captured keypoints: position, size, colour and opacity."""

import numpy as np
import pytest
from rendering.drawn_figures import square
from rendering.front_view import PIXELS, drawn, front_view, pixel

from viewer.rendering.passes import point_pass
from viewer.rendering.passes.point_pass import point_radii
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene

RADIUS = 0.2  # radius of the drawn balls, 4 pixels


def dots(*places, limbs=(), sides=None, confidence=None, radius=RADIUS) -> Actor:
    """Return an actor of points; the clip determines their size."""
    count = len(places)
    layout = PointLayout(
        "dots",
        tuple(f"p{number}" for number in range(count)),
        np.array(limbs, dtype=np.int32).reshape(-1, 2),
        np.zeros(count, dtype=np.int32) if sides is None else sides,
    )
    # Two points are corners of a cube with a diagonal of radius / 0.012; the others are far apart
    # too.
    size = radius / 0.012
    spread = np.zeros((1, count, 4))
    spread[0, :, 0] = np.linspace(0.0, size, count) if count > 1 else 0.0
    spread[..., 3] = 1.0
    clip = PointClip("dots", Timing(30.0, [0]), spread)
    actor = Actor(Figure("dots", points=layout), clip=clip)
    certain = np.ones(count) if confidence is None else confidence
    actor.points = np.column_stack([np.array(places, dtype=float), certain])
    return actor


def width(mask) -> int:
    columns = np.nonzero(mask.any(axis=0))[0]
    return int(columns.max() - columns.min() + 1) if len(columns) else 0


def test_points_are_drawn_as_balls_at_their_positions(offscreen):
    picture = front_view(offscreen, Scene([dots((-1.0, 1.0, 0.0), (1.0, -1.0, 0.0))]))
    mask = drawn(picture)
    left, right = mask[:, : PIXELS // 2], mask[:, PIXELS // 2 :]
    for half, row, column in ((left, 20, 20), (right, 60, 20)):
        rows, columns = np.nonzero(half)
        assert (rows.mean() + 0.5, columns.mean() + 0.5) == pytest.approx((row, column), abs=0.3)
        # The disc has a radius of 4 pixels, reduced by the polygonal outline of the ball.
        assert 0.8 * 50 < half.sum() < 1.1 * 50


def test_limbs_are_half_as_wide_as_their_points(offscreen):
    picture = front_view(offscreen, Scene([dots((-1.5, 0, 0), (1.5, 0, 0), limbs=[(0, 1)])]))
    mask = drawn(picture)
    assert mask[:, 40].sum() == 4  # 2 pixels up and down
    assert width(mask) == pytest.approx(68, abs=1)  # 60 plus a radius at both ends


def test_limb_without_length_is_drawn(offscreen):
    for end in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
        actor = dots((0.0, 0.0, 0.0), end, limbs=[(0, 1)])
        assert drawn(front_view(offscreen, Scene([actor]))).any()


def test_colours_distinguish_sides(offscreen):
    places = [(-1.5, 0, 0), (0.0, 0, 0), (1.5, 0, 0), (0.0, 1.5, 0)]
    limbs = [(0, 1), (1, 2), (1, 3)]
    scene = Scene([dots(*places, limbs=limbs, sides=[-1, 0, 1, 0])])
    picture = front_view(offscreen, scene)
    for x in (-1.5, -0.7):  # right points and limbs from the centre line to them are red
        red, green, blue, _ = pixel(picture, x, 0.0)
        assert red > 2 * max(green, blue)
    for x in (0.7, 1.5):
        red, green, blue, _ = pixel(picture, x, 0.0)
        assert blue > 1.5 * max(red, green)
    red, green, blue, _ = pixel(picture, 0.0, 0.7)
    assert max(red, green, blue) < 1.6 * min(red, green, blue)
    scene.actors[0].color = 0.0, 0.6, 0.0
    red, green, blue, _ = pixel(front_view(offscreen, scene), 0.0, 0.7)
    assert green > 1.5 * max(red, blue)


def test_limb_between_sides_has_the_colour_of_neither_side(offscreen):
    scene = Scene([dots((-1.5, 0, 0), (1.5, 0, 0), limbs=[(0, 1)], sides=[-1, 1])])
    red, green, blue, _ = pixel(front_view(offscreen, scene), 0.0, 0.0)
    assert max(red, green, blue) < 1.6 * min(red, green, blue)


def test_confidence_is_opacity(offscreen):
    places = [(-1.5, 0.0, 0), (0.0, 0.0, 0), (1.5, 0.0, 0)]
    actor = dots(*places, limbs=[(0, 1), (1, 2)], confidence=[1.0, 0.4, 0.8])
    picture = front_view(offscreen, Scene([actor]))
    for x, alpha in ((-1.5, 255), (0.0, 102), (1.5, 204), (-0.7, 102), (0.7, 102)):
        assert pixel(picture, x, 0.0)[3] == pytest.approx(alpha, abs=1)


def test_uncertain_or_undetected_points_are_omitted_with_their_limbs(offscreen):
    places = [(-1.5, 0.0, 0), (0.0, 0.0, 0), (1.5, 0.0, 0)]
    for confidence, shown in ((0.0, {0.0: False}), (0.05, {0.0: False}), (0.1, {0.0: True})):
        actor = dots(*places, limbs=[(0, 1), (1, 2)], confidence=[1.0, confidence, 1.0])
        mask = drawn(front_view(offscreen, Scene([actor])))
        assert bool(mask[40, 40]) == shown[0.0]
        assert bool(mask[40, 25]) == shown[0.0]  # the limb
        assert mask[40, 10] and mask[40, 70]
    mask = drawn(front_view(offscreen, Scene([actor]), min_confidence=0.2))
    assert not mask[40, 40]
    unseen = dots(*places, confidence=[0.0, 0.0, 0.0])
    assert not drawn(front_view(offscreen, Scene([unseen]), min_confidence=0.0)).any()


def test_absent_actors_and_those_without_points_are_not_drawn(offscreen):
    actor = dots((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    for name, value in (("is_present", False), ("visible", False), ("points", None)):
        before = getattr(actor, name)
        setattr(actor, name, value)
        assert not drawn(front_view(offscreen, Scene([actor]))).any()
        setattr(actor, name, before)
    assert drawn(front_view(offscreen, Scene([actor]))).any()


def test_points_behind_a_surface_are_faintly_visible(offscreen):
    actor = dots((0.0, 0.0, -0.5), (1.8, 0.0, 0.5))
    wall = Actor(Figure("wall", square(z=0.0, half=1.0)))
    bare = pixel(front_view(offscreen, Scene([wall])), 0.0, 0.0)
    covered = pixel(front_view(offscreen, Scene([wall, actor])), 0.0, 0.0)
    free = pixel(front_view(offscreen, Scene([actor])), 0.0, 0.0)
    for surface, seen, point in zip(bare[:3], covered[:3], free[:3], strict=True):
        # This is the default opacity of a skeleton over a skin.
        assert seen == pytest.approx(0.65 * surface + 0.35 * point, abs=2)


def test_placement_is_applied_and_reflection_keeps_balls_outward(offscreen):
    actor = dots((0.5, 0.0, 0.0), (0.5, 0.5, 0.0))
    plain = front_view(offscreen, Scene([actor]))
    actor.placement[0, 0] = -1.0
    mirrored = front_view(offscreen, Scene([actor]))
    assert np.array_equal(drawn(mirrored), drawn(plain)[:, ::-1])
    light = pixel(plain, 0.5, 0.0)
    assert pixel(mirrored, -0.5, 0.0) == pytest.approx(light, abs=25)


def test_translucent_points_are_sorted_as_the_camera_orbits(offscreen):
    """A red ball is in front of a blue one, and vice versa; the nearer ball covers more."""
    near, far = (0.0, 0.0, 0.5), (0.0, 0.0, -0.5)
    for places in ((near, far), (far, near)):
        actor = dots(*places, (1.9, 1.9, 0.0), sides=[-1, 1, 0], confidence=[0.6, 0.6, 1.0])
        red, _, blue, alpha = pixel(front_view(offscreen, Scene([actor])), 0.0, 0.0)
        assert (red > blue) == (places[0] is near)
        assert alpha == pytest.approx(255 * (1 - 0.4 * 0.4), abs=2)


def test_unchanged_points_are_uploaded_once(offscreen, monkeypatch):
    actor = dots((0.5, 0.0, 0.0), (0.5, 0.5, 0.0))
    scene = Scene([actor])
    front_view(offscreen, scene)
    monkeypatch.setattr(point_pass, "float32", None)
    front_view(offscreen, scene)
    actor.points[0, 0] = 0.6
    with pytest.raises(TypeError):
        front_view(offscreen, scene)


def test_points_of_removed_actors_are_freed(offscreen):
    front_view(offscreen, Scene([dots((0, 0, 0), (1, 0, 0))]))
    assert len(offscreen.renderer.buffers.points) == 1
    front_view(offscreen, Scene([]))
    assert len(offscreen.renderer.buffers.points) == 0


def frames(*places):
    points = np.array(places, dtype=float)
    return np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2)


def test_radii_follow_the_size_of_the_whole_figure():
    """The radius is 0.012 of the diagonal 5 of a 3 x 4 rectangle, and scales with the unit."""
    corners = [(0, 0, 0), (3, 0, 0), (0, 4, 0), (3, 4, 0)]
    assert point_radii(frames(corners)) == pytest.approx([0.06] * 4)
    assert point_radii(1000.0 * frames(corners)) == pytest.approx([60.0] * 4)


def test_radii_are_smaller_for_close_points():
    """The radius is 0.3 of the distance 0.1; coincident points have 0.0015 of the size 10."""
    points = frames([(0, 0, 0), (10, 0, 0), (5, 0, 0), (5.1, 0, 0), (2, 0, 0), (2, 0, 0)])
    assert point_radii(points) == pytest.approx([0.12, 0.12, 0.03, 0.03, 0.12, 0.12])
    close = frames([(0, 0, 0), (10, 0, 0), (2, 0, 0), (2.001, 0, 0)])
    assert point_radii(close)[2:] == pytest.approx([0.015, 0.015])


def test_radii_are_medians_over_the_frames_with_a_point():
    sizes = np.stack([frames([(0, 0, 0), (size, 0, 0), (size / 2, 0, 0)])[0] for size in (1, 2, 9)])
    sizes[2, 1, 3] = 0.0  # the third frame then has length 4.5, and the median is 2
    assert point_radii(sizes) == pytest.approx([0.024] * 3)
    sizes[..., 3] = 0.0
    assert point_radii(sizes).tolist() == [0.0, 0.0, 0.0]
    assert point_radii(np.zeros((0, 2, 4))).tolist() == [0.0, 0.0]


def test_radii_of_many_points_follow_their_density():
    side = np.arange(40) / 39
    plane = np.stack([*np.meshgrid(side, side), np.zeros((40, 40))], axis=-1).reshape(-1, 3)
    points = np.concatenate([plane, np.ones((1600, 1))], axis=1)
    # A cell of the grid has one or two points, so gaps are 1/48 or 1/48 divided by sqrt 2.
    radii = point_radii(points[None])
    assert 0.3 / 48 / 2 <= radii.min() <= radii.max() <= 0.3 / 48


def test_hidden_points_leave_the_rest_of_the_picture_as_it_is(offscreen):
    body = Actor(Figure("square", square()))
    without = front_view(offscreen, Scene([body]))
    both = Scene([body, dots((-1.0, 1.0, 0.5), (1.0, -1.0, 0.5))])
    assert (front_view(offscreen, both) != without).any()
    np.testing.assert_array_equal(front_view(offscreen, both, captured_keypoints=False), without)
