"""The switches for planted feet and hands at the body of driven figures in the Actors panel."""

import threading
import time
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from rigs.retargeting.hanging_arms import body, motion
from rigs.retargeting.rest_twins import t_pose, written
from rigs.retargeting.two_people import BODY, figure_of
from rigs.retargeting.walking import RATE, walk

from viewer.app.core.reasons import no_undo
from viewer.app.core.undo_actions import undo
from viewer.app.files.files import Files, Stream, stream_captures
from viewer.app.retargeting import drive_changes
from viewer.app.retargeting.drive_changes import (
    keeps_hands,
    no_edit,
    plants_feet,
    toggle_feet,
    toggle_hands,
)
from viewer.formats import Source, read
from viewer.loading import bundled_body
from viewer.loading.capturing import Builder
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.sampled_clip import with_rate
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.driven_feet import plant_feet
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.scene import Actor, Scene

driven_clip_module = import_module("viewer.rigs.retargeting.driven_clip")


@pytest.fixture
def walker(drive):
    figure = figure_of(BODY, "body")
    motion = Drive(written(t_pose(), *walk(), rate=RATE))
    clip, _ = driven_clip(motion, figure)
    hand = drive(scene=Scene([Actor(figure, clip=clip, drive=motion)]), size=(1000, 1000))
    hand.show_panel("Actors")
    hand.step(3)
    return hand


def test_check_box_turns_planted_feet_off_and_undo_restores_them(walker):
    hand, actor = walker, walker.state.actor
    before = actor.clip
    plain = retarget(actor.drive.motion, actor.figure).clip
    assert plants_feet(hand.state) and no_edit(hand.state) == ""
    hand.state.clock.seek(0.5)
    hand.step(2)
    pose = actor.pose.dofs.copy()
    hand.click("Feet on the ground")
    hand.step(2)
    assert not plants_feet(hand.state)
    np.testing.assert_array_equal(actor.clip.rotations, plain.rotations)
    assert np.abs(actor.pose.dofs - pose).max() > 1e-3
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.clip is before and plants_feet(hand.state)
    np.testing.assert_array_equal(actor.pose.dofs, pose)
    toggle_feet(hand.state)
    assert not plants_feet(hand.state) and hand.says("Feet: as retargeted")


def test_check_box_turns_hands_at_the_body_off_and_undo_restores_them(drive):
    figure, motion_drive = body(width=1.5), Drive(motion(0.3, 0.2), plants_feet=False)
    clip, _ = driven_clip(motion_drive, figure)
    hand = drive(scene=Scene([Actor(figure, clip=clip, drive=motion_drive)]), size=(1000, 1000))
    hand.show_panel("Actors")
    hand.step(3)
    actor, plain = hand.state.actor, retarget(motion_drive.motion, figure).clip
    assert keeps_hands(hand.state) and np.abs(clip.rotations - plain.rotations).max() > 1e-3
    hand.click("Hands at the body")
    hand.step(2)
    assert not keeps_hands(hand.state) and hand.says("Hands: as retargeted")
    assert not plants_feet(hand.state)
    np.testing.assert_array_equal(actor.clip.rotations, plain.rotations)
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.clip is clip and keeps_hands(hand.state)


@pytest.mark.parametrize(
    ("toggle", "is_on"), [(toggle_feet, plants_feet), (toggle_hands, keeps_hands)]
)
def test_figures_without_a_motion_of_another_skeleton_have_no_switch(hand, toggle, is_on):
    toggle(hand.state)
    assert not is_on(hand.state)
    assert hand.says("no motion of another skeleton drives this figure")


def test_long_motions_are_retargeted_in_the_background(walker, monkeypatch):
    hand, actor = walker, walker.state.actor
    monkeypatch.setattr(drive_changes, "_SHORT", 10)
    before = actor.clip
    toggle_feet(hand.state)
    job = hand.state.job
    assert job.title.startswith("Retargeting ")
    assert actor.clip is before and not plants_feet(hand.state)
    toggle_feet(hand.state)  # refused while the job runs
    assert hand.state.job is job and hand.says("wait for: Retargeting")
    hand.finish_job()
    plain = retarget(actor.drive.motion, actor.figure).clip
    assert not plants_feet(hand.state) and hand.says("Feet: as retargeted")
    np.testing.assert_array_equal(actor.clip.rotations, plain.rotations)
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.clip is before and plants_feet(hand.state)


def test_cancelled_retargeting_changes_nothing(walker, monkeypatch):
    hand, actor = walker, walker.state.actor
    monkeypatch.setattr(drive_changes, "_SHORT", 10)
    before = actor.clip, actor.drive
    toggle_feet(hand.state)
    hand.state.job.cancel()
    hand.finish_job()
    hand.step(3)
    assert (actor.clip, actor.drive) == before and hand.state.job is None
    assert plants_feet(hand.state)


