"""A skin's influences on the GPU: a range of pairs per vertex, the strongest pair first."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import buffer, pair_texture
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skin import Skin, has_influence, strongest_first, weight_sums

__all__ = ["SkinBuffers"]


class SkinBuffers:
    """Influences of a mesh's split vertices.

    Parameters
    ----------
    context : moderngl.Context
        The context in use; ``release`` frees all buffers.
    skin : Skin or None
        None for vertices without influences.
    sources : (R,)
        Vertex of the skin for each split vertex.

    Attributes
    ----------
    bindings : moderngl.Buffer
        One row per split vertex, see ``include/skinning.glsl``.
    fractions : moderngl.Buffer
        The skin's fraction of DQS at each split vertex.
    joint_fractions : (J,)
        Each joint's fraction of the sum of all weights, for the mean motion of the figure.
    """

    def __init__(self, context: moderngl.Context, skin: Skin | None, sources: Ints) -> None:
        self._owner = Owner()
        with self._owner.guard():
            self._upload(context, skin, sources)

    def _upload(self, context: moderngl.Context, skin: Skin | None, sources: Ints) -> None:
        keep = self._owner.keep
        if skin is None:
            self.joint_fractions: Floats = np.zeros(0)
            ranges, excess = np.zeros((len(sources), 2), "u4"), np.zeros(len(sources))
            self.pairs = keep(pair_texture(context, [], []))
        else:
            skin = strongest_first(skin)
            counts = np.where(has_influence(skin), np.diff(skin.starts), 0)
            ranges = np.stack([skin.starts[:-1], counts], axis=1)[sources]
            self.pairs = keep(pair_texture(context, skin.joints, skin.weights))
            sums = np.bincount(skin.joints, np.abs(skin.weights), minlength=skin.n_joints)
            self.joint_fractions = sums / (sums.sum() or 1.0)
            # In float64: float32 sums deviate from 1, which displaces vertices far from the origin.
            excess = (weight_sums(skin) - 1.0)[sources]
        # One packed attribute: each attribute costs software drivers as much as a matrix product.
        bindings = np.empty((len(sources), 4), dtype="u4")
        bindings[:, :2], bindings[:, 2] = ranges, sources
        bindings[:, 3] = excess.astype("f4").view("u4")
        self.bindings = keep(buffer(context, bindings, "u4"))
        stated = None if skin is None else skin.dqs_fractions
        fractions = np.zeros(len(sources)) if stated is None else stated[sources]
        self.fractions = keep(buffer(context, fractions, "f4"))

    def release(self) -> None:
        """Free everything."""
        self._owner.release()
