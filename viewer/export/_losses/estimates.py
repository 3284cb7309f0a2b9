"""Single-precision estimates of vertex distances, which select candidates for exact measurement.

Many frames are skinned together, a few hundred vertices at a time, so that their matrices stay in
the CPU cache. Candidates are then measured in double precision.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.export._losses.skinned import Body, Poses
from viewer.rig.arrays import Floats
from viewer.rig.skinning._blocks import blocks_of

Single = NDArray[np.float32]

_STEPS = 2.0**-18  # error bound of single-precision sums, relative to the largest term


class Estimator:
    """Estimator for two bodies with the same vertices.

    ``first``, ``second``: the bodies, stored in single precision.
    """

    def __init__(self, first: Body, second: Body) -> None:
        self._first, self._second = _Rest(first), _Rest(second)
        self._gap = (first.positions - second.positions).T.ravel().astype(np.float32)
        self._strayed = None
        if first.shapes is not None and second.shapes is not None:
            self._strayed = _rows(first.shapes - second.shapes)
        self._skins = first.skin, second.skin
        self._excess = _sums(first) - _sums(second)
        self._left = 1.0 - _sums(second)

    def of_rest(self, first: Poses, second: Poses) -> Single:
        """Return upper bounds of the distances between the rest meshes: (F, V)."""
        corrective_weights = first.corrective_weights
        if second.corrective_weights.shape[1]:
            corrective_weights = corrective_weights - second.corrective_weights
        change = first.weights
        if self._second.shapes is not None:
            change = change - second.weights
        gap = replace(first, corrective_weights=corrective_weights, weights=change)
        off = self._first.moves(gap) + self._gap
        if self._strayed is not None:
            off = off + second.weights.astype(np.float32) @ self._strayed
        found = _lengths(off.reshape(len(off), 3, -1))
        return np.broadcast_to(found * (1.0 + _STEPS), (len(first.palette), found.shape[1]))

    def of_skinned(self, first: Poses, second: Poses) -> Single:
        """Return upper bounds of the distances between the skinned vertices: (F, V)."""
        # Move both palettes near the origin, where single precision is more accurate.
        shift = first.shifts - second.shifts
        away = first.palette[:, 0, :3, 3]
        palettes = first.palette.copy(), second.palette.copy()
        palettes[0][..., :3, 3] -= away[:, None]
        palettes[1][..., :3, 3] -= (away + shift)[:, None]
        rests = self._first.of(first), self._second.of(second)
        off = np.zeros((len(away), 3, rests[0].shape[2]), np.float32)
        for sign, rest, skin, palette in zip((1, -1), rests, self._skins, palettes, strict=True):
            rows = palette[:, :, :3].transpose(0, 2, 3, 1).reshape(len(palette), 12, -1)
            rows = rows.astype(np.float32)
            for block in blocks_of(skin):
                blended = np.take(rows, block.joints, axis=2) @ block.weights.astype(np.float32)
                blended = blended.reshape(len(rows), 3, 4, -1)
                moved = blended[:, :, 3]
                for axis in range(3):
                    moved += blended[:, :, axis] * rest[:, axis, None, block.rows]
                off[..., block.rows] += np.float32(sign) * moved
        for vectors, amounts in ((away, self._excess), (shift, self._left)):
            if amounts.any():
                off += (vectors[:, :, None] * amounts).astype(np.float32)
        found = _lengths(off)
        return np.asarray(found + _doubts(palettes, rests)[:, None].astype(np.float32))


class _Rest:
    """Rest meshes of a body in many poses."""

    def __init__(self, body: Body) -> None:
        self.positions = body.positions.T.astype(np.float32)
        self.shapes = _rows(body.shapes)
        self.correctives = _rows(body.correctives)

    def moves(self, poses: Poses) -> Single:
        """Return displacements by shapes and correctives: (F, 3 V), or (1, 3 V) if constant."""
        found = np.zeros((1, self.positions.size), np.float32)
        for directions, weights in (
            (self.shapes, poses.weights),
            (self.correctives, poses.corrective_weights),
        ):
            if directions is not None and weights.any():
                found = found + weights.astype(np.float32) @ directions
        return found

    def of(self, poses: Poses) -> Single:
        """Return the rest mesh of each pose: (F, 3, V)."""
        moved = self.moves(poses)
        rest = moved.reshape(len(moved), 3, -1) + self.positions
        return np.broadcast_to(rest, (len(poses.palette), *self.positions.shape))


def _rows(directions: Floats | None) -> Single | None:
    """Return directions (S, V, 3) as rows of all x, then y, then z: (S, 3 V)."""
    if directions is None:
        return None
    turned = directions.transpose(0, 2, 1).astype(np.float32, order="C")
    return turned.reshape(len(directions), -1)


def _lengths(vectors: Single) -> Single:
    """Return the lengths of vectors (F, 3, V): (F, V)."""
    squares = vectors[:, 0] * vectors[:, 0]
    squares += vectors[:, 1] * vectors[:, 1]
    squares += vectors[:, 2] * vectors[:, 2]
    return np.sqrt(squares, out=squares)


def _sums(body: Body) -> Floats:
    """Return the sum of weights of each vertex in double precision: (V,)."""
    skin = body.skin
    owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))
    return np.bincount(owners, skin.weights, skin.n_vertices).astype(np.float64)


def _doubts(palettes: tuple[Floats, Floats], rests: tuple[Single, Single]) -> Floats:
    """Return error bounds of single precision: (F,)."""
    found = np.zeros(len(palettes[0]))
    for palette, rest in zip(palettes, rests, strict=True):
        linear = np.abs(palette[..., :3, :3]).sum(axis=3).max(axis=(1, 2))
        far = np.abs(palette[..., :3, 3]).max(axis=(1, 2))
        found += _STEPS * (far + linear * np.abs(rest).max(axis=(1, 2), initial=0.0))
    return found
