"""Humanoids: joints with the standard names of human bones, as VRM files state them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["Humanoid"]


@dataclass(frozen=True, slots=True, eq=False)
class Humanoid:
    """Joints of a figure by the standard name of the human bone that they are.

    Attributes
    ----------
    joints : mapping of str to int
        Bones of VRM 1.0 (``"hips"``, ``"leftUpperArm"`` ...) and the joint of each.
    """

    joints: Mapping[str, int]
