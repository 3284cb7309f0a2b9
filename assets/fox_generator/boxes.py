"""Boxes drawn for the joints, each around the vertices that its joint influences most."""

import numpy as np
from generator_tools.shapes import Floats

from .skeleton import Joint

TRIM = 6.0  # percentage of the vertices that lie outside the box on each side
# With a skull box and a muzzle box, the head is recognisable as a fox's; with one box it would not
# be.
FIXED = {
    "head": ((-0.060, 0.452, 0.205), (0.060, 0.548, 0.308)),
    "jaw": ((-0.024, 0.438, 0.300), (0.024, 0.484, 0.382)),
}
LEAST = 0.006  # half the minimum thickness of a box, metres


def fit_boxes(vertices: Floats, weights: Floats, table: list[Joint]) -> Floats:
    """Return box corners (J, 2, 3) in joint space: lowest, highest."""
    owner = weights.argmax(axis=1)
    boxes = np.empty((len(table), 2, 3))
    for i, joint in enumerate(table):
        segment = np.array([joint.pivot, joint.end], float)
        low, high = segment.min(axis=0) - LEAST, segment.max(axis=0) + LEAST
        own = vertices[owner == i]
        if len(own):
            low = np.minimum(low, np.percentile(own, TRIM, axis=0))
            high = np.maximum(high, np.percentile(own, 100 - TRIM, axis=0))
        boxes[i] = np.array(FIXED.get(joint.name, (low, high))) - joint.pivot
    return boxes
