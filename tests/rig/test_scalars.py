"""Scalar views: lengths per vertex, each worked out by hand on a few points."""

from dataclasses import replace

import numpy as np
import pytest
from hand_made import mesh, skeleton
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rig.blendshapes import Correctives
from viewer.rig.figure import Figure
from viewer.rig.pose import rest_pose
from viewer.rig.scalars import SCALARS, compute, length_unit, strongest
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import Skinning

POINTS = [[0.0, 3, 4], [0.0, 3, 4], [1.0, 1, 1]]


def sliding(influences, **parts) -> Figure:
    """Return three points bound to six joints that slide along x and turn about x."""
    dofs = [(joint, kind, 0.0) for joint in range(6) for kind in ("tx", "x")]
    bones = skeleton([-1] * 6, dofs)
    skin = skin_from_lists(influences, np.tile(np.eye(4), (6, 1, 1)))
    return Figure("points", mesh(POINTS), bones, skin, **parts)


def slid(figure, *moves):
    pose = rest_pose(figure.skeleton)
    pose.dofs[::2][: len(moves)] = moves
    return pose


def test_cut_is_the_distance_to_four_influences():
    # Six equal sixths; the last two joints move by 6: one unit each is lost.
    sixths = [(joint, 1 / 6) for joint in range(6)]
    figure = sliding([sixths, [(5, 1.0)], []])
    found = compute("cut", figure, slid(figure, 0, 0, 0, 0, 6, 6), Skinning())
    assert_allclose(found, [2.0, 0, 0], atol=1e-14)


def test_cut_follows_the_chosen_number_of_influences():
    figure = sliding([[(0, 0.5), (1, 0.25), (2, 0.25)], [(0, 1.0)], []])
    pose = slid(figure, 4, 0, 0)
    # With one influence 4 instead of 2; with two 4 * 2/3; with three nothing is cut.
    for count, expected in ((1, 2.0), (2, 4 * 2 / 3 - 2), (3, 0.0)):
        found = compute("cut", figure, pose, Skinning(max_influences=count))
        assert_allclose(found, [expected, 0, 0], atol=1e-14)


def test_normalized_is_what_the_sum_of_the_weights_takes_away():
    # 0.9 of a vertex 5 from the origin: half a unit. 0.5 of (1, 1, 1) is half its length.
    figure = sliding([[(0, 0.9)], [(0, 0.5), (1, 0.5)], [(0, 0.5)]])
    for how in (Skinning(), Skinning(normalize=True), Skinning(max_influences=4)):
        found = compute("normalized", figure, slid(figure), how)
        assert_allclose(found, [0.5, 0, np.sqrt(3) / 2], atol=1e-14)


def test_methods_is_what_linear_blending_loses_in_a_twist():
    figure = sliding([[(0, 0.5), (1, 0.5)], [(0, 1.0)], [(1, 1.0)]])
    pose = rest_pose(figure.skeleton)
    pose.dofs[3] = np.pi / 2  # joint 1 about x
    # Radius 5 against 5 cos 45.
    expected = [5.0 * (1.0 - np.sqrt(0.5)), 0, 0]
    for method in ("lbs", "dqs", "mix"):
        found = compute("methods", figure, pose, Skinning(method))
        assert_allclose(found, expected, atol=1e-14)


def test_correctives_is_how_far_they_move_a_vertex():
    offsets = np.zeros((45, 3, 3))
    offsets[4, 0] = 3.0, 0.0, 4.0  # joint 1, middle of the second row: cos x - 1
    ties = [[(0, 1.0)]] * 3
    figure = sliding(ties, correctives=Correctives(offsets))
    pose = rest_pose(figure.skeleton)
    pose.dofs[3] = np.pi
    for on in (True, False):
        found = compute("correctives", figure, pose, Skinning(correctives=on))
        assert_allclose(found, [10.0, 0, 0], atol=1e-14)
    assert compute("correctives", sliding(ties), pose, Skinning()).tolist() == [0, 0, 0]


def test_asymmetry_of_a_posed_figure():
    points = [[2.0, 0, 0], [-2.0, 0, 0], [0.0, 1, 0]]
    figure = sliding([[(0, 1.0)], [(1, 1.0)], [(2, 1.0)]], symmetry=np.array([1, 0, 2]))
    figure = replace(figure, mesh=mesh(points))
    assert compute("asymmetry", figure, slid(figure), Skinning()).tolist() == [0, 0, 0]
    # Both sides outwards by one is symmetric, one side alone is not; the middle counts twice.
    assert compute("asymmetry", figure, slid(figure, 1, -1), Skinning()).tolist() == [0, 0, 0]
    assert compute("asymmetry", figure, slid(figure, 1, 0, 0.5), Skinning()).tolist() == [1, 1, 1]


def test_asymmetry_is_not_that_of_the_place_but_of_the_figure():
    points = [[2.0, 0, 0], [-1.0, 0, 0], [0.0, 1, 0]]
    figure = sliding([[(0, 1.0)]] * 3, symmetry=np.array([1, 0, 2]))
    figure = replace(figure, mesh=mesh(points))
    pose = slid(figure)
    pose.figure_scale, pose.figure_translation[:] = 2.0, (7, 8, 9)
    assert_allclose(compute("asymmetry", figure, pose, Skinning()), [2, 2, 0], atol=1e-14)


def test_asymmetry_without_a_map_is_nothing():
    figure = sliding([[(0, 1.0)]] * 3)
    assert compute("asymmetry", figure, slid(figure, 1), Skinning()).tolist() == [0, 0, 0]


@pytest.mark.parametrize("name", SCALARS)
def test_mesh_in_its_binding_space_shows_nothing(name):
    figure = sliding([[(0, 0.5), (1, 0.2)]] * 3)
    assert compute(name, figure, None, Skinning()).tolist() == [0, 0, 0]
    bare = Figure("bare", mesh(POINTS), figure.skeleton)
    assert compute(name, bare, slid(figure, 5), Skinning()).tolist() == [0, 0, 0]


def test_unknown_view_is_refused():
    with pytest.raises(RigError) as caught:
        compute("magic", sliding([[]] * 3), None, Skinning())
    assert str(caught.value) == f'no scalar view "magic"; there are: {", ".join(SCALARS)}'


def test_colours_begin_at_zero_and_never_have_no_range():
    shown = SCALARS["cut"].shown
    assert shown(0.25, 2.0) == (0.0, 2.0)
    assert shown(0.0, 0.0) == (0.0, 1.0)


def test_small_lengths_are_millimetres_or_a_share_of_the_size():
    figure = sliding([[]] * 3, unit="m")
    assert length_unit(figure) == (1000.0, "mm")
    # Box of 1 x 2 x 3: a diagonal of sqrt 14.
    factor, word = length_unit(replace(figure, unit=""))
    assert word == "% of the size"
    assert factor == pytest.approx(100.0 / np.sqrt(14.0))
    assert length_unit(Figure("bones", skeleton=figure.skeleton)) == (1.0, "units")


def test_strongest_is_the_largest_number_of_influences():
    assert strongest(sliding([[], [(0, 0.5)] * 3, [(1, 1.0)]])) == 3
    assert strongest(sliding([[]] * 3)) == 0
    assert strongest(Figure("bare", mesh(POINTS))) == 0
