"""Small synthetic models with the keys of the SMPL family, bit-identical on every machine.

All numbers are sines and cosines of indices, rounded to multiples of a power of two that float32
represents exactly, so a reader that converts to float32 (as the package smplx does) gets the same
model.
"""

from collections.abc import Iterable

import numpy as np

KINDS = ("smpl", "smplh", "smplx", "mano", "flame")
"""Kinds of models, as their published names in lower case."""

NO_PARENT = 4294967295
"""The parent of the root in ``kintree_table``, -1 as an unsigned number."""

TURNS = 8
"""Vertices per turn of the spiral that forms the skin."""

BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
FACE_PARENTS = (15, 15, 15)

# Offsets from the parent joint in metres, for the pelvis and the left side of the body.
BODY_STEPS = {
    0: (0.0, -0.25, 0.03),
    1: (0.08, -0.08, 0.0),
    3: (0.0, 0.11, -0.03),
    4: (0.04, -0.38, 0.0),
    6: (0.0, 0.13, 0.0),
    7: (-0.01, -0.4, -0.04),
    9: (0.0, 0.06, 0.03),
    10: (0.02, -0.06, 0.12),
    12: (0.0, 0.21, -0.04),
    13: (0.07, 0.12, -0.02),
    15: (0.0, 0.08, 0.05),
    16: (0.1, 0.04, -0.01),
    18: (0.26, -0.02, -0.02),
    20: (0.25, 0.01, 0.0),
}
FACE_STEPS = ((0.0, 0.01, 0.06), (0.03, 0.07, 0.09), (-0.03, 0.07, 0.09))
HEAD_STEPS = ((0.0, -0.05, 0.01), (0.0, 0.06, 0.02), *FACE_STEPS)


def model(
    kind: str, n_vertices: int = 96, n_shapes: int = 10, n_expressions: int = 10
) -> dict[str, np.ndarray]:
    """Return a complete model as the arrays of a published file.

    Parameters
    ----------
    kind
        One of ``KINDS``: 24, 52, 55, 16 or 5 joints.
    n_vertices
        At least 16; the mesh has 2 * n_vertices - 4 triangles.
    n_shapes
        Columns of ``shapedirs`` for the shape.
    n_expressions
        Further columns for the expression; only smplx and flame have them.

    >>> body = model("smplx")
    >>> body["weights"].shape, body["shapedirs"].shape, body["posedirs"].shape
    ((96, 55), (96, 3, 20), (96, 3, 486))
    """
    parents = joint_parents(kind)
    n_joints = len(parents)
    template = _template(kind, n_vertices)
    faces = _faces(n_vertices)
    regressor = _regressor(template, _joint_targets(kind))
    size = {"mano": 0.2, "flame": 0.3}.get(kind, 1.0)
    n_columns = n_shapes + (n_expressions if kind in ("smplx", "flame") else 0)
    kintree = np.stack([np.array(parents) % (NO_PARENT + 1), np.arange(n_joints)])
    arrays = {
        "v_template": template,
        "f": faces.astype(np.uint32),
        "weights": _weights(template, _joint_targets(kind), parents),
        "J_regressor": regressor,
        "J": regressor @ template,
        "shapedirs": _shape_directions(n_vertices, n_shapes, n_columns, size),
        "posedirs": _rounded(0.004 * size * _waves(0.7, n_vertices, 3, 9 * (n_joints - 1))),
        "kintree_table": kintree.astype(np.uint32),
        "bs_style": np.array("lbs"),
        "bs_type": np.array("lrotmin"),
    }
    if kind == "mano":
        arrays |= {"hands_components": _components(1), "hands_mean": _hand_mean(1)}
    if kind in ("smplh", "smplx"):
        for number, side in enumerate("lr", start=2):
            arrays[f"hands_components{side}"] = _components(number)
            arrays[f"hands_mean{side}"] = _hand_mean(number)
    if kind == "smplx":
        arrays |= _landmarks(len(faces)) | _texture_coordinates(faces, n_vertices)
    return arrays


