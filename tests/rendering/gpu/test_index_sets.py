"""Triangle order for the vertex cache: consecutive neighbours, all triangles, unchanged runs."""

import numpy as np
import pytest
from rendering.drawn_figures import sphere

from viewer.rendering.gpu.index_sets import curve_order, curve_places, index_set
from viewer.rendering.gpu.surfaces import PLAIN


def shaded(triangles, kept=32) -> int:
    """Return the number of vertices that are shaded with a small cache."""
    recent: list[int] = []
    count = 0
    for vertex in np.ravel(triangles).tolist():
        if vertex not in recent:
            count += 1
            recent = [vertex, *recent[: kept - 1]]
    return count


def drawn(ctx, triangles, materials, positions):
    parts = np.full(len(triangles), -1)
    order = None if positions is None else curve_order(triangles, materials, parts, positions)
    made = index_set(ctx, triangles, materials, [PLAIN, PLAIN], order)
    indices = np.frombuffer(made.indices.read(), dtype="u4").reshape(-1, 3)
    made.indices.release()
    return made, indices


def test_shuffled_triangles_are_sorted_spatially(ctx):
    ball = sphere(24)
    shuffled = np.random.default_rng(0).permutation(ball.triangles)
    made, indices = drawn(ctx, shuffled, np.full(len(shuffled), -1), ball.positions)
    assert np.array_equal(indices, shuffled[made.order])
    assert sorted(made.order) == list(range(len(shuffled)))
    assert made.spans == ((0, 3 * len(shuffled)),)
    # The optimum is one vertex for two triangles, the worst case three for each.
    assert shaded(shuffled) > 2.9 * len(shuffled)
    assert shaded(indices) < 0.9 * len(shuffled)


def test_material_runs_keep_their_order(ctx):
    ball = sphere(8)
    materials = np.zeros(len(ball.triangles), dtype=np.int32)
    materials[20:50] = 1
    materials[100:] = -1
    made, indices = drawn(ctx, ball.triangles, materials, ball.positions)
    assert [(run.first, run.count) for run in made.runs] == [
        (0, 60),
        (60, 90),
        (150, 150),
        (300, 3 * len(materials) - 300),
    ]
    assert np.array_equal(materials[made.order], materials)
    assert np.array_equal(indices, ball.triangles[made.order])


def test_order_is_unchanged_without_positions(ctx):
    ball = sphere(6)
    made, indices = drawn(ctx, ball.triangles, np.zeros(len(ball.triangles)), None)
    assert np.array_equal(indices, ball.triangles)
    assert np.array_equal(made.order, np.arange(len(ball.triangles)))


@pytest.mark.parametrize("count", [0, 1])
def test_small_numbers_of_triangles_are_sorted(ctx, count):
    points = np.zeros((3, 3))
    triangles = np.array([[0, 1, 2]], dtype=np.int32)[:count]
    order = curve_order(triangles, np.zeros(count), np.zeros(count), points)
    made = index_set(ctx, triangles, np.zeros(count), [PLAIN], order)
    assert made.spans == ((0, 3 * count),) and len(made.order) == count
    made.indices.release()


def test_curve_interleaves_the_bits_of_cells():
    cells = np.array([[0, 0, 0], [1023, 1023, 1023], [5, 3, 6], [512, 0, 1]], dtype=float)
    wanted = []
    for cell in cells.astype(int):
        place = 0
        for bit in range(10):
            for axis in range(3):
                place |= (int(cell[axis]) >> bit & 1) << (3 * bit + axis)
        wanted.append(place)
    assert curve_places(cells).tolist() == wanted
    # The result does not depend on size and position of the cloud.
    assert curve_places(cells / 1024 + 64.0).tolist() == wanted
