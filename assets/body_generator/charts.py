"""Texture coordinates: the left half is cut into a few charts, which are flattened and packed.

A chart is mapped to a disc first, which never folds it (Tutte 1963), then relaxed to preserve
shapes ("A Local/Global Approach to Mesh Parameterization", Liu et al. 2008). The right half shares
the charts.
"""

from itertools import pairwise

import numpy as np
from generator_tools.diffusion import cotangent_stiffness
from generator_tools.remesh import drop_unused, face_normals, find_edges
from generator_tools.shapes import Floats
from scipy.sparse import csr_matrix, eye
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu, spsolve

ROUNDS = 12  # iterations of the relaxation of a chart
MARGIN = 0.006  # margin around each chart, as a fraction of the square
SMOOTHING = 8  # smoothing iterations of the values that distinguish front and back
# Coordinates at which charts end, metres.
NECK, SHOULDER, WRIST, CROTCH, SOLE = 1.490, 0.200, 0.700, 0.800, 0.030

# Vertical axis and magnification of each chart: trunk (front, back), arm (below, above), hand
# (below, above), sole, head, leg (front, back).
UPWARDS = (1, 1, 0, 0, 0, 0, 2, 1, 1, 1)
ENLARGED = (1.0, 1.0, 1.0, 1.0, 1.4, 1.4, 1.2, 1.6, 1.0, 1.0)


def _sides(vertices: Floats, triangles: np.ndarray, axis: int) -> Floats:
    """Return the component of each triangle's normal along an axis, smoothed over neighbours."""
    faces = face_normals(vertices, triangles)
    at_corners = np.zeros((len(vertices), 3))
    for _ in range(SMOOTHING):
        at_corners[:] = 0
        for corner in range(3):
            np.add.at(at_corners, triangles[:, corner], faces)
        faces = at_corners[triangles].mean(axis=1)
    return faces[:, axis] / np.linalg.norm(faces, axis=1)


def _labels(vertices: Floats, triangles: np.ndarray) -> np.ndarray:
    """Return the chart of each triangle before stray pieces are joined to their neighbours."""
    x, y, _ = vertices[triangles].mean(axis=1).T
    front = (_sides(vertices, triangles, 2) > 0).astype(int)
    top = (_sides(vertices, triangles, 1) > 0).astype(int)
    label = np.where(x > SHOULDER, 2 + top, np.where(y < CROTCH, 9, 1) - front)
    label = np.where(x > WRIST, 4 + top, label)
    label = np.where((y < SOLE) & (top == 0), 6, label)
    return np.where(y > NECK, 7, label)