def joint_parents(kind: str) -> tuple[int, ...]:
    """Return the parent of each joint, -1 for the root.

    >>> [len(joint_parents(kind)) for kind in KINDS]
    [24, 52, 55, 16, 5]
    """
    if kind == "smpl":
        return (*BODY_PARENTS, 20, 21)
    if kind == "smplh":
        return (*BODY_PARENTS, *_finger_parents(20, 22), *_finger_parents(21, 37))
    if kind == "smplx":
        hands = (*_finger_parents(20, 25), *_finger_parents(21, 40))
        return (*BODY_PARENTS, *FACE_PARENTS, *hands)
    if kind == "mano":
        return (-1, *_finger_parents(0, 1))
    if kind == "flame":
        return (-1, 0, 1, 1, 1)
    raise ValueError(f"no model kind {kind!r}")


def _finger_parents(wrist: int, first: int) -> list[int]:
    """Return the parents of five fingers of three joints each, starting with joint ``first``."""
    return [wrist if joint % 3 == 0 else first + joint - 1 for joint in range(15)]


def _rounded(values: np.ndarray, bits: int = 24) -> np.ndarray:
    """Return the nearest multiples of two to the power ``-bits``."""
    return np.round(values * 2.0**bits) / 2.0**bits


def _waves(seed: float, *shape: int) -> np.ndarray:
    """Return values from -1 to 1 without repetition along any axis."""
    indices = np.indices(shape, dtype=float) + 1.0
    phase = np.full(shape, seed)
    for axis, index in enumerate(indices):
        phase += (1.3 + 0.7 * axis + seed) * index + (0.05 + 0.02 * axis) * index * index
    return np.sin(phase + 0.618 * np.prod(indices, axis=0))


def _template(kind: str, n_vertices: int) -> np.ndarray:
    """Return a rising spiral around a body with outstretched arms, a hand or a head."""
    index = np.arange(n_vertices)
    height = index / (n_vertices - 1)
    angle = 2.0 * np.pi * index / TURNS
    bulge = {"smpl": 0.6, "smplh": 0.6, "smplx": 0.6}.get(kind, 0.0)
    wide = 0.14 + 0.04 * np.sin(9.0 * height) + bulge * np.cos(np.pi * (height - 0.81)) ** 60
    deep = 0.11 + 0.02 * np.cos(7.0 * height)
    points = np.stack(
        [
            wide * np.cos(angle),
            1.75 * height - 1.3,
            0.05 * np.sin(np.pi * height) + deep * np.sin(angle),
        ],
        axis=1,
    )
    if kind == "mano":  # the length of the hand along x
        points = np.stack([points[:, 1] + 1.25, -points[:, 0], points[:, 2]], axis=1) * 0.11
    if kind == "flame":
        points = (points + np.array([0.0, 0.5, 0.0])) * np.array([0.5, 0.17, 0.8])
    return _rounded(points, 20)


def _faces(n_vertices: int) -> np.ndarray:
    """Return the triangles of the closed spiral, counter-clockwise seen from outside."""
    low = np.arange(n_vertices - TURNS - 1)
    up = low + TURNS
    sides = np.stack([low, up, low + 1, low + 1, up, up + 1], axis=1).reshape(-1, 3)
    ring = np.arange(1, TURNS)
    bottom = np.stack([np.zeros_like(ring), ring, ring + 1], axis=1)
    top = (n_vertices - 1) - bottom
    return np.concatenate([bottom, sides, top])


def _joint_targets(kind: str) -> np.ndarray:
    """Return the approximate positions of the joints."""
    parents = joint_parents(kind)
    places = np.zeros((len(parents), 3))
    for joint, parent in enumerate(parents):
        places[joint] = _joint_step(kind, joint) + (places[parent] if joint else 0.0)
    return places


def _joint_step(kind: str, joint: int) -> np.ndarray:
    """Return the offset of a joint from its parent."""
    if kind == "flame":
        return np.array(HEAD_STEPS[joint])
    if kind == "mano":
        return np.array([0.01, 0.005, 0.002]) if joint == 0 else _finger_step(joint - 1)
    if joint < 22:
        mirrored = joint not in BODY_STEPS
        return np.array(BODY_STEPS[joint - mirrored]) * [-1.0 if mirrored else 1.0, 1.0, 1.0]
    if kind == "smpl":
        return np.array([0.08 if joint == 22 else -0.08, -0.01, -0.01])
    if kind == "smplx" and joint < 25:
        return np.array(FACE_STEPS[joint - 22])
    finger = joint - (25 if kind == "smplx" else 22)
    return _finger_step(finger % 15) * [1.0 if finger < 15 else -1.0, 1.0, 1.0]


