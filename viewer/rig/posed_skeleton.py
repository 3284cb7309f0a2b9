"""A skeleton in one pose: where its joints are, and what carries the vertices of its skins."""

from __future__ import annotations

from viewer.rig.arrays import Floats
from viewer.rig.number_key import NumberKey
from viewer.rig.skeleton import Skeleton
from viewer.rig.skin import Skin

__all__ = ["PosedSkeleton"]


class PosedSkeleton:
    """World and skinning matrices of one pose, made once for whoever asks; they are read-only.

    A pose keeps the one that was made of it last, see ``viewer.rig.kinematics.posed_skeleton``.

    Parameters
    ----------
    skeleton : Skeleton
        Of the shaped figure.
    key : NumberKey
        The pose's ``skinning_key``.
    world : (J, 4, 4)
        Joint-to-figure matrices of that pose; made read-only.
    """

    __slots__ = ("_palette", "_skin", "key", "skeleton", "world")

    def __init__(self, skeleton: Skeleton, key: NumberKey, world: Floats) -> None:
        self.skeleton, self.key, self.world = skeleton, key, world
        world.flags.writeable = False
        self._skin: Skin | None = None
        self._palette: Floats = world

    def palette(self, skin: Skin) -> Floats:
        """Return what carries a bound vertex with each joint: M[j] = W[j] inverse(B[j]).

        Parameters
        ----------
        skin : Skin
            Of the shaped figure.

        Returns
        -------
        (J, 4, 4)
            Bind-to-posed matrices, read-only.
        """
        if self._skin is not skin:
            self._palette = self.world @ skin.inverse_bind
            self._palette.flags.writeable = False
            self._skin = skin
        return self._palette
