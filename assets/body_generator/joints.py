"""The 24 joints: names, parents and centres, metres above the floor."""

import numpy as np
from generator_tools.shapes import Floats

# Name, parent, centre; paired joints are listed once, for the left side.
_TABLE = (
    ("pelvis", "", (0.0, 0.950, -0.020)),
    ("hip", "pelvis", (0.0860, 0.8850, -0.0050)),
    ("spine1", "pelvis", (0.0, 1.050, -0.035)),
    ("knee", "hip", (0.0990, 0.4870, -0.0080)),
    ("spine2", "spine1", (0.0, 1.165, -0.035)),
    ("ankle", "knee", (0.1080, 0.0780, -0.0360)),
    ("spine3", "spine2", (0.0, 1.250, -0.035)),
    ("foot", "ankle", (0.1240, 0.0190, 0.0930)),
    ("neck", "spine3", (0.0, 1.430, -0.040)),
    ("collar", "spine3", (0.0450, 1.3750, -0.0150)),
    ("head", "neck", (0.0, 1.525, -0.010)),
    ("shoulder", "collar", (0.1720, 1.3720, -0.0240)),
    ("elbow", "shoulder", (0.4400, 1.3720, -0.0310)),
    ("wrist", "elbow", (0.6900, 1.3720, -0.0190)),
    ("hand", "wrist", (0.7770, 1.3730, -0.0180)),
)


def _both_sides() -> tuple[list[str], list[str], list[tuple[float, float, float]]]:
    names, parents, centres = [], [], []
    paired = {name for name, _, centre in _TABLE if centre[0] != 0}
    for name, parent, (x, y, z) in _TABLE:
        sides = (("left_", 1), ("right_", -1)) if name in paired else (("", 0),)
        for side, sign in sides:
            names.append(side + name)
            parents.append(side + parent if parent in paired else parent)
            centres.append((sign * x, y, z))
    return names, parents, centres


_names, _parents, _centres = _both_sides()
NAMES: tuple[str, ...] = tuple(_names)
PARENTS: tuple[int, ...] = tuple(NAMES.index(p) if p else -1 for p in _parents)
CENTRES: Floats = np.array(_centres)


def _other(name: str) -> str:
    swapped = {"left": "right", "right": "left"}
    side, _, rest = name.partition("_")
    return f"{swapped[side]}_{rest}" if side in swapped else name


# Mirror counterpart of each joint, which is the joint itself for joints in the middle.
PARTNERS = np.array([NAMES.index(_other(name)) for name in NAMES])


def index(name: str) -> int:
    """Return the number of a joint."""
    return NAMES.index(name)
