"""Animals of different proportions, and a trot with exactly planted paws, built by trigonometry."""

import numpy as np
from rigs.retargeting.two_people import figure_of
from rigs.retargeting.walking import RATE, plane_angles

from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing

N_TROT = 160
STRIDE = 0.2  # metres in 80 frames, 45 of which are a stance of each paw
LIFT = 0.04
PAWS = ("hind_l", "hind_r", "fore_l", "fore_r")
DIAGONAL = ("hind_l", "fore_r")


def animal(thigh: float = 0.13, shin: float = 0.14, length: float = 0.3) -> dict:
    """Return names, parents and positions of the joints of a standing animal."""
    table = {
        "hips": ("", (0.0, 0.34, 0.0)),
        "spine": ("hips", (0.0, 0.35, 0.5 * length)),
        "chest": ("spine", (0.0, 0.35, length)),
        "skull": ("chest", (0.0, 0.45, length + 0.1)),
        "tail": ("hips", (0.0, 0.33, -0.2)),
    }
    for end, side in (("hind", 1.0), ("hind", -1.0), ("fore", 1.0), ("fore", -1.0)):
        leg = f"{end}_{'l' if side > 0 else 'r'}"
        back, top = (0.0, "hips") if end == "hind" else (length, "chest")
        # The knees of the hind legs point forwards, the elbows backwards; hocks are 0.09 above the
        # toes.
        slope = 0.5 if end == "hind" else -0.5
        knee = np.array([0.0, 0.33 - thigh * np.cos(slope), back + thigh * np.sin(slope)])
        hock = knee - shin * np.array([0.0, np.cos(slope), np.sin(slope)])
        lower = hock[1] - 0.11  # the toes rest at 0.02
        table[f"{leg}_1"] = top, (0.05 * side, 0.33 - lower, back)
        table[f"{leg}_2"] = f"{leg}_1", np.add(knee, (0.05 * side, -lower, 0.0))
        table[f"{leg}_3"] = f"{leg}_2", np.add(hock, (0.05 * side, -lower, 0.0))
        table[f"{leg}_toe"] = f"{leg}_3", np.add(hock, (0.05 * side, -lower - 0.09, 0.02))
    return table


def stands(paw: str) -> np.ndarray:
    """Return whether a paw stands in each frame: (N,)."""
    return (np.arange(N_TROT) + (0 if paw in DIAGONAL else 40)) % 80 < 45


def trot() -> SkeletonMotion:
    """Return the trot of the first animal."""
    table = animal()
    figure = figure_of(table, "trot")
    names = list(table)
    vectors = np.zeros((N_TROT, len(names), 3))
    path = np.zeros((N_TROT, 3))
    path[:, 2] = STRIDE * np.arange(N_TROT) / 80.0
    path[:, 1] = -0.02
    for paw in PAWS:
        frames = np.arange(N_TROT) + (0 if paw in DIAGONAL else 40)
        phase = np.maximum(frames % 80 - 45, 0) / 35.0
        smooth = phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
        start = 0.28 - (0.0 if paw in DIAGONAL else 0.5)
        joints = tuple(np.array(table[f"{paw}_{n}"][1])[[2, 1]] for n in (1, 2, 3))
        goal = np.tile(joints[2], (N_TROT, 1))
        goal[:, 0] += STRIDE * (start + frames // 80 + smooth)
        goal[:, 1] += LIFT * 64.0 * (phase * (1.0 - phase)) ** 3
        front = 1.0 if paw.startswith("hind") else -1.0
        upper, lower = plane_angles(joints, goal - (joints[0] + path[:, [2, 1]]), front)
        for name, angle in zip((1, 2, 3), (-upper, upper - lower, lower), strict=True):
            vectors[:, names.index(f"{paw}_{name}"), 0] = angle
    shifts = np.zeros((N_TROT, len(names), 3))
    shifts[:, 0] = path
    clip = SampledClip(
        "trot", Timing(RATE, np.arange(N_TROT)), matrix_to_quaternion(matrices(vectors)), shifts
    )
    return SkeletonMotion(figure, clip)


def other_animal() -> Figure:
    """Return an animal with the same joints but longer shins, a longer back and shorter thighs."""
    return figure_of(animal(0.11, 0.18, 0.4), "other animal")
