"""The forward pass of the SMPL family as in its paper, with explicit loops (Loper et al. 2015)."""

import numpy as np
from builders import rotation


def smpl_forward(
    arrays: dict, shape=(), pose=None, columns=None, correct=True, turns=None
) -> tuple[np.ndarray, np.ndarray]:
    """Return posed vertices (V, 3) and joints (J, 3).

    Parameters
    ----------
    arrays
        Arrays as returned by ``synthetic_smpl.model``.
    shape
        Weights of the first columns of ``shapedirs``, or of the given ``columns``.
    pose
        (J, 3) rotation vectors, unless ``turns`` are given, (J, 3, 3).
    columns
        Columns that ``shape`` weights.
    correct
        Whether pose blend shapes are added.
    """
    parents = arrays["kintree_table"][0].astype(np.int64)
    n_joints = len(parents)
    pose = np.zeros((n_joints, 3)) if pose is None else np.reshape(pose, (n_joints, 3))
    vertices = arrays["v_template"].copy()
    for weight, column in zip(shape, columns or range(len(shape)), strict=True):
        vertices += weight * arrays["shapedirs"][:, :, column]
    joints = arrays["J_regressor"] @ vertices
    turns = [rotation(vector) for vector in pose] if turns is None else turns
    if correct:
        blend = np.concatenate([(turn - np.eye(3)).ravel() for turn in turns[1:]])
        vertices = vertices + arrays["posedirs"] @ blend
    world: list[np.ndarray] = []
    for joint in range(n_joints):
        local = np.eye(4)
        local[:3, :3] = turns[joint]
        local[:3, 3] = joints[joint] - (joints[parents[joint]] if joint else 0.0)
        world.append(world[parents[joint]] @ local if joint else local)
    posed = np.zeros_like(vertices)
    for vertex, point in enumerate(vertices):
        for joint in np.flatnonzero(arrays["weights"][vertex]):
            from_joint = np.append(point - joints[joint], 1.0)
            posed[vertex] += arrays["weights"][vertex, joint] * (world[joint] @ from_joint)[:3]
    return posed, np.array([matrix[:3, 3] for matrix in world])
