"""Motions of figures with model parameters, from the arrays of tools that estimate them."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Floats, frozen
from viewer.rig.coefficients import apply_coefficients
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.scene import figure_pose
from viewer.rig.units import METRES


@dataclass(frozen=True, slots=True, eq=False)
class ParameterMotion:
    """Model parameters of one person over time, as SAM 3D Body stores them for MHR.

    Attributes
    ----------
    name : str
        Display name.
    timing : Timing
        Frame rate, and the row of each frame.
    parameters : (N, P)
        ``mhr_model_params``: placement, pose and scales.
    identity, expression : (N, S), (N, E)
        ``shape_params`` and ``expr_params``.
    places : (N, 3)
        Translations of the whole figure, metres.
    """

    name: str
    timing: Timing
    parameters: Floats
    identity: Floats
    expression: Floats
    places: Floats

    def __post_init__(self) -> None:
        count = len(self.parameters)
        for name in ("parameters", "identity", "expression", "places"):
            size = 3 if name == "places" else None
            object.__setattr__(self, name, frozen(name, getattr(self, name), (count, size)))


def parameter_clip(motion: ParameterMotion, figure: Figure) -> SampledClip:
    """Return a motion of a figure with model parameters, in metres.

    Parameters
    ----------
    motion : ParameterMotion
        At least one row.
    figure : Figure
        MHR, or another figure with model parameters.

    Raises
    ------
    RigError
        If the figure has no model parameters, or the number of values is wrong.
    """
    if len(motion.parameters) == 0:
        raise RigError("expected model parameters of at least one frame")
    skeleton = figure.require_skeleton()
    rows = zip(motion.parameters, motion.identity, motion.expression, strict=True)
    poses = [parameter_pose(figure, *row) for row in rows]
    rotations = np.stack([joint_rotations(skeleton, pose) for pose in poses])
    still = skeleton.rest_translations
    moves = np.stack([local_matrices(skeleton, pose)[:, :3, 3] - still for pose in poses])
    return SampledClip(
        motion.name,
        motion.timing,
        matrix_to_quaternion(rotations),
        translations=moves,
        figure_translations=motion.places,
        figure_scales=np.full(len(poses), METRES.get(figure.unit, 1.0)),
        shape_weights=np.stack([pose.shape_weights for pose in poses]),
        scales=np.stack([pose.scales for pose in poses]),
    )


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
