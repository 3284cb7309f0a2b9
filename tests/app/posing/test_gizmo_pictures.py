"""Golden images of the gizmo handles, compared coarsely; see test_panel_pictures.py.

``make golden NAME…`` re-renders them; review them before committing.
"""

import pytest
from app.posing_rigs import around, joint_seen
from app.test_panel_pictures import _compare, _is_like

from viewer.app.posing.posing import Posing
from viewer.app.posing.rotate_tool import RADIUS
from viewer.loading import bundled_files


def _posed(drive, joint, key):
    """Return a test driver on the fox with a joint selected, a tool active and panels hidden."""
    hand = drive(*bundled_files(), size=(700, 520), samples=1, pixels_per_point=1.0)
    hand.key(key)
    hand.key("tab")
    hand.step(3)
    hand.key("f")
    hand.state.selected_joint = hand.state.actor.figure.skeleton.names.index(joint)
    hand.state.messages.notes.clear()
    return hand


def _rotate(drive):
    hand = _posed(drive, "head", "e")
    place = around(joint_seen(hand, hand.state.selected_joint), RADIUS, 0.8, 0.8, 1)[0]
    hand.move((5.0, place[1]))
    return hand


def _turning(drive):
    hand = _posed(drive, "head", "e")
    center = joint_seen(hand, hand.state.selected_joint)
    for number, place in enumerate(around(center, 1.2 * RADIUS, 0.0, 1.4)):
        hand.move(place)
        if not number:
            hand.press()
    return hand


def _moving(drive):
    hand = _posed(drive, "head", "d")
    hand.state.of(Posing).chain_length = 3
    x, y = joint_seen(hand, hand.state.selected_joint)
    hand.move((x, y))
    hand.press()
    hand.move((x + 60, y - 120))
    return hand


PICTURES = {"gizmo_rotate": _rotate, "gizmo_turning": _turning, "gizmo_moving": _moving}


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize("name", PICTURES)
def test_handles_match_golden_images(drive, name):
    hand = PICTURES[name](drive)
    hand.state.messages.notes.clear()
    _compare(hand.screen(), name)


def test_comparison_detects_missing_handles(drive):
    hand = _rotate(drive)
    with_rings = hand.screen()
    hand.key("q")
    hand.state.messages.notes.clear()
    assert not _is_like(with_rings, hand.screen())
