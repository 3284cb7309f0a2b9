"""Alignment of bounding boxes with a separate scale per axis, as in the seed method."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.mesh import bounding_box

__all__ = ["align_boxes"]

_FLAT = 1e-9  # minimum thickness of a box that can be scaled, as a fraction of its longest side


def align_boxes(positions: Floats, onto: Floats) -> Floats:
    """Return the map that aligns the bounding boxes of two sets of points.

    p' = (p - c) * e' / e + c', with box centres c and extents e, per axis. This is the rule of
    Tex-An Mesh; an axis along which both boxes are flat keeps its scale.

    Parameters
    ----------
    positions : (N, 3)
        Points to move: the target mesh.
    onto : (M, 3)
        Points whose box is the target: the posed template.

    Returns
    -------
    (4, 4)
        Diagonal scale and shift.

    Raises
    ------
    RigError
        If only one of the boxes is flat along an axis.

    >>> align_boxes(np.array([[0.0, 0, 0], [2, 1, 1]]), np.array([[1.0, 1, 1], [2, 2, 2]])).tolist()
    [[0.5, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
    """
    box, other = bounding_box(positions), bounding_box(onto)
    extents, wanted = box[1] - box[0], other[1] - other[0]
    flat = extents <= _FLAT * extents.max(initial=0.0)
    other_flat = wanted <= _FLAT * wanted.max(initial=0.0)
    odd = np.flatnonzero(flat != other_flat)
    if len(odd):
        name = "xyz"[odd[0]]
        raise RigError(
            f"alignment of boxes: expected both meshes to extend along {name}, "
            f"found {extents[odd[0]]:g} and {wanted[odd[0]]:g}"
        )
    factors = np.where(flat, 1.0, wanted / np.where(flat, 1.0, extents))
    matrix = np.eye(4)
    matrix[:3, :3] *= factors
    matrix[:3, 3] = other.mean(axis=0) - factors * box.mean(axis=0)
    return matrix
