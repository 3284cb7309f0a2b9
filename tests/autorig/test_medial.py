"""Routes through the middle of solids."""

import numpy as np
from scipy.spatial import ConvexHull

from viewer.autorig.medial import Paths
from viewer.autorig.solid import solid_of


def routes_in(solid, beside):
    """Return two routes of 13 voxels along x from the same one, beside each other for some."""
    start = solid.voxels[:, 0].min() + np.arange(13)
    apart = np.where(np.arange(13) <= beside, 1, 3) * (np.arange(13) > 0)
    return [solid.numbers[start, 6 + side, 4] for side in (0 * apart, apart)]


def test_routes_beside_each_other_are_one_up_to_where_they_part():
    corners = np.array(np.meshgrid([0.0, 16.0], [0.0, 9.0], [0.0, 5.0])).reshape(3, 8).T
    hull = ConvexHull(corners)
    a, b, c = np.moveaxis(corners[hull.simplices], 1, 0)
    outward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) > 0.0
    triangles = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
    solid = solid_of(corners, triangles.astype(np.int32), 16)
    paths = Paths(solid)
    # The solid is 5 thick: its radius is 2.5 in the middle, which both routes are in.
    assert paths.radii.max() == 2.5
    first, second = routes_in(solid, 8)
    thick = np.ones(len(solid.voxels), dtype=np.bool_)
    joined = paths.joined([first, second], thick)
    assert joined[0].tolist() == first.tolist()
    # Number 8 is the last one beside the other route; 3 before it, for the radius, they become one.
    assert joined[1].tolist() == [*first[:5], *second[5:]]
    assert paths.joined([first, second], ~thick)[1].tolist() == second.tolist()
    # Where limbs part, their routes are beside each other for that long: nothing changes.
    first, second = routes_in(solid, 2)
    assert paths.joined([first, second], thick)[1].tolist() == second.tolist()
