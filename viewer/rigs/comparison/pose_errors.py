"""Errors of an estimated motion: MPJPE, PA-MPJPE, PVE and acceleration error, as papers state them.

Ionescu, Papava, Olaru, Sminchisescu 2014, "Human3.6M": MPJPE, after moving the roots together.
Zhou, Zhu, Leonardos, Derpanis, Daniilidis 2017, "Sparseness Meets Deepness": PA-MPJPE, after the
similarity that fits best. Kanazawa, Zhang, Felsen, Malik 2019, "Learning 3D Human Dynamics from
Video": acceleration error. Pavlakos, Zhu, Zhou, Daniilidis 2018: per-vertex error.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.scene import Actor
from viewer.rigs.units import METRES

_MILLI = 1000.0


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Mean errors of a motion, millimetres; NaN where one cannot be computed."""

    mpjpe: float
    """Mean distance of joints, with the roots moved together."""
    pa_mpjpe: float
    """Mean distance of joints after the similarity of each frame that fits best."""
    pve: float
    """Mean distance of vertices, with the roots moved together; NaN without equal meshes."""
    acceleration: float
    """Mean difference of the joints' accelerations, in millimetres per squared second; NaN for
    fewer than three frames in a row."""
    n_frames: int
    """Number of frames in which both are present."""


def pose_errors(found: Actor, reference: Actor) -> PoseErrors:
    """Return the errors of a motion against a reference, as papers on body capture state them.

    Parameters
    ----------
    found : Actor
        The estimated motion, or a pose.
    reference : Actor
        The true one: as many joints and frames, at the same rate. Joints correspond by index.

    Returns
    -------
    PoseErrors
        Means over joints and over frames in which both are present.

    Raises
    ------
    RigError
        If joints or frames differ in number, units are unknown, or no frame has both.
    """
    ours, theirs = found.joints(), reference.joints()
    for axis, what in ((1, "joints"), (0, "frames")):
        if ours.shape[axis] != theirs.shape[axis]:
            raise RigError(
                f"{found.name}: expected {theirs.shape[axis]} {what} as in {reference.name}, "
                f"found {ours.shape[axis]}"
            )
    rates = [_rate(actor) for actor in (found, reference)]
    if rates[0] != rates[1]:
        raise RigError(f"{found.name}: expected {rates[1]:g} frames per second, found {rates[0]:g}")
    scales = [_millimetres(actor) for actor in (found, reference)]
    ours, theirs = ours * scales[0], theirs * scales[1]
    seen: Bools = np.isfinite(np.concatenate([ours, theirs], axis=1)).all(axis=(1, 2))
    if not seen.any():
        raise RigError(f"{found.name} and {reference.name}: no frame has both")
    roots = ours[:, :1], theirs[:, :1]
    apart = ours - roots[0] - (theirs - roots[1])
    fitted = np.stack([_fitted(a, b) for a, b in zip(ours[seen], theirs[seen], strict=True)])
    pve = math.nan
    if found.figure.mesh is not None and reference.figure.mesh is not None:
        body, other = found.vertices() * scales[0], reference.vertices() * scales[1]
        if body.shape == other.shape:
            pve = _mean((body - roots[0] - (other - roots[1]))[seen])
    return PoseErrors(
        mpjpe=_mean(apart[seen]),
        pa_mpjpe=_mean(fitted - theirs[seen]),
        pve=pve,
        acceleration=_acceleration(ours, theirs, seen, rates[0]),
        n_frames=int(seen.sum()),
    )


def _mean(apart: Floats) -> float:
    """Return the mean length of differences (..., 3)."""
    return float(np.linalg.norm(apart, axis=-1).mean())


def _rate(actor: Actor) -> float:
    return 0.0 if actor.joint_motion is None else sample_animation(actor).frame_rate


def _millimetres(actor: Actor) -> float:
    """Return the millimetres of a unit of the figure."""
    if actor.figure.unit not in METRES:
        raise RigError(f"{actor.name}: expected a figure with a known length unit, found none")
    # A placement may convert units, too.
    scale = float(np.linalg.norm(actor.placement[:3, 0])) or 1.0
    return _MILLI * METRES[actor.figure.unit] / scale


def _fitted(points: Floats, wanted: Floats) -> Floats:
    """Return points (J, 3) after the similarity that is nearest to others (Umeyama 1991)."""
    middle, aim = points.mean(axis=0), wanted.mean(axis=0)
    a, b = points - middle, wanted - aim
    # With U D V^T = sum b a^T: R = U S V^T, where S = diag(1, 1, det) prevents a reflection
    # (eq. 40), and the scale is tr(D S) / sum |a|^2 (eq. 42).
    left, values, right = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0])
    total = float((a * a).sum())
    scale = float(values @ signs) / total if total > 0.0 else 1.0
    placed: Floats = scale * a @ ((left * signs) @ right).T + aim
    return placed


def _acceleration(ours: Floats, theirs: Floats, seen: Bools, rate: float) -> float:
    """Return the mean difference of second differences, over runs of three frames."""
    runs = seen[:-2] & seen[1:-1] & seen[2:]
    if len(seen) < 3 or not runs.any():
        return math.nan
    second = [x[:-2] - 2.0 * x[1:-1] + x[2:] for x in (ours, theirs)]
    return _mean((second[0] - second[1])[runs]) * rate * rate
