"""Tiny STAR, SUPR and SMAL models with the published keys, and their forward passes."""

import numpy as np
from builders import rotation

SMPL_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
SMAL_PARENTS = (
    *(-1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 6, 11, 12, 13, 6, 15, 0, 17, 18, 19, 0, 21, 22, 23),
    *(0, 25, 26, 27, 28, 29, 30, 16, 16, 16),
)
N_VERTICES, N_SHAPES = 30, 6


def star(parents=SMPL_PARENTS, seed=4):
    """Return the arrays of ``model.npz``."""
    generator = np.random.default_rng(seed)
    count = len(parents)
    regressor = generator.random((count, N_VERTICES))
    weights = generator.random((N_VERTICES, count))
    kintree = np.stack([np.array(parents) % 2**32, np.arange(count)])
    return {
        "v_template": generator.uniform(-1.0, 1.0, (N_VERTICES, 3)),
        "f": np.stack([np.arange(N_VERTICES - 2) + k for k in range(3)], axis=1),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "kintree_table": kintree,
        "shapedirs": generator.normal(size=(N_VERTICES, 3, N_SHAPES)),
        "posedirs": generator.normal(size=(N_VERTICES, 3, 4 * (count - 1) + 1)),
    }


def supr(n_joints=7, seed=5):
    """Return the arrays of SUPR, which has a regressor that mixes coordinates."""
    parents = (-1, *(joint // 2 for joint in range(n_joints - 1)))
    generator = np.random.default_rng(seed)
    arrays = star(parents, seed)
    shape = 3 * n_joints, 3 * N_VERTICES + 1
    regressor = generator.normal(size=shape) * (generator.random(shape) < 0.2)
    directions = generator.normal(size=(N_VERTICES, 3, 4 * n_joints))
    return arrays | {"J_regressor": regressor, "posedirs": directions}


def smal(seed=6):
    """Return the arrays of SMAL, whose rotation matrices drive the correctives, as in SMPL."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(N_VERTICES, 3, 9 * (len(SMAL_PARENTS) - 1)))
    return star(SMAL_PARENTS, seed) | {"posedirs": directions}


def quaternion(vector):
    """Return the quaternion of a rotation vector as (x, y, z, w - 1)."""
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle else np.zeros(3)
    return np.append(np.sin(0.5 * angle) * axis, np.cos(0.5 * angle) - 1.0)


def forward(arrays, vectors, betas, place):
    """Return vertices and joints for rotation vectors, (J, 3)."""
    parents = np.where(arrays["kintree_table"][0] > 1000, -1, arrays["kintree_table"][0])
    shaped = arrays["v_template"] + arrays["shapedirs"] @ betas
    regressor = arrays["J_regressor"]
    is_supr = regressor.shape[1] != N_VERTICES
    if is_supr:
        joints = (regressor @ np.append(shaped.ravel(), 1.0)).reshape(-1, 3)
        feature = np.concatenate([quaternion(vector) for vector in vectors])
    elif arrays["posedirs"].shape[2] == 9 * (len(vectors) - 1):
        joints = regressor @ shaped
        feature = np.concatenate([(rotation(vector) - np.eye(3)).ravel() for vector in vectors[1:]])
    else:
        joints = regressor @ shaped
        feature = np.append(np.concatenate([quaternion(v) for v in vectors[1:]]), betas[1])
    posed = shaped + arrays["posedirs"] @ feature
    rotations, places = [], []
    for joint, vector in enumerate(vectors):
        above = parents[joint]
        if above < 0:
            rotations.append(rotation(vector))
            places.append(joints[joint])
            continue
        rotations.append(rotations[above] @ rotation(vector))
        places.append(places[above] + rotations[above] @ (joints[joint] - joints[above]))
    found = np.zeros_like(posed)
    for joint, (turn, at) in enumerate(zip(rotations, places, strict=True)):
        moved = (posed - joints[joint]) @ turn.T + at
        found += arrays["weights"][:, joint, None] * moved
    return found + place, np.array(places) + place
