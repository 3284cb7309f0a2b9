"""The published equations of the SMPL family, reimplemented with plain loops over joints."""

from typing import Any

import numpy as np
from formats.synthetic_smpl import joint_parents

Floats = np.ndarray[Any, np.dtype[np.float64]]


def rotation(vector: Any) -> Floats:
    """Return a rotation matrix by Rodrigues' formula."""
    vector = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def vertices(
    kind: str, arrays: dict[str, Any], betas: Any, rotations: Floats, transl: Any
) -> tuple[Floats, Floats]:
    """Return vertices and joints of a pose: V = LBS(T(betas) + P(R), R) + transl. ``rotations`` are
    (J, 3, 3). Further joints have the identity, and further fingers of SMPL-X and SMPL+H the mean
    hand.
    """
    parents = joint_parents(kind)
    given = len(rotations)
    turned = [rotations[j] if j < given else np.eye(3) for j in range(len(parents))]
    hands = {"smplx": (25, 40), "smplh": (22, 37)}.get(kind, ())
    for first, side in zip(hands, "lr", strict=False):
        for finger, vector in enumerate(arrays[f"hands_mean{side}"].reshape(15, 3)):
            if first + finger >= given:
                turned[first + finger] = rotation(vector)
    shaped = arrays["v_template"] + np.einsum(
        "vcs,s->vc", arrays["shapedirs"][..., : len(betas)], np.asarray(betas, dtype=np.float64)
    )
    joints = arrays["J_regressor"] @ shaped
    feature = np.concatenate([(turned[j] - np.eye(3)).ravel() for j in range(1, len(parents))])
    rest = shaped + arrays["posedirs"] @ feature
    world: list[Floats] = []
    for joint, parent in enumerate(parents):
        local = np.eye(4)
        local[:3, :3] = turned[joint]
        local[:3, 3] = joints[joint] - (joints[parent] if parent >= 0 else 0.0)
        world.append(local if parent < 0 else world[parent] @ local)
    moved = np.zeros_like(rest)
    for joint, matrix in enumerate(world):
        move = (rest - joints[joint]) @ matrix[:3, :3].T + matrix[:3, 3]
        moved += arrays["weights"][:, joint, None] * move
    places = np.array([matrix[:3, 3] for matrix in world])
    return moved + np.asarray(transl), places + np.asarray(transl)
