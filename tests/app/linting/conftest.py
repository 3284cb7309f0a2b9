"""Fixtures for Lint panel tests."""

import pytest
from app.linting.checked_scenes import SIZE, finish
from lint.sound import scene_of

from viewer.rig.scene import Scene


@pytest.fixture
def lint(drive):
    """Open an app that shows a figure or scene with the Lint panel open and the check finished."""

    def open_panel(shown, **settings):
        scene = shown if isinstance(shown, Scene) else scene_of(shown)
        hand = drive(scene=scene, size=SIZE, samples=1, **settings)
        hand.menu("menu Edit", "Check the rig")
        finish(hand)
        return hand

    return open_panel
