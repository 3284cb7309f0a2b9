"""Pose correctives: columns linear in R - I, fitted to improved bends.

For samples of one joint's rotation, the skinned surface is improved: the skin keeps its distance
from the bones, flesh on the two sides of a bend meets at the plane between them instead of
interpenetrating, and muscles bulge. The displacements are mapped back to the rest pose and fitted
by ridge regression; values below a threshold are dropped, so that the columns are sparse.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from generator_tools.shapes import Floats
from scipy.sparse import csr_matrix

from .anatomy import Bend, Bulge, bend_of, samples
from .joints import CENTRES, NAMES, PARENTS, PARTNERS, index
from .pose import rotation, skin, world

SAMPLES = 24  # number of random rotations per joint, in addition to rotations about single axes
RIDGE = 0.05
ROUNDS = 3  # iterations of correction and smoothing
SMOOTHING = 3  # smoothing passes per iteration
LEAST = 3e-4  # minimum length of corrections, metres; smaller ones are dropped
MUSH_PASSES = 12  # iterations of smoothing a bend
RESTORE = 0.85  # fraction of the lost distance to the bone that is restored
DEEPEST = 0.05  # maximum length of corrections, metres
STRAIGHT = 0.2  # minimum length of the sum of two unit vectors at a joint that has a fold


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """The rest figure: vertices, weights, mirror counterparts and smoothing matrix (V, V)."""

    vertices: Floats
    weights: Floats
    partner: np.ndarray
    smoother: csr_matrix


def _closest(points: Floats, line: Floats) -> Floats:
    """Return the nearest points (N, 3) of a polyline (S, 3)."""
    best, nearest = np.full(len(points), np.inf), np.zeros_like(points)
    for start, end in pairwise(line):
        step = end - start
        t = np.clip((points - start) @ step / (step @ step), 0, 1)
        on_line = start + t[:, None] * step
        far = np.linalg.norm(points - on_line, axis=1)
        closer = far < best
        best[closer], nearest[closer] = far[closer], on_line[closer]
    return nearest


def _chain(bend: Bend, name: str) -> list[int]:
    side = "left_" if name.startswith("left_") else ""
    return [index(side + kind if side + kind in NAMES else kind) for kind in bend.chain]


def _subtree(j: int) -> np.ndarray:
    """Return a mask of a joint and all joints below it."""
    below = np.zeros(len(NAMES), dtype=bool)
    below[j] = True
    for k, parent in enumerate(PARENTS):
        below[k] |= parent >= 0 and below[parent]
    return below


def _influence(body: Body, bend: Bend, j: int) -> Floats:
    """Return values 0..1 (V,): 1 near the joint, where its weights blend with its parent's."""
    far = np.linalg.norm(body.vertices - CENTRES[j], axis=1) / bend.reach
    share = body.weights[:, _subtree(j)].sum(axis=1)
    mixed = np.clip(12 * share * (1 - share), 0, 1)
    return np.clip(1.6 * (1 - far), 0, 1) * mixed


def _mushed(body: Body, moved: Floats, blended: Floats) -> Floats:
    """Return displacements (V, 3) that smooth the bend but preserve the rest figure's detail.

    Mancewicz et al. 2014, "Delta Mush: smoothing deformations while preserving detail".
    """
    smooth, rest = moved, body.vertices
    for _ in range(MUSH_PASSES):
        smooth, rest = body.smoother @ smooth, body.smoother @ rest
    detail = np.einsum("vab,vb->va", blended[:, :3, :3], body.vertices - rest)
    return smooth + detail - moved


def _restored(body: Body, moved: Floats, line: Floats, rest_line: Floats) -> Floats:
    """Return displacements (V, 3) that restore the skin's distance from the bones."""
    rest = np.linalg.norm(body.vertices - _closest(body.vertices, rest_line), axis=1)
    away = moved - _closest(moved, line)
    now = np.linalg.norm(away, axis=1)
    lost = np.clip(rest - now, -0.004, DEEPEST)
    return (RESTORE * lost / np.maximum(now, 0.01))[:, None] * away


def _fold_side(moved: Floats, bend: Bend, j: int, turned: Floats) -> Floats:
    """Return values 0..1 (V,): how far each point is on the inner side of the bend."""
    inner = np.asarray(bend.above, float) + turned @ np.asarray(bend.below, float)
    size = np.linalg.norm(inner)
    if size < STRAIGHT:
        return np.zeros(len(moved))
    return np.clip((moved - CENTRES[j]) @ (inner / size) / 0.02, 0, 1) * min(size, 1)


