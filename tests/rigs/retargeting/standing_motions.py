"""Motions with known contacts: a jump, kneeling on one knee, and a walk on a treadmill.

The body is the one defined in ``rest_twins``. Hips, knees and ankles rotate about x only.
"""

import numpy as np
from rigs.retargeting.rest_twins import NAMES, POINTS, X, worlds
from rigs.retargeting.walking import STRIDE, plane_angles, walk

from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices

RATE = 60.0
GRAVITY = 981.0  # cm per second squared
SPEED = 220.0  # at take-off, cm per second
KNEELING = slice(90, 150)  # frames


def smooth(x: np.ndarray) -> np.ndarray:
    """Return a smooth step from 0 at x = 0 to 1 at x = 1, with continuous acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def legs_to(
    path: np.ndarray, goals: dict[str, np.ndarray], pitches: dict[str, np.ndarray]
) -> np.ndarray:
    """Return rotations relative to the T-pose, (N, J, 3, 3), that place the ankles at goals.
    ``path``: positions of the hips, (N, 3). ``goals``: positions of the ankles, (N, 2), z and y.
    ``pitches``: rotations of the feet about x, radians.
    """
    vectors = np.zeros((len(path), len(NAMES), 3))
    for side in ("Left", "Right"):
        names = [NAMES.index(f"{side}{part}") for part in ("UpLeg", "Leg", "Foot")]
        hip, knee, ankle = POINTS[names][:, [2, 1]]
        away = goals[side] - (hip + path[:, [2, 1]])
        thigh, shin = plane_angles((hip, knee, ankle), away, 1.0)
        vectors[:, names[0]] = -thigh[:, None] * X
        vectors[:, names[1]] = -(shin - thigh)[:, None] * X
        vectors[:, names[2]] = (shin + pitches[side])[:, None] * X
    return worlds(matrices(vectors))


def jump() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rotations, the path of the hips, and the height of the ankles above rest."""
    flight = 2.0 * SPEED / GRAVITY
    times = np.arange(150) / RATE
    start = 1.1  # seconds: take-off
    crouch, low, push = -7.0, -30.0, 0.25
    after = times - start
    # This quintic leads from the static crouch to the take-off with the speed and gravity of the
    # flight.
    ends = np.array([low, 0.0, 0.0, -4.0, SPEED, -GRAVITY])
    powers = np.array([[0.0**k for k in range(6)], *(
        [k * 0.0 ** max(k - 1, 0) for k in range(6)],
        [k * (k - 1) * 0.0 ** max(k - 2, 0) for k in range(6)],
        [push**k for k in range(6)],
        [k * push ** max(k - 1, 0) for k in range(6)],
        [k * (k - 1) * push ** max(k - 2, 0) for k in range(6)],
    )])  # fmt: skip
    rising = np.polynomial.Polynomial(np.linalg.solve(powers, ends))
    height = crouch + (low - crouch) * smooth((times - 0.2) / 0.5)
    height = np.where(after > -push, rising(after + push), height)
    height = np.where(after > 0.0, -4.0 + SPEED * after - 0.5 * GRAVITY * after**2, height)
    landed = after - flight
    height = np.where(landed > 0.0, rising(push - landed), height)
    height = np.where(landed > push, low + (crouch - low) * smooth((landed - push) / 0.5), height)
    path = np.zeros((len(times), 3))
    path[:, 1] = height
    width = 1.0  # cm: the feet leave the ground smoothly
    rise = width * np.logaddexp(0.0, (height + 4.0) / width)
    ankles = {}
    for side in ("Left", "Right"):
        rest = POINTS[NAMES.index(f"{side}Foot")]
        ankles[side] = np.stack([np.full(len(times), rest[2]), rest[1] + rise], axis=1)
    level = np.zeros(len(times))
    return legs_to(path, ankles, {"Left": level, "Right": level}), path, rise


def kneel() -> tuple[np.ndarray, np.ndarray]:
    """Return rotations and the path of the hips of a person who kneels down on the right knee. In
    the frames ``KNEELING``, the right foot points straight down and stands on its ball.
    """
    frames = np.arange(150)
    names = [NAMES.index(f"Right{part}") for part in ("UpLeg", "Leg", "Foot", "ToeBase")]
    hip, knee, ankle, ball = POINTS[names][:, [2, 1]]
    down = smooth((frames - 20) / 60.0)
    thigh, shin = np.linalg.norm(knee - hip), np.linalg.norm(ankle - knee)
    foot = np.linalg.norm(ball - ankle)
    slope = np.arctan2(ankle[1] - ball[1], ball[0] - ankle[0])  # pitch of the foot at rest
    path = np.zeros((len(frames), 3))
    path[:, 1] = down * (5.0 + thigh - hip[1]) - 7.0 * (1.0 - down) * 0.2 - 1.0
    path[:, 2] = 0.0
    # The knee is below the hip and 5 cm above the ground; the foot points from the ankle to the
    # ground.
    high = ball[1] + foot
    back = hip[0] - np.sqrt(shin**2 - (high - 4.0) ** 2)
    goal = ankle + down[:, None] * (np.array([back, high]) - ankle)
    goal[:, 1] += 10.0 * 64.0 * (down * (1.0 - down)) ** 3
    front = POINTS[NAMES.index("LeftFoot")][[2, 1]] + down[:, None] * [35.0, 0.0]
    front[:, 1] += 10.0 * 64.0 * (down * (1.0 - down)) ** 3
    pitches = {"Left": np.zeros(len(frames)), "Right": down * (np.pi / 2.0 - slope)}
    return legs_to(path, {"Left": front, "Right": goal}, pitches), path


def treadmill() -> tuple[np.ndarray, np.ndarray]:
    """Return the walk of ``walking`` without forward movement: standing feet move backwards."""
    rotations, path = walk()
    path = path.copy()
    path[:, 2] -= STRIDE * np.arange(len(path)) / 100.0
    return rotations, path
