"""Checks in the window while figures move: stale findings, cancellation, and other running jobs."""

from dataclasses import replace

import pytest
from app.linting.checked_scenes import LIGHT, SIZE, codes, finish, jump, marked, row_of
from lint.sound import column, scene_of
from rig.animated import animated_leg, bow, channel, clip_of

from viewer.app.linting.lint_panel import Linting, check_rig, start_check
from viewer.lint import lint_scene
from viewer.progress import report
from viewer.rig.motion.animation_choice import play_animation
from viewer.rig.scene import Actor


def stale(hand, texts):
    texts.clear()
    hand.step(2)
    return any(text.startswith("The figure, pose or limits have changed") for text in texts)


def test_findings_are_stale_while_the_pose_differs(lint, texts):
    hand = lint(LIGHT)
    assert not stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 0.3
    hand.step()
    assert stale(hand, texts)
    hand.key("z", "ctrl")
    assert not stale(hand, texts)


def test_posing_makes_findings_stale_and_playback_does_not(lint, texts):
    hand = lint(jump())
    hand.state.clock.playing = True
    hand.step(20)
    hand.state.clock.playing = False
    assert not stale(hand, texts)
    hand.click(row_of(hand, "C003"))
    assert not stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 0.3
    assert stale(hand, texts)
    hand.click("Recheck")
    finish(hand)
    assert not stale(hand, texts)


def test_a_finding_in_another_animation_plays_it(lint, texts):
    leap = clip_of(channel(0, "translation", [0.0, 1.0], [[0.0] * 3, [1000.0, 0, 0]]), name="leap")
    scene = scene_of(animated_leg(bow(), leap))
    play_animation(scene.actors[0], 0)
    hand = lint(scene)
    hand.click(row_of(hand, "C003"))
    assert hand.state.actor.clip is leap and not hand.state.clock.playing
    assert not stale(hand, texts)
    assert any(text.startswith("leap: ") for text in texts)


def test_recheck_uses_the_current_pose_and_limits(lint, texts):
    hand = lint(column())
    assert codes(hand) == []
    hand.state.of(Linting).options = replace(hand.state.of(Linting).options, max_rotation=1.0)
    assert stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 3.5  # the limits of the DOF are -3 and 3
    hand.click("Recheck")
    finish(hand)
    assert codes(hand) == ["S004"] and not stale(hand, texts)


def test_new_scene_is_shown_as_unchecked(lint, rig, texts):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    hand.open(*rig)
    texts.clear()
    hand.step(2)
    assert hand.state.of(Linting).checked is None and hand.state.of(Linting).marks is None
    assert "This scene has not been checked yet." in texts
    assert not marked(hand)
    hand.click("Check")
    finish(hand)
    assert hand.state.of(Linting).checked.source is hand.state.scene


def test_marks_disappear_with_their_figure(lint, texts):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    hand.state.scene.actors[0] = Actor(column())
    assert stale(hand, texts)
    assert hand.state.of(Linting).marks is None and not marked(hand)


def test_posing_during_a_check_does_not_affect_it(drive, monkeypatch):
    hand = drive(scene=scene_of(column()), size=SIZE, samples=1)
    started, seen, is_held = hold_checks(monkeypatch)
    check_rig(hand.state)
    assert is_held.wait(30)
    hand.step(2)
    assert hand.state.job is not None and hand.state.job.progress == (3, 8, "")
    hand.state.actor.pose.dofs[4] = 3.5
    hand.step()
    started.set()
    finish(hand)
    assert seen and hand.state.of(Linting).checked.findings == ()
    assert hand.state.of(Linting).checked.scene.actors[0].pose.dofs[4] == 0.0


def hold_checks(monkeypatch):
    """Block checks after three steps until an event is set; return it, later steps and times."""
    import threading

    go, seen, is_held = threading.Event(), [], threading.Event()

    def held(scene, options):
        report(3, 8, what="column: mesh")
        is_held.set()
        go.wait(30)
        report(4, 8, what="column: symmetry")
        seen.append(scene)
        return lint_scene(scene, options)

    monkeypatch.setattr("viewer.lint._files.lint_scene", held)
    return go, seen, is_held


@pytest.mark.parametrize("how", ["Cancel check", "escape"])
def test_check_is_cancelled_between_steps(drive, monkeypatch, how):
    hand = drive(scene=scene_of(LIGHT), size=SIZE, samples=1)
    go, seen, is_held = hold_checks(monkeypatch)
    check_rig(hand.state)
    assert is_held.wait(30)
    hand.step(3)
    running = hand.state.of(Linting).running
    if how == "escape":
        hand.key("escape")
    else:
        hand.click(how)
    hand.step(3)
    assert running.job.is_cancelled and hand.says("Cancelled")
    go.set()
    hand.finish_job()
    assert hand.state.job is None and hand.state.of(Linting).running is None
    assert not seen and hand.state.of(Linting).checked is None


def test_check_waits_for_another_running_job(lint, monkeypatch):
    hand = lint(LIGHT)
    go, _, is_held = hold_checks(monkeypatch)
    first = hand.state.of(Linting).checked
    start_check(hand.state)
    assert is_held.wait(30)
    hand.step(2)
    job = hand.state.job
    hand.click("Recheck")  # greyed out
    assert hand.state.job is job
    go.set()
    finish(hand)
    assert hand.state.of(Linting).checked is not first
