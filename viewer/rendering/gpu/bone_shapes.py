"""Shapes of drawn skeletons: octahedron, stick, arrow and ball, as triangles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.geometry.vectors import unit

__all__ = ["arrow", "ball", "octahedron", "stick"]

_Point: TypeAlias = tuple[float, float, float]

_WIDEST = 0.12  # position at which an octahedron is widest, as a fraction of the length
_FLATNESS = 0.7  # thickness over width, so that a 90-degree rotation about the length is visible
_SIDES = 8  # number of sides of sticks and arrows
_TIP = 0.72  # position at which the tip of an arrow begins, as a fraction of the length
_TIP_WIDTH = 2.4  # width of the tip, in widths of the shaft


def octahedron() -> Floats:
    """Return a flat octahedron from a joint to its child, with a ridge on its first side.

    Returns
    -------
    (N, 7)
        Corners of triangles: x and z in half-widths, y in lengths; normals, 0 for flat triangles;
        tint, 1 for the ridge, which shows the roll.
    """
    ring = [(1.0, _WIDEST, 0.0), (0.0, _WIDEST, _FLATNESS)]
    ring += [(-1.0, _WIDEST, 0.0), (0.0, _WIDEST, -_FLATNESS)]
    head, tail = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    faces = []
    for first, second in zip(ring, [*ring[1:], ring[0]], strict=True):
        faces += [(head, first, second), (tail, second, first)]
    return np.concatenate([_flat(faces, 0.0), _ridge(0.71, 0.2, 1.4, 0.74)])


def stick() -> Floats:
    """Return a prism from a joint to its child, with a ridge; rows as in ``octahedron``."""
    return np.concatenate([_tube([(0.0, 1.0), (1.0, 1.0)], 0.0), _ridge(0.9, 0.4, 2.3, 0.95)])


def arrow() -> Floats:
    """Return an arrow in the colour of its axis; rows as in ``octahedron``."""
    return _tube([(0.0, 1.0), (_TIP, 1.0), (_TIP, _TIP_WIDTH), (1.0, 0.0)], 1.0)


def ball() -> Floats:
    """Return a ball of radius 1 with smooth normals; rows as in ``octahedron``."""
    corners = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    points = np.array(corners, dtype=np.float64)
    faces = [(0, 2, 4), (4, 2, 1), (1, 2, 5), (5, 2, 0), (4, 3, 0), (1, 3, 4), (5, 3, 1), (0, 3, 5)]
    triangles: Floats = points[np.array(faces)]
    for _ in range(2):
        triangles = _split(triangles)
    places = triangles.reshape(-1, 3)
    return np.hstack([places, places, np.zeros((len(places), 1))])


def _split(triangles: Floats) -> Floats:
    """Split each triangle into four on the unit sphere: (4 N, 3, 3)."""
    a, b, c = (triangles[:, corner] for corner in range(3))
    ab, bc, ca = (unit(one + other) for one, other in ((a, b), (b, c), (c, a)))
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _ridge(foot: float, half: float, tip: float, end: float) -> Floats:
    """Return a pyramid on the side of +x, up to a third of the length.

    Parameters are in half-widths: position and thickness of its base, distance of its tip from the
    axis, and distance of the surface where the ridge ends.
    """
    low, high = (foot, _WIDEST, half), (foot, _WIDEST, -half)
    top, last = (tip, 1.3 * _WIDEST, 0.0), (end, 0.35, 0.0)
    return _flat([(low, high, top), (low, top, last), (high, last, top)], 1.0)


def _tube(profile: list[tuple[float, float]], tint: float) -> Floats:
    """Return a surface of revolution about y of (height, radius) pairs, with flat sides."""
    angles = 2.0 * np.pi * np.arange(_SIDES + 1) / _SIDES
    faces = []
    for (low, wide), (high, narrow) in pairwise(profile):
        for first, second in pairwise(angles):
            a, b = _around(first, low, wide), _around(second, low, wide)
            c, d = _around(second, high, narrow), _around(first, high, narrow)
            faces += [(a, b, c), (a, c, d)]
    return _flat(faces, tint)


def _around(angle: float, height: float, radius: float) -> _Point:
    return radius * float(np.cos(angle)), height, radius * float(np.sin(angle))


def _flat(faces: Sequence[tuple[_Point, _Point, _Point]], tint: float) -> Floats:
    """Return the corners of flat triangles of one tint."""
    corners = np.array(faces).reshape(-1, 3)
    count = len(corners)
    return np.hstack([corners, np.zeros((count, 3)), np.full((count, 1), tint)])
