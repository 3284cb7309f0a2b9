"""Reset of shapes whose blend shape offsets cannot be read, before panels use them."""

from __future__ import annotations

import numpy as np

from viewer.app.core.state import AppState
from viewer.errors import ViewerError
from viewer.rig.shape import shaped

__all__ = ["drop_unreadable_shapes"]


def drop_unreadable_shapes(state: AppState) -> None:
    """Set all shapes to 0 if blend shape offsets, which are read on first use, cannot be read."""
    try:
        for actor in state.scene.actors:
            if actor.pose is not None:
                shaped(actor.figure, actor.pose.shape_weights)
    except ViewerError as problem:
        state.error = str(problem)
        for actor in state.scene.actors:
            if actor.pose is not None:
                actor.pose.shape_weights = np.zeros(actor.figure.n_shapes)
