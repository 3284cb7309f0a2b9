"""Dual quaternion skinning in two phases: blended stretch, then blended rigid motion.

Kavan, Collins, Zara, O'Sullivan 2008, "Geometric Skinning with Approximate Dual Quaternion
Blending", section 4.2: joints that scale are split into a stretch, blended linearly in the
bind pose, and a rigid motion, blended as dual quaternions.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.vectors import inverse_transposed, unit
from viewer.rigs.skin import Skin, bind_positions, strongest_first

_CHUNK = 1 << 16  # number of vertices per chunk, which limits the memory for large meshes
_RIGID = 1e-12  # tolerance within which a stretch is treated as the identity
_TINY = 1e-12  # minimum length of a blended quaternion that defines a rotation


def deform(
    positions: Floats,
    normals: Floats,
    skin: Skin,
    palette: Floats,
    blend_factor: float | None = 1.0,
) -> tuple[Floats, Floats]:
    """Stretch linearly, then move by the normalised weighted sum of unit dual quaternions.

    Weights are divided by their sum. Quaternions are negated if necessary to lie in the hemisphere
    of the strongest influence (eq. 14 and its text: antipodality). Normals are transformed by the
    inverse transpose of the blended stretch, then by the blended rotation.
    """
    skin = strongest_first(skin)
    centers = bind_positions(skin)
    duals, stretches = split_palette(palette, centers)
    moved, rotated = positions.copy(), normals.copy()
    for chosen, blended, stretch in _blended(skin, duals, stretches):
        points = positions[chosen]
        stretched = np.einsum("vab,vb->va", stretch[:, :, :3], points) + stretch[:, :, 3]
        moved[chosen] = moved_rigidly(blended, stretched)
        stretched_normals = inverse_transposed(
            np.moveaxis(stretch[:, :, :3], 0, -1), normals[chosen]
        )
        rotated[chosen] = _rotated(blended[:, :4], stretched_normals)
    return moved, unit(rotated)


def linear_maps(skin: Skin, palette: Floats) -> Floats:
    """Return the linear part (V, 3, 3) of each vertex's motion: the rotation after the stretch."""
    skin = strongest_first(skin)
    maps = np.tile(np.eye(3), (skin.n_vertices, 1, 1))
    for chosen, blended, stretch in _blended(skin, *split_palette(palette, bind_positions(skin))):
        maps[chosen] = quaternion_to_matrix(blended[:, :4]) @ stretch[:, :, :3]
    return maps


def split_palette(palette: Floats, centers: Floats) -> tuple[Floats, Floats]:
    """Split skinning matrices (J, 4, 4) into rigid motions after stretches about joints, M = D S.

    Returns the unit dual quaternions (J, 8) of D, real part first, (x, y, z, w) each, and the
    affine matrices S (J, 3, 4), whose fixed points are the bind positions ``centers`` (J, 3).
    """
    linear = palette[:, :3, :3]
    rotations = linear.copy()
    stretches = np.tile(np.eye(3), (len(linear), 1, 1))
    gram = np.swapaxes(linear, 1, 2) @ linear
    other = np.abs(gram - np.eye(3)).max(axis=(1, 2)) > _RIGID
    other |= np.linalg.det(linear) < 0.0
    rotations[other], stretches[other] = nearest_rotations(linear[other])
    # S keeps the centres fixed, so D must move each centre as M does.
    places = np.einsum("jab,jb->ja", linear, centers) + palette[:, :3, 3]
    translations = places - np.einsum("jab,jb->ja", rotations, centers)
    real = matrix_to_quaternion(rotations)
    # Dual part: t q / 2 with t = (translation, 0) (eq. 5).
    x, y, z = np.moveaxis(0.5 * translations, -1, 0)
    qx, qy, qz, qw = np.moveaxis(real, -1, 0)
    dual = np.stack(
        [
            x * qw + y * qz - z * qy,
            y * qw + z * qx - x * qz,
            z * qw + x * qy - y * qx,
            -(x * qx + y * qy + z * qz),
        ],
        axis=-1,
    )
    shifts = centers - np.einsum("jab,jb->ja", stretches, centers)
    return np.concatenate([real, dual], axis=1), np.concatenate([stretches, shifts[..., None]], 2)


def _blended(
    skin: Skin, duals: Floats, stretches: Floats
) -> Iterator[tuple[np.ndarray, Floats, Floats]]:
    """Yield moving vertices with their unit dual quaternions and stretches, chunk by chunk."""
    for first in range(0, skin.n_vertices, _CHUNK):
        rows = slice(first, min(first + _CHUNK, skin.n_vertices))
        starts = skin.starts[rows.start : rows.stop + 1]
        listing = np.flatnonzero(np.diff(starts) > 0)
        if len(listing):
            blended, stretch, is_moved = _blend(skin, starts, listing, duals, stretches)
            yield (rows.start + listing)[is_moved], blended[is_moved], stretch[is_moved]


def _blend(
    skin: Skin, starts: Ints, listing: np.ndarray, duals: Floats, stretches: Floats
) -> tuple[Floats, Floats, Bools]:
    """Blend the influences of one chunk; the mask is False for vertices where they cancel out."""
    span = slice(starts[0], starts[-1])
    edges = starts[listing] - starts[0]
    joints, weights = skin.joints[span], skin.weights[span]
    sums = np.add.reduceat(weights, edges)
    is_moved = np.abs(sums) > _TINY
    counts = np.diff(np.append(edges, len(joints)))
    relative = weights / np.repeat(np.where(is_moved, sums, 1.0), counts)
    quaternions = duals[joints]
    # q and -q are the same rotation: only quaternions in one hemisphere can be averaged.
    first = np.repeat(quaternions[edges, :4], counts, axis=0)
    sides = np.where(np.einsum("na,na->n", quaternions[:, :4], first) < 0.0, -1.0, 1.0)
    blended = np.add.reduceat(quaternions * (relative * sides)[:, None], edges, axis=0)
    stretch = np.add.reduceat(stretches[joints] * relative[:, None, None], edges, axis=0)
    lengths = np.linalg.norm(blended[:, :4], axis=1)
    is_moved &= lengths > _TINY
    blended /= np.where(is_moved, lengths, 1.0)[:, None]
    return blended, stretch, is_moved


def moved_rigidly(duals: Floats, points: Floats) -> Floats:
    """Rotate, then translate by 2 (w_r v_d - w_d v_r + v_r x v_d) (Kavan 2008, algorithm 1)."""
    real, dual = duals[:, :3], duals[:, 4:7]
    w_real, w_dual = duals[:, 3:4], duals[:, 7:8]
    return _rotated(duals[:, :4], points) + 2.0 * (
        w_real * dual - w_dual * real + np.cross(real, dual)
    )


def _rotated(quaternions: Floats, vectors: Floats) -> Floats:
    """Rotate by unit quaternions (a, w): v + 2 a x (a x v + w v)."""
    axis, w = quaternions[:, :3], quaternions[:, 3:4]
    return vectors + 2.0 * np.cross(axis, np.cross(axis, vectors) + w * vectors)
