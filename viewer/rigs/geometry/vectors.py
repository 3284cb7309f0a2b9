"""Vector normalisation, and transforms of normals and tangents."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from viewer.rigs.arrays import Floats

# Smaller determinants, of matrices scaled to entries up to 1, have an unreliable sign.
_FLAT = 1e-5

Up: TypeAlias = Literal["y", "z"]
"""Axis that points up in a figure or scene."""
SignedUp: TypeAlias = Literal["y", "z", "-y", "-z"]
"""Axis that points up in the world of a file."""
StatedUp: TypeAlias = Literal[""] | SignedUp
"""The same; empty if it is unknown or not stated."""
SIGNED_UPS: tuple[SignedUp, ...] = ("y", "z", "-y", "-z")
"""All axes that may point up."""
HANGING: dict[Up, SignedUp] = {"y": "-y", "z": "-z"}
"""Opposite of each up axis."""


def lengths_of(vectors: Floats) -> Floats:
    """Return the lengths (...) of many short vectors (..., C), for which ``norm`` is slow."""
    # numpy.linalg.norm takes two to three times as long along a last axis of 3.
    result: Floats = np.sqrt(np.einsum("...a,...a->...", vectors, vectors))
    return result


def unit(vectors: Floats) -> Floats:
    """Return vectors (..., 3) of length 1; a vector of length 0 stays 0."""
    lengths = lengths_of(vectors)[..., None]
    return vectors / np.where(lengths == 0.0, 1.0, lengths)


def axis_vector(name: str) -> Floats:
    """Return the unit vector of an axis, "x", "y" or "z"."""
    return np.eye(3)["xyz".index(name)]


def axes_along(main: Floats, side: Floats) -> Floats:
    """Return axes as columns (3, 3): near ``side``, along ``main``, and across."""
    # Gram-Schmidt orthogonalisation that keeps the main axis and adjusts the side.
    second, third = unit(main), unit(np.cross(side, main))
    return np.stack([np.cross(second, third), second, third], axis=1)


def reflected(points: Floats, axis: int, centre: float = 0.0) -> Floats:
    """Return the mirror images of points (..., 3) across the plane at ``centre`` on an axis."""
    images = points.copy()
    images[..., axis] = 2.0 * centre - images[..., axis]
    return images


def moved_tangents(tangents: Floats, linear: Floats) -> Floats:
    """Return tangents (N, 4) moved by A (3, 3), t' = A t / |A t|; reflections change signs.

    >>> moved_tangents(np.array([[2.0, 0.0, 0.0, 1.0]]), np.diag([1.0, 1.0, -1.0])).tolist()
    [[1.0, 0.0, 0.0, -1.0]]
    """
    reflects = -1.0 if np.linalg.det(linear) < 0.0 else 1.0
    signs = reflects * np.sign(tangents[:, 3:])
    return np.concatenate([unit(tangents[:, :3] @ linear.T), signs], axis=1)


def inverse_transposed(matrices: Floats, normals: Floats) -> Floats:
    """Multiply normals (N, 3) by inverse transposes of (3, 3, N), n' = |det A| A^-T n."""
    largest = np.abs(matrices).max(axis=(0, 1))
    # Only directions matter, and products of entries near 1 do not overflow or underflow.
    a, b, c = np.swapaxes(matrices / np.where(largest > 0.0, largest, 1.0), 0, 1)
    # The columns a, b, c of A define the cofactor matrix [b x c, c x a, a x b] = det(A) A^-T, which
    # stays finite if A is singular. Its sign is changed to the sign of the inverse transpose, so
    # that outward normals stay outward under a reflected joint (likewise, glTF 2.0, section 3.7.4,
    # reverses the winding, not the normals).
    cofactors = cross(b, c), cross(c, a), cross(a, b)
    x, y, z = np.ascontiguousarray(normals.T)
    moved = cofactors[0] * x + cofactors[1] * y + cofactors[2] * z
    # a . (b x c) is the determinant.
    reflected = np.einsum("an,an->n", a, cofactors[0]) < -_FLAT
    return np.where(reflected, -moved, moved).T


def cross(a: Floats, b: Floats) -> Floats:
    """Return cross products of (3,) or (3, N) vectors, for which ``numpy.cross`` is slow."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
