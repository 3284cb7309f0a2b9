import numpy as np
import pytest
from faults import told
from scipy import sparse
from scipy.sparse import linalg as linear

from viewer.autorig.correspondence import Matches, MatchSettings, Template
from viewer.autorig.surface.laplacian import laplacian
from viewer.autorig.surface.welding import weld
from viewer.autorig.weights.result import RigidIslands, match_lines, nothing_matched, rigid_lines
from viewer.autorig.weights.weight_transfer import (
    WeightSettings,
    inpaint,
    nearest_weights,
    put_rows,
    scaled_rows,
    skin_of,
    smooth,
    transferred_weights,
    weight_matrix,
    within,
)
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving
from viewer.rigs.geometry.closest_point import SurfacePoints
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import Skin, skin_from_entries, skin_from_lists

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
        if what == "preparing to inpaint":
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


def wavy_grid(count=9):
    """Return a curved grid of count x count vertices."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count))
    positions = np.stack([x.ravel(), y.ravel(), 0.1 * np.sin(5 * x * y).ravel()], axis=1)
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return weld(positions, triangles.astype(np.int32))


def problem(rng):
    """Return the operators of a grid, weights of three of five joints, and the unknown vertices."""
    mesh = wavy_grid()
    operator, areas = laplacian(mesh)
    count = len(areas)
    weights = np.zeros((count, 5))
    weights[:, [0, 2, 3]] = rng.dirichlet([1, 1, 1], count)
    unknown = np.zeros(count, dtype=bool)
    unknown[30:52] = True
    weights[unknown] = 99.0  # these must not be read
    return operator, areas, weights, unknown


def minimiser(energy, weights, unknown):
    """Minimise trace(W^T Q W) with fixed known rows, as one dense system with multipliers."""
    count, known = len(weights), np.nonzero(~unknown)[0]
    hold = np.zeros((len(known), count))
    hold[np.arange(len(known)), known] = 1.0
    system = np.block([[energy, hold.T], [hold, np.zeros((len(known), len(known)))]])
    right = np.concatenate([np.zeros((count, weights.shape[1])), weights[known]])
    found = np.linalg.solve(system, right)[:count][unknown]
    found = np.maximum(found, 0.0)
    return found / found.sum(axis=1, keepdims=True)


def smooth_energy(operator, areas):
    dense = operator.toarray()
    return dense + dense @ np.diag(1.0 / areas) @ dense


def run(operator, areas, weights, unknown):
    return inpaint(operator, areas, sparse.csr_array(weights), ~unknown, unknown)


def test_inpainting_minimises_the_energy():
    operator, areas, weights, unknown = problem(np.random.default_rng(1))
    found, method = run(operator, areas, weights, unknown)
    assert method == "direct"
    expected = minimiser(smooth_energy(operator, areas), weights, unknown)
    # Solved weights below 1e-6 are set to 0.
    np.testing.assert_allclose(found.toarray(), expected, atol=3e-6)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-12)
    assert found.data.min() > 0.0
    assert set(found.indices) == {0, 2, 3}


def test_inpainting_with_one_joint_returns_that_joint():
    operator, areas, weights, unknown = problem(np.random.default_rng(2))
    weights[:] = [0, 1, 0, 0, 0]
    found, _ = run(operator, areas, weights, unknown)
    np.testing.assert_allclose(found.toarray(), weights[unknown], atol=1e-12)
    assert found.nnz == unknown.sum()


def test_inpainting_without_unknown_vertices_returns_no_rows():
    operator, areas, weights, unknown = problem(np.random.default_rng(2))
    found, _ = run(operator, areas, weights, np.zeros_like(unknown))
    assert found.shape == (0, 5)


def test_inpainting_skips_vertices_that_are_neither_known_nor_requested():
    operator, areas, weights, unknown = problem(np.random.default_rng(3))
    far = sparse.csr_array(sparse.block_diag([operator, sparse.csr_array((2, 2))]))
    weights = np.concatenate([weights, np.full((2, 5), 7.0)])
    matched = np.concatenate([~unknown, [False, False]])
    wanted = np.concatenate([unknown, [False, False]])
    found, _ = inpaint(
        far, np.concatenate([areas, [1.0, 1.0]]), sparse.csr_array(weights), matched, wanted
    )
    expected, _ = run(operator, areas, weights[:-2], unknown)
    np.testing.assert_allclose(found.toarray(), expected.toarray(), atol=1e-12)


def failing(times):
    """Return a factorisation that fails a given number of times before succeeding."""
    real, calls = linear.splu, []

    def splu(*arguments, **options):
        calls.append(1)
        if len(calls) <= times:
            raise RuntimeError("Factor is exactly singular")
        return real(*arguments, **options)

    return splu


@pytest.mark.parametrize(("times", "method"), [(1, "shifted"), (2, "conjugate gradients")])
def test_inpainting_falls_back_when_the_factorisation_fails(monkeypatch, times, method):
    monkeypatch.setattr("scipy.sparse.linalg.splu", failing(times))
    operator, areas, weights, unknown = problem(np.random.default_rng(4))
    found, used = run(operator, areas, weights, unknown)
    assert used == method
    expected = minimiser(smooth_energy(operator, areas), weights, unknown)
    np.testing.assert_allclose(found.toarray(), expected, atol=1e-5)


@pytest.mark.parametrize(
    ("times", "method"), [(2, "harmonic"), (9, "harmonic, conjugate gradients")]
)
def test_inpainting_falls_back_to_harmonic_weights(monkeypatch, times, method):
    monkeypatch.setattr("scipy.sparse.linalg.splu", failing(times))
    operator, areas, weights, unknown = problem(np.random.default_rng(5))
    areas = areas.copy()
    # With areas this uneven, the conjugate gradients of the smooth energy do not converge.
    areas[unknown] *= np.logspace(-16, 0, unknown.sum())
    found, used = run(operator, areas, weights, unknown)
    assert used == method
    expected = minimiser(operator.toarray(), weights, unknown)
    np.testing.assert_allclose(found.toarray(), expected, atol=3e-6)


def test_inpainting_reports_when_every_fallback_fails(monkeypatch):
    operator, areas, weights, unknown = problem(np.random.default_rng(6))
    # The vertex is disconnected from all known vertices.
    inside, outside = np.nonzero(unknown)[0], np.nonzero(~unknown)[0]
    dense = operator.toarray()
    dense[np.ix_(inside, outside)] = 0.0
    dense[np.ix_(outside, inside)] = 0.0
    with pytest.raises(RigError) as caught:
        run(sparse.csr_array(dense), areas, weights, unknown)
    assert str(caught.value) == (
        "the weights of unmatched vertices could not be computed: the mesh is too irregular; try "
        "--method nearest"
    )


def test_inpainting_can_be_cancelled():
    operator, areas, weights, unknown = problem(np.random.default_rng(7))

    def stop(done, total, unit, what):
        raise Cancelled

    with pytest.raises(Cancelled), receiving(stop):
        run(operator, areas, weights, unknown)


def test_inpainting_solves_in_blocks_of_joints(monkeypatch):
    operator, areas, weights, unknown = problem(np.random.default_rng(8))
    whole, _ = run(operator, areas, weights, unknown)
    monkeypatch.setattr("viewer.autorig.weights.weight_transfer._BLOCK", 1)
    seen = []
    with receiving(lambda *step: seen.append(step)):
        single, _ = run(operator, areas, weights, unknown)
    np.testing.assert_allclose(single.toarray(), whole.toarray(), atol=1e-12)
    assert [step[3] for step in seen] == ["preparing to inpaint"] + 3 * ["inpainting weights"]
    assert [step[:2] for step in seen] == [(0, 100), (0, 100), (33, 100), (67, 100)]


STRIP = np.array([[0, 1, 2], [2, 1, 3]])  # edges 01 02 12 13 23


def test_smoothing_adds_a_fifth_of_the_neighbour_mean():
    weights = sparse.csr_array(np.array([[1.0, 0], [0, 1], [0, 1], [0, 1]]))
    active = np.array([True, False, False, True])
    found = smooth(weights, STRIP, active, 1).toarray()
    np.testing.assert_allclose(found, [[0.8, 0.2], [0, 1], [0, 1], [0, 1]], atol=1e-12)
    found = smooth(weights, STRIP, active, 2).toarray()
    np.testing.assert_allclose(found[0], [0.64, 0.36], atol=1e-12)


def test_smoothing_reads_the_previous_iteration():
    weights = np.eye(4)
    mean = np.array([[0, 1, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 1, 0]])
    step = 0.8 * np.eye(4) + 0.2 * mean / mean.sum(axis=1, keepdims=True)
    found = smooth(sparse.csr_array(weights), STRIP, np.ones(4, dtype=bool), 3).toarray()
    np.testing.assert_allclose(found, np.linalg.matrix_power(step, 3), atol=1e-12)


def test_smoothing_skips_isolated_vertices_and_drops_tiny_weights():
    weights = sparse.csr_array(np.array([[1.0, 0], [1, 0], [1, 0], [1 - 1e-8, 1e-8], [0.5, 0.5]]))
    active = np.array([True, True, False, False, True])
    found = smooth(weights, STRIP, active).toarray()
    assert found[2:].tolist() == weights.toarray()[2:].tolist()
    # The tiny weight spreads to vertex 1, where it is dropped.
    np.testing.assert_allclose(found[:2], [[1.0, 0.0], [1.0, 0.0]], atol=0.0)


def test_smoothing_keeps_sums():
    rng = np.random.default_rng(1)
    rows = rng.dirichlet([1, 1, 1], 4) * np.array([[1.0], [1], [1], [1]])
    found = smooth(sparse.csr_array(rows), STRIP, np.ones(4, dtype=bool))
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-12)


def test_within_follows_edges():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [3, 0, 0], [0, 0, 0.1]])
    sources = np.array([True, False, False, False, False])
    assert within(positions, STRIP, sources, 0.9).tolist() == [1, 0, 0, 0, 0]
    assert within(positions, STRIP, sources, 1.0).tolist() == [1, 1, 0, 0, 0]
    assert within(positions, STRIP, sources, 1.5).tolist() == [1, 1, 1, 0, 0]
    # Vertex 4 is near but not connected by an edge.
    assert within(positions, STRIP, sources, 9.0).tolist() == [1, 1, 1, 1, 0]


def test_within_without_sources_is_empty():
    positions = np.zeros((4, 3))
    assert not within(positions, STRIP, np.zeros(4, dtype=bool), 1.0).any()


ALL = np.array([[0, 1, 2]])


def test_weight_matrix_sums_and_normalises_weights():
    skin = skin_from_lists([[(0, 0.5), (2, 1.0), (0, 0.5)], [(1, 4.0)], [(1, 1), (2, 0)]], BIND)
    matrix = weight_matrix(skin, ALL)
    assert matrix.toarray().tolist() == [[0.5, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    assert matrix.nnz == 4


def test_weight_matrix_ignores_negative_weights():
    skin = skin_from_lists([[(0, 1.0), (1, -0.25)], [(1, 1.0)], [(1, 1.0)]], BIND)
    assert weight_matrix(skin, ALL).toarray()[0].tolist() == [1.0, 0.0, 0.0]


def test_weight_matrix_requires_weights_only_for_used_vertices():
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], []], BIND)
    assert weight_matrix(skin, ALL).toarray()[3].tolist() == [0.0, 0.0, 0.0]


def test_weight_matrix_reports_the_first_vertex_without_weights():
    skin = skin_from_lists([[(0, 1.0)], [(1, 0.0)], []], BIND)
    with pytest.raises(RigError) as caught:
        weight_matrix(skin, ALL)
    assert str(caught.value) == (
        "template: expected weights for every vertex, found none for 2 of 3, the first is vertex 1"
    )


def test_weight_matrix_refuses_a_skin_of_a_different_mesh():
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)]], BIND)
    with pytest.raises(RigError) as caught:
        weight_matrix(skin, ALL)
    assert str(caught.value) == "template: expected weights for 3 vertices, found 2"


def test_skin_of_is_the_inverse_of_weight_matrix():
    rows = sparse.csr_array(np.array([[0.25, 0, 0.75], [0, 1, 0], [0.5, 0.25, 0.25]]))
    skin = skin_of(rows, BIND)
    assert skin.starts.tolist() == [0, 2, 3, 6]
    assert weight_matrix(skin, ALL).toarray().tolist() == rows.toarray().tolist()


def test_skin_of_keeps_the_strongest_weights_if_requested():
    rows = sparse.csr_array(np.array([[0.25, 0, 0.75], [0, 1, 0], [0.5, 0.125, 0.375]]))
    skin = skin_of(rows, BIND, 1)
    assert skin.joints.tolist() == [2, 1, 0]
    assert skin.weights.tolist() == [1.0, 1.0, 1.0]


def test_scaled_rows_empties_rows_with_factor_zero():
    found = scaled_rows(sparse.csr_array(np.array([[1.0, 2.0], [3.0, 4.0]])), np.array([0.0, 2.0]))
    assert found.toarray().tolist() == [[0.0, 0.0], [6.0, 8.0]]
    assert found.nnz == 2


def test_put_rows_replaces_rows():
    rows = sparse.csr_array(np.array([[1.0, 0], [0, 1], [0.5, 0.5]]))
    values = sparse.csr_array(np.array([[0.25, 0.75], [0, 1]]))
    found = put_rows(rows, np.array([2, 0]), values)
    assert found.toarray().tolist() == [[0, 1], [0, 1], [0.25, 0.75]]


def matches(matched, inside_out=()):
    count = len(matched)
    points = SurfacePoints(
        np.zeros(count, int),
        np.tile([1.0, 0, 0], (count, 1)),
        np.zeros((count, 3)),
        np.zeros(count),
    )
    return Matches(points, np.array(matched), np.zeros(count), np.array(inside_out, dtype=np.int32))


def test_match_report_counts_vertices():
    found = matches([True, True, True, False])
    assert told(match_lines(found, ~found.matched, "direct")) == [
        ("R005.matched", {"n": 3, "all": 4, "ratio": 0.75, "inpainted": 1})
    ]


def test_match_report_mentions_exceptions():
    found = matches([True, *[False] * 7], [0, 2])
    lines = [*match_lines(found, ~found.matched, "harmonic")]
    assert told(lines) == [
        ("R005.matched", {"n": 1, "all": 8, "ratio": 0.125, "inpainted": 7}),
        ("R006.matched", {"limit": 0.2}),
        ("R005.reversed", {"n": 2}),
        ("R005.solver", {"method": "harmonic"}),
    ]
    assert [line.severity for line in lines] == ["note", "warning", "note", "note"]
    assert lines[1].labelled == (
        "warning: less than 20% of the target matches the template: check the "
        "alignment or allow a larger distance"
    )


def test_match_report_uses_the_singular_for_one_part():
    found = matches([True, True], [0])
    _, line = match_lines(found, ~found.matched, "direct")
    assert str(line) == (
        "1 part of the target is wound opposite to the template: matched with reversed normals"
    )


def islands(counts):
    number = np.arange(len(counts), dtype=np.int32)
    return RigidIslands(10 * number, np.array(counts), number, np.zeros(len(counts)))


def test_rigid_part_report_lists_the_largest_first():
    assert told(rigid_lines(islands([1, 30]))) == [
        ("R007.part", {"n": 30, "vertex": 10, "joint": 1}),
        ("R007.part", {"n": 1, "vertex": 0, "joint": 0}),
    ]
    assert not [*rigid_lines(islands([]))]


def test_rigid_part_report_counts_unnamed_parts():
    lines = [*rigid_lines(islands([9, 8, 7, 6, 5, 4, 3]))]
    assert len(lines) == 6
    assert told(lines[-1:]) == [("R007.more-parts", {"n": 2})]
    assert told(rigid_lines(islands([9, 8, 7, 6, 5, 4])))[-1] == ("R007.more-parts", {"n": 1})


def test_no_match_reports_the_distance():
    assert nothing_matched(np.array([1.0, 3.0, 9.0]), 10.0) == (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        "it at a median distance of 30.0% of the target's size; use a template of the same kind "
        "(--from), or --auto, which needs none"
    )


def fork(gap):
    """Return a flat U of two strips, 1 wide and 10 long, joined at the top; and its strips (V,)."""
    x = np.concatenate([np.linspace(0.0, 1.0, 5), np.linspace(1.0 + gap, 2.0 + gap, 5)])
    y = np.linspace(0.0, 10.0, 41)
    positions = np.stack([*np.meshgrid(x, y), np.zeros((41, 10))], axis=2).reshape(-1, 3)
    index = np.arange(410).reshape(41, 10)
    a, b, c, d = (part for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    # Between the strips, only the uppermost row of squares is there.
    there = np.ones((40, 9), dtype=bool)
    there[:-1, 4] = False
    squares = np.stack([a[there], b[there], c[there], d[there]], axis=1)
    triangles = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]).astype(np.int32)
    return positions, triangles, positions[:, 0] > 1.0


def test_patch_that_lies_on_another_limb_gets_the_weights_around_it():
    # A bulge of the left strip lies on the right one: the closest points are there, as near as
    # those of all others and with the same normals.
    positions, triangles, right = fork(gap=0.1)
    skin = skin_from_entries(len(positions), np.arange(410), right.astype(int), np.ones(410), BIND)
    target = positions.copy()
    bulge = ~right & (np.abs(positions[:, 1] - 4.0) < 0.3) & (positions[:, 0] > 0.3)
    target[bulge, 0] += 0.7
    assert (target[bulge, 0] > 1.1).all()
    template = Template(positions, triangles)
    found = transferred_weights(template, skin, target, triangles, WeightSettings())
    np.testing.assert_array_equal(found.matched, ~bulge)
    below = positions[:, 1] < 9.0  # joints blend above
    expected = np.stack([~right, right, np.zeros(410)], axis=1)[below]
    np.testing.assert_allclose(dense(found)[below], expected, atol=1e-9)


def test_large_patch_on_another_limb_keeps_its_matches():
    # All of the strip's lower half is on the other strip, too large to be a mistake of its matches.
    positions, triangles, right = fork(gap=0.1)
    skin = skin_from_entries(len(positions), np.arange(410), right.astype(int), np.ones(410), BIND)
    target = positions.copy()
    lower = ~right & (positions[:, 1] < 5.0)
    target[lower, 0] += 1.03
    template = Template(positions, triangles)
    found = transferred_weights(template, skin, target, triangles, WeightSettings())
    assert found.matched.all()


def sheet_with_a_step():
    """Return a sheet 10 wide along x, and weights that jump from one joint to the next at x = 0."""
    x, y = np.linspace(-4.975, 4.975, 200), np.linspace(0.0, 1.0, 5)
    positions = np.stack([*np.meshgrid(x, y), np.zeros((5, 200))], axis=2).reshape(-1, 3)
    index = np.arange(1000).reshape(5, 200)
    squares = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    a, b, c, d = (part.ravel() for part in squares)
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    right = positions[:, 0] > 0.0
    skin = skin_from_entries(1000, np.arange(1000), right.astype(int), np.ones(1000), BIND)
    return positions, triangles, right, skin


def test_weights_diffuse_over_twice_the_distance_from_the_template():
    # Of a sheet 0.2 above one with a step of the weights, w - l^2 w'' = step with l = 0.4: the
    # solution is exp(-|x| / l) / 2 on one side, and 1 minus that on the other.
    positions, triangles, right, skin = sheet_with_a_step()
    above, template = positions + np.array([0.0, 0.0, 0.2]), Template(positions, triangles)
    found = transferred_weights(template, skin, above, triangles, WeightSettings())
    assert found.matched.all()
    tail = 0.5 * np.exp(-np.abs(positions[:, 0]) / 0.4)
    np.testing.assert_allclose(dense(found)[:, 1], np.where(right, 1.0 - tail, tail), atol=0.005)
    # Within half a percent of the size, they are copied.
    near = positions + np.array([0.0, 0.0, 0.04])
    found = transferred_weights(template, skin, near, triangles, WeightSettings())
    np.testing.assert_allclose(dense(found)[:, 1], right, atol=1e-12)


def test_weights_diffuse_over_twice_the_length_that_was_squeezed():
    positions, triangles, right, skin = sheet_with_a_step()
    # Before it was fitted, every second column of the template was 0.25 higher. Scaled to the same
    # size, columns 0.05 apart were sqrt(0.05^2 + 0.25^2) apart.
    unfitted = positions.copy()
    unfitted[1::2, 2] = 0.25
    scale = np.sqrt(9.95**2 + 1.0) / np.sqrt(9.95**2 + 1.0 + 0.25**2)
    # A fifth more than 0.05, and half a percent of the size, are within the tolerances.
    within = 1.2 * 0.05 + 0.005 * np.hypot(9.95, 1.0)
    length = 2.0 * (scale * np.hypot(0.05, 0.25) - within)
    tail = 0.5 * np.exp(-np.abs(positions[:, 0]) / length)
    squeezed = Template(positions, triangles, unfitted)
    found = transferred_weights(squeezed, skin, positions, triangles, WeightSettings())
    np.testing.assert_allclose(dense(found)[:, 1], np.where(right, 1.0 - tail, tail), atol=0.005)
    # One that was only smaller gives its weights unchanged.
    smaller = Template(positions, triangles, 0.1 * positions)
    found = transferred_weights(smaller, skin, positions, triangles, WeightSettings())
    np.testing.assert_allclose(dense(found)[:, 1], right, atol=1e-12)
