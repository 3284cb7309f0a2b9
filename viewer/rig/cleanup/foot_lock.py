"""Feet of captured bodies, held in place while they are on the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rig.cleanup.frames import in_frame_order
from viewer.rig.feet.body import body_legs
from viewer.rig.feet.legs import legs_of
from viewer.rig.feet.planting import PlantedFeet, plant
from viewer.rig.figure import Figure
from viewer.rig.geometry.vectors import axis_vector
from viewer.rig.motion.sampled_clip import SampledClip


def lock_feet(
    figure: Figure, clip: SampledClip, up: int, way: float = 1.0
) -> tuple[SampledClip, PlantedFeet]:
    """Hold feet still while they stand, as far as legs reach; ``way``: -1 if ``up`` points down."""
    clip = in_frame_order(clip)
    legs = legs_of(figure.require_skeleton())
    rest_up = axis_vector(figure.up)
    body = body_legs(figure, clip, legs, rest_up) if legs and clip.n_rows else None
    if body is None or body.size <= 0.0:
        return clip, PlantedFeet()
    planted, changes = plant(clip, body, body.worlds(clip), way * np.eye(3)[up])
    if not changes.is_better:  # the motion is unchanged
        changes = replace(changes, after=changes.before, lowered=0.0)
    return planted, changes
