"""The joint regressor: each centre as a weighted mean of a ring of vertices around it."""

from dataclasses import dataclass

import numpy as np
from generator_tools.shapes import Floats
from scipy.optimize import nnls

from .joints import CENTRES, NAMES, PARTNERS

EXACT = 1e3  # weight of the error of a centre relative to the unevenness of weights
FOLLOW = 30.0  # relative weight of the error of a centre under a shape direction
SMALLEST = 1e-4  # weights below this are dropped
MOST = 64  # maximum number of vertices in a ring


@dataclass(frozen=True, slots=True)
class Ring:
    """Vertices within ``band`` of a plane through the joint and within ``radius`` of the joint."""

    normal: tuple[float, float, float]
    band: float
    radius: float


RINGS = {
    "pelvis": Ring((0, 1, 0), 0.030, 0.22),
    "hip": Ring((0, 1, 0), 0.035, 0.17),
    "spine1": Ring((0, 1, 0), 0.025, 0.20),
    "spine2": Ring((0, 1, 0), 0.025, 0.20),
    "spine3": Ring((0, 1, 0), 0.025, 0.21),
    "knee": Ring((0, 1, 0), 0.020, 0.10),
    "ankle": Ring((0, 1, 0.2), 0.016, 0.08),
    "foot": Ring((0.12, 0, 0.99), 0.014, 0.08),
    "neck": Ring((0, 0.93, 0.36), 0.025, 0.12),
    "head": Ring((0, 0.90, 0.43), 0.022, 0.11),
    "collar": Ring((1, 0, 0), 0.026, 0.16),
    "shoulder": Ring((0.95, 0.30, 0), 0.026, 0.12),
    "elbow": Ring((1, 0, 0), 0.016, 0.08),
    "wrist": Ring((1, 0, 0), 0.012, 0.06),
    "hand": Ring((0.97, 0, -0.2), 0.009, 0.06),
}


def _chosen(vertices: Floats, j: int) -> np.ndarray:
    side, _, kind = NAMES[j].rpartition("_")
    ring = RINGS[kind if side else NAMES[j]]
    offset = vertices - CENTRES[j]
    unit = np.asarray(ring.normal) / np.linalg.norm(ring.normal)
    near = np.linalg.norm(offset, axis=1) < ring.radius
    if side:  # rings of paired joints stay on the side of the joint
        near &= vertices[:, 0] >= 0
    away = np.abs(offset @ unit)
    chosen = np.nonzero(near & (away < ring.band))[0]
    return np.sort(chosen[np.argsort(away[chosen], kind="stable")[:MOST]])


def _solve(vertices: Floats, shapes: Floats, moved: Floats, j: int) -> tuple[np.ndarray, Floats]:
    """Return the vertices and weights of one joint, whose centres move by ``moved`` (J, 3, S)."""
    chosen = _chosen(vertices, j)
    even = 1 / len(chosen)
    follow = FOLLOW * shapes[chosen].reshape(len(chosen), -1).T
    system = np.concatenate(
        [
            EXACT * vertices[chosen].T,
            EXACT * np.ones((1, len(chosen))),
            follow,
            np.eye(len(chosen)),
        ]
    )
    wanted = np.concatenate(
        [
            EXACT * CENTRES[j],
            [EXACT],
            FOLLOW * moved[j].ravel(),
            np.full(len(chosen), even),
        ]
    )
    weights, _ = nnls(system, wanted, maxiter=20 * len(chosen))
    weights[weights < SMALLEST] = 0
    return chosen, weights / weights.sum()


def regress(vertices: Floats, partner: np.ndarray, shapes: Floats, moved: Floats) -> Floats:
    """Return the regressor (24, V), exactly mirrored.

    Parameters
    ----------
    vertices : (V, 3)
    partner : (V,)
        Mirror counterpart of each vertex.
    shapes : (V, 3, S)
        Shape directions.
    moved : (24, 3, S)
        Target displacements of the centres.
    """
    matrix = np.zeros((len(NAMES), len(vertices)))
    for j, other in enumerate(PARTNERS):
        if other < j:
            matrix[j] = matrix[other][partner]
            continue
        chosen, weights = _solve(vertices, shapes, moved, j)
        matrix[j, chosen] = weights
        if other == j:
            matrix[j] = 0.5 * (matrix[j] + matrix[j][partner])
    return matrix
