import numpy as np
import pytest
from faults import told
from scipy import sparse

from viewer.autorig.correspondence import MatchSettings, Template
from viewer.autorig.weights.weight_transfer import (
    WeightSettings,
    nearest_weights,
    transferred_weights,
)
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving
from viewer.rig.mesh import Mesh
from viewer.rig.skin import Skin, skin_from_entries, skin_from_lists

BIND = np.tile(np.eye(4), (3, 1, 1))


def tube(rings=13, sides=16, length=3.0):
    """Return an open tube of radius 0.5 along x that faces outwards."""
    rotations = np.linspace(0, 2 * np.pi, sides + 1)[:-1]
    x = np.repeat(np.linspace(0, length, rings), sides)
    around = np.tile(rotations, rings)
    positions = np.stack([x, 0.5 * np.cos(around), 0.5 * np.sin(around)], axis=1)
    index = np.arange(rings * sides).reshape(rings, sides)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    a, b, c, d = (part.ravel() for part in (a, b, c, d))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return positions, triangles.astype(np.int32)


def along(x):
    """Return weights of three joints that vary linearly along the tube."""
    return np.maximum(0.0, 1.0 - np.abs(x[:, None] / 1.5 - np.arange(3)))


def skin_of_rows(rows) -> Skin:
    vertices, joints = np.nonzero(rows)
    return skin_from_entries(len(rows), vertices, joints, rows[vertices, joints], BIND)


def dense(result, n_joints=3):
    shape = (len(result.starts) - 1, n_joints)
    return sparse.csr_array((result.weights, result.joints, result.starts), shape=shape).toarray()


def template():
    positions, triangles = tube()
    return Template(positions, triangles), skin_of_rows(along(positions[:, 0]))


def transfer(positions, triangles, settings=None):
    surface, skin = template()
    return transferred_weights(surface, skin, positions, triangles, settings or WeightSettings())


def test_tube_faces_outwards():
    positions, triangles = tube()
    normals = Template(positions, triangles).normals
    assert (normals[:, 1:] * positions[:, 1:]).sum(axis=1).min() > 0.0


def test_transfer_onto_itself_does_not_change_weights():
    positions, triangles = tube()
    result = transfer(positions, triangles)
    np.testing.assert_allclose(dense(result), along(positions[:, 0]), atol=1e-12)
    assert result.matched.all()
    assert not result.inpainted.any()
    assert told(result.lines) == [
        ("R005.matched", {"n": 208, "all": 208, "ratio": 1.0, "inpainted": 0})
    ]
    np.testing.assert_allclose(result.distances, 0.0, atol=1e-12)


def test_transfer_interpolates_weights_between_vertices():
    # The target has different rings; on the flat-sided tube, weights depend only on x.
    positions, triangles = tube(rings=29)
    result = transfer(positions, triangles)
    np.testing.assert_allclose(dense(result), along(positions[:, 0]), atol=1e-12)


def test_transfer_ignores_corners_with_zero_barycentric_weight():
    # The rings are rotated between the template's sides, so closest points are on edges up to
    # rounding.
    positions, triangles = tube()
    x = positions[:, 0].copy()
    half = np.pi / 16
    rotation = np.array([[np.cos(half), -np.sin(half)], [np.sin(half), np.cos(half)]])
    positions[:, 1:] = positions[:, 1:] @ rotation.T
    positions[:, 0] += 1e-9
    result = transfer(positions, triangles)
    assert result.matched.all()
    assert np.diff(result.starts).tolist() == (along(x) > 1e-6).sum(axis=1).tolist()
    np.testing.assert_allclose(dense(result), along(x), atol=1e-8)
    np.testing.assert_allclose(dense(result).sum(axis=1), 1.0, atol=1e-12)


def test_transfer_inpaints_vertices_away_from_the_template():
    positions, triangles = tube(rings=25)
    x = positions[:, 0]
    bump = np.abs(x - 0.75) < 0.2
    positions[bump, 1:] *= 2.5
    result = transfer(positions, triangles)
    assert result.inpainted.any()
    assert not result.inpainted[np.abs(x - 0.75) > 0.5].any()
    assert (result.matched | result.inpainted).all()
    found = dense(result)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-12)
    # The third joint has no weight this far; the weights of the others change across the bump.
    assert found[bump, 2].max() < 0.05
    order = [found[np.isclose(x, value), 0].mean() for value in np.unique(x[bump])]
    assert order == sorted(order, reverse=True)
    assert found[np.isclose(x, 0.75), :2] == pytest.approx(0.5, abs=0.05)


