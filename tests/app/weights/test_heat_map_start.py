"""The initial heat map, which shows a joint or field that is not 0 everywhere."""

from dataclasses import replace

import numpy as np
import pytest
from app.tiny import SKEL, skin_text

from viewer.app.weights.weights_panel import start_heat_map, toggle_weights
from viewer.rig.annotations import VertexField
from viewer.rig.scalars import informative_quantity, joint_influences, most_influential
from viewer.rig.scene import Actor

TIP = "balljoint arm {\n        balljoint tip { }"


@pytest.fixture
def tipped(drive, tmp_path):
    """A test driver on the tiny rig with an additional child of the arm that moves no vertex."""
    skel, skin = tmp_path / "tipped.skel", tmp_path / "tipped.skin"
    skel.write_text(SKEL.replace("balljoint arm {", TIP))
    skin.write_text(skin_text(3).replace("2 0 0.5 1 0.5", "2 0 0.25 1 0.75"))
    return drive(skel, skin, size=(1000, 1000), samples=1)


def shown(hand):
    """Return the lowest and highest value of the drawn view."""
    hand.step(3)
    return hand.state.stats.scalar_range


def test_influence_of_a_joint_is_the_sum_of_its_weights(tipped):
    figure = tipped.state.actor.figure
    # Four vertices follow the root, four the arm, and four both.
    np.testing.assert_allclose(joint_influences(figure), [5.0, 7.0, 0.0])
    assert most_influential(figure) == 1
    assert informative_quantity("weight", [figure]) == "weight:arm"
    assert most_influential(replace(figure, skin=None)) == -1


@pytest.mark.parametrize("way", ["check box", "shading", "key"])
def test_heat_map_selects_the_joint_with_the_most_influence(tipped, way):
    if way == "check box":
        tipped.show_panel("Weights")
        tipped.click("Heat map")
    elif way == "shading":
        start_heat_map(tipped.state)
    else:
        tipped.key("v")
    assert tipped.state.selected_joint == 1
    assert tipped.state.options.scalar == "weight"
    assert shown(tipped) == (0.0, 1.0)


def test_selected_joint_with_influence_stays(tipped):
    tipped.state.selected_joint = 0
    toggle_weights(tipped.state)
    assert tipped.state.selected_joint == 0 and shown(tipped) == (0.0, 1.0)


def test_selected_joint_without_influence_is_replaced_with_a_note(tipped):
    tipped.state.selected_joint = 2
    toggle_weights(tipped.state)
    assert tipped.state.selected_joint == 1 and shown(tipped) == (0.0, 1.0)
    assert tipped.says("tip has no influence")
    # A later explicit choice is kept, although the joint moves no vertex.
    tipped.state.selected_joint = 2
    assert shown(tipped) == (0.0, 0.0)


def test_chosen_view_is_not_replaced(tipped):
    tipped.state.options.scalar = "entropy"
    start_heat_map(tipped.state)
    assert tipped.state.options.scalar == "entropy" and tipped.state.selected_joint == -1


def test_field_is_the_first_that_is_not_zero_everywhere(tipped):
    state = tipped.state
    count = state.actor.figure.mesh.n_vertices
    fields = (
        VertexField("empty", "Empty", np.zeros(count)),
        VertexField("full", "Full", np.arange(float(count))),
    )
    mesh = replace(state.actor.figure, skeleton=None, skin=None, fields=fields)
    state.scene.actors[:] = [Actor(mesh)]
    state.choose_actor(0)
    start_heat_map(state)  # the field is shown because there are no weights
    assert state.options.scalar == "field:full"
    assert shown(tipped) == (0.0, count - 1.0)
