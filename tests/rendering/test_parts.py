"""Body parts in distinct colours, hidden parts, and reduced meshes."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, sphere, square
from rendering.front_view import alone, drawn, front_view, grid_figure, pixel
from rendering.plain_pictures import draw, plain

from viewer.rendering.camera import Camera
from viewer.rendering.colors import part_colors
from viewer.rendering.gpu.index_sets import kept_triangles
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.mesh_pass import SKIN_COLOR
from viewer.rigs.annotations import BodyParts, ReducedMesh
from viewer.rigs.scene import scene_box

NAMES = ("left", "right", "belt")
# The first colours of Okabe and Ito, as published.
GREY, SKY, ORANGE = (153, 153, 153), (86, 180, 233), (230, 159, 0)


def striped():
    """Return a grid with columns of vertices in the parts left, left, belt, right, right."""
    figure = grid_figure(4)
    column = np.arange(figure.mesh.n_vertices) % 5
    return replace(figure, body_parts=BodyParts(NAMES, np.array([0, 0, 2, 1, 1])[column]))


def near(found, wanted, tolerance=6):
    """Compare colours; the published colours are decoded approximately, by a power of 2.2."""
    return np.abs(np.array(found)[..., :3] - wanted).max() <= tolerance


def test_parts_have_their_colours(offscreen):
    picture = front_view(offscreen, alone(striped()), shading="parts")
    assert near(pixel(picture, -1.2, 0.3), GREY)
    assert near(pixel(picture, 1.2, 0.3), SKY)
    belt = BodyParts(NAMES, np.full(25, 2))
    picture = front_view(offscreen, alone(replace(grid_figure(), body_parts=belt)), shading="parts")
    assert near(picture[drawn(picture)], ORANGE)


def test_figure_without_parts_is_plain(offscreen):
    picture = front_view(offscreen, alone(grid_figure()), shading="parts")
    plain = np.array(SKIN_COLOR)
    expected = 255.0 * (1.055 * plain ** (1 / 2.4) - 0.055)
    assert np.abs(picture[drawn(picture)][:, :3] - expected).max() <= 1.0


def test_figures_with_and_without_parts_are_drawn_together(offscreen):
    both = alone(striped())
    other = scene_of(square(z=-1.0, half=1.9)).actors[0]
    both.actors.append(other)
    picture = front_view(offscreen, both, shading="parts")
    assert near(pixel(picture, -1.2, 0.3), GREY)
    plain = 255.0 * (1.055 * np.array(SKIN_COLOR) ** (1 / 2.4) - 0.055)
    assert near(pixel(picture, 1.8, 1.8), plain, 2)


def test_hidden_parts_are_not_drawn_except_for_border_triangles(offscreen):
    scene = alone(striped())
    whole = drawn(front_view(offscreen, scene))
    assert whole.sum() == 60 * 60
    for hidden, right_edge in (((1,), 0.75), ((1, 2), 0.0)):
        found = drawn(front_view(offscreen, scene, hidden_parts=hidden))
        # Triangles with one corner in a visible part remain, up to the next column.
        across = np.flatnonzero(found.any(axis=0))
        assert across[0] == 10
        assert across[-1] + 1 == 40 + 20 * right_edge
        assert (found <= whole).all()
    assert not drawn(front_view(offscreen, scene, hidden_parts=(0, 1, 2))).any()
    assert drawn(front_view(offscreen, scene)).sum() == 60 * 60


def test_hiding_all_parts_also_hides_edges(offscreen):
    scene = alone(striped())
    picture = front_view(offscreen, scene, hidden_parts=(0, 1, 2), wireframe=True)
    assert not drawn(picture).any()


def test_hidden_parts_do_not_affect_a_figure_without_parts(offscreen):
    assert drawn(front_view(offscreen, alone(grid_figure()), hidden_parts=(0,))).sum() == 60 * 60


def test_triangles_with_a_corner_outside_hidden_parts_are_drawn():
    figure = striped()
    corners = np.array([[0, 1, 5], [3, 4, 9], [1, 2, 3], [2, 7, 12], [0, 4, 2]])
    wanted = {(): [1, 1, 1, 1, 1], (0,): [0, 1, 1, 1, 1], (1, 2): [1, 0, 1, 0, 1]}
    for hidden, expected in wanted.items():
        assert kept_triangles(figure, hidden, corners).tolist() == [bool(e) for e in expected]


def coarse():
    """Return a grid with a reduced mesh of one triangle, the lower right half."""
    return replace(striped(), reduced=ReducedMesh([24, 0, 4], [[1, 2, 0]]))


def test_reduced_mesh_is_drawn_on_request(offscreen):
    scene = alone(coarse())
    assert drawn(front_view(offscreen, scene)).sum() == 60 * 60
    found = drawn(front_view(offscreen, scene, reduced=True))
    assert 0.45 < found.sum() / 3600 < 0.55
    rows, columns = np.nonzero(found)
    # The triangle is below the diagonal: x greater than y, with rows counted from the top.
    assert (columns + rows >= 78).all()


def test_reduced_mesh_follows_the_pose(offscreen):
    scene = alone(coarse())
    scene.actors[0].pose.dofs[2] = np.pi  # the root about z, which shows the upper left half
    rows, columns = np.nonzero(drawn(front_view(offscreen, scene, reduced=True)))
    assert len(rows) > 1500
    assert (columns + rows <= 80).all()


def test_reduced_mesh_obeys_hidden_parts_and_has_colours(offscreen):
    scene = alone(coarse())
    picture = front_view(offscreen, scene, reduced=True, shading="parts")
    assert near(pixel(picture, 1.4, 0.0), SKY, 12)
    # The corners of the triangle are in the parts left and right.
    assert drawn(front_view(offscreen, scene, reduced=True, hidden_parts=(1,))).any()
    assert not drawn(front_view(offscreen, scene, reduced=True, hidden_parts=(0, 1))).any()


def test_figure_without_a_reduced_mesh_draws_its_mesh(offscreen):
    assert drawn(front_view(offscreen, alone(grid_figure()), reduced=True)).sum() == 60 * 60


def primitives(offscreen, scene, **options):
    """Return how many primitives a draw of an unchanged pose generates."""
    front_view(offscreen, scene, **options)
    with offscreen.context as context:
        target = offscreen.target((80, 80), 1)
        query = context.query(primitives=True)
        shown = DisplayOptions(background="transparent", grid=False, samples=1, **options)
        with query:
            offscreen.renderer.draw(scene, Camera(), shown, target, scene_box(scene))
        return query.primitives


def test_fewer_triangles_go_through_the_pipeline(offscreen):
    scene = alone(coarse())
    whole = primitives(offscreen, scene)
    assert whole - primitives(offscreen, scene, reduced=True) == 32 - 1
    # Without "right", the eight triangles of the last column are omitted.
    assert whole - primitives(offscreen, scene, hidden_parts=(1,)) == 8


@pytest.mark.parametrize("count", [0, 1, 8, 9, 24])
def test_part_colours_are_distinct_and_repeat_darker(count):
    colors = part_colors(count)
    assert colors.shape == (count, 3)
    assert len(np.unique(colors, axis=0)) == count
    assert (colors >= 0.0).all()
    assert (colors <= 1.0).all()
    assert (colors[8:].sum(axis=1) < colors[: max(count - 8, 0)].sum(axis=1)).all()


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
