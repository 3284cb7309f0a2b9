"""Signed distances of the shapes from which a figure is blended.

Every shape maps points (N, 3) in metres to distances (N,): negative inside, zero on the surface.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

Floats = NDArray[np.float64]

MIRROR_SOFTNESS = 0.006  # radius that rounds the crease left by mirroring on the midline, metres
FAR = 0.12  # distance from its box above which a shape's distance is only a bound, metres


def fold(points: Floats) -> Floats:
    """Mirror points to the left side: x -> sqrt(x^2 + s^2), so slopes vanish at x = 0."""
    folded = points.copy()
    folded[:, 0] = np.sqrt(points[:, 0] ** 2 + MIRROR_SOFTNESS**2)
    return folded


def smooth_min(a: Floats, b: Floats, k: float) -> Floats:
    """Blend two distances: min(a, b) - h^2 k / 4 with h = max(1 - |a - b| / k, 0)."""
    h = np.maximum(1 - np.abs(a - b) / k, 0)
    return np.minimum(a, b) - h * h * (k / 4)


def smooth_max(a: Floats, b: Floats, k: float) -> Floats:
    """Intersect two shapes with a rounded edge; the counterpart of `smooth_min`."""
    return -smooth_min(-a, -b, k)


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """A curved limb: spheres of changing radius along a spline, flattened along one axis.

    Parameters
    ----------
    points : (S, 3)
        Dense samples of the centre line.
    radii : (S,)
        Radius at each sample.
    axis : (3,)
        Unit direction of the flattening.
    flat : float
        Thickness along ``axis`` divided by the radius.
    """

    points: Floats
    radii: Floats
    axis: Floats
    flat: float

    def distance(self, points: Floats) -> Floats:
        """Return the smallest distance to any segment of the tube."""
        reach = self.radii.max() + FAR
        low, high = self.points.min(0) - reach, self.points.max(0) + reach
        near = np.all((points > low) & (points < high), axis=1)
        result = np.full(len(points), FAR)
        best = np.full(int(near.sum()), FAR)
        for i in range(len(self.points) - 1):
            np.minimum(best, self._to_segment(points[near], i), out=best)
        result[near] = best
        return result

    def _to_segment(self, points: Floats, i: int) -> Floats:
        """Elliptic cone between samples i and i + 1: (|q'| - r) |q'| / |q''|."""
        start, step = self.points[i], self.points[i + 1] - self.points[i]
        offset = points - start
        t = np.clip(offset @ step / (step @ step), 0, 1)
        offset -= t[:, None] * step
        radius = self.radii[i] + t * (self.radii[i + 1] - self.radii[i])
        if self.flat == 1:
            return np.sqrt(np.einsum("ni,ni->n", offset, offset)) - radius
        across = (offset @ self.axis) ** 2
        along = np.einsum("ni,ni->n", offset, offset) - across
        once = np.sqrt(along + across / self.flat**2) + 1e-12
        twice = np.sqrt(along + across / self.flat**4) + 1e-12
        return (once - radius) * once / twice


def tube(rows: ArrayLike, flat: float = 1.0, axis: ArrayLike = (1, 0, 0), samples: int = 4) -> Tube:
    """Build a tube from rows (x, y, z, radius), interpolated without overshoot."""
    table = np.asarray(rows, dtype=float)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(table[:, :3], axis=0), axis=1))])
    n = (len(table) - 1) * samples + 1 if len(table) > 2 else 2
    dense = PchipInterpolator(length, table)(
        np.interp(np.linspace(0, 1, n), np.linspace(0, 1, len(length)), length)
    )
    direction = np.asarray(axis, dtype=float)
    return Tube(dense[:, :3], dense[:, 3], direction / np.linalg.norm(direction), flat)


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid:
    """An ellipsoid rotated about the x axis by ``pitch`` radians."""

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]
    pitch: float = 0.0

    def distance(self, points: Floats) -> Floats:
        """Return the first-order distance k0 (k0 - 1) / k1."""
        q = points - np.asarray(self.centre)
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        q = np.stack([q[:, 0], c * q[:, 1] + s * q[:, 2], -s * q[:, 1] + c * q[:, 2]], axis=1)
        r = np.asarray(self.radii)
        k0 = np.linalg.norm(q / r, axis=1) + 1e-12
        k1 = np.linalg.norm(q / r**2, axis=1) + 1e-12
        return k0 * (k0 - 1) / k1
