"""Motions of captured bodies on characters with other joints, such as VRM and Mixamo figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.quaternion import multiply
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.retargeting.retarget import retarget

__all__ = ["carried_clip", "has_joints"]

_ENOUGH = 0.5  # fraction of the joint names that a body model has
_Z_TO_Y = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


def has_joints(figure: Figure, names: Sequence[str]) -> bool:
    """Return whether a figure is a body model for a motion: it has its root and most of its joints.

    Parameters
    ----------
    figure : Figure
        Figure with a skeleton.
    names : sequence of str
        Joints of the motion, the root first.
    """
    own = set(figure.require_skeleton().names)
    return names[0] in own and sum(name in own for name in names) >= _ENOUGH * len(names)


def carried_clip(
    body: Figure, clip: SampledClip, up: str, target: Figure
) -> tuple[SampledClip, list[Diagnostic]]:
    """Return the motion of a body as a motion of another figure, in the world of the body.

    Parameters
    ----------
    body : Figure
        Body model that ``clip`` moves.
    clip : SampledClip
        Its motion.
    up : "y" or "z"
        Up axis of the motion's world, which the result keeps.
    target : Figure
        Figure with a skeleton.

    Returns
    -------
    clip : SampledClip
        Motion of ``target``.
    notes : list of Diagnostic
        Messages about matched joints and the scale of the path.

    Raises
    ------
    RigError
        If too few joints match.
    """
    moving = Figure(clip.name, skeleton=body.skeleton, up="z" if up == "z" else "y")
    found, notes = retarget(SkeletonMotion(moving, clip), target)
    if up == target.up:
        return found, notes
    # The retargeted figure stands along its own up axis: it is rotated back to that of the world.
    turn = _Z_TO_Y if target.up == "z" else _Z_TO_Y * [-1.0, 1.0, 1.0, 1.0]
    return _rotated(found, target, turn), notes


def _rotated(clip: SampledClip, figure: Figure, turn: Floats) -> SampledClip:
    """Return a motion rotated about the origin: R' = Q R and T' = Q (rest + T) - rest at roots."""
    skeleton = figure.require_skeleton()
    matrix, rotations = quaternion_to_matrix(turn), clip.rotations.copy()
    roots = np.flatnonzero(skeleton.parents < 0)
    rotations[:, roots] = multiply(turn, rotations[:, roots])
    rests = skeleton.rest_translations[roots]
    shifts = np.zeros_like(clip.rotations[..., :3]) if clip.translations is None else (
        clip.translations.copy()
    )  # fmt: skip
    place = clip.figure_translations
    moved = rests + shifts[:, roots]
    if place is None or len(roots) != 1:
        shifts[:, roots] = moved @ matrix.T - rests
        place = None if place is None else place @ matrix.T
    else:
        shifts[:, roots] = 0.0
        place = (moved[:, 0] + place) @ matrix.T - rests[0]
    return replace(
        clip,
        rotations=rotations,
        translations=shifts if shifts.any() else None,
        figure_translations=place,
    )
