"""A motion whose hands hang beside the thighs, and people of other proportions."""

import numpy as np
from rigs.retargeting.rest_twins import NAMES, PERSON, Y, Z, t_pose, worlds, written
from rigs.retargeting.two_people import figure_of

from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices

N = 40  # frames


def body(arms: float = 1.0, width: float = 1.0, height: float = 1.0):
    """Return a person with longer arms, wider shoulders and hips, scaled by a height."""
    table = {name: (parent, np.array(place, float)) for name, (parent, place) in PERSON.items()}
    for name, (parent, place) in table.items():
        if name.endswith(("Arm", "ForeArm", "Hand", "Shoulder")):
            sign = np.sign(place[0])
            root = sign * 18.0
            place[0] = root * width + arms * (place[0] - root) if abs(place[0]) > 18 else (
                place[0] * width
            )  # fmt: skip
        if name.endswith(("UpLeg", "Leg", "Foot", "ToeBase")):
            place[0] *= width
        table[name] = (parent, height * place)
    names = {name: f"{name}_" for name in table}
    return figure_of({names[n]: (names.get(p, ""), q) for n, (p, q) in table.items()}, "other")


def motion(bend: float, swing: float, down: float = 1.5, rate: int = 30):
    """Return arms ``down`` radians below the horizontal, elbows ``bend`` +- ``swing`` radians."""
    count = (N - 1) * rate // 30 + 1
    local = np.tile(np.eye(3), (count, len(NAMES), 1, 1))
    phase = np.linspace(0.0, 2.0 * np.pi, count)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        local[:, NAMES.index(f"{side}Arm")] = matrices(-sign * down * Z)
        turns = -sign * Y * (bend + swing * np.sin(phase))[:, None]
        local[:, NAMES.index(f"{side}ForeArm")] = matrices(turns)
    return written(t_pose(), worlds(local), np.zeros((count, 3)), rate=rate)
