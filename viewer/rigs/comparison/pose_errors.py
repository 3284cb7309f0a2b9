"""Errors of an estimated motion: MPJPE, PA-MPJPE, PVE, acceleration error and foot skate.

Ionescu, Papava, Olaru, Sminchisescu 2014, "Human3.6M": MPJPE, after moving the roots together.
Zhou, Zhu, Leonardos, Derpanis, Daniilidis 2017, "Sparseness Meets Deepness": PA-MPJPE, after the
similarity that fits best. Kanazawa, Zhang, Felsen, Malik 2019, "Learning 3D Human Dynamics from
Video": acceleration error. Pavlakos, Zhu, Zhou, Daniilidis 2018: per-vertex error.

Foot skate follows Shin, Kim, Halilaj, Black 2024, "WHAM". Their ``compute_foot_sliding`` averages
the steps of four vertices of the soles over the frames in which those of the reference move less
than 1 cm. Here, a foot stands while ``foot_contacts`` says so of the reference, and its ball or
ankle counts, so that figures without a mesh or with other vertices have a value, too.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, runs_of
from viewer.rigs.comparison.pairs import pair_joints
from viewer.rigs.feet.body import body_legs
from viewer.rigs.feet.contacts import foot_contacts
from viewer.rigs.feet.legs import legs_of
from viewer.rigs.geometry.rotation import nearest_similarity
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.motion.sampled_animation import clip_of, sample_animation
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
    foot_skate: float
    """Mean distance that a foot moves from one frame to the next while it stands in the reference;
    NaN if no foot of it is known to stand."""
    n_frames: int
    """Number of frames in which both are present."""


def pose_errors(
    found: Actor, reference: Actor, frames: tuple[int, int] | None = None
) -> PoseErrors:
    """Return the errors of a motion against a reference, as papers on body capture state them.

    Parameters
    ----------
    found
        The estimated motion, or a pose.
    reference
        The true one: as many joints and frames, at the same rate. Joints correspond by name if
        both have the same names, in whatever order, else by index.
    frames : (int, int), optional
        First frame and the frame after the last one, counted from 0; all by default.

    Returns
    -------
    PoseErrors
        Means over joints and over frames in which both are present.

    Raises
    ------
    RigError
        If joints or frames differ in number, units are unknown, or no frame has both.
    """
    check_type("found", found, Actor)
    check_type("reference", reference, Actor)
    ours, theirs = found.joints(), reference.joints()
    for axis, what in ((1, "joints"), (0, "frames")):
        if ours.shape[axis] != theirs.shape[axis]:
            raise RigError(
                f"{found.name}: expected {theirs.shape[axis]} {what} as in {reference.name}, "
                f"found {ours.shape[axis]}"
            )
    ours = ours[:, _order(found, reference)]
    rates = [_rate(actor) for actor in (found, reference)]
    if rates[0] != rates[1]:
        raise RigError(f"{found.name}: expected {rates[1]:g} frames per second, found {rates[0]:g}")
    scales = [_millimetres(actor) for actor in (found, reference)]
    chosen = slice(*(frames or (0, len(ours))))
    skate = _foot_skate(ours * scales[0], reference, rates[0], chosen)
    ours, theirs = ours[chosen] * scales[0], theirs[chosen] * scales[1]
    seen: Bools = np.isfinite(np.concatenate([ours, theirs], axis=1)).all(axis=(1, 2))
    if not seen.any():
        raise RigError(f"{found.name} and {reference.name}: no frame has both")
    roots = ours[:, :1], theirs[:, :1]
    apart = ours - roots[0] - (theirs - roots[1])
    fitted = np.stack([_fitted(a, b) for a, b in zip(ours[seen], theirs[seen], strict=True)])
    pve = math.nan
    meshes = [actor.figure.mesh for actor in (found, reference)]
    if None not in meshes and len({mesh.n_vertices for mesh in meshes if mesh is not None}) == 1:
        body = found.vertices()[chosen] * scales[0]
        other = reference.vertices()[chosen] * scales[1]
        pve = _mean((body - roots[0] - (other - roots[1]))[seen])
    return PoseErrors(
        mpjpe=_mean(apart[seen]),
        pa_mpjpe=_mean(fitted - theirs[seen]),
        pve=pve,
        acceleration=_acceleration(ours, theirs, seen, rates[0]),
        foot_skate=skate,
        n_frames=int(seen.sum()),
    )


def _order(found: Actor, reference: Actor) -> Ints | slice:
    """Return the joints of an actor in the order of another's; as they are if names differ."""
    pairs = pair_joints(reference.figure.require_skeleton(), found.figure.require_skeleton())
    has_all = len(pairs.second) == found.figure.require_skeleton().n_joints
    return pairs.second if has_all else slice(None)


def _foot_skate(ours: Floats, reference: Actor, rate: float, chosen: slice) -> float:
    """Return the mean step of joints (F, J, 3) of feet that stand in the reference, all frames."""
    figure, legs = reference.figure, legs_of(reference.figure.require_skeleton())
    if reference.joint_motion is None or not legs:
        return math.nan
    sampled = sample_animation(reference)
    clip = clip_of(reference.name, sampled)
    up = axis_vector(figure.up)
    body = body_legs(figure, clip, legs, up)
    if body is None or body.size <= 0.0:
        return math.nan
    # A frame of the clip is a row of ``ours``. Spans are ranges of present rows.
    spans = runs_of(sampled.frames.present)
    contacts = foot_contacts(body.paths(body.worlds(clip)), spans, rate, body.size, up)
    first, stop, _ = chosen.indices(len(ours))
    steps = [np.zeros(0)]
    for leg, stands in zip(legs, contacts, strict=True):
        for contact in stands:
            held = np.arange(max(contact.start, first), min(contact.stop, stop) - 1)
            # The ball holds while it is on the ground, else the heel, as an ankle does not roll.
            joint = np.where(contact.on_toe[held - contact.start], leg.toe, leg.ankle)
            steps.append(np.linalg.norm(ours[held + 1, joint] - ours[held, joint], axis=1))
    moved = np.concatenate(steps)
    moved = moved[np.isfinite(moved)]
    return float(moved.mean()) if len(moved) else math.nan


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
    scale, rotation, shift = nearest_similarity(points, wanted)
    placed: Floats = scale * points @ rotation.T + shift
    return placed


def _acceleration(ours: Floats, theirs: Floats, seen: Bools, rate: float) -> float:
    """Return the mean difference of second differences, over runs of three frames."""
    runs = seen[:-2] & seen[1:-1] & seen[2:]
    if len(seen) < 3 or not runs.any():
        return math.nan
    second = [x[:-2] - 2.0 * x[1:-1] + x[2:] for x in (ours, theirs)]
    return _mean((second[0] - second[1])[runs]) * rate * rate
