"""Skin weights: a smooth step across each joint, multiplied down the hierarchy, then diffused.

The total weight of a joint and all joints below it is its parent's total times a step along a
direction through the joint, so the totals are nested and the weights sum to 1. Heat diffusion over
the surface then smooths them without crossing gaps, such as those between the legs or the fingers.
"""

from dataclasses import dataclass

import numpy as np
from generator_tools.diffusion import cotangent_stiffness
from generator_tools.shapes import Floats
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from .joints import NAMES, PARENTS, PARTNERS

DIFFUSION = 0.013  # distance over which the weights spread, metres
MOST = 4  # maximum number of joints per vertex
LEVELS = 4096  # number of levels: weights are multiples of its inverse


@dataclass(frozen=True, slots=True)
class Step:
    """A smooth step from 0 to 1 along ``direction``: 1/2 at ``place``, ``half`` metres each way."""

    place: tuple[float, float, float]
    direction: tuple[float, float, float]
    half: float

    def __call__(self, points: Floats) -> Floats:
        """Return the values (N,) of the step."""
        unit = np.asarray(self.direction) / np.linalg.norm(self.direction)
        t = np.clip(0.5 + 0.5 * (points - self.place) @ unit / self.half, 0, 1)
        return t * t * (3 - 2 * t)


STEPS = {
    "hip": Step((0.086, 0.866, 0.0), (0.63, -0.776, 0.08), 0.092),
    "spine1": Step((0, 1.035, -0.03), (0, 1, 0), 0.070),
    "knee": Step((0.099, 0.487, -0.008), (0, -1, 0.0), 0.066),
    "spine2": Step((0, 1.150, -0.03), (0, 1, 0), 0.070),
    "ankle": Step((0.108, 0.078, -0.036), (0, -1, 0.35), 0.040),
    "spine3": Step((0, 1.245, -0.03), (0, 1, 0), 0.065),
    "foot": Step((0.124, 0.019, 0.096), (0.12, 0, 0.99), 0.022),
    "neck": Step((0, 1.430, -0.045), (0, 0.93, 0.36), 0.048),
    "collar": Step((0.100, 1.300, -0.02), (0.62, 0.78, 0), 0.085),
    "head": Step((0, 1.497, -0.010), (0, 0.915, 0.40), 0.038),
    "shoulder": Step((0.170, 1.365, -0.024), (0.97, 0.22, 0), 0.072),
    "elbow": Step((0.440, 1.372, -0.031), (1, 0, 0), 0.050),
    "wrist": Step((0.690, 1.372, -0.019), (1, 0, 0), 0.030),
    "hand": Step((0.775, 1.372, -0.018), (0.96, 0, -0.25), 0.018),
}
BESIDE_NECK = Step((0.100, 0, 0), (-1, 0, 0), 0.045)
BESIDE_SPINE = Step((0.075, 0, 0), (1, 0, 0), 0.060)
CROTCH = 0.805  # height in metres below which the inner thighs follow only the legs
BETWEEN = Step((0.033, 0, 0), (1, 0, 0), 0.040)
BELOW_WAIST = Step((0, 1.12, 0), (0, -1, 0), 0.050)
NAPE = 1.44  # height in metres above which the neck's step is not limited sideways


def _gate(name: str, points: Floats) -> Floats:
    """Return an additional factor (N,) of a joint's step."""
    x, y, _ = points.T
    if name == "hip":
        moved = points.copy()
        moved[:, 0] = x + 1.5 * np.maximum(CROTCH - y, 0)
        return BETWEEN(moved) * BELOW_WAIST(points)
    if name == "neck":
        moved = points.copy()
        moved[:, 0] = x - 2 * np.maximum(y - NAPE, 0)
        return BESIDE_NECK(moved)
    if name == "collar":
        neck = STEPS["neck"](points) * _gate("neck", points)
        return BESIDE_SPINE(points) * (1 - neck)
    return np.ones(len(points))


def _totals(vertices: Floats) -> Floats:
    """Return the total weight (V, J) of each joint and all joints below it."""
    totals = np.ones((len(vertices), len(NAMES)))
    left = vertices * np.where(vertices[:, :1] < 0, [[-1, 1, 1]], 1)
    for j, (name, parent) in enumerate(zip(NAMES, PARENTS, strict=True)):
        if parent < 0:
            continue
        side, _, kind = name.rpartition("_")
        kind = kind if side else name
        step = STEPS[kind](left) * _gate(kind, left)
        if side:
            sign = 1 if side == "left" else -1
            step = np.where(sign * vertices[:, 0] < 0, 0, step)
        totals[:, j] = totals[:, parent] * step
    return totals


def _limited(weights: Floats) -> Floats:
    """Preserve the `MOST` largest weights of each row; the others fade out continuously."""
    next_largest = np.sort(weights, axis=1)[:, -MOST - 1]
    weights = np.maximum(weights - next_largest[:, None], 0)
    return weights / weights.sum(axis=1, keepdims=True)


def _rounded(weights: Floats) -> Floats:
    """Round to discrete levels that still sum to 1 in each row."""
    units = np.round(weights * LEVELS)
    rows = np.arange(len(weights))
    units[rows, weights.argmax(axis=1)] += LEVELS - units.sum(axis=1)
    return units / LEVELS


def skin_weights(vertices: Floats, triangles: np.ndarray, partner: np.ndarray) -> Floats:
    """Return weights (V, 24), exactly mirrored, at most `MOST` per vertex."""
    totals = _totals(vertices)
    own = totals.copy()
    for j, parent in enumerate(PARENTS):
        if parent >= 0:
            own[:, parent] -= totals[:, j]
    stiffness, areas = cotangent_stiffness(vertices, triangles)
    system = (diags(areas) + DIFFUSION**2 * stiffness).tocsc()
    weights = np.asarray(splu(system).solve(areas[:, None] * own))
    weights = np.maximum(weights, 0)
    weights = 0.5 * (weights + weights[partner][:, PARTNERS])
    weights = _limited(weights / weights.sum(axis=1, keepdims=True))
    weights = _rounded(weights)
    # Rounding resolves ties on the midline in favour of one side, so both sides are averaged.
    return 0.5 * (weights + weights[partner][:, PARTNERS])
