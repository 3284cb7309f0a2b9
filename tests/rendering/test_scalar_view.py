"""Scalar views: the numbers that reach the GPU, their range, and their colours in the picture."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_figures import arm, bent, scene_of, square
from family_models import family_figure
from front_view import alone, drawn, front_view, grid_figure, pixel

from viewer.rendering.colormap import colormap
from viewer.rendering.mesh_buffers import MeshBuffers
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.scalar_buffer import ScalarBuffer
from viewer.rig import scalars
from viewer.rig.blendshapes import Correctives
from viewer.rig.pose import rest_pose
from viewer.rig.scalars import compute
from viewer.rig.scene import Scene, figure_pose
from viewer.rig.skinning import Skinning

LUMA = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def rising(largest=1.0):
    """Return a scene whose view "correctives" rises from 0 at the left edge to the right one's."""
    figure = grid_figure()
    offsets = np.zeros((9, figure.mesh.n_vertices, 3))
    # Half a turn about z drives row 0 with -2.
    offsets[0, :, 1] = largest * (figure.mesh.positions[:, 0] + 1.5) / 6.0
    scene = alone(grid_figure(correctives=Correctives(offsets)))
    scene.actors[0].pose.dofs[5] = np.pi
    return scene


def view_of(offscreen, scene, name="correctives"):
    """Draw without the correctives, so that the square stays where it is."""
    how = Skinning(correctives=False)
    return front_view(offscreen, scene, shading="scalar", scalar=name, skinning=how)


@pytest.mark.parametrize("largest", [1.0, 1e-4, 300.0])
def test_colours_of_the_map_run_from_zero_to_the_largest_value(offscreen, largest):
    picture = view_of(offscreen, rising(largest))
    pixels = colormap()[:, :3].astype(int)
    for x in (-1.4, -0.7, 0.0, 0.7, 1.4):
        # Pixel centres are 0.025 apart from the place asked for, eight rows of 256.
        row = round(255 * (x + 1.5) / 3.0)
        near = pixels[max(row - 8, 0) : row + 9]
        assert np.abs(near - pixel(picture, x, 0.5)[:3]).max(axis=1).min() <= 6


def test_brightest_place_is_where_the_value_is_largest(offscreen):
    picture = view_of(offscreen, rising())
    brightness = picture[..., :3] @ LUMA
    row = brightness[40, drawn(picture)[40]]
    assert len(row) == 60
    assert (np.diff(row) > -1.0).all()
    assert row[-1] > row[0] + 150


def test_figure_without_differences_is_dark_all_over(offscreen):
    scene = alone(grid_figure())
    picture = view_of(offscreen, scene, "methods")
    found = picture[drawn(picture)][:, :3].astype(int)
    assert np.abs(found - colormap()[0, :3]).max() <= 3


def test_view_follows_the_pose(offscreen):
    scene = rising()
    before = view_of(offscreen, scene)
    scene.actors[0].pose.dofs[5] = 0.0
    flat = view_of(offscreen, scene)
    assert pixel(before, 1.4, 0)[:3] != pixel(flat, 1.4, 0)[:3]
    assert pixel(flat, 1.4, 0) == pixel(flat, -1.4, 0)


def test_view_of_an_arm_is_brightest_at_its_twisted_elbow(offscreen):
    actor = bent(arm(3), (2, "x", 2.8))
    actor.placement[:3, 3] = -1.5, 0.0, 0.0
    picture = view_of(offscreen, Scene([actor]), "methods")
    brightness = picture[..., :3] @ LUMA * drawn(picture)
    _, column = np.unravel_index(brightness.argmax(), brightness.shape)
    # The elbow between joints 1 and 2 is at x = 2, half a unit right of the middle.
    assert abs((column + 0.5) / 20 - 2.0 - 0.5) < 0.3


@pytest.fixture
def buffers(ctx, tmp_path):
    mesh = MeshBuffers(ctx, family_figure("smplx", tmp_path), [])
    scalar = ScalarBuffer(ctx, mesh)
    yield scalar
    scalar.release()
    mesh.release()


def values_of(buffer: ScalarBuffer):
    return np.frombuffer(buffer.values.read(), dtype="f4")


def posed(figure, seed=0):
    pose = figure_pose(figure)
    pose.dofs[:] = np.random.default_rng(seed).uniform(-1, 1, len(pose.dofs))
    return pose


@pytest.mark.parametrize("name", ["methods", "correctives", "cut"])
def test_every_split_vertex_has_the_number_of_its_vertex(buffers, name):
    figure = buffers.mesh.figure
    pose, how = posed(figure), Skinning(max_influences=2)
    buffers.update(name, pose, how)
    numbers = compute(name, figure, pose, how)
    assert numbers.max() > 0.0
    np.testing.assert_allclose(values_of(buffers), numbers[buffers.mesh.sources], rtol=1e-6)
    assert buffers.range == (numbers.min(), numbers.max())
    assert buffers.shown == (0.0, numbers.max())


def test_numbers_are_computed_when_something_changed_only(buffers, monkeypatch):
    calls = []
    original = scalars.compute

    def counted(*parts):
        calls.append(parts[0])
        return original(*parts)

    monkeypatch.setattr("viewer.rendering.scalar_buffer.compute", counted)
    pose, how = posed(buffers.mesh.figure), Skinning()
    for change in (
        lambda: None,
        lambda: pose.dofs.__setitem__(5, 0.5),
        lambda: setattr(how, "method", "dqs"),
        lambda: pose.shape_weights.__setitem__(0, 1.0),
        lambda: setattr(pose, "figure_scale", 3.0),
    ):
        change()
        before = len(calls)
        buffers.update("cut", pose, how)
        buffers.update("cut", pose, how)
        assert len(calls) == before + 1
    buffers.update("methods", pose, how)
    assert calls[-1] == "methods"


def test_numbers_grow_with_the_figure(buffers):
    pose = posed(buffers.mesh.figure)
    buffers.update("methods", pose, Skinning())
    before = buffers.range[1]
    pose.figure_scale = 2.0
    buffers.update("methods", pose, Skinning())
    assert buffers.range[1] == pytest.approx(2.0 * before)


def test_binding_space_has_numbers_of_zero_and_a_range(buffers):
    buffers.update("cut", posed(buffers.mesh.figure), Skinning(max_influences=1))
    buffers.update("cut", None, Skinning(max_influences=1))
    assert not values_of(buffers).any()
    assert buffers.range == (0.0, 0.0)
    assert buffers.shown == (0.0, 1.0)


def test_figure_without_a_skin_can_be_drawn_so(offscreen):
    picture = view_of(offscreen, scene_of(square()), "cut")
    assert drawn(picture).sum() == 40 * 40


def test_rest_pose_of_this_file_differs_from_its_poses(buffers):
    rest = rest_pose(buffers.mesh.figure.skeleton)
    buffers.update("methods", rest, Skinning())
    assert buffers.range[1] == pytest.approx(0.0, abs=1e-14)
