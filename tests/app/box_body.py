"""A box-shaped body model for hand calculation: three joints, two shapes, one corrective.

The box is 2 m high, 0.5 m wide and 0.25 m deep. Its joints are at the middle of the box, of its
left side (+x), and of its right side (-x). Each side follows its joint rigidly.
"""

import numpy as np

HEIGHT, WIDTH, DEPTH = 2.0, 0.5, 0.25
STATURE, GIRTH = 0.1, 0.2  # relative change of height and width per standard deviation

_FACES = (
    *((0, 1, 3), (0, 3, 2), (6, 7, 5), (6, 5, 4), (4, 5, 1), (4, 1, 0)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (5, 7, 3), (5, 3, 1)),
)


def arrays() -> dict[str, np.ndarray]:
    """Return the arrays of the model's ``.npz`` file."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    corners = 0.5 * signs * [WIDTH, HEIGHT, DEPTH]
    is_left = signs[:, 0] > 0
    sides = np.stack([np.zeros(8), is_left, ~is_left])
    shapes = np.zeros((8, 3, 2))
    shapes[:, 1, 0] = STATURE * corners[:, 1]
    shapes[:, 0, 1] = GIRTH * corners[:, 0]
    correctives = np.zeros((8, 3, 18))
    # R[1, 1] - 1 of the left joint: 1 - cos moves the side outwards.
    correctives[is_left, 0, 4] = -0.5
    return {
        "v_template": corners,
        "f": np.array(_FACES),
        "weights": sides.T.astype(float),
        "J_regressor": np.stack([np.full(8, 0.125), 0.25 * is_left, 0.25 * ~is_left]),
        "kintree_table": np.array([[-1, 0, 0], [0, 1, 2]]),
        "shapedirs": shapes,
        "posedirs": correctives,
    }
