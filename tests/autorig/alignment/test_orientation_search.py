"""Candidate orientations and the selection of the best."""

import numpy as np
import pytest
from autorig.rigged_shapes import tube, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.icp import Cloud
from viewer.autorig.alignment.orientation_search import (
    axis_direction,
    axis_rotations,
    in_place,
    search,
    unit_scale,
)
from viewer.errors import RigError
from viewer.progress import receiving
from viewer.rigs.geometry.samples import sample_surface


def cloud(positions, triangles):
    return Cloud(
        sample_surface(positions, triangles, 600), sample_surface(positions, triangles, 4000)
    )


def test_cube_has_24_rotations_starting_with_the_identity():
    rotations = axis_rotations("y")
    assert len(rotations) == 24 == len({turn.tobytes() for turn in rotations})
    assert_allclose(rotations[0], np.eye(3))
    assert all(np.linalg.det(turn) == pytest.approx(1.0) for turn in rotations)


def test_known_axes_reduce_the_number_of_rotations():
    four = axis_rotations("y", up="z")
    assert len(four) == 4
    assert all((turn @ [0, 1, 0] == [0, 0, 1]).all() for turn in four)
    # If up and forward are known, y maps to z and z to -y, so x is unchanged.
    (one,) = axis_rotations("y", up="z", facing="-y")
    assert_allclose(one, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    # Figures with z up are assumed to face +x.
    (one,) = axis_rotations("z", up="y", facing="z")
    assert_allclose(one @ [1, 0, 0], [0, 0, 1])


def test_contradictory_axes_are_refused():
    with pytest.raises(RigError) as problem:
        axis_rotations("y", up="z", facing="-z")
    assert str(problem.value) == "expected a facing perpendicular to the up axis z, found -z"
    with pytest.raises(RigError) as problem:
        axis_rotations("y", up="w")
    assert str(problem.value) == 'expected an axis, one of x, y, z, -x, -y, -z, found "w"'


def test_axis_direction_has_a_sign():
    assert axis_direction("-z").tolist() == [0.0, 0.0, -1.0]


@pytest.mark.parametrize(
    ("ratio", "scale"),
    [(0.9, 1.0), (1.2, 1.2), (110.0, 100.0), (0.0011, 0.001), (40.0, 39.37), (0.025, 1 / 39.37)],
)
def test_ratios_near_a_unit_are_rounded_to_that_unit(ratio, scale):
    assert unit_scale(ratio) == pytest.approx(scale)


def test_mesh_with_a_different_unit_and_up_axis_is_aligned():
    positions, triangles = tube()
    quarter = turn([1, 0, 0], np.pi / 2)
    other = cloud(1000.0 * positions @ quarter.T, triangles)
    found = in_place(cloud(positions, triangles), other, axis_rotations("y"), scaled=True)
    assert found.similarity.scale == 1000.0 and found.error < 0.01
    assert_allclose(found.similarity.rotation, quarter, atol=1e-15)


def test_mesh_is_not_rotated_for_a_marginally_better_fit():
    positions, triangles = tube()
    rotated = positions * [-1.0, 1.0, -1.0]
    between = 0.46 * positions + 0.54 * rotated  # from behind it is slightly closer
    template, target = cloud(positions, triangles), cloud(between, triangles)
    found = in_place(template, target, axis_rotations("y"), scaled=False)
    assert (found.similarity.rotation == np.eye(3)).all()
    found = in_place(template, cloud(rotated, triangles), axis_rotations("y"), scaled=False)
    assert (found.similarity.rotation == np.diag([-1.0, 1.0, -1.0])).all()


@pytest.mark.slow
def test_search_finds_a_rotated_scaled_and_moved_mesh():
    positions, triangles = tube()
    rotation = turn([0.2, 1, 0.1], 2.2)
    other = cloud(7.0 * positions @ rotation.T + [3.0, 4.0, 5.0], triangles)
    fractions = []
    with receiving(lambda done, total, unit, what: fractions.append(done / total)):
        found = search(cloud(positions, triangles), other, axis_rotations("y"), None)
    assert_allclose(found.similarity.rotation, rotation, atol=0.02)
    assert found.similarity.scale == pytest.approx(7.0, rel=0.02)
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
