"""Transfer of pose correctives to another mesh."""

import numpy as np
from numpy.testing import assert_allclose

from viewer.autorig.transfer import corrective_transfer
from viewer.autorig.transfer.corrective_transfer import transfer_correctives
from viewer.rig.blendshapes import Correctives
from viewer.rig.geometry.closest_point import SurfacePoints

TRIANGLES = np.array([[0, 1, 2]])
OFFSETS = np.arange(81.0).reshape(9, 3, 3)


def points(barycentric):
    count = len(barycentric)
    return SurfacePoints(
        np.zeros(count, np.int32), barycentric, np.zeros((count, 3)), np.zeros(count)
    )


def strip(count):
    """Return a strip of triangles along x with two vertices per step."""
    positions = np.array([[x, y, 0.0] for x in range(count) for y in (0.0, 1.0)])
    first = 2 * np.arange(count - 1)
    triangles = np.concatenate(
        [np.stack([first, first + 2, first + 1], 1), np.stack([first + 1, first + 2, first + 3], 1)]
    )
    return positions, triangles


def test_offsets_are_interpolated_from_the_corners_and_scaled():
    barycentric = np.array([[1.0, 0, 0], [0, 0, 1], [0.5, 0.25, 0.25], [0, 1, 0]])
    positions, triangles = strip(2)
    found = transfer_correctives(
        Correctives(OFFSETS), points(barycentric), TRIANGLES, np.ones(4, bool), positions,
        triangles, 10.0,
    )  # fmt: skip
    expected = 10.0 * np.einsum("vk,pka->pva", barycentric, OFFSETS)
    assert_allclose(found.values(), expected, rtol=1e-14)


def test_offsets_fade_out_away_from_the_template():
    positions, triangles = strip(40)
    matched = positions[:, 0] < 20
    barycentric = np.tile([1.0, 0, 0], (80, 1))
    found = transfer_correctives(
        Correctives(np.ones((9, 3, 3))), points(barycentric), TRIANGLES, matched, positions,
        triangles, 1.0,
    )  # fmt: skip
    along = found.values()[0, ::2, 0]
    # Ten rounds extend by ten steps to both sides and decrease monotonically.
    assert_allclose(along[:9], 1.0, atol=1e-12)
    assert_allclose(along[31:], 0.0, atol=1e-12)
    assert (np.diff(along) <= 1e-12).all() and 0.3 < along[19] < 1.0 and 0.0 < along[21] < 0.7


def test_offsets_beyond_the_memory_limit_are_left_out(monkeypatch):
    monkeypatch.setattr(corrective_transfer, "MOST_NUMBERS", 9 * 4 * 3 - 1)
    positions, triangles = strip(2)
    found = transfer_correctives(
        Correctives(OFFSETS), points(np.tile([1.0, 0, 0], (4, 1))), TRIANGLES, np.ones(4, bool),
        positions, triangles, 1.0,
    )  # fmt: skip
    assert found is None