def test_undo_cancels_a_change_that_is_being_computed(walker, monkeypatch):
    hand, actor = walker, walker.state.actor
    toggle_feet(hand.state)
    hand.step(2)
    before = actor.clip, actor.drive
    monkeypatch.setattr(drive_changes, "_SHORT", 10)
    toggle_feet(hand.state)
    assert no_undo(hand.state) == ""
    undo(hand.state)
    assert hand.says("Cancelled")
    hand.finish_job()
    hand.step(3)
    assert (actor.clip, actor.drive) == before and hand.state.job is None
    undo(hand.state)  # of the earlier change
    assert plants_feet(hand.state) and hand.says("Undone")
    assert not hand.says("Feet: as retargeted")


def captured(count: int) -> Capture:
    """Return a capture of somebody who stands still."""

    def parts():
        for first in range(0, count, 20):
            timing = Timing(RATE, np.where(np.arange(count) // 20 == first // 20,
                                           np.arange(count) - first, -1), holds=False)  # fmt: skip
            names = ("pelvis", "left_hip", "right_hip", "spine1")
            motion = BodyMotion("take", timing, names, np.zeros((20, 4, 3)), np.zeros((20, 3)))
            yield CapturePart(first + 20, {0: motion})

    return Capture("take", count, 0, parts, up="y")


def test_captures_are_retargeted_to_the_end_in_the_background(drive, monkeypatch):
    model, target = read(Source.open(bundled_body())), figure_of(BODY, "other")
    threads = []

    def planted(*arguments):
        threads.append(threading.get_ident())
        return plant_feet(*arguments)

    monkeypatch.setattr(driven_clip_module, "plant_feet", planted)
    builder = Builder(captured(100), model)
    builder.read_some()
    builder.place("y")
    builder.carry_to(target)
    hand = drive(scene=Scene(list(builder.actors)), size=(1000, 1000))
    stream_captures(hand.state, [builder])
    (actor,) = builder.actors
    hand.state.clock.pose(actor, again=True)
    actor.clip = with_rate(actor.clip, 12.0)  # as the timeline does
    stream = hand.state.of(Files).stream
    for _ in range(500):
        hand.step()
        if hand.state.of(Files).stream is None:
            break
        stream.wait()
    assert stream.is_done and stream.error == "" and stream.title.startswith("Retargeting")
    assert actor.clip.n_rows == 100 and actor.clip.timing.frame_rate == 12.0
    assert plants_feet(hand.state)
    assert len(threads) == 1 and threads[0] != threading.get_ident()


def test_redo_while_retargeting_runs_discards_its_result(walker, monkeypatch):
    hand, actor = walker, walker.state.actor
    toggle_feet(hand.state)
    hand.step(2)
    second = actor.clip, actor.drive
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.clip is not second[0]
    redone = threading.Event()

    def waits(*arguments):
        redone.wait(60.0)
        return driven_clip(*arguments)

    monkeypatch.setattr(drive_changes, "_SHORT", 10)
    monkeypatch.setattr(drive_changes, "driven_clip", waits)
    toggle_feet(hand.state)
    hand.key("z", "ctrl shift")
    hand.step(2)
    redone.set()
    assert actor.clip is second[0] and hand.state.job is not None
    hand.finish_job()
    assert actor.clip is second[0] and actor.drive is second[1] and hand.state.history.undone_next
    assert hand.says("the motion was changed meanwhile")


@pytest.mark.parametrize("frames", (10, 10_000))
def test_unexpected_errors_of_retargeting_are_shown(walker, monkeypatch, frames):
    hand, actor = walker, walker.state.actor
    monkeypatch.setattr(drive_changes, "_SHORT", frames)
    monkeypatch.setattr(threading, "excepthook", lambda _: None)

    def fails(*_):
        raise np.linalg.LinAlgError("Singular matrix")

    before = actor.clip, actor.drive
    monkeypatch.setattr(driven_clip_module, "plant_feet", fails)
    monkeypatch.setattr(driven_clip_module, "retarget", fails)
    if frames > 1000:
        with pytest.raises(np.linalg.LinAlgError):
            toggle_feet(hand.state)
    else:
        toggle_feet(hand.state)
        hand.finish_job()
        assert "Singular matrix" in hand.state.error
    assert (actor.clip, actor.drive) == before and hand.state.job is None
    assert plants_feet(hand.state)


@pytest.mark.parametrize("fails", (False, True))
def test_captures_that_end_early_stop_being_read(monkeypatch, fails):
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    whole = captured(100)

    def parts():
        first, *_ = whole.parts()
        yield first
        if fails:
            raise KeyError("poses")

    builder = Builder(replace(whole, parts=parts), read(Source.open(bundled_body())))
    stream = Stream([builder], lambda: None)
    for _ in range(500):
        stream.take()
        if stream.is_done:
            break
        stream.wait()
        time.sleep(0.01)
    assert stream.is_done and builder.n_read == 20
    assert ("poses" in stream.error) == fails
