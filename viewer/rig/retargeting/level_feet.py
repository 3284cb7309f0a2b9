"""Levelling of a driven figure's soles while the source's soles rest flat on the ground.

Retargeting preserves the direction from the ankle to the ball. Where ankles have different heights,
or the rest pose of a file is inexact, the sole is then tilted. While the ball and the heel of the
source stand, the foot rotates until its sole is level; while only the ball stands, the toes rotate
instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.cleanup.curves import falling, smooth_curves
from viewer.rig.cleanup.leg_ik import Leg
from viewer.rig.geometry.quaternion import (
    align_signs,
    conjugate,
    multiply,
    rotation_vector_to_quaternion,
)
from viewer.rig.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.driven_legs import DrivenLegs
from viewer.rig.retargeting.foot_plan import FootPlan

_NOISE = 0.04  # seconds below which changes of a standing foot's rotation are noise
_EASE = 0.06  # seconds over which a correction falls to 40 % outside contacts
_EXACT = 6.0  # decimal exponent of the weight of a standing foot
# Cosines of the tilts beyond which a sole is unchanged and below which it is fully levelled.
_TILTED = (np.cos(np.radians(55.0)), np.cos(np.radians(35.0)))


def levelled(clip: SampledClip, body: DrivenLegs, worlds: Floats, plan: FootPlan) -> SampledClip:
    """Return a motion whose standing soles are level.

    ``worlds``: (N, K, 4, 4), their world matrices.
    """
    legs, up = body.legs, plan.up
    ankles, toes = [leg.ankle for leg in legs], [leg.toe for leg in legs]
    linear = worlds[..., :3, :3]
    lengths = np.maximum(np.linalg.norm(linear, axis=-2, keepdims=True), 1e-30)
    old = matrix_to_quaternion(linear / lengths)
    holds, flat = _holds(plan, legs)
    if not (holds > 0.0).any():
        return clip
    steady = _steadied(plan, np.stack([old[:, ankles], old[:, toes]]), holds)
    normals = np.stack([_normals(steady[0], body.level), _normals(steady[1], body.toe_level)])
    cosines = normals @ up
    flat *= falling((_TILTED[1] - cosines) / (_TILTED[1] - _TILTED[0]))
    tilts = _smoothed(plan, _tilts(normals, up) * (flat > 0.0)[..., None], flat)
    return _rotated(clip, body, old, multiply(rotation_vector_to_quaternion(tilts), steady))


def _holds(plan: FootPlan, legs: Sequence[Leg]) -> tuple[Floats, Floats]:
    """Return how firmly feet and toes stand, and how firmly with flat soles: (2, N, L) each."""
    holds = np.zeros((2, len(plan.feet[0].toe), len(legs)))
    flat = np.zeros_like(holds)
    for foot, leg in enumerate(legs):
        if plan.feet[foot].toe is plan.feet[foot].heel:  # animals stand on their toes
            continue
        for contact, rows, _ in plan.stances(foot):
            holds[:, rows, foot] = contact.hold
            flat[0, rows, foot] = contact.hold * contact.is_flat
            flat[1, rows, foot] = contact.hold * contact.on_toe * (leg.toe != leg.ankle)
    return holds, flat


def _steadied(plan: FootPlan, rotations: Floats, holds: Floats) -> Floats:
    """Return rotations, (2, N, L, 4), smoothed over time where feet stand."""
    rotations = rotations.copy()
    align_signs(rotations.swapaxes(0, 1))
    smooth, ones = np.empty_like(rotations), np.ones(holds.shape)
    for part in (0, 1):
        smooth[part] = _curves(plan, rotations[part], ones[part], _NOISE)
    blend = np.stack([_curves(plan, h[..., None], ones[0], _EASE)[..., 0] for h in holds])
    mixed = rotations + np.clip(blend, 0.0, 1.0)[..., None] * (smooth - rotations)
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)


def _normals(rotations: Floats, level: Floats) -> Floats:
    """Return the unit normals of soles: (N, L, 3)."""
    found = np.einsum("nlab,lb->nla", quaternion_to_matrix(rotations), level)
    return found / np.maximum(np.linalg.norm(found, axis=2, keepdims=True), 1e-30)


def _tilts(normals: Floats, up: Floats) -> Floats:
    """Return the smallest rotations from normals to the up axis, as rotation vectors."""
    axes = np.cross(normals, up)
    sines = np.linalg.norm(axes, axis=-1, keepdims=True)
    return axes / np.maximum(sines, 1e-30) * np.arctan2(sines, (normals @ up)[..., None])


def _smoothed(plan: FootPlan, targets: Floats, holds: Floats) -> Floats:
    """Return corrections, (2, N, L, 3), that fade out where soles are not flat."""
    weights = 1.0 + holds * 10.0 ** (_EXACT * holds)
    parts = zip(targets, weights, strict=True)
    return np.stack([_curves(plan, target, weight, _EASE) for target, weight in parts])


def _curves(plan: FootPlan, targets: Floats, weights: Floats, seconds: float) -> Floats:
    """Return smooth curves of all feet, (N, L, C); gaps in time separate them."""
    result = np.empty_like(targets)
    for start, stop in plan.spans:
        part = slice(start, stop)
        rows = targets[part].swapaxes(0, 1), weights[part].swapaxes(0, 1)
        result[part] = smooth_curves(*rows, seconds * plan.rate).swapaxes(0, 1)
    return result


def _rotated(clip: SampledClip, body: DrivenLegs, old: Floats, new: Floats) -> SampledClip:
    """Return a motion with new rotations of ankles and toes in the world, (2, N, L, 4)."""
    rotations, joints, parents = clip.rotations.copy(), body.chains.joints, body.chains.parents
    for foot, leg in enumerate(body.legs):
        ankle, above = new[0][:, foot], int(parents[leg.ankle])
        rotations[:, joints[leg.ankle]] = multiply(conjugate(old[:, above]), ankle)
        if leg.toe == leg.ankle:
            continue
        change = multiply(ankle, conjugate(old[:, leg.ankle]))
        outer = multiply(change, old[:, int(parents[leg.toe])])
        rotations[:, joints[leg.toe]] = multiply(conjugate(outer), new[1][:, foot])
    return replace(clip, rotations=rotations)
