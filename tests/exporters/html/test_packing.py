"""Numbers of a page: rounding, differences, and fields of displacements."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rendering.drawn_figures import random_figure, random_pose

from viewer.exporters.html.motion import _pack_fields, tracks_of
from viewer.exporters.html.offsets import principal_fields
from viewer.exporters.html.packing import Packer, earlier_corners, unpacked
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.shape import pose_weights
from viewer.rigs.skinning import Skinning


def read_back(packer):
    return unpacked(packer.items, packer.text())


def test_arrays_are_rounded_to_steps():
    random = np.random.default_rng(3)
    first, second = random.normal(size=(50, 3)), random.normal(size=(7, 2)) * [1e-3, 1e4]
    packer = Packer()
    assert packer.add(first, 1e-3) == 0
    assert packer.add_file(b"\x89PNG", "image/png") == 1
    assert packer.add(second, [1e-6, 1.0]) == 2
    rounded, none, scaled = read_back(packer)
    assert_allclose(rounded, first, rtol=0, atol=0.5001e-3)
    assert none.size == 0
    assert (np.abs(scaled - second).max(axis=0) <= [0.5001e-6, 0.5001]).all()


def test_equal_arrays_and_files_are_stored_once():
    packer, rows = Packer(), np.random.default_rng(4).normal(size=(40, 3))
    found = [packer.add(rows, 1e-3), packer.add_file(b"\x89PNG", "image/png")]
    size = len(packer.text())
    assert [packer.add(rows + 0.0, 1e-3), packer.add_file(b"\x89PNG", "image/png")] == found
    assert len(packer.text()) == size
    other = [packer.add(rows, 2e-3), packer.add(rows.reshape(20, 6), 1e-3)]
    other.append(packer.add_file(b"\x89PNG", "image/jpeg"))
    assert other == [2, 3, 4]
    first, _, coarse, wide, _ = read_back(packer)
    assert_array_equal(wide.shape, (20, 6))
    assert not np.array_equal(first, coarse)


@pytest.mark.parametrize("values", [[], [0], [-1], [2**29, -(2**29), 0], [5] * 9, range(-4, 300)])
def test_integers_are_exact(values):
    packer = Packer()
    packer.add(values)
    assert_array_equal(read_back(packer)[0].reshape(-1), np.array([*values], dtype=float))


def test_smooth_tracks_need_few_bytes():
    """The second differences of a parabola are constant: 1000 rows take hardly any space."""
    packer = Packer()
    packer.add(np.arange(1000.0)[:, None] ** 2 * [1.0, -3.0])
    assert packer.items[0]["order"] == 2 and len(packer.text()) < 100


def grid(rows, columns):
    """Triangles of a grid of vertices, numbered row by row, and the places (V, 2) of these."""
    places = np.stack(np.divmod(np.arange(rows * columns), columns), axis=1)
    first = np.arange(rows * columns).reshape(rows, columns)[:-1, :-1].reshape(-1, 1)
    squares = first + np.array([[0, 1, columns + 1, columns]])
    return np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]), places


def test_vertices_are_predicted_from_triangles_before_them():
    """Two squares beside each other::

    3 - 4 - 5        triangles 0 1 4, 0 4 3, 1 2 5, 1 5 4
    | / | / |
    0 - 1 - 2
    """
    near = earlier_corners(np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]), 7)
    assert near[5].tolist() == [1, 4, 0]
    # The others have the last neighbour before them, or the vertex before.
    assert near[[0, 1, 2, 3, 4, 6]].tolist() == [[each] * 3 for each in (0, 0, 1, 0, 3, 5)]
    # 3 and 2 are opposite corners of the edge 0 1.
    assert earlier_corners(np.array([[0, 1, 2], [1, 0, 3]]), 4)[3].tolist() == [0, 1, 2]


@pytest.mark.parametrize("seed", range(5))
def test_predictions_use_vertices_before_only(seed):
    random = np.random.default_rng(seed)
    triangles = random.integers(0, 30, size=(200, 3))  # also degenerate ones, and edges of many
    near = earlier_corners(triangles, 33)
    assert (near[1:] < np.arange(1, 33)[:, None]).all() and (near >= 0).all()


def test_smooth_values_of_a_mesh_need_fewer_bytes_and_stay_exact():
    triangles, places = grid(300, 4)
    waves = np.sin(places @ np.random.default_rng(1).normal(size=(2, 60)) * 0.2)
    packers = Packer(), Packer()
    packers[0].add(waves, 1e-3)
    packers[1].add(waves, 1e-3, earlier_corners(triangles, len(places)))
    assert "near" in packers[1].items[-1]
    plain, meshed = read_back(packers[0])[0], read_back(packers[1])[-1]
    assert_array_equal(meshed, plain)
    assert len(packers[1].text()) < 0.9 * len(packers[0].text())
    # Where it saves nothing, nothing is added.
    packer, noise = Packer(), np.random.default_rng(2).normal(size=waves.shape)
    packer.add(noise, 1e-3, earlier_corners(triangles, len(places)))
    assert len(packer.items) == 1


def test_numbers_far_from_the_origin_keep_their_step():
    packer = Packer()
    values = 1e9 + np.array([[0.0], [0.25], [3.5]])
    packer.add(values, 0.25)
    assert_array_equal(read_back(packer)[0], values)


def test_steps_grow_where_integers_would_not_suffice():
    packer = Packer()
    packer.add([[0.0], [1e12]], 1e-3)
    assert_allclose(read_back(packer)[0], [[0.0], [1e12]], atol=1e12 / 2**30)


def test_fields_reproduce_a_motion_of_three_directions():
    """The weights of 40 shapes move along 3 directions only, so 3 fields suffice."""
    random = np.random.default_rng(5)
    shapes = random.normal(size=(40, 30, 3))
    weights = random.normal(size=(25, 3)) @ random.normal(size=(3, 40)) + random.normal(size=40)
    found = principal_fields(weights, lambda row: np.einsum("s,sva->va", row, shapes), 1e-9)
    assert len(found.fields) == 3 and np.abs(found.weights).max() <= 1.0 + 1e-12
    wanted = np.einsum("fs,sva->fva", weights, shapes)
    again = found.mean + np.einsum("fk,kva->fva", found.weights, found.fields)
    assert_allclose(again, wanted, atol=2e-9)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-6])
def test_fields_keep_their_tolerance(tolerance):
    random = np.random.default_rng(6)
    shapes = random.normal(size=(12, 50, 3)) * 0.5 ** np.arange(12)[:, None, None]
    weights = random.normal(size=(60, 12))
    found = principal_fields(weights, lambda row: np.einsum("s,sva->va", row, shapes), tolerance)
    wanted = np.einsum("fs,sva->fva", weights, shapes)
    again = found.mean + np.einsum("fk,kva->fva", found.weights, found.fields)
    assert np.linalg.norm(again - wanted, axis=-1).max() <= 1.000001 * tolerance


def test_a_still_pose_needs_no_field():
    shapes = np.random.default_rng(7).normal(size=(4, 10, 3))
    weights = np.array([[0.5, -1.0, 0.0, 2.0]])
    found = principal_fields(weights, lambda row: np.einsum("s,sva->va", row, shapes), 1e-9)
    assert len(found.fields) == 0
    assert_allclose(found.mean, np.einsum("s,sva->va", weights[0], shapes), atol=1e-12)


def test_many_needed_correctives_are_those_of_the_model():
    """Each corrective moves one vertex, so its own field is nearly all zeros."""
    figure = moved_vertex_by_vertex()
    poses = [random_pose(figure.skeleton, np.random.default_rng(seed)) for seed in range(40)]
    surface = tracks_of(figure, poses, Skinning()).surface
    found = surface.correctives
    assert_array_equal(np.count_nonzero(found.fields.any(axis=2), axis=1), 1)
    skeleton = figure.skeleton
    weights = np.stack([pose_weights(figure.correctives, skeleton, pose) for pose in poses])
    wanted = np.einsum("fp,pva->fva", weights, figure.correctives.offsets)
    again = found.mean + np.einsum("fk,kva->fva", found.weights, found.fields)
    assert_allclose(again, wanted, atol=1e-12)


def moved_vertex_by_vertex():
    random = np.random.default_rng(11)
    figure = random_figure(random, 4, n_vertices=60)
    offsets = np.zeros((27, figure.mesh.n_vertices, 3))
    offsets[np.arange(27), np.arange(27)] = random.normal(size=(27, 3))
    return replace(figure, correctives=Correctives(offsets))


@pytest.mark.parametrize("sizes", [1.0, (0.01, 1.0)], ids=["even", "uneven"])
def test_sums_of_rounded_fields_are_as_exact_as_asked_but_not_much_more(sizes):
    random, error = np.random.default_rng(8), 1e-4
    low, high = np.broadcast_to(sizes, 2)
    weights = random.uniform(-1.0, 1.0, (50, 40)) * np.geomspace(low, high, 40)
    fields, packer, motion = random.normal(size=(40, 600, 3)), Packer(), {}
    near = earlier_corners(np.zeros((0, 3), np.int32), fields.shape[1])
    _pack_fields(("weights", "fields"), weights, fields, near, error, packer, motion)
    rows = unpacked(packer.items, packer.text())[motion["fields"]].reshape(600, 40, 3)
    apart = np.abs(np.einsum("fk,vka->fva", weights, rows - np.moveaxis(fields, 0, 1)))
    assert 0.5 * error < apart.max() < 1.1 * error
