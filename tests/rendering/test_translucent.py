"""Translucent actors, drawn as one layer regardless of surfaces inside or behind them."""

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, sphere, square
from rendering.plain_pictures import draw, plain

pytestmark = pytest.mark.slow


def middle(pixels):
    return pixels[pixels.shape[0] // 2, pixels.shape[1] // 2].tolist()


def test_translucent_actor_shows_opaque_actors_behind_it_but_not_its_back(offscreen):
    scene = scene_of(sphere(), square(z=-2.0, half=3.0))
    options = plain(background="#000000")
    front_only = middle(draw(offscreen, scene_of(sphere()), options))
    behind = middle(draw(offscreen, scene_of(square(z=-2.0, half=3.0)), options))
    scene.actors[0].opacity = 0.25
    seen = middle(draw(offscreen, scene, options))
    expected = 0.25 * np.array(front_only[:3]) + 0.75 * np.array(behind[:3])
    np.testing.assert_allclose(seen[:3], expected, atol=2)  # of 255, for rounding of both images


def test_opacity_of_the_display_multiplies_that_of_actors(offscreen):
    options = plain(background="transparent", opacity=0.5)
    scene = scene_of(sphere())
    for own, alpha in ((1.0, 127.5), (0.5, 63.75), (0.0, 0.0)):
        scene.actors[0].opacity = own
        assert abs(middle(draw(offscreen, scene, options))[3] - alpha) < 1.0


def test_translucent_actors_do_not_show_through_each_other(offscreen):
    scene = scene_of(sphere(), sphere(radius=0.5, center=(0.0, 0.0, -1.5)))
    options = plain(background="transparent")
    for actor in scene.actors:
        actor.opacity = 0.5
    alpha = middle(draw(offscreen, scene, options))[3]
    assert abs(alpha - 127.5) < 1.0
    scene.actors[0].opacity = 0.0
    assert abs(middle(draw(offscreen, scene, options))[3] - 127.5) < 1.0
