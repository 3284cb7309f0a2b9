"""A figure's shape in glTF form: morph targets, or a mesh with the shape baked in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.morph_target import MORPH_GROUP
from viewer.rig.shape import shaped

# Maximum number of targets: each takes 12 bytes per vertex, and programs support few.
_MOST_TARGETS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The written form of a figure's shape.

    Attributes
    ----------
    figure : Figure
        Figure whose mesh, skeleton and skin are written.
    targets : (M,) int
        Blend shapes that become morph targets.
    weights : (F, M) or (1, M)
        Weights of the targets over time.
    baked : (S,) or None
        The shape baked into the mesh instead; None if there is none.
    """

    figure: Figure
    targets: NDArray[np.intp]
    weights: Floats
    baked: Floats | None = None


def shape_of(figure: Figure, weights: Floats, reference: int = 0) -> Shape:
    """Return the written form of a figure's shape.

    Morph targets do not move joints, so a shape that affects joints or has too many targets is
    baked into the mesh. Morph targets of the figure's own file are always written; expressions,
    which combine them, only if they are used.

    ``figure``: figure without its shape applied.
    ``weights`` (F, S) or (1, S): weights of its blend shapes over time.
    ``reference``: index of the row to bake in.
    """
    shapes, is_used = figure.blend_shapes, np.asarray(weights.any(axis=0))
    is_own = np.zeros(len(is_used), dtype=np.bool_)
    if shapes is not None and figure.record is not None:
        groups = enumerate(shapes.groups[: len(is_used)])
        is_own[:] = [group == MORPH_GROUP and not shapes.is_expression(s) for s, group in groups]
    used = np.flatnonzero(is_used | is_own)
    if figure.mesh is None or shapes is None or len(used) == 0:
        return Shape(figure, used[:0], np.zeros((1, 0)))
    if (
        figure.joint_regressor is None
        and shapes.is_linear
        and np.sum(is_used & ~is_own) <= _MOST_TARGETS
    ):
        return Shape(figure, used, weights[:, used])
    row = weights[min(reference, len(weights) - 1)]
    whole = replace(shaped(figure, row), blend_shapes=None)
    return Shape(whole, used[:0], np.zeros((1, 0)), row)
