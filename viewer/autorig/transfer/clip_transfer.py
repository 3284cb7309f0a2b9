"""Transfer of a template's clips to the rigged figure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton


def transfer_clip(
    clip: Clip | SampledClip,
    skeleton: Skeleton,
    length_scale: float,
    figure_scale: float = 1.0,
    path_scale: float | None = None,
) -> Clip | SampledClip:
    """Return a clip of the template for the rigged target: angles unchanged, lengths scaled.

    ``length_scale``: target units per unit of the template's figure space, 1 if nothing was scaled.
    ``path_scale``: replaces it for the figure's translation and its roots, which scale with the
    length of the legs. Shape weights of captures are dropped, as the target has a different shape.
    Raises ``RigError`` if the clip has a different number of joints, or moves a missing DOF.
    """
    path = length_scale if path_scale is None else path_scale
    roots = skeleton.parents < 0
    inside = np.where(roots, path, length_scale) * figure_scale
    if clip.kind == "curves":
        channels = tuple(_scaled(channel, skeleton, inside) for channel in clip.channels)
        return replace(clip, channels=channels)
    if clip.n_joints != skeleton.n_joints:
        raise RigError(
            f"clip {clip.name} has {clip.n_joints} joints, but the figure has {skeleton.n_joints}"
        )
    places, scales, moves = clip.figure_translations, clip.figure_scales, clip.translations
    return replace(
        clip,
        translations=None if moves is None else moves * inside[:, None],
        figure_translations=None if places is None else places * path,
        figure_scales=None if scales is None else scales / figure_scale,
        shape_weights=None,
    )


def _scaled(channel: Channel, skeleton: Skeleton, factors: Floats) -> Channel:
    """Scale a curve of lengths: its values, and its numeric slopes."""
    if channel.target >= skeleton.n_dofs:
        raise RigError(
            f"a channel moves DOF {channel.target}, but the figure has {skeleton.n_dofs} DOFs"
        )
    if skeleton.dof_kinds[channel.target] >= FIRST_ROTATION:
        return channel
    factor = float(factors[skeleton.dof_joints[channel.target]])
    tangents = tuple(
        (
            before if isinstance(before, str) else before * factor,
            after if isinstance(after, str) else after * factor,
        )
        for before, after in channel.tangents
    )
    return replace(channel, values=channel.values * factor, tangents=tangents)
