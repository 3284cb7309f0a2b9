import numpy as np

from viewer.autorig.surface.welding import edges, islands, weld

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_weld_joins_the_corners_of_a_seam():
    # The two triangles of a square have three separate vertices each.
    positions = SQUARE[[0, 1, 2, 0, 2, 3]]
    welded = weld(positions, np.array([[0, 1, 2], [3, 4, 5]]))
    assert welded.vertices.tolist() == [0, 1, 2, 0, 2, 3]
    assert welded.positions.tolist() == SQUARE.tolist()
    assert welded.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert welded.islands.tolist() == [0, 0, 0, 0]


def test_weld_treats_minus_zero_as_zero():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, -0.0]])
    assert weld(positions, np.array([[0, 1, 2]])).vertices.tolist() == [0, 1, 2, 0]


def test_weld_joins_vertices_that_differ_by_rounding():
    # The median edge is 1, so vertices within 1e-4 are joined.
    positions = SQUARE[[0, 1, 2, 0, 2, 3]].copy()
    positions[3, 2] = 0.5e-4
    positions[4, 2] = 2e-4
    welded = weld(positions, np.array([[0, 1, 2], [3, 4, 5]]))
    assert welded.vertices.tolist() == [0, 1, 2, 0, 3, 4]


def test_weld_joins_a_whole_cluster():
    rng = np.random.default_rng(5)
    cluster = rng.uniform(-1e-5, 1e-5, (40, 3))
    positions = np.concatenate([SQUARE, cluster])
    welded = weld(positions, np.array([[0, 1, 2], [0, 2, 3]]))
    assert welded.vertices.tolist() == [0, 1, 2, 3] + [0] * 40


def test_weld_drops_collapsed_triangles_and_keeps_zero_area_ones():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 0]])
    welded = weld(positions, np.array([[0, 1, 3], [0, 4, 1], [0, 1, 2]]))
    assert welded.triangles.tolist() == [[0, 1, 3], [0, 1, 2]]


def test_weld_counts_an_unused_vertex_as_an_island():
    positions = np.concatenate([SQUARE + 5.0, SQUARE])
    welded = weld(positions, np.array([[4, 5, 6], [0, 1, 2]]))
    assert welded.islands.tolist() == [0, 0, 0, 1, 2, 2, 2, 3]
    assert welded.n_islands == 4


def test_weld_of_an_empty_mesh_is_empty():
    welded = weld(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    assert welded.n_islands == 0
    assert len(welded.positions) == 0


def test_weld_of_coincident_points_is_one_vertex():
    welded = weld(np.ones((3, 3)), np.array([[0, 1, 2]]))
    assert welded.vertices.tolist() == [0, 0, 0]
    assert welded.triangles.shape == (0, 3)


def test_islands_are_numbered_by_their_first_vertex():
    triangles = np.array([[6, 5, 4], [1, 2, 3]])
    assert islands(7, triangles).tolist() == [0, 1, 1, 1, 2, 2, 2]


def test_edges_are_listed_once():
    assert edges(np.array([[0, 1, 2], [2, 1, 3]])).tolist() == [
        [0, 1],
        [0, 2],
        [1, 2],
        [1, 3],
        [2, 3],
    ]
