"""Inexpensive upper bounds of the distance between the vertices of two bodies, one per pose.

With palettes M and N, rest meshes a and b, weights v and w, and T = max sum_j |v_j|::

    |sum v_j M_j a - sum w_j N_j b| <= T max_j |(M_j - N_j) b| + T max_j |M_j| max |a - b|
                                     + max_v sum_j |v_j - w_j| max_j |N_j b|

The vertices of each joint are bounded by a sphere, so a bound takes only a few operations per
joint. Poses whose bound is below the tolerance, or below the largest distance so far, are skipped.
"""

from __future__ import annotations

import weakref

import numpy as np

from viewer.export._losses.skinned import Body, Poses
from viewer.rig.arrays import Floats
from viewer.rig.skin import Skin, merged, owners, skin_from_entries

# Cached bounds of the correctives used last: a batch writes many motions of the same body.
_known: tuple[weakref.ref[Floats] | None, Floats] = (None, np.zeros(0))

_NUMBERS = 9  # entries of a joint's rotation matrix, which drive the correctives


class Bounds:
    """Bounds for two bodies with the same vertices and joints.

    ``first``, ``second``: the bodies; the second has the same correctives as the first, or none.
    """

    def __init__(self, first: Body, second: Body) -> None:
        same = _are_equal(first.skin, second.skin)
        both = first.skin if same else _joined(first.skin, second.skin, 1.0)
        self._centers, self._radii = _spheres(second, both)
        self._most = float(_sums(first.skin).max(initial=0.0))
        self._change = 0.0
        if not same:
            self._change = float(_sums(_joined(first.skin, second.skin, -1.0)).max(initial=0.0))
        off = np.linalg.norm(first.positions - second.positions, axis=1)
        self._apart = float(off.max(initial=0.0))
        self._shapes, self._other_shapes = first.shapes, second.shapes
        self._lengths = _lengths(first.shapes)
        self._strayed = np.zeros(0)
        if first.shapes is not None and second.shapes is not None:
            self._strayed = _lengths(first.shapes - second.shapes)
        self._stretches = _stretches(first.correctives)

    def of(self, first: Poses, second: Poses) -> Floats:
        """Return an upper bound of the vertex distance for each pose: (F,)."""
        rest = self.stretches(first) * self._rest(first, second)
        return self.by_joints(first, second) + rest

    def stretches(self, first: Poses) -> Floats:
        """Return the largest factor by which skinning can enlarge |a - b|: (F,)."""
        return self._most * _largest_stretch(first.palette)

    def by_joints(self, first: Poses, second: Poses) -> Floats:
        """Return the part of the bound that is due to joints and weights: (F,)."""
        shift = first.shifts - second.shifts
        other = second.palette.copy()
        other[..., :3, 3] -= shift[:, None]
        reach = self._radii + self._moved(second)[:, None]
        found = self._most * self._farthest(first.palette - other, reach)
        if self._change > 0.0:
            far = self._farthest(other, reach) + np.linalg.norm(shift, axis=1)
            found += self._change * far
        return found

    def _farthest(self, palette: Floats, reach: Floats) -> Floats:
        """Return the largest length to which matrices map vertices of their joints: (F,)."""
        at_center = np.einsum("fjab,jb->fja", palette[..., :3, :3], self._centers)
        at_center += palette[..., :3, 3]
        sizes = np.linalg.norm(palette[..., :3, :3], axis=(2, 3))
        far = np.linalg.norm(at_center, axis=2) + sizes * reach
        return np.asarray(far.max(axis=1))

    def _moved(self, poses: Poses) -> Floats:
        """Return the largest displacement by shapes and correctives of the second body: (F,)."""
        far = np.zeros(len(poses.palette))
        if self._other_shapes is not None:
            far = far + np.abs(poses.weights) @ _lengths(self._other_shapes)
        if poses.corrective_weights.shape[1]:
            far = far + _norms(poses.corrective_weights) @ self._stretches
        return far

    def _rest(self, first: Poses, second: Poses) -> Floats:
        """Return the upper bound of |a - b|: (F,)."""
        found = np.full(len(first.palette), self._apart)
        if self._shapes is not None:
            both = self._other_shapes is not None
            change = first.weights - second.weights if both else first.weights
            found = found + np.abs(change) @ self._lengths
            if both:
                found = found + np.abs(second.weights) @ self._strayed
        if first.corrective_weights.shape[1]:
            change = first.corrective_weights
            if second.corrective_weights.shape[1]:
                change = change - second.corrective_weights
            found = found + _norms(change) @ self._stretches
        return found


def _are_equal(first: Skin, second: Skin) -> bool:
    """Return whether two skins have the same influences."""
    return first is second or (
        np.array_equal(first.starts, second.starts)
        and np.array_equal(first.joints, second.joints)
        and np.array_equal(first.weights, second.weights)
    )


def _spheres(body: Body, skin: Skin) -> tuple[Floats, Floats]:
    """Return bounding spheres of each joint's vertices: centres (J, 3) and radii (J,)."""
    order = np.argsort(skin.joints, kind="stable")
    joints, points = skin.joints[order], body.positions[owners(skin)[order]]
    found, starts = np.unique(joints, return_index=True)
    centers, radii = np.zeros((skin.n_joints, 3)), np.zeros(skin.n_joints)
    if len(found):
        low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
        centers[found] = 0.5 * (low + high)
        off = np.linalg.norm(points - centers[joints], axis=1)
        radii[found] = np.maximum.reduceat(off, starts)
    return centers, radii


def _joined(first: Skin, second: Skin, factor: float) -> Skin:
    """Return the sum of the first skin's weights and ``factor`` times the second's."""
    return merged(
        skin_from_entries(
            first.n_vertices,
            np.concatenate([owners(first), owners(second)]),
            np.concatenate([first.joints, second.joints]),
            np.concatenate([first.weights, factor * second.weights]),
            first.inverse_bind,
        )
    )


def _sums(skin: Skin) -> Floats:
    """Return the sum of absolute weights of each vertex: (V,)."""
    return np.bincount(owners(skin), np.abs(skin.weights), skin.n_vertices).astype(np.float64)


def _lengths(directions: Floats | None) -> Floats:
    """Return the largest displacement of a vertex by each blend shape: (S,)."""
    if directions is None:
        return np.zeros(0)
    return np.sqrt(np.einsum("sva,sva->sv", directions, directions).max(axis=1, initial=0.0))


def _norms(weights: Floats) -> Floats:
    """Return the norm of the nine corrective weights of each joint: (F, J)."""
    return np.asarray(np.linalg.norm(weights.reshape(len(weights), -1, _NUMBERS), axis=2))


def _stretches(correctives: Floats | None) -> Floats:
    """Return upper bounds of the displacement by nine corrective weights of norm 1: (J,)."""
    global _known
    if correctives is None:
        return np.zeros(0)
    known, found = _known
    if known is None or known() is not correctives:
        squares = np.einsum("pva,pva->pv", correctives, correctives)
        of_joints = squares.reshape(len(squares) // _NUMBERS, _NUMBERS, -1).sum(axis=1)
        found = np.sqrt(of_joints.max(axis=1, initial=0.0))
        if not correctives.flags.writeable:
            _known = weakref.ref(correctives), found
    return found


def _largest_stretch(palette: Floats) -> Floats:
    """Return upper bounds of the palettes' spectral norms: (F,), exact for rotations."""
    linear = palette[..., :3, :3]
    squares = np.swapaxes(linear, -1, -2) @ linear
    return np.asarray(np.sqrt(np.abs(squares).sum(axis=-1).max(axis=(1, 2))))
