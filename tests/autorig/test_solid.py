import numpy as np
import pytest
from autorig.rigged_shapes import tube

from viewer.autorig.solid import solid_of
from viewer.autorig.transfer.joint_transfer import winding_numbers
from viewer.errors import RigError

# Sides of a box: two triangles each, counter-clockwise from outside; -x, +x, -y, +y, -z, +z.
SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                  [1, 5, 7, 3]])  # fmt: skip


def box(low, high, sides=range(6)):
    corners = np.array(list(np.ndindex(2, 2, 2))) * (np.array(high) - low) + low
    quads = SIDES[list(sides)]
    return corners, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def joined(*parts):
    starts = np.cumsum([0] + [len(positions) for positions, _ in parts])
    return (
        np.concatenate([positions for positions, _ in parts]),
        np.concatenate([start + part[1] for start, part in zip(starts, parts, strict=False)]),
    )


def volume(solid):
    return len(solid.voxels) * solid.spacing**3


@pytest.mark.parametrize("triangles", [1, -1])
def test_box_has_its_volume_and_distances_also_inside_out(triangles):
    positions, corners = box([1.0, 2, 3], [3, 3, 4])
    solid = solid_of(positions, corners[:, ::triangles], resolution=40)
    assert volume(solid) == pytest.approx(2.0, rel=1e-6)  # 40 x 20 x 20 voxels of 0.05
    middle = solid.voxel_of(np.array([2.0, 2.5, 3.5]))
    assert solid.inside[tuple(middle)]
    assert solid.distance[tuple(middle)] == pytest.approx(0.5, abs=0.026)  # half a voxel
    np.testing.assert_allclose(solid.centers(middle), [2.0, 2.5, 3.5], atol=0.026)


def test_box_with_some_triangles_inside_out_is_solid():
    positions, corners = box([1.0, 2, 3], [3, 3, 4])
    corners[:6] = corners[:6, ::-1]  # half of each side
    solid = solid_of(positions, corners, resolution=40)
    assert volume(solid) == pytest.approx(2.0, rel=1e-6)


def test_box_with_triangles_for_both_sides_is_solid():
    positions, corners = box([1.0, 2, 3], [3, 3, 4])
    solid = solid_of(positions, np.concatenate([corners, corners[:, ::-1]]), resolution=40)
    assert volume(solid) == pytest.approx(2.0, rel=1e-6)


def test_open_side_of_a_box_is_closed():
    solid = solid_of(*box([0.0, 0, 0], [1, 1, 1], sides=range(5)), resolution=20)
    assert volume(solid) == pytest.approx(1.0, rel=1e-6)


def crate(height, has_floor, turned=(0, 1, 2)):
    """Return walls of 0.1 around a square of 1, with a floor or without one."""
    walls = [box([0.0, 0, low], [1, height, low + 0.1]) for low in (0.0, 0.9)]
    walls += [box([low, 0.0, 0.1], [low + 0.1, height, 0.9]) for low in (0.0, 0.9)]
    positions, corners = joined(*walls, *[box([0.1, 0, 0.1], [0.9, 0.1, 0.9])] * has_floor)
    return positions[:, list(turned)], corners if turned == (0, 1, 2) else corners[:, ::-1]


@pytest.mark.parametrize("turned", [(0, 1, 2), (1, 0, 2), (0, 2, 1)])
def test_hollows_with_a_floor_and_deep_ones_are_filled_on_request(turned):
    for height, has_floor in ((0.3, True), (0.6, False), (1.0, True)):
        parts = crate(height, has_floor, turned)
        walls = height * (1.0 - 0.8**2) + 0.8**2 * 0.1 * has_floor
        assert volume(solid_of(*parts, resolution=40)) == pytest.approx(walls, rel=0.1)
        filled = solid_of(*parts, resolution=40, fills_hollows=True)
        assert volume(filled) == pytest.approx(height, rel=0.05)


def test_holes_of_frames_stay_open():
    # Wider than deep, 0.8 to 0.3, and without a floor, as the loop of a handle or a door.
    parts = crate(0.3, has_floor=False)
    open_one = solid_of(*parts, resolution=40, fills_hollows=True)
    assert volume(open_one) == pytest.approx(0.3 * (1.0 - 0.8**2), rel=0.1)


def test_solid_agrees_with_winding_numbers():
    positions, triangles = tube()
    solid = solid_of(positions, triangles, resolution=24)
    everywhere = np.array(list(np.ndindex(solid.inside.shape)), dtype=np.int32)
    numbers = winding_numbers(positions, triangles, solid.centers(everywhere))
    np.testing.assert_array_equal(numbers.reshape(solid.inside.shape) > 0.5, solid.inside)


def test_overlapping_and_near_parts_are_one_component():
    parts = joined(
        box([0.0, 0, 0], [1, 1, 1]), box([0.5, 0, 0], [2, 1, 1]), box([2.1, 0.0, 0], [3, 1, 1])
    )
    solid = solid_of(*parts, resolution=30)
    # Volumes 2 and 0.9, and a bridge of at most three voxels of 0.1.
    assert 2.9 <= volume(solid) + 1e-9 <= 2.904
    steps = solid.graph()
    from scipy.sparse import csgraph

    ends = solid.nearest(np.array([[0.05, 0.5, 0.5], [2.95, 0.5, 0.5]]))
    length = csgraph.dijkstra(steps, indices=[ends[0]])[0, ends[1]]
    assert 2.9 - 0.1 <= length < 4.0  # voxels are 0.1 wide; the bridge may be at a corner


def test_distant_parts_are_left_out():
    solid = solid_of(*joined(box([0.0, 0, 0], [1, 1, 1]), box([4.0, 0, 0], [4.5, 1, 1])), 45)
    assert volume(solid) == pytest.approx(1.0, rel=1e-6)


def test_sheet_thinner_than_a_voxel_is_kept():
    parts = joined(box([0.0, 0, 0], [1, 1, 1]), box([1.0, 0, 0.52], [3, 1, 0.521]))
    solid = solid_of(*parts, resolution=30)
    assert solid.inside[tuple(solid.voxel_of(np.array([2.9, 0.5, 0.52])))]


def test_flat_mesh_is_refused_where_nothing_is_enclosed():
    with pytest.raises(RigError, match="expected a mesh with an extent, found a point"):
        solid_of(np.zeros((3, 3)), np.array([[0, 1, 2]]))


@pytest.mark.parametrize("length", [1.0, 0.01])
def test_middle_is_halfway_through_the_first_part_that_a_ray_meets(length):
    # Two plates, 1 and 3 thick, with a gap from x = 1 to 4, joined above by a bridge.
    plates = box([0.0, 0, 0], [1, 4, 2]), box([4.0, 0, 0], [7, 4, 2])
    parts = joined(*plates, box([0.0, 4, 0], [7, 5, 2]))
    solid = solid_of(*parts, resolution=70)  # voxels of 0.1
    for origin, way, x in (
        ([-9.0, 1, 1], [1.0, 0, 0], 0.5),
        ([20.0, 1, 1], [-1.0, 0, 0], 5.5),
        ([-9.0, 4.5, 1], [1.0, 0, 0], 3.5),
    ):
        found = solid.middle(np.array(origin), length * np.array(way))
        np.testing.assert_allclose(found, [x, origin[1], 1.0], atol=0.06)  # half a voxel
    assert solid.middle(np.array([-9.0, 1, 1]), np.array([-1.0, 0, 0])) is None  # behind
    assert solid.middle(np.array([-9.0, 1, 9]), np.array([1.0, 0, 0])) is None