def _without_spikes(triangles: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Assign triangles that share two edges with another chart to that chart."""
    edges = find_edges(triangles)
    pairs = edges.faces[edges.faces[:, 1] >= 0]
    charts = label.max() + 1
    for _ in range(10):
        votes = np.zeros((len(label), charts))
        np.add.at(votes, (pairs[:, 0], label[pairs[:, 1]]), 1)
        np.add.at(votes, (pairs[:, 1], label[pairs[:, 0]]), 1)
        label = np.where(votes.max(axis=1) >= 2, votes.argmax(axis=1), label)
    return label


def _joined(triangles: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Assign all but the largest piece of each chart to the chart with most shared edges."""
    edges = find_edges(triangles)
    pairs = edges.faces[edges.faces[:, 1] >= 0]
    for _ in range(20):
        same = pairs[label[pairs[:, 0]] == label[pairs[:, 1]]]
        links = csr_matrix((np.ones(len(same)), same.T), shape=(len(label),) * 2)
        count, piece = connected_components(links, directed=False)
        sizes = np.bincount(piece)
        owner = np.zeros(count, dtype=int)
        owner[piece] = label
        largest = {k: np.argmax(np.where(owner == k, sizes, 0)) for k in np.unique(label)}
        strays = [p for p in range(count) if largest[owner[p]] != p]
        if not strays:
            return label
        label = label.copy()
        for stray in strays:
            touching = piece[pairs] == stray
            other = pairs[touching.sum(axis=1) == 1][~touching[touching.sum(axis=1) == 1]]
            label[piece == stray] = np.bincount(label[other]).argmax()
    raise ValueError("the charts do not converge")


def _rim(triangles: np.ndarray) -> np.ndarray:
    """Return the boundary vertices of a disc in order."""
    half = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known = {tuple(edge) for edge in half.tolist()}
    following = {a: b for a, b in known if (b, a) not in known}
    loop = [min(following)]
    while len(loop) < len(following):
        loop.append(following[loop[-1]])
        if loop[-1] == loop[0]:
            raise ValueError("a chart has a hole")
    return np.array(loop)


def _on_disc(vertices: Floats, triangles: np.ndarray, rim: np.ndarray) -> Floats:
    """Return positions (V, 2) with the rim on a circle and all others at the mean of neighbours."""
    lengths = [np.linalg.norm(vertices[a] - vertices[b]) for a, b in pairwise([*rim, rim[0]])]
    turn = 2 * np.pi * np.cumsum([0.0, *lengths[:-1]]) / np.sum(lengths)
    stiffness, _ = cotangent_stiffness(vertices, triangles)
    flat = np.zeros((len(vertices), 2))
    flat[rim] = np.column_stack([np.cos(turn), np.sin(turn)])
    inner = np.setdiff1d(np.arange(len(vertices)), rim)
    right = -(stiffness[inner][:, rim] @ flat[rim])
    flat[inner] = spsolve(stiffness[inner][:, inner].tocsc(), right)
    return flat * np.sum(lengths) / (2 * np.pi)


def _plane_corners(vertices: Floats, triangles: np.ndarray) -> Floats:
    """Return each triangle's corners (T, 3, 2) in its own plane, without distortion."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    base = np.linalg.norm(b - a, axis=1)
    along = np.einsum("ti,ti->t", c - a, b - a) / base
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / base
    zero = np.zeros_like(base)
    return np.stack([zero, zero, base, zero, along, height], axis=1).reshape(-1, 3, 2)


def _is_simple(flat: Floats, triangles: np.ndarray, rim: np.ndarray) -> bool:
    """Return whether no triangle is flipped and the rim does not intersect itself."""
    a, b, c = (flat[triangles[:, i]] for i in range(3))
    if np.any(_cross(b - a, c - a) <= 0):
        return False
    start, end = flat[rim], flat[np.roll(rim, -1)]
    side = end - start
    first = _cross(side[:, None], start - start[:, None])
    second = _cross(side[:, None], end - start[:, None])
    parts = first * second < 0
    return not np.any(parts & parts.T)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _flatten(vertices: Floats, triangles: np.ndarray) -> Floats:
    """Return a chart's positions (V, 2), in which triangles are as rigid as possible."""
    rim = _rim(triangles)
    flat = best = _on_disc(vertices, triangles, rim)
    corners = _plane_corners(vertices, triangles)
    stiffness, _ = cotangent_stiffness(vertices, triangles)
    solver = splu((stiffness + 1e-9 * eye(len(vertices))).tocsc())
    for _ in range(ROUNDS):
        u = flat[triangles] - flat[triangles].mean(axis=1, keepdims=True)
        p = corners - corners.mean(axis=1, keepdims=True)
        left, _, right = np.linalg.svd(np.einsum("tci,tcj->tij", u, p))
        left[:, :, 1] *= np.linalg.det(left @ right)[:, None]
        turned = np.einsum("tij,tcj->tci", left @ right, corners)
        wanted = np.zeros_like(flat)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            e, f = (corners[:, m] - corners[:, k] for m in (i, j))
            twice = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])
            weight = 0.5 * np.maximum(np.einsum("ti,ti->t", e, f) / twice, 0.02)
            pull = weight[:, None] * (turned[:, i] - turned[:, j])
            np.add.at(wanted, triangles[:, i], pull)
            np.add.at(wanted, triangles[:, j], -pull)
        flat = solver.solve(wanted)
        if _is_simple(flat, triangles, rim):
            best = flat
    return best


def _upright(vertices: Floats, flat: Floats, axis: int) -> Floats:
    """Rotate a chart so that the figure's ``axis`` points up, and move its box to the origin."""
    slope, *_ = np.linalg.lstsq(
        np.column_stack([flat, np.ones(len(flat))]), vertices[:, axis], rcond=None
    )
    up = slope[:2] / np.linalg.norm(slope[:2])
    turned = flat @ np.array([[up[1], up[0]], [-up[0], up[1]]])
    return turned - turned.min(axis=0)


def _shelves(sizes: Floats, scale: float) -> Floats | None:
    """Pack boxes (N, 2) onto shelves of the unit square; None if they do not fit."""
    boxes = scale * sizes + 2 * MARGIN
    places, x, y, tallest = np.zeros_like(boxes), 0.0, 0.0, 0.0
    for i in np.argsort(-boxes[:, 1], kind="stable"):
        if x + boxes[i, 0] > 1:
            x, y, tallest = 0.0, y + tallest, 0.0
        if x + boxes[i, 0] > 1 or y + boxes[i, 1] > 1:
            return None
        places[i] = x + MARGIN, y + MARGIN
        x, tallest = x + boxes[i, 0], max(tallest, boxes[i, 1])
    return places


def texture_map(vertices: Floats, triangles: np.ndarray) -> tuple[Floats, np.ndarray]:
    """Return texture coordinates (U, 2) and their triangles (F, 3) for the mirrored mesh."""
    half = triangles[: len(triangles) // 2]
    label = _joined(half, _without_spikes(half, _labels(vertices, half)))
    corners, charts, used = np.empty_like(half), [], 0
    for k in np.unique(label):
        points, local = drop_unused(vertices, half[label == k])
        flat = _upright(points, _flatten(points, local), UPWARDS[k])
        charts.append(ENLARGED[k] * flat)
        corners[label == k] = local + used
        used += len(points)
    sizes = np.array([np.ptp(chart, axis=0) for chart in charts])
    scale = next(s for s in np.geomspace(4, 0.05, 400) if _shelves(sizes, s) is not None)
    places = _shelves(sizes, scale)
    flat = [scale * chart + place for chart, place in zip(charts, places, strict=True)]
    return np.concatenate(flat), np.concatenate([corners, corners[:, ::-1]])