def test_transfer_keeps_seams_closed():
    positions, triangles = tube(rings=25)
    bump = np.abs(positions[:, 0] - 0.75) < 0.2
    positions[bump, 1:] *= 2.5
    whole = transfer(positions, triangles)
    # Every triangle has separate vertices.
    corners = triangles.ravel()
    split = transfer(positions[corners], np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    np.testing.assert_allclose(dense(split), dense(whole)[corners], atol=1e-9)
    assert split.inpainted.tolist() == whole.inpainted[corners].tolist()
    assert split.points.triangles.shape == corners.shape


def button(x):
    """Return a tetrahedron that hovers over the tube at x."""
    corners = 0.02 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return corners + np.array([x, 1.5, 0.0]), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def test_transfer_binds_unmatched_parts_to_the_point_closest_to_their_centre():
    positions, triangles = tube()
    corners, faces = button(1.2)
    result = transfer(
        np.concatenate([positions, corners]), np.concatenate([triangles, faces + len(positions)])
    )
    # At x = 1.2 joint 0 has 1 - 0.8 and joint 1 has 0.8.
    np.testing.assert_allclose(dense(result)[-4:], [[0.2, 0.8, 0.0]] * 4, atol=1e-12)
    assert not (result.matched | result.inpainted)[-4:].any()
    assert result.rigid.vertices.tolist() == [208]
    assert result.rigid.counts.tolist() == [4]
    assert result.rigid.joints.tolist() == [1]
    np.testing.assert_allclose(result.rigid.distances, 1.0, atol=1e-12)
    assert told(result.lines)[1] == ("R007.part", {"n": 4, "vertex": 208, "joint": 1})


def test_transfer_does_not_depend_on_unit_or_position():
    positions, triangles = tube(rings=25)
    bump = np.abs(positions[:, 0] - 0.75) < 0.2
    positions[bump, 1:] *= 2.5
    here = transfer(positions, triangles)
    source, faces = tube()
    turn = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    surface = Template(source @ turn.T * 100.0 + 40.0, faces)
    there = transferred_weights(
        surface,
        skin_of_rows(along(source[:, 0])),
        positions @ turn.T * 100.0 + 40.0,
        triangles,
        WeightSettings(),
    )
    # The tolerance is rounding of coordinates of order 100 in a system with condition number 1e6.
    np.testing.assert_allclose(dense(there), dense(here), atol=1e-7)


def test_transfer_can_smooth_and_prune():
    positions, triangles = tube(rings=25)
    bump = np.abs(positions[:, 0] - 0.75) < 0.2
    positions[bump, 1:] *= 2.5
    plain = transfer(positions, triangles)
    smooth = transfer(positions, triangles, WeightSettings(smoothing_rounds=10))
    difference = np.abs(dense(smooth) - dense(plain)).max(axis=1)
    assert difference.max() > 1e-3
    assert difference[positions[:, 0] > 2.5].max() == 0.0
    cut = transfer(positions, triangles, WeightSettings(max_influences=1))
    assert np.diff(cut.starts).max() == 1
    np.testing.assert_allclose(cut.weights, 1.0, atol=1e-12)


def test_transfer_reports_its_progress_and_can_be_cancelled():
    positions, triangles = tube(rings=25)
    positions[np.abs(positions[:, 0] - 0.75) < 0.2, 1:] *= 2.5
    fractions = []
    with receiving(lambda done, total, unit, what: fractions.append(done / total)):
        transfer(positions, triangles)
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)

    def stop(done, total, unit, what):
        if what == "factorising":
            raise Cancelled

    with pytest.raises(Cancelled), receiving(stop):
        transfer(positions, triangles)


def test_transfer_refuses_a_distant_target():
    positions, triangles = tube()
    with pytest.raises(RigError) as caught:
        transfer(positions + np.array([0.0, 100.0, 0.0]), triangles)
    # The target's box is 3 x 1 x 1; the median distance is about 100 minus a radius.
    assert str(caught.value).startswith(
        "no vertex of the target meets the template: expected a target aligned with it, "
        "found it at a median distance of 30"
    )


def test_transfer_refuses_a_target_without_size():
    with pytest.raises(RigError) as caught:
        transfer(np.ones((3, 3)), np.array([[0, 1, 2]]))
    assert str(caught.value) == ("target: expected a mesh with a size, found 3 coincident vertices")


def test_transfer_accepts_points_without_triangles():
    result = transfer(
        np.array([[0.0, 0.5, 0], [3, 0.5, 0], [1.5, 0, 0.5]]), np.zeros((0, 3), dtype=np.int32)
    )
    assert result.matched.all()
    np.testing.assert_allclose(dense(result), [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-12)


def test_transfer_reports_negative_template_weights():
    positions, triangles = tube()
    rows = along(positions[:, 0])
    rows[0] = 1.0, -0.5, 0.0
    result = transferred_weights(
        template()[0], skin_of_rows(rows), positions, triangles, WeightSettings()
    )
    assert told(result.lines)[0] == ("R005.negative-weights", {"n": 1})
    np.testing.assert_allclose(dense(result)[0], [1.0, 0.0, 0.0], atol=1e-12)


def test_result_is_converted_to_a_skin():
    positions, triangles = tube()
    skin = transfer(positions, triangles).skin(BIND)
    assert skin.n_vertices == len(positions)
    assert Mesh(positions, positions, triangles).n_vertices == skin.n_vertices


def test_nearest_weights_are_copied_rows():
    skin = skin_from_lists([[(0, 0.5), (1, 0.25)], [(2, 1.0)]], BIND)
    result = nearest_weights(
        np.array([[0.0, 0, 0], [1, 0, 0]]), skin, np.array([[0.9, 0, 0], [0.1, 0, 0], [0, 0, 5.0]])
    )
    assert result.starts.tolist() == [0, 1, 3, 5]
    assert result.joints.tolist() == [2, 0, 1, 0, 1]
    assert result.weights.tolist() == [1.0, 0.5, 0.25, 0.5, 0.25]
    # 5 % of the diagonal of a box of 0.9 x 0 x 5 is 0.254.
    assert result.matched.tolist() == [True, True, False]
    assert told(result.lines) == [("R005.nearest", {"n": 2, "all": 3})]
    assert result.points is None


def test_settings_refuse_invalid_values():
    with pytest.raises(RigError) as caught:
        WeightSettings(smoothing_rounds=-1)
    assert str(caught.value) == "smoothing: expected at least 0 iterations, found -1"
    with pytest.raises(RigError) as caught:
        WeightSettings(max_influences=0)
    assert str(caught.value) == "influences: expected at least 1, found 0"
    assert WeightSettings().match == MatchSettings()
