"""Bounding spheres around the joints of a posed figure that contain its skinned vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.pose import batch_last
from viewer.rigs.skin import Skin, bind_positions, owners

_MARGIN = 1.03  # margin for pose correctives and for skinning methods that do not blend linearly
_reaches: Memo[Figure, tuple[Floats, Floats]] = Memo()


class Bounds(NamedTuple):
    """Bounds of one or several actors."""

    spheres: Floats
    """(N, 4). Centres and radii that contain them, scene space."""
    size: float
    """Largest extent of one actor's centres, scene units."""


def bounds_of(spheres: Floats) -> Bounds:
    """Return the bounds of actors by their spheres (A, N, 4), without those that are not finite."""
    is_finite = np.isfinite(spheres)
    if not is_finite.all():
        spheres = spheres[is_finite.all(axis=(1, 2))]
    if not spheres.size:
        return Bounds(np.zeros((0, 4)), 0.0)
    parts = batch_last(spheres, 2).swapaxes(0, 1)  # (4, N, A)
    spans = np.ptp(parts[:3], axis=1)
    return Bounds(parts.reshape(4, -1).T, float(np.linalg.norm(spans, axis=0).max()))


def skin_spheres(figure: Figure, palette: Floats, sizes: Floats | None = None) -> Floats:
    """Return bounds of a figure's vertices from its joints: (..., N, 4) centre, radius.

    ``palette``: (..., J, 4, 4) skinning matrices to any space. ``sizes``: their ``palette_sizes``,
    if known.
    """
    # A linearly skinned vertex is a weighted mean of its positions under each joint's transform, so
    # it lies in the convex hull of spheres around the joints that reach their farthest vertices.
    skin = figure.require_skin()
    centers, radii = _reaches.get(figure, (), lambda: _reaches_of(figure, skin))
    is_rigid = sizes is not None and bool((sizes > 0.0).all())
    stretches = np.sqrt(sizes) if sizes is not None and is_rigid else stretch_bounds(palette)
    stretches = np.broadcast_to(stretches, palette.shape[:-2])
    used = np.flatnonzero(radii >= 0.0)
    matrices = np.moveaxis(palette, (-1, -2, -3), (0, 1, 2))[:, :3, used]
    spheres = np.empty((4, len(used), *palette.shape[:-3]))
    spheres[:3] = np.einsum("kij...,jk->ij...", matrices[:3], centers[used]) + matrices[3]
    spheres[3] = _MARGIN * (radii * stretches)[..., used].T
    return spheres.T


def moved_spheres(matrices: Floats, spheres: Floats) -> Floats:
    """Return spheres (A, N, 4) after affine transforms (A, 4, 4), which may enlarge them."""
    moved = np.empty(spheres.shape[::-1])
    entries = batch_last(matrices, 2)[:3]
    moved[:3] = np.einsum("ika,kna->ina", entries[:, :3], spheres.T[:3]) + entries[:, 3, None]
    moved[3] = (spheres[..., 3] * stretch_bounds(matrices)[:, None]).T
    return moved.T


def stretch_bounds(matrices: Floats) -> Floats:
    """Return upper bounds, (...), of the spectral norms of affine matrices, (..., 4, 4)."""
    # The spectral norm is at most the square root of the largest absolute row sum of M^T M; exactly
    # that for rotations.
    linear = batch_last(matrices[..., :3, :3], 2)
    products = np.abs(np.einsum("ki...,kj...->ij...", linear, linear))
    return np.sqrt(products.sum(axis=1).max(axis=0))


def _reaches_of(figure: Figure, skin: Skin) -> tuple[Floats, Floats]:
    """Return joints' bind positions, (J, 3), and farthest vertices' distances, (J,), -1: none."""
    centers, positions = bind_positions(skin), figure.require_mesh().positions
    used = skin.weights != 0.0
    joints = skin.joints[used]
    away = np.linalg.norm(positions[owners(skin)[used]] - centers[joints], axis=1)
    radii = np.full(len(centers), -1.0)
    np.maximum.at(radii, joints, away)
    return centers, radii


def box_spheres(box: Floats) -> Floats:
    """Return the corners of a box, (2, 3), as spheres of radius 0: (8, 4)."""
    corners = np.array(np.meshgrid(*box.T, indexing="ij")).reshape(3, -1).T
    return np.pad(corners, ((0, 0), (0, 1)))
