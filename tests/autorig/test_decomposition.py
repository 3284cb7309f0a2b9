"""Bones, weights and motions that are found again in meshes made from known ones."""

import numpy as np
import pytest
from autorig.moving_shapes import tube, two_boxes

from viewer.autorig.decomposition import DecompositionSettings, decompose
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving


def skinned(rest, found):
    """Return sum_b w_b (R_b u + t_b) for each frame and vertex, one bone after the other."""
    result = np.zeros((len(found.transforms), *rest.shape))
    for bone in range(found.weights.shape[1]):
        for frame, transforms in enumerate(found.transforms):
            matrix = transforms[bone]
            moved = rest @ matrix[:3, :3].T + matrix[:3, 3]
            result[frame] += found.weights[:, bone, None] * moved
    return result


def assert_is_rig(found, most):
    """Check weights and rotations; 1e-12 allows the rounding of sums and products."""
    assert found.weights.min() >= 0.0
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0, atol=1e-12)
    assert (found.weights > 0.0).sum(axis=1).max() <= most
    turns = found.transforms[..., :3, :3]
    identity = np.broadcast_to(np.eye(3), turns.shape)
    np.testing.assert_allclose(turns @ np.swapaxes(turns, -1, -2), identity, atol=1e-12)
    assert np.linalg.det(turns).min() > 0.0


@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1e5, 1e6)])
def test_weights_of_tube_are_found_in_any_unit_and_place(scale, shift):
    rest, positions, _, weights = tube()
    rest, positions = scale * rest + shift, scale * positions + shift
    found = decompose(rest, positions, DecompositionSettings(bones=2))
    assert_is_rig(found, 2)
    # The rounds end when they hardly improve an error of 1e-5 of the size.
    errors = np.linalg.norm(skinned(rest, found) - positions, axis=2)
    assert errors.max() < 1e-4 * 3.0 * scale
    upper = found.weights[:, found.weights[rest[:, 2].argmax()].argmax()]
    np.testing.assert_allclose(upper, weights, atol=2e-3)


def test_rigid_parts_are_exact_and_need_no_further_bone():
    positions, _ = two_boxes()
    found = decompose(positions[0], positions)
    assert found.weights.shape == (16, 2)
    # Each part moves by one bone alone.
    assert set(found.weights.ravel().tolist()) == {0.0, 1.0}
    np.testing.assert_allclose(skinned(positions[0], found), positions, atol=1e-8)


def test_one_bone_is_the_rigid_motion_of_all():
    positions = two_boxes()[0][:, :8]
    found = decompose(positions[0], positions)
    assert found.weights.tolist() == [[1.0]] * 8
    expected = np.arange(4)[:, None] * [0.1, 0.0, 0.0]
    np.testing.assert_allclose(found.transforms[:, 0, :3, 3], expected, atol=1e-9)


def test_tolerance_decides_the_number_of_bones():
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12)), axis=2)
    flat = np.concatenate([grid.reshape(-1, 2), np.zeros((144, 1))], axis=1)
    phases = np.arange(8) * 0.8
    positions = np.repeat(flat[None], 8, axis=0)
    positions[:, :, 2] = 0.1 * flat[:, 0] * np.sin(6.0 * flat[:, 0] - phases[:, None])
    counts = []
    for tolerance in (2.0, 0.5):
        found = decompose(flat, positions, DecompositionSettings(tolerance=tolerance))
        errors = np.linalg.norm(skinned(flat, found) - positions, axis=2)
        assert 100.0 * np.sqrt((errors**2).mean(axis=1)).max() < tolerance
        counts.append(found.weights.shape[1])
    assert 1 < counts[0] < counts[1]


def test_influences_are_limited():
    rest, positions, _, _ = tube()
    for most in (1, 2):
        settings = DecompositionSettings(bones=3, max_influences=most)
        assert_is_rig(decompose(rest, positions, settings), most)


def test_frames_and_vertices_that_were_not_chosen_are_fitted_too(monkeypatch):
    monkeypatch.setattr("viewer.autorig.decomposition._KEY_FRAMES", 5)
    monkeypatch.setattr("viewer.autorig.decomposition._KEY_VERTICES", 40)
    monkeypatch.setattr("viewer.rigs.arrays._MOST_NUMBERS", 3000)  # many parts
    rest, positions, _, _ = tube()
    found = decompose(rest, positions, DecompositionSettings(bones=2))
    assert np.linalg.norm(skinned(rest, found) - positions, axis=2).max() < 1e-3 * 3.0


def test_vertices_in_one_place_are_refused():
    with pytest.raises(RigError, match="found all vertices in one place"):
        decompose(np.ones((4, 3)), np.ones((2, 4, 3)))


def test_work_is_reported_and_cancelled():
    rest, positions, _, _ = tube()
    seen = []

    def cancel(done, total, unit, what):
        seen.append((done, what))
        if len(seen) == 3:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(cancel):
        decompose(rest, positions, DecompositionSettings(bones=4))
    assert len(seen) == 3 and seen[0][1].startswith("2 bones")
