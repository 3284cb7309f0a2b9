"""A scalar quantity: the height of each vertex above the lowest one."""

import numpy as np
from numpy.typing import NDArray

import viewer
from viewer.rigs.scalars import Scalar


def heights(figure: viewer.Figure, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heights (V,) of posed vertices (V, 3)."""
    along = vertices[:, 2 if figure.up == "z" else 1]
    lowest: np.float64 = along.min(initial=np.inf)
    return along - lowest


HEIGHT = Scalar(heights, title="Height", unit="length")
