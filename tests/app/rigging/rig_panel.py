"""Contents of the Rig panel."""

from __future__ import annotations

from viewer.rig.geometry.transform import apply_transform
from viewer.rig.skinning import deform

SIZE = (900, 1250)


def names(hand):
    return [actor.name for actor in hand.state.scene.actors]


def seen(hand, row):
    actor = hand.state.scene.actors[row]
    return apply_transform(actor.placement, deform(actor.figure, actor.pose)[0])
