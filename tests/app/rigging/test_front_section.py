"""The choice of the front in the Rig panel: two pictures, one click, and the run goes on."""

from dataclasses import replace

import numpy as np
import pytest
from app.rig_scene import MOVE, TRUE
from app.rigging.rig_panel import names
from autorig.rigged_shapes import HALF_TURN, turn
from numpy.testing import assert_allclose

from viewer.app.rigging import work
from viewer.app.rigging.facing import FacingChoice, front_scene, fronts_now
from viewer.app.rigging.joint_editing.state import JointEditing
from viewer.app.rigging.placing import as_similarity, placing_now
from viewer.app.rigging.rigging import Rigging, target_mesh
from viewer.autorig.alignment.posed_alignment import ALIKE, PosedAlignment
from viewer.autorig.alignment.surface_alignment import Alignment
from viewer.diagnostics import note
from viewer.phrases import Remedy
from viewer.rigs.skinning import deform, joint_matrices

pytestmark = pytest.mark.usefixtures("quick_fits")

BACK = TRUE.copy()
BACK[:3, :3] = turn([0, 1, 0], HALF_TURN) @ TRUE[:3, :3]


def alike(figure, pose, *_args, **_settings):
    """Return fits that face z and -z with equal gaps."""
    fits = [
        PosedAlignment(
            Alignment(as_similarity(matrix), 0.01, 0.01, (0.01, 0.01), "fit"),
            figure, pose, deform(figure, pose)[0], (note("R003.pose: fitted"),), front=front,
        )
        for matrix, front in ((TRUE, "z"), (BACK, "-z"))
    ]  # fmt: skip
    line = note(ALIKE, front="z", gap=1.0, back="-z", other=1.0, remedy=Remedy("click", "--facing"))
    return replace(fits[0], lines=(*fits[0].lines, line), other=fits[1])


@pytest.fixture
def asked(rigging, monkeypatch):
    """A driver whose Run waits for the front."""
    monkeypatch.setattr(work, "align_posed", alike)
    hand = rigging(placed=False)
    hand.click("Run")
    hand.finish_job()
    hand.step(3)
    return hand


def rotation(hand):
    return placing_now(hand.state).similarity.matrix


def test_run_waits_for_the_front_and_goes_on_with_the_clicked_picture(asked, texts):
    state = asked.state
    assert names(asked) == ["scan", "arm"] and state.job is None
    texts.clear()
    asked.step()
    assert {"front z, gap 1.00 %", "front -z, gap 1.00 %"} <= set(texts)
    left, right = (state.item_rects[f"front {front}"] for front in ("z", "-z"))
    assert left[2] < right[0] and left[1] == right[1]
    steps = asked.undo_steps
    asked.click("front -z")
    assert_allclose(rotation(asked), BACK, atol=1e-9)
    assert state.history.undone_next.name == "face -z" and asked.undo_steps == steps + 1
    asked.finish_job()
    asked.step(2)
    (result,) = state.of(Rigging).results.values()
    assert_allclose(result.rigged.alignment.similarity.matrix, BACK, atol=1e-9)
    assert all(line.key != "R004.facing" for line in result.rigged.lines)
    assert names(asked)[0] == "scan rigged"


def test_choice_of_the_front_is_undone_and_made_again(asked):
    asked.click("Cancel###cancel facing")
    asked.click("front -z")
    assert asked.state.job is None and not placing_now(asked.state).asks
    asked.key("z", "ctrl")
    asked.step(2)
    assert_allclose(rotation(asked), TRUE, atol=1e-9)
    assert placing_now(asked.state).asks
    asked.click("front z")
    asked.click("front -z")
    assert_allclose(rotation(asked), BACK, atol=1e-9)
    assert placing_now(asked.state).other.front == "z"


def test_cancelled_question_starts_nothing_until_run_asks_again(asked):
    state = asked.state
    asked.click("Cancel###cancel facing")
    assert state.of(FacingChoice).waiting is None and state.job is None
    asked.click("Run")
    asked.step(3)
    assert state.job is None and state.of(FacingChoice).waiting is not None
    asked.key("z", "ctrl")  # the alignment
    asked.step(3)
    assert fronts_now(state) == [] and state.of(FacingChoice).waiting is None
    assert state.of(FacingChoice).textures == ()


def test_editing_of_a_fitted_template_waits_for_the_front(rigging, monkeypatch):
    monkeypatch.setattr(work, "align_posed", alike)
    hand = rigging(placed=False)
    hand.state.of(JointEditing).start = "template"
    hand.click("Edit skeleton")
    hand.finish_job()
    hand.step(3)
    assert not hand.state.of(JointEditing).is_on
    hand.click("front z")
    hand.finish_job()
    hand.step(2)
    assert hand.state.of(JointEditing).is_on


def test_pictures_show_each_front_with_the_skeleton_inside(asked):
    state = asked.state
    fits = fronts_now(state)
    mesh = target_mesh(state)
    for one, sign in zip(fits, (1.0, -1.0), strict=True):
        (actor,) = front_scene(mesh, one).actors
        # Both turn about the height of the mesh; what faces the front faces +z.
        assert_allclose(actor.placement[:3, :3] @ [0, 0, sign], [0, 0, 1], atol=1e-12)
        assert_allclose(actor.placement[:3, :3] @ [0, 1, 0], [0, 1, 0], atol=1e-12)
        places = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
        assert_allclose(places[0], MOVE, atol=1e-9)  # the first joint of the template is at 0
        assert_allclose(deform(actor.figure, actor.pose)[0], mesh.positions, atol=1e-9)
    pictures = [target.read() for target in asked.app.frame._fronts._targets]
    assert len(pictures) == len(state.of(FacingChoice).textures) == 2
    assert all(np.ptp(one[..., :3].astype(int), axis=(0, 1)).min() > 60 for one in pictures)
    assert np.abs(pictures[0].astype(int) - pictures[1]).max() > 60
