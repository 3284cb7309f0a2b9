"""Weights of facial expressions for the blend shapes of a figure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.rig.arrays import Floats
from viewer.rig.expressions import OLD_PRESETS
from viewer.rig.figure import Figure
from viewer.rig.scene import figure_pose

__all__ = ["expression_weights"]


def expression_weights(
    expressions: Mapping[str, Floats], figure: Figure
) -> tuple[Floats | None, list[Diagnostic]]:
    """Return a figure's blend shape weights over time; other shapes keep their rest weights.

    Parameters
    ----------
    expressions : mapping of str to (N,)
        Weights by the names of VRM 1.0.
    figure : Figure
        Its blend shapes may have the names of VRM 0.x.

    Returns
    -------
    weights : (N, S) or None
        None if no expression moves a shape of the figure.
    notes : list of Diagnostic
        The expressions that the figure does not have.
    """
    shapes = figure.blend_shapes
    names = () if shapes is None else shapes.names
    # Expressions come after the morph targets, whose names they may share.
    columns = {_plain(name): column for column, name in enumerate(names)}
    rules = None if shapes is None else shapes.rules
    for row, preset in zip(rules.rows, rules.presets, strict=False) if rules is not None else ():
        if preset:
            columns[_plain(preset)] = int(row)
    found = {name: columns[_plain(name)] for name in expressions if _plain(name) in columns}
    missing = [name for name, rows in expressions.items() if name not in found and rows.any()]
    notes = [Diagnostic("F007.expressions-unmatched", values={"names": missing})] if missing else []
    if not found:
        return None, notes
    count = len(next(iter(expressions.values())))
    weights = np.tile(figure_pose(figure).shape_weights, (count, 1))
    for name, column in found.items():
        weights[:, column] = expressions[name]
    return weights, notes


def _plain(name: str) -> str:
    lower = name.lower()
    return OLD_PRESETS.get(lower, lower).lower()
