"""Fit a pose by gradient descent, and watch it: the window shows each step while it computes."""

import numpy as np

import viewer

scene = viewer.load()  # the bundled fox
fox = scene.actors[0]
jaw = fox.figure.require_skeleton().names.index("jaw")
target = fox.joints()[0, jaw] + [0.05, -0.05, 0.0]  # where the jaw should be


def distance(angles: np.ndarray) -> float:
    """Return how far the jaw is from the target with rotations of neck and head, (2, 3) radians."""
    fox["neck_1"], fox["head"] = angles  # the window follows
    return float(np.linalg.norm(fox.joints()[0, jaw] - target))


angles, step = np.zeros((2, 3)), 1e-4
with viewer.show(scene, block=False) as window:
    while distance(angles) > 0.01 and window.is_open:
        found = distance(angles)
        nudges = step * np.eye(6).reshape(6, 2, 3)
        slopes = [(distance(angles + nudge) - found) / step for nudge in nudges]
        angles -= 0.2 * np.reshape(slopes, (2, 3))
    print(f"{distance(angles):.4f} from the target")