def _finger_step(joint: int) -> np.ndarray:
    """Return the offset of a joint of the left fingers, 0 to 14, from its parent."""
    finger, bone = divmod(joint, 3)
    return np.array([0.03 if bone else 0.09, -0.004 * bone, 0.0 if bone else 0.045 - 0.02 * finger])


def _order_by_distance(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return, for each point, the indices of the other points, nearest first."""
    whole = [np.round(places * 2.0**20).astype(np.int64) for places in (points, others)]
    gaps = whole[0][:, None] - whole[1][None]
    return np.argsort((gaps * gaps).sum(axis=2), axis=1, kind="stable")


def _regressor(template: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return rows of multiples of 1/16 for the nearest vertices and a distant one."""
    regressor = np.zeros((len(targets), len(template)))
    nearest = _order_by_distance(targets, template)
    for joint, row in enumerate(regressor):
        far = (17 * joint + 5) % len(template)
        for vertex, share in zip([*nearest[joint, :4], far], (6, 4, 2, 2, 2), strict=True):
            row[vertex] += share / 16.0
    return regressor


def _weights(template: np.ndarray, targets: np.ndarray, parents: Iterable[int]) -> np.ndarray:
    """Return rows of one to four multiples of 1/16; if possible, every joint has influence."""
    weights = np.zeros((len(template), len(targets)))
    nearest = _order_by_distance(template, targets)
    above = [max(parent, 0) for parent in parents]
    shares = ((9, 4, 2, 1), (10, 6, 0, 0), (8, 5, 3, 0), (16, 0, 0, 0))
    for vertex, row in enumerate(weights):
        own = vertex % len(targets)
        joints = (own, nearest[vertex, 0], above[own], nearest[vertex, 1])
        for joint, share in zip(joints, shares[vertex % 4], strict=True):
            row[joint] += share / 16.0
    return weights


def _shape_directions(n_vertices: int, n_shapes: int, n_columns: int, size: float) -> np.ndarray:
    """Return displacements of up to 2 cm for shapes, 8 mm for expressions, decreasing by index."""
    column = np.arange(n_columns)
    shape_sizes = 0.02 / (1.0 + 0.1 * column)
    expression_sizes = 0.008 / (1.0 + 0.1 * np.maximum(column - n_shapes, 0))
    sizes = np.where(column < n_shapes, shape_sizes, expression_sizes)
    return _rounded(size * sizes * _waves(0.2, n_vertices, 3, n_columns))


def _components(number: int) -> np.ndarray:
    """Return 45 orthonormal rows, exactly, as reflections of four axes at a time."""
    rows = np.eye(45)
    signs = np.array([1.0, -1.0, 1.0, 1.0])
    for stride in (7, 11, 13, 17):
        order = (number + stride * np.arange(45)) % 45
        for group in order[:44].reshape(11, 4):
            rows[group] -= np.outer(signs, signs @ rows[group]) / 2.0
    return rows


def _hand_mean(number: int) -> np.ndarray:
    """Return the mean pose of a hand in radians."""
    return _rounded(0.25 * _waves(0.3 + number, 45), 16)


def _landmarks(n_faces: int) -> dict[str, np.ndarray]:
    """Return 51 points on triangles."""
    index = np.arange(51)
    shares = np.array([[8, 4, 4], [2, 13, 1], [5, 5, 6]]) / 16.0
    return {"lmk_faces_idx": (7 * index + 3) % n_faces, "lmk_bary_coords": shares[index % 3]}


def _texture_coordinates(faces: np.ndarray, n_vertices: int) -> dict[str, np.ndarray]:
    """Return texture coordinates; a seam up the spiral makes them outnumber the vertices."""
    index = np.arange(n_vertices)
    coordinates = np.stack([index % TURNS / TURNS, _rounded(index / (n_vertices - 1), 20)], axis=1)
    doubled = index[TURNS::TURNS]
    seam = np.stack([np.ones(len(doubled)), coordinates[doubled - 1, 1]], axis=1)
    twins = index.copy()
    twins[doubled] = n_vertices + np.arange(len(doubled))
    crosses = (faces % TURNS == TURNS - 1).any(axis=1, keepdims=True)
    return {
        "vt": np.concatenate([coordinates, seam]),
        "ft": np.where(crosses, twins[faces], faces).astype(np.uint32),
    }
