"""Shape and expression coefficients of a pose record, applied to a figure."""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.figure import Figure
from viewer.rigs.pose import Pose

_MOST_SIGMA = 1e6  # largest plausible coefficient, standard deviations


def unused_coefficients(group: str, values: Floats, used: int, name: str) -> list[Diagnostic]:
    """Return a message about coefficients (..., S) from ``used`` on that are not all 0."""
    rest, count = values[..., used:], values.shape[-1]
    if not rest.any():
        return []
    values_shown = {
        "group": group,
        "first": used + 1,
        "last": count,
        "figure": name,
        "most": used,
        "largest": rounded(float(np.abs(rest).max())),
    }
    key = (
        "F007.coefficients-left-out: {group} coefficients {first} to {last} omitted "
        "(largest value {largest}): {figure} has {most}"
        if count > used + 1
        else "F007.coefficient-left-out: {group} coefficient {last} omitted (largest value "
        "{largest}): {figure} has {most}"
    )
    return [note(key, **values_shown)]


def space_misfit(space: ShapeSpace, figure: Figure) -> Diagnostic | None:
    """Return a warning about a body of another model or gender than a figure; None if it fits.

    ``C019.model``: the coefficients must not be applied, because they are weights of other
    directions. ``C019.gender``: they may be, because the only model at hand may be the neutral one.
    """
    own = figure.shape_space
    values = {"figure": figure.name, "own": own.title, "other": space.title}
    if not space.shares_coefficients(own):
        return note(
            "C019.model: shape coefficients of {other} omitted: they do not apply to {own} "
            "({figure})",
            **values,
        )
    if own.gender and space.gender and own.gender != space.gender:
        return note(
            "C019.gender: made for a {other} body, but {figure} is {own}: size and shape "
            "differ from the file's",
            **values,
        )
    return None


def apply_coefficients(
    group: str, values: Floats | None, figure: Figure, pose: Pose, cut: bool
) -> list[Diagnostic]:
    """Set a group's first weights (N,) in place and its others to 0; None leaves them unchanged.

    ``cut`` ignores coefficients that the figure does not have; otherwise they raise ``RigError``.
    """
    if values is None or len(values) == 0:
        return []
    groups = figure.blend_shapes.groups if figure.blend_shapes else ()
    # Records store all weights outside the shape group as expressions, including morphs.
    rows = [index for index, name in enumerate(groups) if (name == "shape") == (group == "shape")]
    values = np.asarray(values, dtype=np.float64).ravel()
    notes = unused_coefficients(group, values, len(rows), figure.name)
    if notes and not cut:
        raise RigError(f"{figure.name} has {len(rows)} {group} coefficients, found {len(values)}")
    if np.abs(values).max() > _MOST_SIGMA:
        raise RigError(
            f"{group} coefficients: expected at most {_MOST_SIGMA:g}, "
            f"found {np.abs(values).max():g}"
        )
    weights = np.zeros(len(groups))
    weights[: len(pose.shape_weights)] = pose.shape_weights
    count = min(len(rows), len(values))
    weights[rows] = 0.0
    weights[rows[:count]] = values[:count]
    pose.shape_weights = weights
    return notes
