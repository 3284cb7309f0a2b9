import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import linalg as linear

from viewer.autorig.surface.laplacian import laplacian
from viewer.autorig.surface.welding import weld
from viewer.autorig.weights.weight_transfer import inpaint
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving


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
        "the weights of unmatched vertices could not be computed: the mesh is too irregular"
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
    assert [step[3] for step in seen] == ["factorising"] + 3 * ["inpainting weights"]
    assert [step[:2] for step in seen] == [(0, 100), (0, 100), (33, 100), (67, 100)]
