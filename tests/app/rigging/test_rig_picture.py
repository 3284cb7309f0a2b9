"""Golden images of the Rig panel: a mesh with its template, and the result with its report."""

import pytest
from app import rig_scene
from app.test_panel_pictures import _compare, _shown

from viewer.app.layout import ShownPanels

pytestmark = pytest.mark.usefixtures("quick_fits")

SIZE = (1000, 1100)


def _aligned(hand):
    hand.click("Align")
    hand.finish_job()
    hand.click("rig tool rotate")
    hand.move((5, 5))


def _result(hand):
    hand.click("Run")
    hand.finish_job()
    hand.state.clock.playing = False
    hand.state.clock.seek(0.0)
    hand.click("color class:confidence")
    hand.move((5, 5))


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize(("name", "prepare"), [("rig", _aligned), ("rigged", _result)])
def test_rig_panel_matches_golden_image(drive, name, prepare):
    hand = drive(scene=rig_scene.scene(), size=SIZE, samples=1, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed.add("stats")  # the displayed times differ between runs
    hand.menu("menu Window", "Rig")
    hand.step(2)
    _compare(_shown(hand, prepare), name)
