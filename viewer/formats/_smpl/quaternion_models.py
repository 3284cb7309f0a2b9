"""Arrays in which STAR and SUPR differ from SMPL: correctives, and SUPR's joint regressor."""

from __future__ import annotations

import numpy as np

from viewer.formats._archive.checking import finite
from viewer.formats._archive.values import Archive, Sparse
from viewer.rig.arrays import Deferred
from viewer.rig.blendshapes import Correctives, JointRegressor
from viewer.rig.bodies.quaternion_feature import QuaternionFeature

__all__ = ["coordinate_regressor", "quaternion_correctives"]

_STAR_SHAPE = 1  # index of the shape coefficient that drives correctives of STAR


def coordinate_regressor(archive: Archive, matrix: Sparse, n_joints: int) -> JointRegressor:
    """Return SUPR's regressor: rows are coordinates of joints, the last column is a constant."""
    rows, columns, numbers = matrix.entries()
    weights = finite(archive, "J_regressor", numbers, "joints", rows // 3)
    last = matrix.shape[1] - 1
    constant = columns == last
    bias = np.bincount(rows[constant], weights[constant], minlength=3 * n_joints)
    rows, columns, weights = rows[~constant], columns[~constant], weights[~constant]
    return JointRegressor(
        n_joints,
        (rows // 3).astype(np.int32),
        (columns // 3).astype(np.int32),
        weights,
        axes=np.stack([rows % 3, columns % 3], axis=1).astype(np.int32),
        bias=bias.astype(np.float64, copy=False).reshape(-1, 3),
    )


def quaternion_correctives(
    archive: Archive, n_vertices: int, n_joints: int
) -> tuple[Correctives, str] | None:
    """Return correctives that quaternions drive, and the model's title; None for SMPL's.

    STAR has four columns for each joint except the root, and one for a shape coefficient; SUPR has
    four for each joint.
    """
    array = archive.array("posedirs")
    kinds = {
        4 * (n_joints - 1) + 1: (QuaternionFeature(n_joints, False, _STAR_SHAPE), "STAR"),
        4 * n_joints: (QuaternionFeature(n_joints, True), "SUPR"),
    }
    count = array.shape[-1] if len(array.shape) == 3 else 0
    if array.shape != (n_vertices, 3, count) or count not in kinds or n_joints < 2:
        return None

    def load() -> np.ndarray:
        rows = np.ascontiguousarray(np.moveaxis(array.values(), 2, 0), np.float64)
        return finite(archive, "posedirs", rows)

    feature, title = kinds[count]
    return Correctives(Deferred((count, n_vertices, 3), np.float64, load), feature), title
