"""Fixtures for Rig panel tests."""

import pytest
from app import rig_scene
from app.rig_scene import TRUE
from app.rigging.rig_panel import SIZE

from viewer.app.rigging.placing import as_similarity, move_by_hand
from viewer.app.rigging.rigging import current_template


@pytest.fixture
def rigging(drive):
    """A test driver on the mesh with its aligned template and the Rig panel open."""

    def opened(placed=True, **settings):
        hand = drive(scene=rig_scene.scene(**settings), size=SIZE, samples=1)
        hand.menu("menu Window", "Rig")
        hand.step(2)
        if placed:  # the search takes seconds
            move_by_hand(hand.state, current_template(hand.state), as_similarity(TRUE))
            hand.step(2)
        return hand

    return opened
