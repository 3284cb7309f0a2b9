"""Ghosts, which are surfaces drawn over the scene without being part of it."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import square
from rendering.front_view import PIXELS, drawn, front_view, pixel

from viewer.rendering.offscreen import Offscreen
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.scene import Actor, Scene

BLUE = (0.0, 0.0, 1.0)


@pytest.fixture
def offscreen():
    with Offscreen() as result:
        yield result


def ghost(style="solid", away=(0.0, 0.0, 0.0), color=BLUE):
    return Ghost(Figure("ghost", square()), translation_matrix(np.array(away)), style, color)


def shown(offscreen, what, scene=None, **options):
    offscreen.renderer.ghost = what
    return front_view(offscreen, scene or Scene([]), **options)


def test_solid_ghost_is_drawn_at_its_placement(offscreen):
    picture = shown(offscreen, ghost(away=(0.5, 0.0, 0.0)))
    at = drawn(picture).any(axis=0)
    assert drawn(picture).any()
    moved = drawn(shown(offscreen, ghost(away=(0.0, 0.0, 0.0)))).any(axis=0)
    shift = np.nonzero(at)[0].min() - np.nonzero(moved)[0].min()
    assert shift == pytest.approx(0.5 * 20, abs=1)  # a unit is 20 pixels


def test_translucent_ghost_lets_the_scene_through(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    bare = pixel(shown(offscreen, None, scene), 0.0, 0.0)
    thin = pixel(shown(offscreen, ghost("translucent"), scene), 0.0, 0.0)
    thick = pixel(shown(offscreen, ghost("solid"), scene), 0.0, 0.0)
    assert thick[0] < thin[0] < bare[0]  # red decreases
    mixed = np.add(np.multiply(0.6, bare[:3]), np.multiply(0.4, thick[:3]))
    assert np.abs(np.subtract(thin[:3], mixed)).max() < 12  # blending is in sRGB


def test_ghost_behind_a_surface_is_hidden_and_ghost_inside_it_is_visible(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    bare = shown(offscreen, None, scene)
    behind = shown(offscreen, ghost(away=(0.0, 0.0, -0.5)), scene)
    assert pixel(behind, 0.0, 0.0) == pixel(bare, 0.0, 0.0)
    within = shown(offscreen, ghost(), scene)
    assert pixel(within, 0.0, 0.0) != pixel(bare, 0.0, 0.0)


def test_wireframe_ghost_has_only_edges(offscreen):
    picture = shown(offscreen, ghost("wireframe"))
    whole = drawn(shown(offscreen, ghost("solid"))).sum()
    assert 0 < drawn(picture).sum() < 0.5 * whole
    assert picture.shape[0] == PIXELS


def test_ghost_does_not_affect_scalar_colours(offscreen):
    plain = shown(offscreen, ghost())
    assert (shown(offscreen, ghost(), shading="scalar") == plain).all()


def test_ghosts_are_replaced_and_freed_once(offscreen):
    first = drawn(shown(offscreen, ghost())).sum()
    half = replace(square(), positions=0.5 * square().positions)
    small = Ghost(Figure("small", half), np.eye(4))
    assert drawn(shown(offscreen, small)).sum() < first
    assert not drawn(shown(offscreen, None)).any()
    assert drawn(shown(offscreen, ghost())).sum() == first
