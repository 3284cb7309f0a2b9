"""Poses of figures with model parameters, from the arrays of tools that estimate them."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.coefficients import apply_coefficients
from viewer.rig.figure import Figure
from viewer.rig.pose import Pose
from viewer.rig.scene import figure_pose

__all__ = ["parameter_pose"]


def parameter_pose(
    figure: Figure, parameters: Floats, identity: Floats, expression: Floats
) -> Pose:
    """Return the pose that SAM 3D Body stores for MHR.

    The tool's vertices and joints are the pose's vertices and joints times 0.01, with y and z
    negated.

    Parameters
    ----------
    figure : Figure
        MHR, or another figure with model parameters.
    parameters : (P,)
        ``mhr_model_params``: placement, pose and scales.
    identity, expression : (N,), (M,)
        ``shape_params`` and ``expr_params``; missing trailing ones are treated as 0.

    Raises
    ------
    RigError
        If the figure has no model parameters, or the number of values is wrong.
    """
    if figure.parameters is None:
        raise RigError(f"figure {figure.name} has no model parameters")
    pose = figure_pose(figure)
    figure.parameters.apply(figure.require_skeleton(), pose, np.asarray(parameters, np.float64))
    for group, values in (("shape", identity), ("expression", expression)):
        apply_coefficients(group, np.asarray(values, np.float64), figure, pose, cut=False)
    return pose
