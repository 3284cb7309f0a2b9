"""Motions of figures with model parameters, from the arrays of tools that estimate them."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.pose import joint_rotations, local_matrices
from viewer.rig.posing.parameter_pose import parameter_pose
from viewer.rig.units import METRES

__all__ = ["parameter_clip"]


def parameter_clip(
    name: str,
    timing: Timing,
    figure: Figure,
    parameters: Floats,
    identity: Floats,
    expression: Floats,
    places: Floats,
) -> SampledClip:
    """Return the motion of one person, as SAM 3D Body stores it for MHR, in metres.

    Parameters
    ----------
    name : str
        Display name.
    timing : Timing
        Frame rate, and the row of each frame.
    figure : Figure
        MHR, or another figure with model parameters.
    parameters : (N, P)
        ``mhr_model_params`` of each row.
    identity, expression : (N, S), (N, E)
        ``shape_params`` and ``expr_params``.
    places : (N, 3)
        Translations of the whole figure, metres.

    Raises
    ------
    RigError
        If the figure has no model parameters, or a number of values is wrong.
    """
    if len(parameters) == 0:
        raise RigError("expected model parameters of at least one frame")
    skeleton = figure.require_skeleton()
    poses = [
        parameter_pose(figure, *row) for row in zip(parameters, identity, expression, strict=True)
    ]
    rotations = np.stack([joint_rotations(skeleton, pose) for pose in poses])
    still = skeleton.rest_translations
    moves = np.stack([local_matrices(skeleton, pose)[:, :3, 3] - still for pose in poses])
    return SampledClip(
        name,
        timing,
        matrix_to_quaternion(rotations),
        translations=moves,
        figure_translations=places,
        figure_scales=np.full(len(poses), METRES.get(figure.unit, 1.0)),
        shape_weights=np.stack([pose.shape_weights for pose in poses]),
        scales=np.stack([pose.scales for pose in poses]),
    )
