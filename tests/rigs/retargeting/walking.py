"""A walk with exactly planted feet, built from the paths of the ankles by trigonometry.

The body is the one defined in ``rest_twins``. Each foot stands for 60 of 100 frames with the sole
on the ground, and swings to the next position in the remaining frames. Hips, knees and ankles
rotate about x only.
"""

import numpy as np
from rigs.retargeting.rest_twins import NAMES, POINTS, X, worlds

from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices

RATE = 60.0
STRIDE = 100.0  # cm per 100 frames
N_WALK = 250
STANCE = 60
PELVIS = -7.0  # cm relative to the rest pose, so that the legs are never straight


def stands(side: str) -> np.ndarray:
    """Return whether a foot stands in each frame: (N,)."""
    return (np.arange(N_WALK) + (0 if side == "Left" else 50)) % 100 < STANCE


def ankle_path(side: str, lift: float = 12.0) -> np.ndarray:
    """Return the path of an ankle in the plane of its leg: (N, 2), z and y."""
    frames = np.arange(N_WALK) + (0 if side == "Left" else 50)
    step, phase = frames // 100, np.maximum(frames % 100 - STANCE, 0) / (100 - STANCE)
    smooth = phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
    rest = POINTS[NAMES.index(f"{side}Foot")]
    start = STRIDE * (0.3 if side == "Left" else -0.2)
    along = start + STRIDE * (step + smooth) + rest[2]
    return np.stack([along, rest[1] + lift * 64.0 * (phase * (1.0 - phase)) ** 3], axis=1)


def plane_angles(
    joints: tuple[np.ndarray, np.ndarray, np.ndarray], away: np.ndarray, front: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotations of thigh and shin towards +z, radians, by the law of cosines.

    ``joints``: hip, knee and ankle at rest, z and y. ``away``: from the hip to the ankle, (N, 2).
    ``front``: 1 if the knee bends forwards, -1 backwards.
    """
    hip, knee, ankle = joints
    a, b = np.linalg.norm(knee - hip), np.linalg.norm(ankle - knee)
    distance = np.linalg.norm(away, axis=1)
    assert (distance < a + b).all()
    bend = np.pi - np.arccos((a * a + b * b - distance**2) / (2.0 * a * b))
    inner = np.arccos((a * a + distance**2 - b * b) / (2.0 * a * distance))
    thigh = np.arctan2(away[:, 0], -away[:, 1]) + front * inner
    own = [np.arctan2(*((end - start) * [1.0, -1.0])) for start, end in
           ((hip, knee), (knee, ankle))]  # fmt: skip
    return thigh - own[0], thigh - front * bend - own[1]


def walk(rise: float = 0.0, lift: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations relative to the T-pose, (N, J, 3, 3), and the path of the hips, (N, 3).

    ``rise``: height of each step, as on stairs, cm.
    """
    vectors = np.zeros((N_WALK, len(NAMES), 3))
    path = np.zeros((N_WALK, 3))
    path[:, 2] = STRIDE * np.arange(N_WALK) / 100.0
    path[:, 1] = PELVIS + rise * (np.arange(N_WALK) / 50.0 - 1.4)
    for side in ("Left", "Right"):
        names = [NAMES.index(f"{side}{part}") for part in ("UpLeg", "Leg", "Foot")]
        hip, knee, ankle = POINTS[names][:, [2, 1]]
        goal = ankle_path(side, lift)
        moved = (goal[:, 0] - ankle[0] - STRIDE * (0.3 if side == "Left" else -0.2)) / STRIDE
        goal[:, 1] += rise * (2.0 * moved + (0.0 if side == "Left" else -1.0))
        hips, shins = plane_angles((hip, knee, ankle), goal - (hip + path[:, [2, 1]]), 1.0)
        vectors[:, names[0]] = -hips[:, None] * X
        vectors[:, names[1]] = -(shins - hips)[:, None] * X
        vectors[:, names[2]] = shins[:, None] * X
    return worlds(matrices(vectors)), path