def _parted(body: Body, moved: Floats, bend: Bend, j: int, turned: Floats) -> Floats:
    """Return displacements (V, 3) that keep the two sides of a bend apart."""
    above = np.asarray(bend.above, float)
    plane = turned @ np.asarray(bend.below, float) - above
    rest_plane = np.asarray(bend.below, float) - above
    plane, rest_plane = (v / np.linalg.norm(v) for v in (plane, rest_plane))
    side = (moved - CENTRES[j]) @ plane
    own = (body.vertices - CENTRES[j]) @ rest_plane
    wrong = np.where(own > 0, np.minimum(side, 0), np.maximum(side, 0))
    return -np.clip(wrong, -DEEPEST, DEEPEST)[:, None] * plane


def _bulged(body: Body, bulge: Bulge, vector: Floats) -> Floats:
    """Return a muscle's displacements (V, 3) in the rest pose."""
    angle = max(float(vector @ np.asarray(bulge.about, float)), 0.0)
    far = np.sum(((body.vertices - bulge.place) / bulge.radii) ** 2, axis=1)
    return (1 - np.cos(angle)) * np.exp(-far)[:, None] * np.asarray(bulge.push)


def _target(body: Body, bend: Bend, j: int, vector: Floats) -> Floats:
    """Return the target displacements (V, 3) in the rest pose for one rotation."""
    matrices = np.tile(np.eye(3), (len(NAMES), 1, 1))
    matrices[j] = rotation(vector)
    transforms = world(matrices, CENTRES)
    moved, blended = skin(body.vertices, body.weights, transforms)
    chain = _chain(bend, NAMES[j])
    ends = CENTRES[chain]
    line = np.einsum("sab,sb->sa", transforms[chain, :3, :3], ends) + transforms[chain, :3, 3]
    mask = _influence(body, bend, j)[:, None]
    step = np.zeros_like(moved)
    for _ in range(ROUNDS):
        step += bend.smooth * mask * _mushed(body, moved + step, blended)
        fold = _fold_side(moved + step, bend, j, matrices[j])[:, None]
        kept, parted = bend.fold
        outside = 1 - (1 - kept) * fold
        step += mask * outside * _restored(body, moved + step, line, ends)
        step += mask * parted * fold * _parted(body, moved + step, bend, j, matrices[j])
        for _ in range(SMOOTHING):
            step = body.smoother @ step
    rest = np.linalg.solve(blended[:, :3, :3] + 1e-3 * np.eye(3), step[..., None])[..., 0]
    length = np.linalg.norm(rest, axis=1, keepdims=True)
    rest *= np.minimum(1, DEEPEST / np.maximum(length, 1e-9))
    for bulge in bend.bulges:
        rest += _bulged(body, bulge, vector)
    return rest


def _fit(body: Body, j: int) -> Floats:
    """Return one joint's columns (V, 3, 9)."""
    bend = bend_of(NAMES[j])
    vectors = samples(bend, SAMPLES, seed=j)
    features = (rotation(vectors) - np.eye(3)).reshape(len(vectors), 9)
    wanted = np.stack([_target(body, bend, j, vector).ravel() for vector in vectors])
    system = features.T @ features + RIDGE * np.eye(9)
    columns = np.linalg.solve(system, features.T @ wanted)
    reached = np.abs(features @ columns).reshape(len(vectors), -1, 3)
    weak = np.linalg.norm(reached, axis=2).max(axis=0) < LEAST
    columns = columns.reshape(9, -1, 3).transpose(1, 2, 0)
    columns[weak] = 0
    return columns


def _mirrored(columns: Floats, partner: np.ndarray) -> Floats:
    """Return the columns of the joint on the other side."""
    flip = np.array([-1.0, 1.0, 1.0])
    signs = flip[:, None] * np.outer(flip, flip).ravel()
    return columns[partner] * signs


def pose_directions(body: Body) -> Floats:
    """Return the pose blend columns (V, 3, 207), exactly mirrored."""
    columns = np.zeros((len(body.vertices), 3, 9 * len(NAMES)))
    for j, other in enumerate(PARTNERS):
        if j == 0 or other < j:
            continue
        own = _fit(body, j)
        image = _mirrored(own, body.partner)
        if other == j:
            own = image = 0.5 * (own + image)
        columns[..., 9 * j : 9 * j + 9] = own
        columns[..., 9 * other : 9 * other + 9] = image
    return columns[..., 9:]
