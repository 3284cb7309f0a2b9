"""Local transforms of the nodes of a glTF document; matrices are decomposed where possible."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._gltf.elements import Table
from viewer.formats._gltf.member_rows import member_rows
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)

__all__ = ["Transforms", "node_transforms"]

_UNIT = 1e-3  # maximum deviation of a quaternion's length from 1 that is not reported
_TINY = 1e-12  # minimum length of a quaternion with a direction
# Relative error of T R S compared with the matrix: the rounding of a few products in float32.
_EXACT = 1e-6
_LAST_ROW = 1e-5  # maximum deviation of the last row from 0 0 0 1 that is due to rounding


@dataclass(frozen=True, slots=True, eq=False)
class Transforms:
    """Local transforms as in ``NodeTree``."""

    translations: Floats
    rotations: Floats
    scales: Floats
    matrices: dict[int, Floats]


def node_transforms(table: Table) -> Transforms:
    """Return the local transforms of all nodes.

    Raises
    ------
    FormatError
        If a member is malformed, or a matrix is not affine.
    """
    count = len(table)
    translations, scales = np.zeros((count, 3)), np.ones((count, 3))
    rotations = np.zeros((count, 4))
    rotations[:, 3] = 1.0
    for name, rows in (("translation", translations), ("scale", scales)):
        places, values = member_rows(table, name, 3)
        rows[places] = values
    places, values = member_rows(table, "rotation", 4)
    rotations[places] = _unit(table, places, values)
    result = Transforms(translations, rotations, scales, {})
    _put_matrices(table, result)
    return result


def _unit(table: Table, places: Ints, rotations: Floats) -> Floats:
    """Return quaternions of unit length; those without a direction become the identity."""
    lengths = np.linalg.norm(rotations, axis=1)
    odd = np.abs(lengths - 1.0) > _UNIT
    if odd.any():
        first = int(odd.argmax())
        pointer = table[int(places[first])].at("rotation")
        n = int(odd.sum())
        table.source.warn("G003.rotation", pointer, n=n, found=float(lengths[first]))
    is_zero = lengths < _TINY
    rotations = np.where(is_zero[:, None], (0.0, 0.0, 0.0, 1.0), rotations)
    return rotations / np.where(is_zero, 1.0, lengths)[:, None]


def _put_matrices(table: Table, result: Transforms) -> None:
    """Set the transforms of the nodes that have a matrix."""
    places, columns = member_rows(table, "matrix", 16)
    if not len(places):
        return
    _check_mixture(table, places)
    matrices = columns.reshape(-1, 4, 4).transpose(0, 2, 1)
    _check_affine(table, places, matrices)
    rotations, scales, is_exact = _decomposed(matrices[:, :3, :3])
    exact = places[is_exact]
    result.translations[exact] = matrices[is_exact, :3, 3]
    result.rotations[exact] = rotations[is_exact]
    result.scales[exact] = scales[is_exact]
    for place, matrix in zip(places[~is_exact].tolist(), matrices[~is_exact], strict=True):
        result.translations[place], result.scales[place] = 0.0, 1.0
        result.rotations[place] = 0.0, 0.0, 0.0, 1.0
        result.matrices[place] = np.vstack([matrix[:3], (0.0, 0.0, 0.0, 1.0)])


def _check_mixture(table: Table, places: Ints) -> None:
    for place in places.tolist():
        others = {"translation", "rotation", "scale"} & table.items[place].keys()
        if others:
            table[place].warn("G003.matrix-and", "matrix", names=sorted(others))


def _check_affine(table: Table, places: Ints, matrices: Floats) -> None:
    odd = (np.abs(matrices[:, 3] - (0.0, 0.0, 0.0, 1.0)) > _LAST_ROW).any(axis=1)
    if odd.any():
        first = int(odd.argmax())
        row = " ".join(f"{value:g}" for value in matrices[first, 3])
        raise table[int(places[first])].fault("F002.gltf-affine", "matrix", found=row)


def _decomposed(linear: Floats) -> tuple[Floats, Floats, np.ndarray]:
    """Return rotations (N, 4) and scales (N, 3) of linear parts, and whether they are exact.

    A reflection becomes a negative scale along x.
    """
    scales = np.linalg.norm(linear, axis=1)
    scales[:, 0] *= np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)
    # Columns of length 0 are replaced so that the matrix is a rotation.
    columns = linear / np.where(scales == 0.0, 1.0, scales)[:, None, :]
    turns, _ = nearest_rotations(columns)
    rotations = matrix_to_quaternion(turns)
    again = quaternion_to_matrix(rotations) * scales[:, None, :]
    sizes = np.abs(linear).max(axis=(1, 2))
    is_exact = np.abs(again - linear).max(axis=(1, 2)) <= _EXACT * sizes
    return rotations, scales, is_exact
