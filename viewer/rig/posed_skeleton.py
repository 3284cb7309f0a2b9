"""World and skinning matrices of a skeleton in one pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from viewer.rig.arrays import Floats
from viewer.rig.number_key import NumberKey
from viewer.rig.skeleton import Skeleton

if TYPE_CHECKING:
    from viewer.rig.skin import Skin

__all__ = ["PosedSkeleton"]


class PosedSkeleton:
    """Read-only world and skinning matrices of one pose, each computed once.

    A pose caches its latest instance; see ``viewer.rig.kinematics.posed_skeleton``.

    Parameters
    ----------
    skeleton : Skeleton
        Skeleton of the shaped figure.
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
        """Return the skinning matrices: M[j] = W[j] inverse(B[j]).

        Parameters
        ----------
        skin : Skin
            Skin of the shaped figure.

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
