"""Queries and steps for tests of the Rig panel."""

from viewer.app.rigging.results import plays_motion, plays_trial
from viewer.app.rigging.rigging import Rigging
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.skinning import deform

SIZE = (1000, 1250)


def names(hand):
    return [actor.name for actor in hand.state.scene.actors]


def seen(hand, row):
    actor = hand.state.scene.actors[row]
    return apply_transform(actor.placement, deform(actor.figure, actor.own_pose)[0])


def stop(hand):
    """Stop the motion that plays after Run, so that the result has the target's pose."""
    hand.state.clock.playing = False
    for label in ("Trial motion", "Move like the template"):
        result = next(iter(hand.state.of(Rigging).results.values()))
        if (plays_trial if label == "Trial motion" else plays_motion)(result):
            hand.click(label)
    hand.step(2)
